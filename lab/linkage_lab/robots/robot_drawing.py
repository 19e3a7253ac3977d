# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Draws the closed loops of a robot, with the robot's own joints.

The conversion of the drawing decides what mechanism it is. The loops are closed at the driven
joint's value; of the assemblies that the mechanism then has, the nearest to the pose is drawn.
"""

import cmath
import itertools
import math
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from typing import Any, NamedTuple

from linkage_lab.robots.artist import Artist, Drawn, point_of, position_of, tidy, to_digits
from linkage_lab.robots.loops import Request, find_loops
from linkage_lab.robots.model import Robot
from linkage_lab.robots.notes import notes_of
from linkage_lab.robots.plane import FRAME, JointMap, Plane, Step
from linkage_ros import (
    CROSSED,
    OPEN,
    ConfigurationError,
    FourBar,
    LinkageError,
    Mechanism,
    SliderCrank,
    UnreachableError,
)
from linkage_ros.formulas import Array
from linkage_ros.internals import reach_of, wrap

_CLOSED = 1e-6  # largest distance of the ends of a closed loop, relative to the longest link
_ALIKE = 1e-9  # rad, difference between two assemblies that cannot be told apart
_ONE = 1e-6  # rad or m, largest difference of assemblies that meet
_TRIALS = 12  # values of the driven joint, at which the loops may close if they do not as given
_ENDS = ('A0', 'A'), ('A', 'B'), ('B0', 'B'), ('A0', 'B0')  # of the links of a loop, frame last
_MOST = 8  # parts of which all assemblies are compared
_TURNED = 4  # links on which others slide, of which both directions are tried
_AWAY = 0.05  # rad, or of the longest link: where a drawn linkage is compared with the robot


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


def draw_robot(robot: Robot, request: Request) -> RobotDrawing:
    """Draws the loops of a robot that move with its driven joint.

    Args:
        robot: The robot.
        request: Specification of the import.

    Returns:
        The drawing, with its joints and bodies.

    Raises:
        ConfigurationError: A name is unknown, there is no such loop, it cannot be a linkage, or
            the pose does not determine its assembly.
    """
    loops, values = find_loops(robot, request), dict(request.at)
    if loops.frame_joint:
        values.pop(loops.frame_joint.joint.name, None)  # gravity is that at its 0
    plane = Plane(loops, values, request.up)
    return _Poser(Artist(loops, plane), values).drawing()


class _Poser:
    """Closes the loops, and draws them in the assembly nearest to the given pose."""

    def __init__(self, artist: Artist, values: Mapping[str, float]) -> None:
        self.artist, self.plane, self.values = artist, artist.plane, values
        self.driven, self.size = artist.driven, artist.plane.size

    def drawing(self) -> RobotDrawing:
        """Returns the drawing; see `draw_robot`."""
        drawn = self._in_assembly(self._anywhere())
        plane, loops = self.plane, self.artist.loops
        given = {step.joint: self.values.get(step.joint, 0.0) for step in plane.steps}
        residual, across = self._residual(drawn)
        gap, _ = plane.apart({**self.values, **given})
        bodies = {
            name: [*loops.tree.bodies[body].links] for body, name in self.artist.names.items()
        }
        pin = next(x for x in self.artist.pins if x.name == point_of(drawn.mechanism, 'A0'))
        origin = pin.places[loops.frame]
        values = drawn.values | self.artist.frame_joint(origin)
        notes = [
            *notes_of(loops, plane, self.values, self.artist.names, drawn.joints),
            *self.artist.off_pin(),
        ]
        axes = plane.fixed[pin.joint], plane.x, plane.y, plane.normal
        return RobotDrawing(
            values, drawn.mechanism, drawn.joints, bodies, axes, given=given, closed=drawn.closed,
            residual=residual, gap=gap, across=across, size=self.size, notes=notes,
        )  # fmt: skip

    def _anywhere(self) -> Drawn:
        """Draws the loops at the given value of the driven joint, or where they close.

        Raises:
            ConfigurationError: They do not close, or are no mechanism.
        """
        crank, whole = self.driven.joint, math.pi if self.driven.side else self.size
        moves = (sign * whole * k / _TRIALS for k in range(1, _TRIALS + 1) for sign in (1, -1))
        refusals = list[ConfigurationError]()
        for move in (0.0, *moves):
            found = [*self._drawn_at(self.values.get(crank, 0.0) + move, refusals)]
            if found:
                return next((drawn for drawn in found if self._is_on_side(drawn)), found[0])
        if refusals:
            raise refusals[0]
        gap, _ = self.plane.apart(self.values)
        raise ConfigurationError(
            f'the loop cannot close with {crank} at {self.values.get(crank, 0.0):g}, nor at other '
            f'values: the ends are {gap:.4g} m apart; give --at and the values of another pose'
        )

    def _drawn_at(self, value: float, refusals: list[ConfigurationError]) -> Iterator[Drawn]:
        """Yields drawings of the loops at a value of the driven joint, and notes refusals.

        There may be one for each side to which links reach that slide on others.
        """
        own = {step.far: step.joint for step in self.plane.steps if step.side}
        joints = [*dict.fromkeys(own[x.near] for x in self.artist.slides if x.near in own)][
            :_TURNED
        ]
        for some in itertools.product((0.0, math.pi), repeat=len(joints)):
            turned = {
                joint: self.values.get(joint, 0.0) + move
                for joint, move in zip(joints, some, strict=True)
            }
            start = {**self.values, **turned, self.driven.joint: value}
            closed = self.plane.closed(start) or {}
            trials = (self._tried(closed, x, refusals) for x in self.artist.blocks() if closed)
            if drawn := next((drawn for drawn in trials if drawn), None):
                yield drawn

    def _tried(
        self,
        closed: dict[str, float],
        blocks: dict[int, Step],
        refusals: list[ConfigurationError],
    ) -> Drawn | None:
        """Draws the loops at closed joint values, or notes why that is no mechanism."""
        try:
            return self.artist.draw(closed, blocks)
        except ConfigurationError as error:
            refusals.append(error)
            return None

    def _is_on_side(self, drawn: Drawn) -> bool:
        """Returns whether each slide is on its side of the foot from its link's pin, as given."""
        links = drawn.mechanism.structure().links
        joints = [drawn.joints[link.name] for link in links if link.slides and not link.is_guided]
        return all(x.zero + self.values.get(x.name, 0.0) / x.ratio >= 0 for x in joints)

    def _in_assembly(self, sample: Drawn) -> Drawn:
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
        closed = {joint: tidy(value, 1.0) for joint, value in closed.items()} | {crank: given}
        try:
            drawn = self.artist.draw(closed, sample.blocks)
            origin = point_of(drawn.mechanism, 'A0')
            drawn = self.artist.draw(closed, sample.blocks, origin)
            return self.artist.draw(closed, sample.blocks, origin, *self._exact(drawn))
        except ConfigurationError as error:
            raise ConfigurationError(f'{error}: give --at {crank}=VALUE, another value') from error

    def _moves(self, values: Mapping[str, float], others: Mapping[str, float]) -> Iterator[float]:
        """Yields the differences of joint values, rad or relative to the size."""
        for step in self.plane.steps:
            move = values[step.joint] - others.get(step.joint, 0.0)
            yield float(wrap(move)) if step.side else move / self.size

    def _unreachable(self, sample: Drawn, joint: JointMap, own: float) -> ConfigurationError:
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

    def _exact(self, drawn: Drawn) -> tuple[dict[str, float], dict[str, complex]]:
        """Returns lengths with the digits of the file, if the linkage has a change point.

        Otherwise rounding errors of the pins would decide whether the crank turns fully.

        Returns:
            The lengths of the loop's links by name, m, and the place of its last pin: the
            rocker's fixed one, or that of the slider.
        """
        mechanism = drawn.mechanism
        if not isinstance(mechanism, FourBar | SliderCrank) or mechanism.drawn is None:
            return {}, {}
        places = {pin.name: pin.places for pin in self.artist.pins}
        pins = {own: places[name] for own, name in mechanism.drawn.points}
        bodies = {name: body for body, name in self.artist.names.items()}
        *_, last = mechanism.drawn.links
        ends = dict(zip((*mechanism.drawn.links, FRAME), _ENDS, strict=True))
        if isinstance(mechanism, SliderCrank):
            ends = {link: pair for link, pair in ends.items() if link not in {last, FRAME}}
        lengths = {
            link: to_digits(abs(pins[B][bodies[link]] - pins[A][bodies[link]]), self.size)
            for link, (A, B) in ends.items()
        }
        parts = 'crank', 'coupler', 'rocker', 'frame'
        changes: dict[str, Any] = {
            part: replace(getattr(mechanism, part), length=length)
            for part, length in zip(parts, lengths.values(), strict=False)
        }
        if isinstance(mechanism, SliderCrank):
            offset = to_digits(mechanism.slider.offset, self.size)
            changes['slider'] = replace(mechanism.slider, offset=offset)
            way = complex(*drawn.values[f'drawing.slides.{last}.direction'])
            pin = complex(*drawn.values[f'drawing.pins.{point_of(mechanism, "B")}'])
            moved = {'B': complex((pin / way).real, offset / abs(way)) * way}
        else:
            moved = {'B0': cmath.rect(lengths.pop(FRAME), mechanism.frame.angle)}
        with suppress(LinkageError):
            if replace(mechanism, **changes).reach().has_change_point:
                return lengths, {point_of(mechanism, own): x for own, x in moved.items()}
        return {}, {}

    def _residual(self, drawn: Drawn) -> tuple[float, float]:
        """Returns the distances of the ends of the robot's loops, moved as the drawn linkage.

        Returns:
            The largest distance in the plane, and along the normal, m.

        Raises:
            ConfigurationError: They do not meet, as nearly as parallel axes allow.
        """
        start, found = position_of(drawn.mechanism), (0.0, 0.0)
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


def _assemblies(mechanism: Mechanism) -> Iterator[Mechanism]:
    """Yields a mechanism in each of its assemblies; of many dyads, with one changed at most."""
    parts: tuple[Any, ...] = (mechanism, *mechanism.dyads)
    sides = list[list[Any]]()
    for part in parts:
        sides.append([part])
        with suppress(ConfigurationError):  # some have one assembly
            other = CROSSED if part.assembly == OPEN else OPEN
            sides[-1].append(replace(part, assembly=other))
    for chosen in itertools.product(*sides) if len(parts) <= _MOST else _changed_once(sides):
        base, *dyads = chosen
        yield replace(base, dyads=tuple(dyads))


def _changed_once(sides: list[list[Any]]) -> Iterator[list[Any]]:
    """Yields the first of each list, and then all with one replaced by the second."""
    first = [side[0] for side in sides]
    yield first
    for i, side in enumerate(sides):
        for other in side[1:]:
            yield [*first[:i], other, *first[i + 1 :]]
