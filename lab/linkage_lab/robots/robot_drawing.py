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

from linkage_lab.assemblies import choices, combined
from linkage_lab.robots.artist import Artist, Drawn, point_of, position_of, tidy, to_digits
from linkage_lab.robots.loops import Request, find_loops
from linkage_lab.robots.model import RobotModel
from linkage_lab.robots.notes import notes_of
from linkage_lab.robots.plane import FRAME, JointMap, Plane, Step
from linkage_ros import (
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


def draw_robot(robot: RobotModel, request: Request) -> RobotDrawing:
    """Draws the loops of a robot that move with its driven joint.

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
        crank, largest = self.driven.joint, math.pi if self.driven.side else self.size
        given = self.values.get(crank, 0.0)
        moves = (sign * largest * k / _TRIALS for k in range(1, _TRIALS + 1) for sign in (1, -1))
        refusals = list[ConfigurationError]()
        for move in (0.0, *moves):
            drawings = [*self._drawn_at(given + move, refusals)]
            if drawings:
                on_side = (drawn for drawn in drawings if self._is_on_side(drawn))
                return next(on_side, drawings[0])
        if refusals:
            raise refusals[0]
        gap, _ = self.plane.apart(self.values)
        raise ConfigurationError(
            f'the loop cannot close with {crank} at {given:g}, nor at other '
            f'values: the ends are {gap:.4g} m apart; give --at and the values of another pose'
        )

    def _drawn_at(self, value: float, refusals: list[ConfigurationError]) -> Iterator[Drawn]:
        """Yields drawings of the loops at a value of the driven joint, and notes refusals.

        There may be one for each side to which links reach that slide on others.
        """
        turning = {step.far: step.joint for step in self.plane.steps if step.side}
        carriers = [slide.near for slide in self.artist.slides if slide.near in turning]
        joints = [*dict.fromkeys(turning[carrier] for carrier in carriers)][:_TURNED]
        for half_turns in itertools.product((0.0, math.pi), repeat=len(joints)):
            start = {**self.values}
            for joint, half_turn in zip(joints, half_turns, strict=True):
                start[joint] = self.values.get(joint, 0.0) + half_turn
            start[self.driven.joint] = value
            closed = self.plane.closed(start)
            if closed is None:
                continue
            for blocks in self.artist.blocks():
                drawn = self._tried(closed, blocks, refusals)
                if drawn:
                    yield drawn
                    break

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
        """Draws the assembly nearest to the pose, given a drawing of any closed joint values.

        Raises:
            ConfigurationError: The loops cannot close at the driven joint's value, or two
                assemblies are equally near.
        """
        crank = self.driven.joint
        nearest = self._nearest_assembly(sample)
        values = self.plane.closed(nearest) or nearest
        closed = {joint: tidy(value, 1.0) for joint, value in values.items()}
        closed[crank] = self.values.get(crank, 0.0)
        try:
            drawn = self.artist.draw(closed, sample.blocks)
            origin = point_of(drawn.mechanism, 'A0')
            drawn = self.artist.draw(closed, sample.blocks, origin)
            lengths, moved = self._exact(drawn)
            return self.artist.draw(closed, sample.blocks, origin, lengths, moved)
        except ConfigurationError as error:
            raise ConfigurationError(f'{error}: give --at {crank}=VALUE, another value') from error

    def _nearest_assembly(self, sample: Drawn) -> dict[str, float]:
        """Returns the closed joint values of the assembly that is nearest to the pose.

        Raises:
            ConfigurationError: See `_in_assembly`.
        """
        joints, crank = sample.joints, self.driven.joint
        link = next(link for link, joint in joints.items() if joint.name == crank)
        given = self.values.get(crank, 0.0)
        own = joints[link].zero + given / joints[link].ratio
        closed = list[tuple[float, dict[str, float]]]()  # distance from the pose, joint values
        for mechanism in _assemblies(sample.mechanism):
            with suppress(UnreachableError):
                values = {**sample.values_at(mechanism, own), crank: given}
                distance = math.fsum(map(abs, self._moves(values, self.values)))
                closed.append((distance, values))
        if not closed:
            raise self._unreachable(sample, joints[link], own)
        (distance, nearest), *others = sorted(closed, key=lambda one: one[0])
        for other_distance, other in others:
            if other_distance - distance < _ALIKE:
                raise self._ambiguous(nearest, other)
        return nearest

    def _ambiguous(
        self, values: Mapping[str, float], others: Mapping[str, float]
    ) -> ConfigurationError:
        """Describes that two assemblies are equally near, given their joint values."""
        crank = self.driven.joint
        if max(map(abs, self._moves(values, others))) < _ONE:
            return ConfigurationError(
                f'at {crank} {self.values.get(crank, 0.0):g} all links are in line, and both '
                f'assemblies meet: give --at {crank}=VALUE, another value'
            )
        passive = [step.joint for step in self.plane.steps if step is not self.driven]
        return ConfigurationError(
            'both assemblies are equally far from this pose: give --at and a value of '
            f'{" or ".join(passive)} in the wanted assembly'
        )

    def _moves(self, values: Mapping[str, float], others: Mapping[str, float]) -> Iterator[float]:
        """Yields the differences of joint values, rad or relative to the size."""
        for step in self.plane.steps:
            move = values[step.joint] - others.get(step.joint, 0.0)
            yield float(wrap(move)) if step.side else move / self.size

    def _unreachable(self, sample: Drawn, joint: JointMap, own: float) -> ConfigurationError:
        """Describes where the loops close, which is not at the value `own` of the driven link."""
        given = self.values.get(joint.name, 0.0)
        reach = reach_of(sample.mechanism)
        is_angle = reach is not None and not reach.slides
        ranges = list[str]()
        for start, end in reach.arcs if reach else ():
            # The arc in the turn that is nearest to the value.
            shift = math.tau * round((own - (start + end) / 2) / math.tau) if is_angle else 0.0
            low, high = ((x + shift - joint.zero) * joint.ratio for x in (start, end))
            ranges.append(f'{low:.6g} to {high:.6g}')
        unit = 'rad, plus whole turns' if is_angle else 'm'
        return ConfigurationError(
            f'the loop cannot close with {joint.name} at {given:g}: it can from '
            f'{" or ".join(ranges)} {unit}; give --at {joint.name}=VALUE'
        )

    def _exact(self, drawn: Drawn) -> tuple[dict[str, float], dict[str, complex]]:
        """Returns lengths with the digits of the file, if the linkage has a change point.

        Otherwise rounding errors of the pins would decide whether the crank turns fully.

        Returns:
            The lengths of the loop's links by name, m, and the place of its last pin: the
            rocker's fixed one, or that of the slider. Both are empty without a change point.
        """
        mechanism = drawn.mechanism
        if not isinstance(mechanism, FourBar | SliderCrank) or mechanism.drawn is None:
            return {}, {}
        places = {pin.name: pin.places for pin in self.artist.pins}
        pins = {own: places[name] for own, name in mechanism.drawn.points}
        bodies = {name: body for body, name in self.artist.names.items()}

        def length(link: str, start: str, end: str) -> float:
            body = bodies[link]
            return to_digits(abs(pins[end][body] - pins[start][body]), self.size)

        crank, coupler, last = mechanism.drawn.links
        lengths = {crank: length(crank, 'A0', 'A'), coupler: length(coupler, 'A', 'B')}
        changes: dict[str, Any] = {
            'crank': replace(mechanism.crank, length=lengths[crank]),
            'coupler': replace(mechanism.coupler, length=lengths[coupler]),
        }
        if isinstance(mechanism, SliderCrank):
            offset = to_digits(mechanism.slider.offset, self.size)
            changes['slider'] = replace(mechanism.slider, offset=offset)
            direction = complex(*drawn.values[f'drawing.slides.{last}.direction'])
            pin = complex(*drawn.values[f'drawing.pins.{point_of(mechanism, "B")}'])
            along = (pin / direction).real
            moved = {'B': complex(along, offset / abs(direction)) * direction}
        else:
            lengths[last], frame = length(last, 'B0', 'B'), length(FRAME, 'A0', 'B0')
            changes['rocker'] = replace(mechanism.rocker, length=lengths[last])
            changes['frame'] = replace(mechanism.frame, length=frame)
            moved = {'B0': cmath.rect(frame, mechanism.frame.angle)}
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
        drawn_position = position_of(drawn.mechanism)
        away = _AWAY if self.driven.side else _AWAY * self.size
        poses = [drawn.closed]
        for move in (away, -away):
            with suppress(UnreachableError):
                poses.append(drawn.values_at(drawn.mechanism, drawn_position + move))
        # An axis that is not parallel moves what it carries, also along the normal.
        tilts = sum(angle for _, angle in self.plane.tilts)
        allowed = _CLOSED * self.size + tilts * self.plane.reach_of_joints()
        largest_inside, largest_across = 0.0, 0.0
        for pose in poses:
            inside, across = self.plane.apart({**self.values, **pose})
            largest_inside = max(largest_inside, inside)
            largest_across = max(largest_across, across)
            if inside > allowed:
                values = ', '.join(f'{name} {value:.6g}' for name, value in pose.items())
                raise ConfigurationError(
                    f'the ends of the loop stay {inside:.4g} m apart at {values}: must be at '
                    f'most {allowed:.4g} m; give --at and the values of another pose'
                )
        return largest_inside, largest_across


def _assemblies(mechanism: Mechanism) -> Iterator[Mechanism]:
    """Yields a mechanism in each of its assemblies; of many dyads, with one changed at most."""
    lists = choices(mechanism)
    has_few = len(lists) <= _MOST
    yield from map(combined, itertools.product(*lists) if has_few else _changed_once(lists))


def _changed_once(lists: list[list[Any]]) -> Iterator[list[Any]]:
    """Yields the first of each list, and then all with one replaced by the second."""
    first = [options[0] for options in lists]
    yield first
    for i, options in enumerate(lists):
        for other in options[1:]:
            yield [*first[:i], other, *first[i + 1 :]]
