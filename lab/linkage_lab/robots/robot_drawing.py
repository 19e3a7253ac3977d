# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Draws the closed loops of a robot, with the robot's own joints.

The conversion of the drawing decides what mechanism it is. The loops are closed at the driven
joint's value; of the assemblies that the mechanism then has, the nearest to the pose is drawn.
"""

import cmath
import itertools
import json
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any, NamedTuple, cast

from linkage_lab.robots.loops import Loops, Request, find_loops
from linkage_lab.robots.model import REVOLUTE, Robot, listed
from linkage_lab.robots.plane import Plane, Pose
from linkage_ros import (
    CROSSED,
    OPEN,
    ConfigurationError,
    FourBar,
    LinkageError,
    Mechanism,
    Solver,
    UnreachableError,
)
from linkage_ros.extensions import MECHANISMS
from linkage_ros.formulas import Array
from linkage_ros.internals import axes_of, reach_of, spin_of, wrap
from linkage_ros.quantities import build

FRAME = 'frame'
_CLOSED = 1e-6  # largest distance of the ends of a closed loop, relative to the longest link
_DIGITS = 14  # kept of the longest length, so that links of equal length stay equal
_NOISE = 4e-16  # relative to the longest link: differences below are rounding errors
_SAME = 1e-9  # relative to the longest link: pins at this distance are one
_OFF_PIN = 1e-6  # m, distance of a slider's centre of mass from its pin that is noted
_ALIKE = 1e-9  # rad, difference between two assemblies that cannot be told apart
_ONE = 1e-6  # rad or m, largest difference of assemblies that meet
_TRIALS = 24  # values of the driven joint, at which the loops may close if they do not as given
_AWAY = 0.05  # rad, or of the longest link: where a drawn linkage is compared with the robot
_NAME = '[A-Za-z](_?[A-Za-z0-9])*_?'
_TAKEN = {'frame', 'world', 'base_link', 'y', 'n', 'yes', 'no', 'on', 'off', 'true', 'false'}


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


class RobotDrawing(NamedTuple):
    """The drawing of a robot's loops.

    Attributes:
        values: Parameters of the drawing and of `frame_joint`, by dotted name.
        mechanism: The mechanism that the drawing shows.
        joints: The robot's joint of each link.
        bodies: Names of the robot's links in each link of the mechanism, including the frame.
        axes: The plane in the axes of the frame's first link: origin, x axis, y axis and normal.
        given: The joint values of the pose.
        closed: The joint values that close the loops, which are drawn.
        residual: Distance in the plane between both ends of a loop at the closed pose, m.
        gap: The same distance at the given pose, m.
        across: Distance of both ends along the normal, m.
        size: Longest distance of two joints of a link, m.
        notes: Sentences about probably wrong values and omitted properties of the robot.
    """

    values: dict[str, Any]
    mechanism: Mechanism
    joints: dict[str, JointMap]
    bodies: dict[str, list[str]]
    axes: tuple[Array, Array, Array, Array]
    given: dict[str, float]
    closed: dict[str, float]
    residual: float
    gap: float
    across: float
    size: float
    notes: list[str]

    @property
    def is_closed(self) -> bool:
        """Whether the residual is at most 1e-6 of the longest link."""
        return self.residual <= _CLOSED * self.size

    @property
    def parameters(self) -> dict[str, Any]:
        """All parameters by dotted name, including the robot's joints."""
        return self.values | {
            f'joints.{link}.{name}': value
            for link, joint in self.joints.items()
            for name, value in joint._asdict().items()
            if value != '' or name == 'name'
        }


class _Pin(NamedTuple):
    """An axis about which bodies turn.

    Attributes:
        name: Name in the drawing.
        joint: Name of its joint or closure in the robot.
        places: Its place in the coordinates of each body, m.
    """

    name: str
    joint: str
    places: dict[int, complex]


class _Drawn(NamedTuple):
    """A drawing at closed joint values.

    Attributes:
        values: Its parameters by dotted name.
        mechanism: What it shows.
        joints: The robot's joint of each link.
        closed: The joint values.
    """

    values: dict[str, Any]
    mechanism: Mechanism
    joints: dict[str, JointMap]
    closed: dict[str, float]

    def values_at(self, mechanism: Mechanism, position: float) -> dict[str, float]:
        """Returns the joint values of the mechanism, or of one in another assembly.

        Raises:
            UnreachableError: It does not close there.
        """
        links = mechanism.structure().links
        places = _places(mechanism, position)
        found = {}
        for i, link in enumerate(links):
            joint = self.joints[link.name]
            move = _own(links, places, i, joint.parent) - joint.zero
            found[joint.name] = joint.ratio * (move if link.slides else float(wrap(move))) + 0.0
        return found


def draw_robot(robot: Robot, request: Request) -> RobotDrawing:
    """Draws the loops of a robot that move with its driven joint.

    Args:
        robot: The robot.
        request: What to import.

    Returns:
        The drawing, with its joints and bodies.

    Raises:
        ConfigurationError: A name is unknown, there is no such loop, it cannot be a linkage, or
            the pose does not determine its assembly.
    """
    loops, values = find_loops(robot, request), dict(request.at)
    if loops.frame_joint:
        values.pop(loops.frame_joint.joint.name, None)  # gravity is that at its 0
    return _Artist(loops, values, Plane(loops, values, request.up)).drawing()


class _Artist:
    """Draws loops in their plane."""

    def __init__(self, loops: Loops, values: Mapping[str, float], plane: Plane) -> None:
        """Names the links and pins.

        Raises:
            ConfigurationError: A body has no two pins, or the loops do not have one degree of
                freedom.
        """
        self.loops, self.plane, self.values = loops, plane, values
        self.size = plane.size
        self.blocks = {step.far: step for step in plane.steps if not step.side}
        taken = dict[str, None]()
        tree = loops.tree
        self.names = {loops.frame: FRAME}
        for body in loops.bodies[1:]:
            self.names[body] = _name(tree.name(body), 'link', taken)
        self.pins = self._pins(taken)
        self._require_pins()
        self._require_one_motor()
        self.driven = next(x for x in plane.steps if x.joint == loops.driven.joint.name)

    def _pins(self, taken: dict[str, None]) -> list[_Pin]:
        """Returns the pins; joints of a body with a common axis are one."""
        found = list[tuple[str, dict[int, complex]]]()
        joined = [(x.joint, (x.near, x.far), x.places) for x in self.plane.steps if x.side]
        joined += [(x.name, x.bodies, x.places) for x in self.plane.meetings]
        for name, bodies, places in joined:
            own = dict(zip(bodies, places, strict=True))
            for other in [*found]:
                common = own.keys() & other[1].keys()
                if any(abs(own[x] - other[1][x]) < _SAME * self.size for x in common):
                    found.remove(other)
                    name, own = other[0], other[1] | own
            found.append((name, own))
        order = [name for name, *_ in joined]
        found.sort(key=lambda pin: order.index(pin[0]))
        return [_Pin(_name(name, 'pin', taken), name, places) for name, places in found]

    def _require_pins(self) -> None:
        carriers = {step.near for step in self.blocks.values()}
        for body in self.loops.bodies[1:]:
            own, slides = [pin for pin in self.pins if body in pin.places], body in self.blocks
            if len(own) + slides + (body in carriers) < 2:
                raise ConfigurationError(
                    f'all pins of {self.loops.tree.name(body)} are in one place: a link of the '
                    'loop needs a length'
                )
            if not own:
                raise ConfigurationError(
                    f'{self.loops.tree.name(body)} only slides: a link of the loop needs a pin'
                )

    def _require_one_motor(self) -> None:
        joints = len(self.blocks) + sum(len(pin.places) - 1 for pin in self.pins)
        free = 3 * (len(self.loops.bodies) - 1) - 2 * joints
        if free == 1:
            return
        cure = 'write a file for each motor, with --close for the loops that it alone moves'
        if free < 1:
            pairs = dict.fromkeys(' '.join(x.links) for x in self.loops.closures)
            cure = f'choose loops with --close, of {listed(pairs, "; ")}'
        raise ConfigurationError(
            f'the loops of {self.loops.driven.joint.name} have {free} degrees of freedom, where '
            f'one motor needs 1: {cure}'
        )

    # ---------------------------------------------------------------- the drawing

    def drawing(self) -> RobotDrawing:
        """Returns the drawing; see `draw_robot`."""
        drawn = self._in_assembly(self._anywhere())
        plane, loops = self.plane, self.loops
        given = {step.joint: self.values.get(step.joint, 0.0) for step in plane.steps}
        residual, across = self._residual(drawn)
        gap, _ = plane.apart({**self.values, **given})
        bodies = {name: [*loops.tree.bodies[body].links] for body, name in self.names.items()}
        pin = next(x for x in self.pins if x.name == _point(drawn.mechanism, 'A0'))
        origin = pin.places[loops.frame]
        values = drawn.values | self._frame_joint(origin)
        axes = plane.fixed[pin.joint], plane.x, plane.y, plane.normal
        return RobotDrawing(
            values, drawn.mechanism, drawn.joints, bodies, axes, given, drawn.closed, residual,
            gap, across, self.size, [*self._notes(drawn)],
        )  # fmt: skip

    def _draw(
        self,
        closed: dict[str, float],
        origin: str = '',
        lengths: Mapping[str, float] | None = None,
        moved: Mapping[str, complex] | None = None,
    ) -> _Drawn:
        """Draws the loops at joint values.

        Args:
            closed: The values, at which the loops are closed.
            origin: Name of the pin at [0, 0]; empty for the origin of the frame.
            lengths: Lengths of links by name that replace those drawn, m.
            moved: Places of pins by name that replace those computed, m.

        Raises:
            ConfigurationError: The drawing shows no mechanism.
        """
        pose, lengths = self.plane.pose(closed), lengths or {}
        places = {pin.name: self._place(pose, pin) for pin in self.pins}
        shift = places.get(origin, 0j)
        places = {name: place - shift for name, place in places.items()} | {**(moved or {})}
        values: dict[str, Any] = {
            'mechanism': 'drawing',
            'gravity': _pair(self._in_plane(self.plane.gravity), math.hypot(*self.plane.gravity)),
            'drawing.input': self.names[self.driven.far],
            'drawing.frame': [x.name for x in self.pins if self.loops.frame in x.places],
        }
        for name, place in places.items():
            values[f'drawing.pins.{name}'] = _pair(place, self.size)
        for body in self.loops.bodies[1:]:
            name, step, (place, turn) = self.names[body], self.blocks.get(body), pose[body]
            mass = self.plane.mass(body)
            part: dict[str, Any] = {'pins': [x.name for x in self.pins if body in x.places]}
            is_guided = step is not None and step.near == self.loops.frame
            if step:
                part['direction'] = _pair(pose[step.near][1] * step.way, 1.0)
                part['on'] = self.names[step.near]
            part['mass'] = mass.mass
            if not is_guided:
                part['inertia'] = mass.inertia
            if mass.mass and not is_guided:
                part['center'] = _pair(place + turn * mass.center - shift, self.size)
            if name in lengths:
                part['length'] = lengths[name]
            group = f'drawing.{"slides" if step else "links"}.{name}'
            values |= {f'{group}.{word}': value for word, value in part.items()}
        mechanism: Mechanism = build(MECHANISMS['drawing'], values).converted()
        joints = self._joints(mechanism, closed, pose)
        return _Drawn(values, mechanism, joints, closed)

    def _in_plane(self, vector: Array) -> complex:
        return complex(self.plane.x @ vector, self.plane.y @ vector)

    def _place(self, pose: Pose, pin: _Pin) -> complex:
        """Returns the place of a pin on the body of it that is nearest to the frame, m."""
        body = next(body for body in self.loops.bodies if body in pin.places)
        place, turn = pose[body]
        return place + turn * pin.places[body]

    def _joints(
        self, mechanism: Mechanism, closed: Mapping[str, float], pose: Pose
    ) -> dict[str, JointMap]:
        """Returns the robot's joint of each link: the one towards the frame."""
        links, found = mechanism.structure().links, dict[str, JointMap]()
        places = _places(mechanism, _position(mechanism))
        index = {link.name: i for i, link in enumerate(links)}
        for step in self.plane.steps:
            near, far = self.names[step.near], self.names[step.far]
            above = None if near == FRAME else index[near]
            i, ratio = index[far], step.side
            parent = FRAME if above is None or spin_of(links, above) is None else near
            if not step.side:
                parent, is_far = '', links[i].slides and links[i].parent == above
                i = i if is_far else index[near]
                spin, angle = axes_of(links, i)
                guide = cmath.rect(1.0, (angle or 0.0) + (0.0 if spin is None else places[spin]))
                along = (pose[step.near][1] * step.way * guide.conjugate()).real
                ratio = math.copysign(1.0, along if is_far else -along)
            elif links[i].slides:  # it turns with the link on which it slides
                i = next(x for x in [spin_of(links, i)] if x is not None)
            zero = _own(links, places, i, parent) - closed[step.joint] / ratio
            zero = zero if links[i].slides else float(wrap(zero))
            found[links[i].name] = JointMap(step.joint, _tidy(zero, 1.0) + 0.0, ratio, parent)
        return {link.name: found[link.name] for link in links}

    # ---------------------------------------------------------------- the assembly

    def _anywhere(self) -> _Drawn:
        """Draws the loops at the given value of the driven joint, or where they close.

        Raises:
            ConfigurationError: They do not close, or are no mechanism.
        """
        crank = self.driven.joint
        refusal: ConfigurationError | None = None
        given, whole = self.values.get(crank, 0.0), math.pi if self.driven.side else self.size
        moves = (sign * whole * k / _TRIALS for k in range(1, _TRIALS + 1) for sign in (1, -1))
        found: _Drawn | None = None
        for move, turned in itertools.product((0.0, *moves), self._turned()):
            closed = self.plane.closed({**self.values, **turned, crank: given + move})
            if closed is None:
                continue
            try:
                drawn = self._draw(closed)
            except ConfigurationError as error:
                refusal = refusal or error
                continue
            found = found or drawn
            if self._is_on_side(drawn):
                return drawn
        if found:
            return found
        if refusal:
            raise refusal
        gap, _ = self.plane.apart(self.values)
        raise ConfigurationError(
            f'the loop cannot close with {crank} at {given:g}, nor at other values: the ends are '
            f'{gap:.4g} m apart; give --at and the values of another pose'
        )

    def _turned(self) -> list[dict[str, float]]:
        """Returns joint values that turn round the links on which others slide."""
        own = {step.far: step.joint for step in self.plane.steps if step.side}
        joints = [own[step.near] for step in self.blocks.values() if step.near in own]
        return [
            {x: self.values.get(x, 0.0) + math.pi for x in some}
            for count in range(len(joints) + 1)
            for some in itertools.combinations(dict.fromkeys(joints), count)
        ]

    def _is_on_side(self, drawn: _Drawn) -> bool:
        """Returns whether each slide is on its side of the foot from its link's pin, as given."""
        links = drawn.mechanism.structure().links
        joints = [drawn.joints[link.name] for link in links if link.slides and not link.is_guided]
        return all(x.zero + self.values.get(x.name, 0.0) / x.ratio >= 0 for x in joints)

    def _in_assembly(self, sample: _Drawn) -> _Drawn:
        """Draws the assembly that is nearest to the pose.

        Args:
            sample: A drawing of the loops at any closed joint values.

        Raises:
            ConfigurationError: The loops cannot close at the driven joint's value, or two
                assemblies are equally near.
        """
        joints, crank = sample.joints, self.driven.joint
        link = next(link for link, joint in joints.items() if joint.name == crank)
        given = self.values.get(crank, 0.0)
        own = joints[link].zero + given / joints[link].ratio
        found = list[tuple[float, dict[str, float]]]()
        for mechanism in _assemblies(sample.mechanism):
            with suppress(UnreachableError):
                closed = {**sample.values_at(mechanism, own), crank: given}
                found.append((math.fsum(map(abs, self._moves(closed, self.values))), closed))
        if not found:
            raise self._unreachable(sample, joints[link], own)
        found.sort(key=lambda one: one[0])
        (away, closed), *others = found
        for other, pose in others:
            if other - away >= _ALIKE:
                continue
            if max(map(abs, self._moves(closed, pose))) < _ONE:
                raise ConfigurationError(
                    f'at {crank} {given:g} all links are in line, and both assemblies meet: give '
                    f'--at {crank}=VALUE, another value'
                )
            passive = [step.joint for step in self.plane.steps if step is not self.driven]
            raise ConfigurationError(
                'both assemblies are equally far from this pose: give --at and a value of '
                f'{" or ".join(passive)} in the wanted assembly'
            )
        closed = self.plane.closed(closed) or closed
        closed = {joint: _tidy(value, 1.0) for joint, value in closed.items()} | {crank: given}
        try:
            drawn = self._draw(closed)
            origin = _point(drawn.mechanism, 'A0')
            drawn = self._draw(closed, origin)
            return self._draw(closed, origin, *self._exact(drawn))
        except ConfigurationError as error:
            raise ConfigurationError(f'{error}: give --at {crank}=VALUE, another value') from error

    def _moves(self, values: Mapping[str, float], others: Mapping[str, float]) -> Iterator[float]:
        """Yields the differences of joint values, rad or relative to the size."""
        for step in self.plane.steps:
            move = values[step.joint] - others.get(step.joint, 0.0)
            yield float(wrap(move)) if step.side else move / self.size

    def _unreachable(self, sample: _Drawn, joint: JointMap, own: float) -> ConfigurationError:
        """Describes where the loops close."""
        given = self.values.get(joint.name, 0.0)
        reach = reach_of(sample.mechanism)
        turn = 0.0 if reach is None or reach.slides else math.tau
        arcs = reach.arcs if reach else ()
        turns = [turn and turn * round((own - sum(arc) / 2) / turn) for arc in arcs]
        reached = ' or '.join(
            ' to '.join(f'{(x + turn - joint.zero) * joint.ratio:.6g}' for x in arc)
            for arc, turn in zip(arcs, turns, strict=True)
        )
        unit = 'rad, plus whole turns' if turn else 'm'
        return ConfigurationError(
            f'the loop cannot close with {joint.name} at {given:g}: it can from {reached} {unit}; '
            f'give --at {joint.name}=VALUE'
        )

    def _exact(self, drawn: _Drawn) -> tuple[dict[str, float], dict[str, complex]]:
        """Returns lengths with the digits of the file, if the linkage has a change point.

        Otherwise rounding errors of the pins would decide whether the crank turns fully.

        Returns:
            The lengths of the loop's links by name, m, and the place of the rocker's fixed pin.
        """
        mechanism = drawn.mechanism
        if not isinstance(mechanism, FourBar) or mechanism.drawn is None:
            return {}, {}
        pins = {pin.name: pin.places for pin in self.pins}
        A0, A, B, B0 = (pins[_point(mechanism, x)] for x in ('A0', 'A', 'B', 'B0'))
        bodies = {name: body for body, name in self.names.items()}
        parts = 'crank', 'coupler', 'rocker', 'frame'
        ends = (A0, A), (A, B), (B0, B), (A0, B0)
        lengths = {
            link: _rounded(abs(end[bodies[link]] - start[bodies[link]]), self.size)
            for link, (start, end) in zip((*mechanism.drawn.links, FRAME), ends, strict=True)
        }
        changes: dict[str, Any] = {
            part: replace(getattr(mechanism, part), length=length)
            for part, length in zip(parts, lengths.values(), strict=True)
        }
        with suppress(LinkageError):
            if replace(mechanism, **changes).reach().has_change_point:
                ground = cmath.rect(lengths.pop(FRAME), mechanism.frame.angle)
                return lengths, {_point(mechanism, 'B0'): ground}
        return {}, {}

    def _residual(self, drawn: _Drawn) -> tuple[float, float]:
        """Returns the distances of the ends of the robot's loops, moved as the drawn linkage.

        Returns:
            The largest distance in the plane, and along the normal, m.

        Raises:
            ConfigurationError: They do not meet, as nearly as parallel axes allow.
        """
        start, found = _position(drawn.mechanism), (0.0, 0.0)
        away = _AWAY if self.driven.side else _AWAY * self.size
        poses = [drawn.closed]
        for move in (away, -away):
            with suppress(UnreachableError):
                poses.append(drawn.values_at(drawn.mechanism, start + move))
        for pose in poses:
            apart = self.plane.apart({**self.values, **pose})
            found = max(found[0], apart[0]), max(found[1], apart[1])
            # An axis that is not parallel moves what it carries, also along the normal.
            allowed = _CLOSED * self.size
            allowed += sum(angle for _, angle in self.plane.tilts) * self.plane.reach_of_joints()
            if apart[0] > allowed:
                values = ', '.join(f'{name} {value:.6g}' for name, value in pose.items())
                raise ConfigurationError(
                    f'the ends of the loop stay {apart[0]:.4g} m apart at {values}: must be at '
                    f'most {allowed:.4g} m; give --at and the values of another pose'
                )
        return found

    def _frame_joint(self, origin: complex) -> dict[str, Any]:
        """Returns the parameters of the joint that turns the frame, if there is one."""
        found, edge = self.plane.frame_joint(), self.loops.frame_joint
        if found is None or edge is None:
            return {}
        place, side = found
        return {
            'frame_joint.name': edge.joint.name,
            'frame_joint.zero': 0.0,
            'frame_joint.ratio': side,
            'frame_joint.pivot': _pair(place - origin, self.size),
        }

    # ---------------------------------------------------------------- notes

    def _notes(self, drawn: _Drawn) -> Iterator[str]:
        """Yields sentences about probably wrong values and omitted properties of the robot."""
        for joint in self.loops.robot.joints:
            value = self.values.get(joint.name, 0.0)
            if joint.kind == REVOLUTE and abs(value) > math.tau:
                yield (
                    f'{joint.name} is at {value:g} rad; did you mean {value:g} deg = '
                    f'{math.radians(value):.4g} rad?'
                )
        yield from self._simplified()
        yield from self._mimics(drawn)
        yield from self._off_pin()
        yield from self._beside()

    def _simplified(self) -> Iterator[str]:
        """Yields what the model has and the linkage has not, and what is assumed."""
        for name, angle in self.plane.tilts:
            yield (
                f'the axis of {name} is {angle:.4g} rad ({math.degrees(angle):.3g} deg) off, but '
                'is taken as exact'
            )
        robot = self.loops.robot
        yield from robot.notes
        left_out = {joint.name: joint.left_out for joint in robot.joints}
        names = [step.joint for step in self.plane.steps]
        closing = [x.joint for x in self.loops.closures if x.joint]
        for name in (*names, *closing):
            if text := left_out.get(name):
                yield f'{name}: {text}: left out'
        for name in closing:
            yield f'{name} closes the loop: its value is not published'
        for body in self.loops.bodies[1:]:
            for link in self.loops.tree.bodies[body].links:
                if link in robot.doubts:
                    yield f'{link}: {robot.doubts[link]}'

    def _mimics(self, drawn: _Drawn) -> Iterator[str]:
        """Yields the couplings in the file, and how to measure a driven joint that is coupled."""
        for outward in self.loops.joints:
            joint = outward.edge.joint
            if not joint.mimics:
                continue
            other, multiplier, offset = joint.mimics
            cure = 'the loop determines its value'
            if outward.edge is self.loops.driven:
                cure = 'it must be measured itself'
                link, own = next(x for x in drawn.joints.items() if x[1].name == joint.name)
                if multiplier:
                    zero = json.dumps(float(own.zero + offset / own.ratio))
                    cure = (
                        f'if only {other} is measured, give joints.{link} name: '
                        f'{json.dumps(other)}, zero: {zero}, ratio: {own.ratio / multiplier!r}'
                    )
            yield f'{joint.name}: <mimic> is ignored; {cure}'

    def _off_pin(self) -> Iterator[str]:
        """Yields what is wrong if a slider's centre of mass is not its pin, as in the model.

        Raises:
            ConfigurationError: The frame turns, and the torque would be wrong.
        """
        for body, step in self.blocks.items():
            mass = self.plane.mass(body)
            pin = next(pin for pin in self.pins if body in pin.places)
            off = abs(mass.center - pin.places[body])
            if step.near != self.loops.frame or not mass.mass or off <= _OFF_PIN:
                continue
            where = f'the centre of mass of {self.names[body]} is {off:.4g} m from its pin'
            if self.loops.frame_joint:
                raise ConfigurationError(
                    f'{where}: on a frame that turns it must be in the pin; leave out --world for '
                    'the torque on a frame at rest'
                )
            yield f'{where}, but is taken there: the moment on the guide is wrong'

    def _beside(self) -> Iterator[str]:
        """Yields the joints that are in no loop, and the links without mass."""
        tree, inside = self.loops.tree, [id(joint.edge) for joint in self.loops.joints]
        for body, name in self.names.items():
            others = [edge for edge in tree.edges_of(body) if id(edge) not in inside]
            if name == FRAME:
                above = {*tree.ancestors(body)[1:]}
                others = [edge for edge in others if edge is not self.loops.frame_joint]
                moving = [edge.joint.name for edge in others if {*edge.ends} & above]
                if moving:
                    yield (
                        f'the frame hangs on {", ".join(moving)}: it is taken as at rest, and '
                        'gravity is that of this pose; --world follows one joint in the plane'
                    )
                continue
            for edge in others:
                yield (
                    f'{edge.joint.name} moves relative to {name}, but is in no loop of '
                    f'{self.driven.joint}: the mass beyond it is left out'
                )
            if not any(self.loops.robot.links[link] for link in tree.bodies[body].links):
                yield f'{name} has no mass in the model'


def _assemblies(mechanism: Mechanism) -> Iterator[Mechanism]:
    """Yields a mechanism in each of its assemblies."""
    sides = list[list[Any]]()
    for part in (mechanism, *mechanism.dyads):
        sides.append([])
        for side in (OPEN, CROSSED):
            with suppress(ConfigurationError):  # some have one assembly
                sides[-1].append(replace(cast('Any', part), assembly=side))
    for base, *dyads in itertools.product(*sides):
        yield replace(base, dyads=tuple(dyads))


def _position(mechanism: Mechanism) -> float:
    """Returns the position of the driven link as drawn, rad or m."""
    return mechanism.drawn.position if mechanism.drawn else 0.0


def _places(mechanism: Mechanism, position: float) -> list[float]:
    """Returns the positions of the links, rad or m, at one of the driven link.

    Raises:
        UnreachableError: The mechanism does not close there.
    """
    state = Solver(mechanism, traced=False).state(position)
    return [float(place) for place in state.position]


def _point(mechanism: Mechanism, name: str) -> str:
    """Returns the name in a drawing of a pin of its loop."""
    return dict(mechanism.drawn.points)[name] if mechanism.drawn else name


def _own(links: Sequence[Any], places: Sequence[float], i: int, parent: str) -> float:
    """Returns the value of a link's joint before it is mapped, rad or m."""
    if links[i].slides or parent == FRAME:
        return places[i]
    above = next(j for j, link in enumerate(links) if link.name == parent)
    spin, guide = axes_of(links, above)
    return places[i] - (0.0 if spin is None else places[spin]) - (guide or 0.0)


def _name(text: str, kind: str, taken: dict[str, None]) -> str:
    """Returns a valid name for a link or pin of the robot, and takes it."""
    name = text if re.fullmatch(_NAME, text) else re.sub('[^A-Za-z0-9]+', '_', text).strip('_')
    if not re.fullmatch(_NAME, name) or name.lower() in _TAKEN:
        name = f'{kind}_{name}'.rstrip('_')
    for number in itertools.count(2):
        if name not in taken:
            break
        name = f'{name.removesuffix(f"_{number - 1}").rstrip("_")}_{number}'
    taken[name] = None
    return name


def _pair(place: complex, size: float) -> list[float]:
    return [_tidy(place.real, size), _tidy(place.imag, size)]


def _rounded(number: float, size: float) -> float:
    """Rounds a number to a fixed fraction of a size; returns 0.0 instead of -0.0."""
    return round(number, _DIGITS - math.ceil(math.log10(size))) + 0.0 if size else number


def _tidy(number: float, size: float) -> float:
    """Rounds a number if that changes it by less than a rounding error of the size."""
    rounded = _rounded(number, size)
    return rounded if abs(rounded - number) <= _NOISE * size else number
