# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Projects the closed loops of a robot onto their plane.

With the joints of the loops at 0, each body gets coordinates x + iy in the axes of the plane. A
pose of a body is then x -> place + turn x, with a turn of length 1.
"""

import cmath
import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from linkage_lab.robots.loops import Loops, Outward, gravity_of
from linkage_lab.robots.model import PRISMATIC, Inertial, lumped
from linkage_lab.robots.tree import Edge
from linkage_ros import ConfigurationError
from linkage_ros.formulas import Array

FRAME = 'frame'
_PARALLEL = 2e-3  # rad, largest angle between axes that count as parallel
_NOTED = 1e-6  # rad, smallest such angle that is noted
_SLANTED = 0.6  # shortest projection of an axis of the frame that gives the plane's y axis
_MASSLESS = Inertial(0.0, np.zeros(3), np.zeros((3, 3)))
_ROUNDS = 100  # of Newton's method
_MET = 1e-10  # relative to the size: ends at this distance meet, but for rounding errors


class JointMap(NamedTuple):
    """The joint of the robot that moves a link of the mechanism.

    Its value is ratio * (own - zero). `own` is the direction of the link minus that of `parent`,
    rad, or the position of the slider, m.

    Attributes:
        name: Name of the joint; empty if it has none.
        zero: Value of `own` at which the joint is at 0.
        ratio: 1 or -1.
        parent: Name of the link from which it is measured; empty if that is given by its guide.
    """

    name: str
    zero: float
    ratio: float
    parent: str


class Step(NamedTuple):
    """A joint of the loops, on the way from the frame.

    Attributes:
        joint: Name of the joint.
        near: Number of the body nearer to the frame.
        far: Number of the other body.
        places: The joint in the coordinates of both, m.
        side: 1 if the far body turns counter-clockwise as the value increases, else -1; 0 for a
            joint that slides.
        way: Direction in which the far body slides as the value increases, of length 1.
    """

    joint: str
    near: int
    far: int
    places: tuple[complex, complex]
    side: float
    way: complex = 1.0 + 0j


class Meeting(NamedTuple):
    """Two points of two bodies that a closure joins.

    Attributes:
        name: Name of the closure.
        bodies: Numbers of both bodies.
        places: The point in the coordinates of each, m.
    """

    name: str
    bodies: tuple[int, int]
    places: tuple[complex, complex]


class FlatBody(NamedTuple):
    """Mass of a body in the plane.

    Attributes:
        mass: Mass, kg.
        inertia: Moment of inertia about the normal through the centre of mass, kg m^2.
        center: Centre of mass in the body's coordinates, m.
    """

    mass: float
    inertia: float
    center: complex


Pose = dict[int, tuple[complex, complex]]


class Plane:
    """The loops of a robot in their plane.

    Attributes:
        normal: Normal of the plane in the axes of the frame.
        x: First axis in the axes of the frame.
        y: Second axis in the axes of the frame, up as far as these allow.
        gravity: Acceleration of gravity in the axes of the frame, m/s^2.
        steps: The joints, each after those that lead to it from the frame.
        meetings: The closures.
        size: Largest distance of two joints of a body, m.
        fixed: Place of each joint and closure of the frame in its axes, m, by name.
        tilts: Names of joints that are taken as parallel or normal, and their angle, rad.
    """

    def __init__(self, loops: Loops, values: Mapping[str, float], up: Array | None) -> None:
        """Computes the plane.

        Args:
            loops: The loops.
            values: Joint values of the pose.
            up: Direction opposite to gravity in the root's axes; None for the model's gravity.

        Raises:
            ConfigurationError: The loops are not planar, or the frame does not turn in the plane.
        """
        self.loops, self.tree = loops, loops.tree
        self.tilts: list[tuple[str, float]] = []
        names = {joint.edge.joint.name for joint in loops.joints}
        # The joints of the loops at 0; the others do not change them.
        outside = {name: value for name, value in values.items() if name not in names}
        self._zero, posed = self.tree.poses(outside), self.tree.poses(values)
        turning = next(joint for joint in loops.joints if joint.edge is loops.turning)
        self._world_normal = self._axis(turning)
        for joint in loops.joints:
            if joint is not turning:
                slides = joint.edge.joint.kind == PRISMATIC
                self._require_axis(joint.edge.joint.name, self._axis(joint), slides=slides)
        for closure in loops.closures:
            if closure.axis is not None:
                link = closure.links[0]
                body = self.tree.home[link]
                turn = self._zero[body].rotation @ self.tree.bodies[body].links[link].rotation
                self._require_axis(closure.joint, turn @ closure.axis, slides=False)
        if loops.frame_joint:
            name = loops.frame_joint.joint.name
            self._require_axis(name, self._own_axis(loops.frame_joint), slides=False)
        turn = self._zero[loops.frame].rotation.T
        self.normal = turn @ self._world_normal
        self.gravity = posed[loops.frame].rotation.T @ gravity_of(loops.robot, up)
        flat = [in_plane(axis, self.normal) for axis in np.eye(3)[[1, 0, 2]]]
        ways = [way / length for way in flat if (length := math.hypot(*way)) > _SLANTED]
        self.y = max(
            (sign * way for way in ways for sign in (1.0, -1.0)),
            key=lambda way: round(float(-self.gravity @ way), 6),
        )
        self.x = np.cross(self.y, self.normal)
        self.steps = [self._step(joint) for joint in loops.joints]
        self.meetings = self._meetings()
        self.fixed = self._fixed()
        self.size = self._size()

    # ---------------------------------------------------------------- bodies and joints

    def _step(self, joint: Outward) -> Step:
        (edge, near, far), axis = joint, self._axis(joint)
        frames = self.tree.frames(edge)
        places = self.flat(near, frames[near].place), self.flat(far, frames[far].place)
        if edge.joint.kind == PRISMATIC:
            inside = self._zero[self.loops.frame].rotation.T @ axis
            way = complex(self.x @ inside, self.y @ inside)
            return Step(edge.joint.name, near, far, places, 0.0, way / abs(way))
        side = 1.0 if axis @ self._world_normal > 0 else -1.0
        return Step(edge.joint.name, near, far, places, side)

    def _meetings(self) -> list[Meeting]:
        found = []
        for closure in self.loops.closures:
            homes = [self.tree.home[link] for link in closure.links]
            places = [
                self.flat(home, self.tree.bodies[home].links[link].of(point))
                for home, link, point in zip(homes, closure.links, closure.points, strict=True)
            ]
            name = closure.joint or closure.name
            found.append(Meeting(name, (homes[0], homes[1]), (places[0], places[1])))
        return found

    def _fixed(self) -> dict[str, Array]:
        frame, found = self.loops.frame, dict[str, Array]()
        for (edge, near, _), step in zip(self.loops.joints, self.steps, strict=True):
            if near == frame:
                found[step.joint] = self.tree.frames(edge)[frame].place
        for closure, meeting in zip(self.loops.closures, self.meetings, strict=True):
            for link, point in zip(closure.links, closure.points, strict=True):
                if self.tree.home[link] == frame:
                    found[meeting.name] = self.tree.bodies[frame].links[link].of(point)
        return found

    def _size(self) -> float:
        places = dict[int, list[complex]]()
        for step in self.steps:
            for body, place in zip((step.near, step.far), step.places, strict=True):
                places.setdefault(body, []).append(place)
        for meeting in self.meetings:
            for body, place in zip(meeting.bodies, meeting.places, strict=True):
                places.setdefault(body, []).append(place)
        return max(abs(x - y) for row in places.values() for x in row for y in row)

    def _axis(self, joint: Outward) -> Array:
        """Returns the axis about or along which a joint moves the body farther from the frame."""
        axis = self._own_axis(joint.edge)
        return axis if joint.near == joint.edge.ends[0] else -axis

    def _own_axis(self, edge: Edge) -> Array:
        """Returns the axis of a joint, about or along which its child moves."""
        parent, _ = edge.ends
        turn = self._zero[parent].rotation @ self.tree.frames(edge)[parent].rotation
        axis: Array = turn @ edge.joint.axis
        return axis

    def _require_axis(self, name: str, axis: Array, *, slides: bool) -> None:
        """Requires an axis parallel to the normal, or normal to it if the joint slides.

        Raises:
            ConfigurationError: The linkage is not planar.
        """
        normal = self._world_normal
        along, across = abs(float(axis @ normal)), math.hypot(*np.cross(axis, normal))
        angle = math.atan2(along, across) if slides else math.atan2(across, along)
        if angle > _NOTED:
            self.tilts.append((name, angle))
        if angle > _PARALLEL:
            need = 'normal' if slides else 'parallel'
            raise ConfigurationError(
                f'the axis of {name} is {angle:.6g} rad ({math.degrees(angle):.4g} deg) off being '
                f'{need} to that of {self.loops.turning.joint.name}: must be at most '
                f'{_PARALLEL:g} rad, because the linkage is planar'
            )

    def flat(self, body: int, vector: Array) -> complex:
        """Returns a vector of a body in the plane, with the joints of the loops at 0, x + iy."""
        turn = self._zero[self.loops.frame].rotation.T @ self._zero[body].rotation
        inside = turn @ vector
        return complex(self.x @ inside, self.y @ inside)

    def mass(self, body: int) -> FlatBody:
        """Returns the mass of a body.

        Raises:
            ConfigurationError: A mass is negative, that of a mesh, or not finite.
        """
        parts = []
        for link, pose in self.tree.bodies[body].links.items():
            inertial = self.loops.robot.links[link]
            if inertial is None:
                continue
            if inertial.mass < 0:
                raise ConfigurationError(
                    f'the mass of {link} is {inertial.mass:g} kg: must be 0 or more'
                )
            if not math.isfinite(inertial.mass):
                raise ConfigurationError(
                    f'the mass of {link} is that of a mesh, which is not read, or not finite: '
                    'give it an inertial'
                )
            turned = pose.rotation @ inertial.inertia @ pose.rotation.T
            parts.append(Inertial(inertial.mass, pose.of(inertial.center), turned))
        found = lumped(parts) or _MASSLESS
        normal = self._zero[body].rotation.T @ self._world_normal
        inertia = float(normal @ found.inertia @ normal)
        return FlatBody(found.mass, inertia, self.flat(body, found.center))

    def frame_joint(self) -> tuple[complex, float] | None:
        """Returns the pin about which the frame turns, m, and the sign of its turn.

        The sign is 1 if the frame turns counter-clockwise as the joint's value increases, else -1.
        """
        edge, frame = self.loops.frame_joint, self.loops.frame
        if edge is None:
            return None
        is_above, is_along = edge.ends[1] == frame, self._own_axis(edge) @ self._world_normal > 0
        place = self.flat(frame, self.tree.frames(edge)[frame].place)
        return place, 1.0 if is_along == is_above else -1.0

    # ---------------------------------------------------------------- poses

    def pose(self, values: Mapping[str, float]) -> Pose:
        """Returns the pose of each body at joint values; the loops may be open."""
        found: Pose = {self.loops.frame: (0j, 1 + 0j)}
        for step in self.steps:
            (place, turn), (near, far) = found[step.near], step.places
            value = values.get(step.joint, 0.0)
            if step.side:
                turned = turn * cmath.rect(1.0, step.side * value)
                found[step.far] = place + turn * near - turned * far, turned
            else:
                found[step.far] = place + turn * (near + value * step.way - far), turn
        return found

    def closed(self, values: Mapping[str, float]) -> dict[str, float] | None:
        """Closes the loops with the driven joint at its value, starting at joint values.

        Returns:
            The values of all joints; None if the loops do not close from there.
        """
        driven = self.loops.driven.joint.name
        free = [step for step in self.steps if step.joint != driven]
        found = {step.joint: values.get(step.joint, 0.0) for step in self.steps}
        scales = np.array([1.0 if step.side else self.size for step in free])
        damping = 1e-3
        gaps, slopes = self._gaps(found, free)
        for _ in range(_ROUNDS):
            jacobian = slopes * scales
            if (error := math.hypot(*gaps)) < _MET * self.size:
                damping = 0.0  # a last step, to the limit of rounding errors
            square = jacobian.T @ jacobian + damping * self.size**2 * np.eye(len(free))
            move = (
                np.linalg.solve(square, -jacobian.T @ gaps)
                if damping
                else np.linalg.lstsq(jacobian, -gaps, rcond=None)[0]
            )
            trial = dict(found)
            for step, change in zip(free, move * scales, strict=True):
                trial[step.joint] += float(change)
            ahead = self._gaps(trial, free)
            is_better = math.hypot(*ahead[0]) < error
            if is_better:
                found, (gaps, slopes) = trial, ahead
            if not damping:
                return found
            damping = damping / 10 if is_better else damping * 4
        return None

    def _gaps(self, values: Mapping[str, float], free: list[Step]) -> tuple[Array, Array]:
        """Returns the distances of the ends of each closure, m, and their derivatives."""
        pose = self.pose(values)
        carried: dict[int, set[str]] = {self.loops.frame: set()}
        for step in self.steps:
            carried[step.far] = carried[step.near] | {step.joint}
        gaps, slopes = list[complex](), list[list[complex]]()
        for meeting in self.meetings:
            ends = [
                pose[body][0] + pose[body][1] * place
                for body, place in zip(meeting.bodies, meeting.places, strict=True)
            ]
            gaps.append(ends[0] - ends[1])
            row = []
            for step in free:
                place, turn = pose[step.near]
                pivot = place + turn * step.places[0]
                moved = [
                    0j if step.joint not in carried[body]
                    else 1j * step.side * (end - pivot) if step.side else turn * step.way
                    for body, end in zip(meeting.bodies, ends, strict=True)
                ]  # fmt: skip
                row.append(moved[0] - moved[1])
            slopes.append(row)
        flat = np.array([part for gap in gaps for part in (gap.real, gap.imag)])
        rows = np.array(slopes).reshape(len(gaps), len(free))
        return flat, np.stack([rows.real, rows.imag], axis=1).reshape(len(flat), len(free))

    def apart(self, values: Mapping[str, float]) -> tuple[float, float]:
        """Returns the largest distance of the ends of a closure, in space.

        Args:
            values: Joint values of the robot.

        Returns:
            The distance in the plane, and along its normal, m.
        """
        poses, found = self.tree.poses(values), (0.0, 0.0)
        normal = poses[self.loops.frame].rotation @ self.normal
        for closure in self.loops.closures:
            first, second = (
                poses[home].of(self.tree.bodies[home].links[link].of(point))
                for link, point in zip(closure.links, closure.points, strict=True)
                for home in [self.tree.home[link]]
            )
            between = second - first
            across = abs(float(between @ normal))
            found = max(found[0], math.hypot(*in_plane(between, normal))), max(found[1], across)
        return found

    def reach_of_joints(self) -> float:
        """Returns the sum of the distances between joints and their bodies' origins, m."""
        places = [
            frame.place
            for joint in self.loops.joints
            for frame in self.tree.frames(joint.edge).values()
        ]
        for closure in self.loops.closures:
            for link, point in zip(closure.links, closure.points, strict=True):
                places.append(self.tree.bodies[self.tree.home[link]].links[link].of(point))
        return math.fsum(math.hypot(*place) for place in places)


def in_plane(vector: Array, normal: Array) -> Array:
    """Returns the part of a vector that is normal to a unit vector."""
    part: Array = vector - (vector @ normal) * normal
    return part
