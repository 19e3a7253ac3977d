# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Draws the loops of a robot at closed joint values, and maps the links to its joints."""

import cmath
import itertools
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple, cast

from linkage_lab.robots.loops import Loops
from linkage_lab.robots.model import listed
from linkage_lab.robots.plane import FRAME, JointMap, Plane, Pose, Step
from linkage_ros import ConfigurationError, Mechanism
from linkage_ros.extensions import MECHANISMS, Constants
from linkage_ros.formulas import Array
from linkage_ros.internals import axes_of, spin_of, wrap
from linkage_ros.quantities import BOOLEANS, build

_DIGITS = 14  # kept of the longest length, so that links of equal length stay equal
_NOISE = 1e-15  # relative to the longest link: differences below are rounding errors
_SAME = 1e-9  # relative to the longest link: pins at this distance are one
_OFF_PIN = 1e-6  # m, distance of a slider's centre of mass from its pin that is noted
_NAME = '[A-Za-z](_?[A-Za-z0-9])*_?'
_TAKEN = {'frame', 'world', 'base_link', *BOOLEANS}


class Pin(NamedTuple):
    """An axis about which bodies turn.

    Attributes:
        name: Name in the drawing.
        joint: Name of its joint or closure in the robot.
        places: Position of the pin in the coordinates of each body, m.
    """

    name: str
    joint: str
    places: dict[int, complex]


class Drawn(NamedTuple):
    """A drawing at closed joint values.

    Attributes:
        values: Parameters of the drawing by dotted name.
        mechanism: The mechanism that the drawing shows.
        joints: The robot's joint of each link.
        closed: The joint values.
        blocks: The sliding joint of each block.
    """

    values: dict[str, Any]
    mechanism: Mechanism
    joints: dict[str, JointMap]
    closed: dict[str, float]
    blocks: dict[int, Step]

    def values_at(self, mechanism: Mechanism, position: float) -> dict[str, float]:
        """Returns the joint values of the mechanism, or of one in another assembly.

        Raises:
            UnreachableError: It does not close there.
        """
        links = mechanism.structure().links
        positions = _positions(mechanism, position)
        values = {}
        for i, link in enumerate(links):
            joint = self.joints[link.name]
            move = _own(links, positions, i, joint.parent) - joint.zero
            values[joint.name] = joint.ratio * (move if link.slides else float(wrap(move))) + 0.0
        return values


class Artist:
    """Draws loops in their plane.

    Attributes:
        loops: The loops.
        plane: Their plane.
        driven: The driven joint.
        slides: The sliding joints.
        names: Names of the links in the drawing, by number of the body.
        pins: The pins.
    """

    def __init__(self, loops: Loops, plane: Plane) -> None:
        """Names the links and pins.

        Raises:
            ConfigurationError: A body has no two pins, or the loops do not have one degree of
                freedom.
        """
        self.loops, self.plane = loops, plane
        self.slides = [step for step in plane.steps if not step.side]
        taken = dict[str, None]()
        tree = loops.tree
        self.names = {loops.frame: FRAME}
        for body in loops.bodies[1:]:
            self.names[body] = _name(tree.name(body), 'link', taken)
        self.pins = self._pins(taken)
        self._require_pins()
        self._require_one_motor()
        self.driven = next(x for x in plane.steps if x.joint == loops.driven.joint.name)

    def _pins(self, taken: dict[str, None]) -> list[Pin]:
        """Returns the pins; joints of a body with a common axis are one."""
        unmerged = [
            Pin('', step.joint, {step.near: step.places[0], step.far: step.places[1]})
            for step in self.plane.steps
            if step.side
        ]
        for meeting in self.plane.meetings:
            places = dict(zip(meeting.bodies, meeting.places, strict=True))
            unmerged.append(Pin('', meeting.name, places))
        pins = list[Pin]()
        for joint_pin in unmerged:
            merged = joint_pin  # with each of the pins that is the same
            for pin in [*pins]:
                if self._is_same(merged, pin):
                    pins.remove(pin)
                    merged = pin._replace(places=pin.places | merged.places)
            pins.append(merged)
        order = [pin.joint for pin in unmerged]
        pins.sort(key=lambda pin: order.index(pin.joint))
        return [pin._replace(name=_name(pin.joint, 'pin', taken)) for pin in pins]

    def _is_same(self, one: Pin, other: Pin) -> bool:
        """Returns whether two pins have one place on a body."""
        return any(
            abs(one.places[body] - other.places[body]) < _SAME * self.plane.size
            for body in one.places.keys() & other.places.keys()
        )

    def _require_pins(self) -> None:
        """Requires two pins of each body, or one if it slides or is a guide.

        Raises:
            ConfigurationError: A body has fewer.
        """
        sliding = [body for step in self.slides for body in (step.near, step.far)]
        for body in self.loops.bodies[1:]:
            name = self.loops.tree.name(body)
            own = [pin for pin in self.pins if body in pin.places]
            if not own:
                raise ConfigurationError(f'{name} only slides: a link of the loop needs a pin')
            if len(own) == 1 and body not in sliding:
                raise ConfigurationError(
                    f'all pins of {name} are in one place: a link of the loop needs a length'
                )

    def _require_one_motor(self) -> None:
        """Requires loops with one degree of freedom.

        Raises:
            ConfigurationError: They have another number.
        """
        joints = len(self.slides) + sum(len(pin.places) - 1 for pin in self.pins)
        free = 3 * (len(self.loops.bodies) - 1) - 2 * joints
        if free == 1:
            return
        cure = 'write a file for each motor, with --close for the loops that it alone moves'
        if len(self.loops.closures) == 1:
            cure = 'such a loop cannot be imported'
        elif free < 1:
            pairs = dict.fromkeys(' '.join(x.links) for x in self.loops.closures)
            cure = f'choose loops with --close, of {listed(pairs, "; ")}'
        raise ConfigurationError(
            f'the loops of {self.loops.driven.joint.name} have {free} degrees of freedom, where '
            f'one motor needs 1: {cure}'
        )

    def draw(
        self,
        closed: dict[str, float],
        blocks: dict[int, Step],
        origin: str = '',
        lengths: Mapping[str, float] | None = None,
        moved: Mapping[str, complex] | None = None,
    ) -> Drawn:
        """Draws the loops at joint values.

        Args:
            closed: The values, at which the loops are closed.
            blocks: The sliding joint of each block.
            origin: Name of the pin at [0, 0]; empty for the origin of the frame.
            lengths: Lengths of links by name that replace those drawn, m.
            moved: Places of pins by name that replace those computed, m.

        Raises:
            ConfigurationError: The drawing shows no mechanism.
        """
        pose = self.plane.pose(closed)
        driven_blocks = (body for body, step in blocks.items() if step is self.driven)
        driven = next(driven_blocks, self.driven.far)
        places = {pin.name: self._place(pose, pin) for pin in self.pins}
        shift = places.get(origin, 0j)
        values: dict[str, Any] = {
            'mechanism': 'drawing',
            'gravity': _pair(self._in_plane(self.plane.gravity), math.hypot(*self.plane.gravity)),
            'drawing.input': self.names[driven],
            'drawing.frame': [x.name for x in self.pins if self.loops.frame in x.places],
        }
        for name, place in places.items():
            values[f'drawing.pins.{name}'] = _pair(place - shift, self.plane.size)
        for name, place in (moved or {}).items():
            values[f'drawing.pins.{name}'] = [place.real, place.imag]
        for body in self.loops.bodies[1:]:
            name, step = self.names[body], blocks.get(body)
            part = self._part(body, step, pose, shift)
            if lengths and name in lengths:
                part['length'] = lengths[name]
            group = f'drawing.{"slides" if step else "links"}.{name}'
            values |= {f'{group}.{word}': value for word, value in part.items()}
        mechanism: Mechanism = build(MECHANISMS['drawing'], values).converted()
        joints = self._joints(mechanism, closed, pose)
        return Drawn(values, mechanism, joints, closed, blocks)

    def _part(self, body: int, step: Step | None, pose: Pose, shift: complex) -> dict[str, Any]:
        """Returns the parameters of a link or block by name, without those of its group.

        Args:
            body: Number of the body.
            step: The joint that slides it if it is a block, otherwise None.
            pose: The pose that is drawn.
            shift: The place that becomes [0, 0], m.
        """
        mass = self.plane.mass(body)
        part: dict[str, Any] = {'pins': [x.name for x in self.pins if body in x.places]}
        if step:
            part['direction'] = _pair(pose[step.near].turn * step.direction, 1.0)
            part['on'] = self.names[step.near if body == step.far else step.far]
        part['mass'] = mass.mass
        is_guided = step is not None and step.near == self.loops.frame
        if is_guided:  # it neither turns nor has a centre of mass beside its pin
            return part
        part['inertia'] = mass.inertia
        if mass.mass:
            part['center'] = _pair(pose[body].of(mass.center) - shift, self.plane.size)
        return part

    def _in_plane(self, vector: Array) -> complex:
        return complex(self.plane.x @ vector, self.plane.y @ vector)

    def _place(self, pose: Pose, pin: Pin) -> complex:
        """Returns the place of a pin on the body of it that is nearest to the frame, m."""
        body = next(body for body in self.loops.bodies if body in pin.places)
        return pose[body].of(pin.places[body])

    def _joints(
        self, mechanism: Mechanism, closed: Mapping[str, float], pose: Pose
    ) -> dict[str, JointMap]:
        """Returns the robot's joint of each link: the one towards the frame."""
        links, joints = mechanism.structure().links, dict[str, JointMap]()
        positions = _positions(mechanism, position_of(mechanism))
        for step in self.plane.steps:
            if step.side:
                (i, parent), ratio = self._turned_by(links, step), step.side
            else:
                (i, ratio), parent = self._slid_by(links, step, positions, pose), ''
            zero = _own(links, positions, i, parent) - closed[step.joint] / ratio
            zero = zero if links[i].slides else float(wrap(zero))
            joints[links[i].name] = JointMap(step.joint, tidy(zero, 1.0) + 0.0, ratio, parent)
        return {link.name: joints[link.name] for link in links}

    def _turned_by(self, links: Sequence[Any], step: Step) -> tuple[int, str]:
        """Returns the index of the link that a joint turns, and the link that carries it."""
        near, far = self.names[step.near], self.names[step.far]
        index = {link.name: i for i, link in enumerate(links)}
        i = index[far]
        if links[i].slides:  # it turns with the link on which it slides
            i = cast('int', spin_of(links, i))
        is_at_rest = near == FRAME or spin_of(links, index[near]) is None
        return i, FRAME if is_at_rest else near

    def _slid_by(
        self, links: Sequence[Any], step: Step, positions: Sequence[float], pose: Pose
    ) -> tuple[int, float]:
        """Returns the index of the link that a joint slides, and 1.0, or -1.0 if it is reversed.

        It is the farther body, unless the mechanism slides the nearer one on it.
        """
        index: dict[str, int | None] = {link.name: i for i, link in enumerate(links)}
        near = index.get(self.names[step.near])  # None for the frame
        far = cast('int', index[self.names[step.far]])
        slides_far = links[far].slides and links[far].parent == near
        slider = far if slides_far else cast('int', near)
        spin, angle = axes_of(links, slider)
        guide = cmath.rect(1.0, (angle or 0.0) + (0.0 if spin is None else positions[spin]))
        along = (pose[step.near].turn * step.direction * guide.conjugate()).real
        return slider, math.copysign(1.0, along if slides_far else -along)

    def blocks(self) -> Iterator[dict[int, Step]]:
        """Yields the ways to call one body of each sliding joint the block, the other its guide.

        The conversion solves the guide first.
        """
        never = {self.loops.frame}
        if self.driven.side:  # the crank
            never.add(self.driven.far)
        choices = [[x for x in (step.far, step.near) if x not in never] for step in self.slides]
        for bodies in itertools.product(*choices):
            is_distinct = len({*bodies}) == len(bodies)
            if is_distinct:
                yield dict(zip(bodies, self.slides, strict=True))

    def frame_joint(self, origin: complex) -> dict[str, Any]:
        """Returns the parameters of the joint that turns the frame, if there is one."""
        pivot, edge = self.plane.frame_joint(), self.loops.frame_joint
        if pivot is None or edge is None:
            return {}
        place, side = pivot
        return {
            'frame_joint.name': edge.joint.name,
            'frame_joint.zero': 0.0,
            'frame_joint.ratio': side,
            'frame_joint.pivot': _pair(place - origin, self.plane.size),
        }

    def off_pin(self) -> Iterator[str]:
        """Yields what is wrong if a slider's centre of mass is not its pin, as in the model.

        Raises:
            ConfigurationError: The frame turns, and the torque would be wrong.
        """
        for step in self.slides:
            body, mass = step.far, self.plane.mass(step.far)
            pin = next(pin for pin in self.pins if body in pin.places)
            off = abs(mass.center - pin.places[body])
            is_guided = step.near == self.loops.frame
            if not is_guided or not mass.mass or off <= _OFF_PIN:
                continue
            where = f'the centre of mass of {self.names[body]} is {off:.4g} m from its pin'
            if self.loops.frame_joint:
                raise ConfigurationError(
                    f'{where}: on a frame that turns it must be in the pin; leave out --world for '
                    'the torque on a frame at rest'
                )
            yield f'{where}, but is taken there: the moment on the guide is wrong'


def position_of(mechanism: Mechanism) -> float:
    """Returns the position of the driven link as drawn, rad or m."""
    return mechanism.drawn.position if mechanism.drawn else 0.0


def _positions(mechanism: Mechanism, position: float) -> list[float]:
    """Returns the positions of the links, rad or m, at one of the driven link.

    Raises:
        UnreachableError: The mechanism does not close there.
    """
    pose = Constants(mechanism.chain()).tree.pose((position,))
    return [float(link.position) for link in pose.links]


def point_of(mechanism: Mechanism, name: str) -> str:
    """Returns the name in a drawing of a pin of its loop."""
    return dict(mechanism.drawn.points)[name] if mechanism.drawn else name


def _own(links: Sequence[Any], positions: Sequence[float], i: int, parent: str) -> float:
    """Returns the value `own` of a link's joint, rad or m; see `JointMap`."""
    if links[i].slides or parent == FRAME:
        return positions[i]
    carrier = next(j for j, link in enumerate(links) if link.name == parent)
    spin, guide = axes_of(links, carrier)
    return positions[i] - (0.0 if spin is None else positions[spin]) - (guide or 0.0)


def _name(text: str, kind: str, taken: dict[str, None]) -> str:
    """Returns a valid name for a link or pin of the robot, and takes it."""
    name = text if re.fullmatch(_NAME, text) else re.sub('[^A-Za-z0-9]+', '_', text).strip('_')
    if not re.fullmatch(_NAME, name) or name.lower() in _TAKEN:
        name = f'{kind}_{name}'.rstrip('_')
    if name in taken:
        base = f'{name.rstrip("_")}_{kind}'
        numbered = (f'{base}_{n}' for n in itertools.count(2))
        name = next(x for x in itertools.chain([base], numbered) if x not in taken)
    taken[name] = None
    return name


def _pair(place: complex, size: float) -> list[float]:
    return [tidy(place.real, size), tidy(place.imag, size)]


def to_digits(number: float, size: float) -> float:
    """Rounds a number to a fixed fraction of a size; returns 0.0 instead of -0.0."""
    return round(number, _DIGITS - math.ceil(math.log10(size))) + 0.0 if size else number


def tidy(number: float, size: float) -> float:
    """Rounds a number if that changes it by less than a rounding error of the size."""
    rounded = to_digits(number, size)
    return rounded if abs(rounded - number) <= _NOISE * size else number
