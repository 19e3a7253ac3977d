# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Projects the closed loops of a robot onto their plane.

With the joints of the loops at 0, each body gets coordinates x + iy in the axes of the plane. A
pose of a body is then x -> place + turn x, with a turn of length 1.
"""

import cmath
import itertools
import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from linkage_lab.robots.loops import Loops, Outward, gravity_of
from linkage_lab.robots.model import PRISMATIC, Closure, Inertial, lumped
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
        direction: Direction in which the far body slides as the value increases, of length 1.
    """

    joint: str
    near: int
    far: int
    places: tuple[complex, complex]
    side: float
    direction: complex = 1.0 + 0j


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


class Placement(NamedTuple):
    """Where a body is: its point x is at place + turn x.

    Attributes:
        place: Origin of its coordinates, m.
        turn: Direction of its first axis, of length 1.
    """

    place: complex
    turn: complex

    def of(self, point: complex) -> complex:
        """Returns where a point of the body is, m."""
        return self.place + self.turn * point


Pose = dict[int, Placement]  # by number of the body


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
        """Computes the plane in the pose of joint values; see `Request` for `up`.

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
        self._require_planar(turning)
        self.normal = self._zero[loops.frame].rotation.T @ self._world_normal
        self.gravity = posed[loops.frame].rotation.T @ gravity_of(loops.robot, up)
        self.y = self._up()
        self.x = np.cross(self.y, self.normal)
        self.steps = [self._step(joint) for joint in loops.joints]
        self.meetings = self._meetings()
        self.fixed = self._fixed()
        self.size = self._size()

    # ---------------------------------------------------------------- axes of the plane

    def _require_planar(self, turning: Outward) -> None:
        """Requires the axes of all joints to fit to that of one joint.

        Raises:
            ConfigurationError: The linkage is not planar.
        """
        for joint in self.loops.joints:
            if joint is not turning:
                slides = joint.edge.joint.kind == PRISMATIC
                self._require_axis(joint.edge.joint.name, self._axis(joint), slides=slides)
        for closure in self.loops.closures:
            if closure.axis is not None:
                link = closure.links[0]
                body = self.tree.home[link]
                turn = self._zero[body].rotation @ self.tree.bodies[body].links[link].rotation
                self._require_axis(closure.joint, turn @ closure.axis, slides=False)
        if self.loops.frame_joint:
            name = self.loops.frame_joint.joint.name
            self._require_axis(name, self._own_axis(self.loops.frame_joint), slides=False)

    def _up(self) -> Array:
        """Returns the axis of the frame, projected onto the plane, that points up the most."""
        projections = [in_plane(axis, self.normal) for axis in np.eye(3)[[1, 0, 2]]]
        axes = [x / length for x in projections if (length := math.hypot(*x)) > _SLANTED]
        return max(
            (sign * axis for axis in axes for sign in (1.0, -1.0)),
            key=lambda axis: round(float(-self.gravity @ axis), 6),
        )

    # ---------------------------------------------------------------- bodies and joints

    def _step(self, joint: Outward) -> Step:
        """Projects a joint of the loops onto the plane."""
        (edge, near, far), axis = joint, self._axis(joint)
        frames = self.tree.frames(edge)
        places = self.flat(near, frames[near].place), self.flat(far, frames[far].place)
        if edge.joint.kind == PRISMATIC:
            in_frame = self._zero[self.loops.frame].rotation.T @ axis
            direction = complex(self.x @ in_frame, self.y @ in_frame)
            return Step(edge.joint.name, near, far, places, 0.0, direction / abs(direction))
        side = 1.0 if axis @ self._world_normal > 0 else -1.0
        return Step(edge.joint.name, near, far, places, side)

    def _points(self, closure: Closure) -> list[tuple[int, Array]]:
        """Returns the body of each link of a closure, and the point in its coordinates, m."""
        points = list[tuple[int, Array]]()
        for link, point in zip(closure.links, closure.points, strict=True):
            body = self.tree.home[link]
            points.append((body, self.tree.bodies[body].links[link].of(point)))
        return points

    def _meetings(self) -> list[Meeting]:
        """Projects the closures onto the plane."""
        meetings = []
        for closure in self.loops.closures:
            (first, first_point), (second, second_point) = self._points(closure)
            places = self.flat(first, first_point), self.flat(second, second_point)
            meetings.append(Meeting(closure.joint or closure.name, (first, second), places))
        return meetings

    def _fixed(self) -> dict[str, Array]:
        """Returns the place of each joint and closure of the frame in its axes, m, by name."""
        frame, fixed = self.loops.frame, dict[str, Array]()
        for (edge, near, _), step in zip(self.loops.joints, self.steps, strict=True):
            if near == frame:
                fixed[step.joint] = self.tree.frames(edge)[frame].place
        for closure, meeting in zip(self.loops.closures, self.meetings, strict=True):
            for body, point in self._points(closure):
                if body == frame:
                    fixed[meeting.name] = point
        return fixed

    def _size(self) -> float:
        """Returns the largest distance of two joints or closures of a body, m."""
        places = dict[int, list[complex]]()
        for step in self.steps:
            places.setdefault(step.near, []).append(step.places[0])
            places.setdefault(step.far, []).append(step.places[1])
        for meeting in self.meetings:
            for body, place in zip(meeting.bodies, meeting.places, strict=True):
                places.setdefault(body, []).append(place)
        return max(
            abs(one - other)
            for of_body in places.values()
            for one, other in itertools.product(of_body, repeat=2)
        )

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
        frame_from_body = self._zero[self.loops.frame].rotation.T @ self._zero[body].rotation
        in_frame = frame_from_body @ vector
        return complex(self.x @ in_frame, self.y @ in_frame)

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
        whole = lumped(parts) or _MASSLESS
        normal = self._zero[body].rotation.T @ self._world_normal
        inertia = float(normal @ whole.inertia @ normal)
        return FlatBody(whole.mass, inertia, self.flat(body, whole.center))

    def frame_joint(self) -> tuple[complex, float] | None:
        """Returns the pin about which the frame turns, m, and the sign of its turn.

        The sign is 1 if the frame turns counter-clockwise as the joint's value increases, else -1.
        """
        edge, frame = self.loops.frame_joint, self.loops.frame
        if edge is None:
            return None
        place = self.flat(frame, self.tree.frames(edge)[frame].place)
        # The axis is that about which the child turns.
        is_child, is_along = edge.ends[1] == frame, self._own_axis(edge) @ self._world_normal > 0
        return place, 1.0 if is_along == is_child else -1.0

    # ---------------------------------------------------------------- poses

    def pose(self, values: Mapping[str, float]) -> Pose:
        """Returns the pose of each body at joint values; the loops may be open."""
        pose: Pose = {self.loops.frame: Placement(0j, 1 + 0j)}
        for step in self.steps:
            near, (at_near, at_far) = pose[step.near], step.places
            value = values.get(step.joint, 0.0)
            if step.side:
                turned = near.turn * cmath.rect(1.0, step.side * value)
                pose[step.far] = Placement(near.of(at_near) - turned * at_far, turned)
            else:
                origin = at_near + value * step.direction - at_far
                pose[step.far] = Placement(near.of(origin), near.turn)
        return pose

    def closed(self, values: Mapping[str, float]) -> dict[str, float] | None:
        """Closes the loops with the driven joint at its value, starting at joint values.

        Returns:
            The values of all joints; None if the loops do not close from there.
        """
        driven = self.loops.driven.joint.name
        free = [step for step in self.steps if step.joint != driven]
        current = {step.joint: values.get(step.joint, 0.0) for step in self.steps}
        scales = np.array([1.0 if step.side else self.size for step in free])
        damping = 1e-3  # of the Levenberg-Marquardt method
        gaps, slopes = self._gaps(current, free)
        for _ in range(_ROUNDS):
            jacobian, error = slopes * scales, math.hypot(*gaps)
            is_last = error < _MET * self.size  # a last step, to the limit of rounding errors
            if is_last:
                move = np.linalg.lstsq(jacobian, -gaps, rcond=None)[0]
            else:
                square = jacobian.T @ jacobian + damping * self.size**2 * np.eye(len(free))
                move = np.linalg.solve(square, -jacobian.T @ gaps)
            trial = dict(current)
            for step, change in zip(free, move * scales, strict=True):
                trial[step.joint] += float(change)
            trial_gaps, trial_slopes = self._gaps(trial, free)
            is_better = math.hypot(*trial_gaps) < error
            if is_better:
                current, gaps, slopes = trial, trial_gaps, trial_slopes
            if is_last:
                return current
            damping = damping / 10 if is_better else damping * 4
        return None

    def _gaps(self, values: Mapping[str, float], free: list[Step]) -> tuple[Array, Array]:
        """Returns the gaps of all closures, m, and their derivatives with respect to joint values.

        Args:
            values: Values of all joints.
            free: The joints whose values change.

        Returns:
            The components x and y of each gap, shape (2 closures,); and their derivatives, shape
            (2 closures, free joints).
        """
        pose = self.pose(values)
        joints_before: dict[int, set[str]] = {self.loops.frame: set()}  # that move each body
        for step in self.steps:
            joints_before[step.far] = joints_before[step.near] | {step.joint}
        gaps, slopes = list[complex](), list[list[complex]]()
        for meeting in self.meetings:
            ends = [
                pose[body].of(place)
                for body, place in zip(meeting.bodies, meeting.places, strict=True)
            ]
            gaps.append(ends[0] - ends[1])
            row = []
            for step in free:
                first, second = (
                    _velocity(step, pose, end) if step.joint in joints_before[body] else 0j
                    for body, end in zip(meeting.bodies, ends, strict=True)
                )
                row.append(first - second)
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
        poses = self.tree.poses(values)
        normal = poses[self.loops.frame].rotation @ self.normal
        inside, across = 0.0, 0.0
        for closure in self.loops.closures:
            first, second = (poses[body].of(point) for body, point in self._points(closure))
            between = second - first
            inside = max(inside, math.hypot(*in_plane(between, normal)))
            across = max(across, abs(float(between @ normal)))
        return inside, across

    def reach_of_joints(self) -> float:
        """Returns the sum of the distances between joints and their bodies' origins, m."""
        places = [
            frame.place
            for joint in self.loops.joints
            for frame in self.tree.frames(joint.edge).values()
        ]
        for closure in self.loops.closures:
            places += [point for _, point in self._points(closure)]
        return math.fsum(math.hypot(*place) for place in places)


def _velocity(step: Step, pose: Pose, point: complex) -> complex:
    """Returns the velocity of a point that a joint moves, per rate of the joint, m or m/rad."""
    near = pose[step.near]
    if not step.side:
        return near.turn * step.direction
    pivot = near.of(step.places[0])
    return 1j * step.side * (point - pivot)


def in_plane(vector: Array, normal: Array) -> Array:
    """Returns the part of a vector that is normal to a unit vector."""
    part: Array = vector - (vector @ normal) * normal
    return part
