# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Measures of designs, computed for many designs and all crank angles of a period at once.

Designs whose constants have the same structure form a group. Their constants are stacked in
arrays, so that one call of the program computes all of them.
"""

import copy
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cached_property
from typing import Any, NamedTuple, cast

import numpy as np
import numpy.typing as npt

from linkage_ros import ConfigurationError, LinkageError, Mechanism, Reach, Solver
from linkage_ros.extensions import Constants, Program
from linkage_ros.formulas import Array, Real
from linkage_ros.internals import Model, Ranges, reactions, signs_around, torque

RPM, SPEED = 'rpm', 'speed'
CANNOT_TURN, TURNS, REFUSED, REVERSES = range(4)


class Way(NamedTuple):
    """A motion of the crank within an arc, which all designs make.

    Attributes:
        low: Smallest crank angle of the motion, rad; for a driven cylinder, a position, m.
        high: Largest crank angle.
        angles: Crank angles at equal times.
        speeds: Crank speeds there, rad/s or m/s; None for a constant speed.
        accelerations: Crank accelerations there; 0 for a constant speed.
        reversals: Crank angles at which the crank reverses.
    """

    low: float
    high: float
    angles: Array
    speeds: Array | None = None
    accelerations: Real = 0.0
    reversals: tuple[float, ...] = ()

    def fits(self, reach: Reach) -> bool:
        """Returns whether a mechanism with this reach can make the motion."""
        starts = (start for start, _ in reach.arcs)
        shifts = (0.0 if reach.slides else (self.low - x) // math.tau * math.tau for x in starts)
        ends = zip(reach.arcs, shifts, strict=True)
        return reach.turns_fully or any(
            start + shift < self.low and self.high < end + shift for (start, end), shift in ends
        )


class Task(NamedTuple):
    """Specifies the computation for every design.

    Attributes:
        mechanism: The base mechanism of all designs.
        speed: Crank speed, rpm, or speed of a driven cylinder, m/s; None if the base has none.
        names: The parameters in which designs differ.
        measures: Names of the measures.
        angles: Number of crank angles in a turn.
        points: Points that the coupler point should pass through, x + iy, m.
        way: Motion of the crank; None for whole turns at a constant speed.
    """

    mechanism: Mechanism
    speed: float | None
    names: tuple[str, ...]
    measures: tuple[str, ...]
    angles: int
    points: tuple[complex, ...] = ()
    way: Way | None = None


def measure(task: Task, designs: Array) -> Array:
    """Computes all measures of many designs.

    Args:
        task: The base mechanism, the varied parameters and the measures.
        designs: Parameter values; a row for each design, a column for each name in the task.

    Returns:
        A row for each design: TURNS or CANNOT_TURN; or, if it can turn, or make the motion of the
        task, REFUSED if a spring or load curve does not fit, REVERSES if the crank reverses where
        a gas has valves; then the measures, NaN where one does not apply.
    """
    found = np.full((len(designs), 1 + len(task.measures)), math.nan)
    found[:, 0] = CANNOT_TURN
    columns = dict(zip(task.names, designs.T, strict=True))
    slides = _drives_cylinder(task)
    speeds = columns.pop(SPEED if slides else RPM, np.full(len(designs), task.speed or 0.0))
    speeds = speeds if slides else speeds * math.pi / 30
    at_once = max(1, 16384 // task.angles)  # few enough values for the processor's cache
    # As in Program.arrays: makes glibc keep freed arrays for reuse.
    np.empty(3_000_000)
    has_valves = bool(task.way and task.way.reversals) and any(
        load.one_way(task.mechanism) for load in task.mechanism.applied_loads()
    )
    with np.errstate(all='ignore'):
        for rows, reaches, constants in groups(task.mechanism, columns, len(designs)):
            (able,) = np.nonzero(
                [task.way.fits(x) if task.way else x.turns_fully for x in reaches]
            )
            rows = rows[able]
            if constants is None:
                found[rows, 0] = REFUSED
                continue
            found[rows, 0] = TURNS
            if has_valves:
                changed = (_design(task.mechanism, columns, row) for row in rows)
                found[rows, 0] = [_outcome(task, mechanism) for mechanism in changed]
                able, rows = (x[found[rows, 0] == TURNS] for x in (able, rows))
            constants, reaches = constants.part(able), tuple(reaches[i] for i in able)
            for start in range(0, len(rows), at_once):
                part = slice(start, start + at_once)
                speed: Real = speeds[rows[part], None]
                kind = SwingBatch if task.way else Batch
                batch = kind(constants.part(part), reaches[part], speed, task)
                for i, name in enumerate(task.measures, 1):
                    found[rows[part], i] = MEASURES[name].of(batch)
    return found


def _drives_cylinder(task: Task) -> bool:
    """Returns whether a cylinder is driven, not a crank."""
    return bool(task.mechanism.structure().driven_link.slides)


def _outcome(task: Task, mechanism: Mechanism) -> int:
    """Returns REVERSES if the crank of a design reverses where a gas has valves, or TURNS."""
    try:
        Ranges(Solver(mechanism)).require_valves(task.way.reversals if task.way else ())
    except ConfigurationError:
        return REVERSES
    return TURNS


# ---------------------------------------------------------------- groups of one structure


def groups(
    mechanism: Mechanism, columns: Mapping[str, Array], count: int
) -> Iterator[tuple[npt.NDArray[np.intp], tuple[Reach, ...], Constants | None]]:
    """Divides designs into groups that share a structure, and therefore a program.

    Args:
        mechanism: The base mechanism of all designs.
        columns: Values for all designs, by parameter name.
        count: Number of designs.

    Yields:
        For each group, the indices of its designs, the reach of their cranks, and the constants
        of the formulas below, with arrays of shape (designs, 1) as numbers, or None if a load does
        not fit. Designs that cannot be assembled are omitted.
    """
    found: dict[Any, list[tuple[int, Reach, Constants]]] = {}
    # A load curve is a function, which cannot be stacked.
    has_curve = any(map(callable, Constants(tuple(mechanism.link_loads().values())).numbers))
    for row in range(count):
        with suppress(LinkageError):
            reach, constants = _constants(mechanism, columns, row)
            if constants is None:
                yield np.array([row]), (reach,), None
                continue
            key = row if has_curve else id(constants.tapes)
            found.setdefault(key, []).append((row, reach, constants))
    for group in found.values():
        rows, reaches, each = zip(*group, strict=True)
        yield np.array(rows), reaches, Constants.stacked(each)


def _constants(
    mechanism: Mechanism, columns: Mapping[str, Array], row: int
) -> tuple[Reach, Constants | None]:
    """Returns the reach of the crank, and the constants of the formulas below.

    The latter are None if a load does not fit the mechanism.
    """
    mechanism = _design(mechanism, columns, row)
    structure = mechanism.structure()
    reach = cast('Reach', Solver(mechanism).mobility if mechanism.dyads else mechanism.reach())
    try:
        model = Model.of(mechanism, structure)
    except LinkageError:
        return reach, None
    return reach, Constants((model, structure.points.get('C'), structure.output_index))


def _design(mechanism: Mechanism, columns: Mapping[str, Array], row: int) -> Mechanism:
    """Returns the mechanism of a design, not checked."""
    for name, column in columns.items():
        mechanism = with_value(mechanism, name, float(column[row]))
    return mechanism


def with_value(part: Any, name: str, value: Any) -> Any:
    """Copies a description with one value replaced; the value is not checked.

    Args:
        part: A mechanism, one of its parts, its dyads, or a pair of numbers.
        name: Dotted name of a parameter; 0 and 1 are the numbers of a pair.
        value: The value to set.

    Returns:
        The copy.
    """
    first, _, rest = name.partition('.')
    if isinstance(part, tuple):
        names = [getattr(old, 'name', str(i)) for i, old in enumerate(part)]
        return tuple(
            old if first != own else with_value(old, rest, value) if rest else value
            for own, old in zip(names, part, strict=True)
        )
    changed = copy.copy(part)
    inner = with_value(getattr(part, first), rest, value) if rest else value
    object.__setattr__(changed, first, inner)
    return changed


# ---------------------------------------------------------------- formulas and measures

# Each formula takes the constants above, the crank angle, rad, the crank speed, rad/s, and, unless
# the speed is constant, the crank acceleration, rad/s^2.


def torque_of(constants: Any, angle: Real, speed: Real, *acceleration: Real) -> tuple[Real, ...]:
    """Computes the driving torque, N m."""
    return torque(constants[0], (angle,), (speed,), acceleration)


def _force_of(constants: Any, angle: Real, speed: Real, *acceleration: Real) -> tuple[Real, ...]:
    """Computes the components of the force on the frame, N."""
    return reactions(constants[0], (angle,), (speed,), acceleration)[2]


def _output_of(constants: Any, angle: Real, *_: Real) -> tuple[Real, ...]:
    """Computes the output position and its first two derivatives with respect to the angle."""
    model, _, output = constants
    link = model.loop.pose((angle,)).links[output]
    return link.position, link.jacobian[0], link.curvature[0]


def _transmission_of(constants: Any, angle: Real, *_: Real) -> tuple[Real, ...]:
    """Computes the sine of the transmission angle."""
    return cast('tuple[Real]', constants[0].loop.pose((angle,)).sines[:1])


def _path_of(constants: Any, angle: Real, *_: Real) -> tuple[Real, ...]:
    """Computes the components of the coupler point's position, m."""
    return _path_motion_of(constants, angle)[:2]


def _path_motion_of(constants: Any, angle: Real, *_: Real) -> tuple[Real, ...]:
    """Computes the coupler point's position and its derivatives with respect to the angle, m."""
    model, point, _ = constants
    links = model.loop.pose((angle,)).links
    found = point.motion(
        [link.direction for link in links],
        [link.jacobian[0] for link in links],
        [link.curvature[0] for link in links],
    )
    return tuple(x for vector in found for x in vector)


class Batch:
    """Designs with the same structure and fully turning cranks, evaluated over a period.

    All arrays have a row for each design. `travel` finds the same reversals, one design at a time.
    """

    def __init__(
        self, constants: Constants, reaches: Sequence[Reach], speed: Array, task: Task
    ) -> None:
        """Stores constants, reach and crank speed, rad/s, shape (designs, 1), of each design."""
        self._constants, self._reaches, self._points = constants, reaches, task.points
        turns = reaches[0].period_turns
        self._has_change_point = turns == 2 or reaches[0].has_change_point
        self._step = 2 * math.pi / task.angles
        self._angles = (np.arange(turns * task.angles) + 0.5) * self._step
        # Those of torques and forces: a load may repeat after two turns, the motion after one.
        turns = max([turns, *(load.turns for load in task.mechanism.loads)])
        self._loaded = (np.arange(turns * task.angles) + 0.5) * self._step
        self._motion: tuple[Real, ...] = (speed,)

    def _run(self, formula: Callable[..., Any], angles: Real | None = None) -> list[Array]:
        """Evaluates a formula at crank angles, rad; by default, at those of the motion."""
        angles = self._angles if angles is None else angles
        names = ('angle', 'speed', 'acceleration')[: 1 + len(self._motion)]
        found = Program(formula, self._constants, names).designs(angles, *self._motion)
        shape = len(self._reaches), angles.shape[-1]
        return [np.broadcast_to(x, shape) for x in found]

    @cached_property
    def torque(self) -> Array:
        """Driving torque, N m."""
        return self._run(torque_of, self._loaded)[0]

    def rms(self) -> Array:
        """Computes the root mean square of the driving torque over time, N m."""
        return np.asarray(np.sqrt(np.mean(self.torque**2, -1)))

    def shaking_force(self) -> Array:
        """Computes the largest force on the frame, N; infinite if there are change points."""
        if self._has_change_point:
            return np.full(len(self._reaches), math.inf)
        return np.asarray(np.hypot(*self._run(_force_of, self._loaded)).max(-1))

    @cached_property
    def _reversals(self) -> Array:
        """Crank angles of the two reversals of the output, rad; NaN unless it reverses twice."""
        _, rate, _ = self._run(_output_of)
        signs = signs_around(rate)
        turned = signs * np.roll(signs, -1, axis=-1) < 0
        first, last = turned.argmax(-1), turned[:, ::-1].argmax(-1)
        before = self._angles[np.stack([first, turned.shape[-1] - 1 - last], -1)]
        at = before + 0.5 * self._step
        for _ in range(8):  # Newton steps; four usually reach full precision
            _, slope, bend = self._run(_output_of, at)
            at = np.clip(at - slope / bend, before, before + self._step)
        # A rocker that passes change points may swing by more than pi.
        twice = (turned.sum(-1, keepdims=True) == 2) & (not self._has_change_point)
        return np.where(twice, at, math.nan)

    def stroke(self) -> Array:
        """Computes the signed distance between the two reversals of the output, rad or m."""
        at = self._reversals
        known = ~np.isnan(at)
        places, *_ = self._run(_output_of, np.where(known, at, self._angles[0]))
        return np.where(known.all(axis=1), places[:, 1] - places[:, 0], math.nan)

    def swing(self) -> Array:
        """Computes the swing of a rocker that stays on one side of the frame, deg."""
        stroke = self.stroke()
        return np.asarray(np.abs(np.degrees(stroke - math.tau * np.rint(stroke / math.tau))))

    def time_ratio(self) -> Array:
        """Computes the ratio of the longer to the shorter crank rotation between reversals."""
        way = self._reversals[:, 1] - self._reversals[:, 0]
        rest = len(self._angles) * self._step - way
        return np.maximum(way, rest) / np.minimum(way, rest)

    def transmission_angle(self) -> Array:
        """Computes the smallest transmission angle, measured as an acute angle, deg."""
        low, high = np.transpose([cast('Any', reach.transmission) for reach in self._reaches])
        return cast('Array', np.degrees(np.minimum(low, math.pi - high)))

    def point_distance(self) -> Array:
        """Computes the largest distance of the given points from the coupler point's path, m."""
        x, y = self._run(_path_of, self._angles)
        path: Any = x + 1j * y
        step = np.roll(path, -1, axis=-1) - path
        points = np.array(self._points)
        ways = (points[:, None, None] - path) / step
        parts = np.clip(ways.real, 0.0, 1.0)
        nearest = np.abs(step * (ways - parts)).argmin(-1)[..., None]
        before = self._angles[nearest[..., 0].T]
        at = before + self._step * np.take_along_axis(parts, nearest, -1)[..., 0].T
        found: Array = np.full_like(at, math.inf)
        for _ in range(8):  # Newton steps from the chord to the path
            found_at = iter(self._run(_path_motion_of, at))
            place, slope, bend = (x + 1j * y for x, y in zip(found_at, found_at, strict=True))
            gap, square = place - points, np.abs(slope) ** 2
            found = np.fmin(found, np.abs(gap))
            grows = square + (gap * bend.conj()).real
            way = (gap * slope.conj()).real / np.where(grows > 0, grows, square)
            at = np.clip(at - way, before - self._step, before + 2 * self._step)
        return np.asarray(found.max(-1))


class SwingBatch(Batch):
    """Designs with the same structure, evaluated along a motion within an arc of the crank."""

    def __init__(
        self, constants: Constants, reaches: Sequence[Reach], speed: Array, task: Task
    ) -> None:
        """See `Batch`."""
        super().__init__(constants, reaches, speed, task)
        way = cast('Way', task.way)
        self._angles = self._loaded = way.angles
        if way.speeds is not None:
            self._motion = way.speeds, way.accelerations

    def rms(self) -> Array:
        """Computes it by the trapezoidal rule, because the motion includes both of its ends."""
        square = self.torque**2
        return np.asarray(np.sqrt(np.mean(square[:, 1:] + square[:, :-1], -1) / 2))

    def stroke(self) -> Array:
        """Computes the distance that the output covers, rad or m."""
        place, *_ = self._run(_output_of)
        return np.asarray(np.ptp(place, axis=-1))

    def swing(self) -> Array:
        """Computes the swing of the rocker, deg."""
        place, *_ = self._run(_output_of)
        return np.asarray(np.degrees(np.ptp(np.unwrap(place), axis=-1)))

    def transmission_angle(self) -> Array:
        """Computes the smallest transmission angle, measured as an acute angle, deg."""
        (sine,) = self._run(_transmission_of)
        return np.asarray(np.degrees(np.arcsin(np.abs(sine).min(-1))))


class Measure(NamedTuple):
    """One measure of designs.

    Attributes:
        unit: Unit of the measure.
        of: Function that computes the measure for each design of a batch.
        needs: Requirement on the task in words.
        applies: Function that returns whether a task meets the requirement.
    """

    unit: str
    of: Callable[[Batch], Array]
    needs: str = ''
    applies: Callable[[Task], bool] = lambda _: True


def _slides(task: Task) -> bool:
    """Returns whether the output link is a slider."""
    structure = task.mechanism.structure()
    return structure.links[structure.output_index].slides


# For torques and forces.
_SPEED: Any = (
    'a crank speed, such as rpm: 60.0 (of a cylinder, speed: 0.1), or a law, and no dry friction',
    lambda task: (
        (task.speed is not None or (task.way is not None and task.way.speeds is not None))
        and not task.mechanism.joint_loads()
    ),
)


def _driving(*, slides: bool) -> Any:
    """Returns requirement and test for the torque of a crank, or the force of a cylinder."""
    needs, has_speed = _SPEED

    def applies(task: Task) -> bool:
        return bool(has_speed(task)) and _drives_cylinder(task) == slides

    return f'{needs}, and a driven {"cylinder" if slides else "crank"}', applies


def _peak(batch: Batch) -> Array:
    return np.asarray(np.abs(batch.torque).max(-1))


_WHOLE: Any = ('a crank that turns fully', lambda task: task.way is None)
MEASURES = {
    'peak_torque': Measure('N m', _peak, *_driving(slides=False)),
    'rms_torque': Measure('N m', lambda x: x.rms(), *_driving(slides=False)),
    'peak_force': Measure('N', _peak, *_driving(slides=True)),
    'rms_force': Measure('N', lambda x: x.rms(), *_driving(slides=True)),
    'shaking_force': Measure('N', lambda x: x.shaking_force(), *_SPEED),
    'swing': Measure(
        'deg', lambda x: x.swing(), 'an output link that swings', lambda task: not _slides(task)
    ),
    'stroke': Measure('m', lambda x: np.abs(x.stroke()), 'a slider', _slides),
    'time_ratio': Measure('', Batch.time_ratio, *_WHOLE),
    'transmission_angle': Measure(
        'deg',
        lambda x: x.transmission_angle(),
        'a four_bar or a slider_crank',
        lambda task: cast('Reach', task.mechanism.reach()).transmission is not None,
    ),
    'point_distance': Measure(
        'm',
        Batch.point_distance,
        'coupler.point, and points: [x, y, ...], and a crank that turns fully',
        lambda task: (
            bool(task.points) and 'C' in task.mechanism.structure().points and not task.way
        ),
    ),
}
