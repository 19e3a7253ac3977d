# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Motion, torque and forces of a mechanism over one period, as named columns."""

import functools
import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np

from linkage_lab.gaps import Column, around_gaps, at_change_points
from linkage_lab.output import name_of
from linkage_lab.sampling import (
    integral,
    interpolated,
    law_duration,
    peaks,
    samples,
    with_breaks,
    without_loads,
)
from linkage_ros import ConfigurationError, Mechanism, Solver, State, Travel, WindPump, travel
from linkage_ros.formulas import Array
from linkage_ros.internals import Picture, radians_per_second, without_turns
from linkage_ros.palette import colors_of

if TYPE_CHECKING:
    from linkage_lab.pump.shooting import PeriodicMotion

# Mean power, relative to its rms, beyond the errors of a mean of 0.
_NET = 0.01
# Speed of a crank that is drawn over its arc, or of a cylinder over its stroke, m/s; and the part
# of the arc or stroke left out at each end.
_SLOW_RPM, _SLOW, _MARGIN = 1.0, 0.01, 0.01
_BEFORE = 16  # ulp of the largest time; the time just before a point of a law
# Names and units of the motion of a link that slides, or of a point, and of a link that turns.
# Directions are absolute, unlike the positions of joints in messages and logs.
SLIDING = ('position', 'm'), ('velocity', 'm/s'), ('acceleration', 'm/s^2')
TURNING = ('direction', 'rad'), ('angular_velocity', 'rad/s'), ('angular_acceleration', 'rad/s^2')
_NET_POWER = 'net_power'  # column of efforts that a period does not keep


class Extent(NamedTuple):
    """Smallest and largest value of a quantity over the period.

    Attributes:
        low: Smallest value.
        low_at: Crank angle, position or time of the smallest value, rad, m or s.
        high: Largest value.
        high_at: The same for the largest value.
        rms: Root mean square over this variable.
    """

    low: float
    low_at: float
    high: float
    high_at: float
    rms: float


class Across(NamedTuple):
    """The variable over which a motion is drawn: name, unit, and its value per rad, m or s."""

    name: str
    unit: str
    scale: float


OVER_TIME = Across('Time', 's', 1.0)


def angle_name(driven: str) -> str:
    """Returns the title of the angle of a driven link."""
    return 'Crank angle' if driven == 'crank' else f'Angle of {driven}'


class Period:
    """One period of a periodic motion, a motion along a law, or a motion over an arc.

    Attributes:
        solver: Solver of the mechanism.
        driven: The link whose joint is driven.
        crank: Positions of this joint: crank angles, rad, or positions of a slide, m. Without a
            law they increase, over a period from 0.
        x: The same or, along a law, the times, in increasing order, rad, m or s.
        across: The variable in `x`.
        speed: Mean speed of the driven joint, rad/s or m/s; along a law, its mean magnitude.
        mean_power: Mean driving power over time, W.
        colors: Colours of the links by name.
        columns: Quantities by name, such as 'coupler.direction'; angles are unwrapped.
        gaps: Whether a column of forces has no value at each crank angle, by name; see
            `around_gaps`.
    """

    def __init__(
        self,
        solver: Solver,
        crank: Array,
        state: State,
        efforts: Mapping[str, Column],
        *,
        speed: float,
        mean_power: float,
        time: Array | None = None,
        turns: int | None = None,
    ) -> None:
        """Converts the motion at all crank angles, and along a law the times, to columns.

        `efforts` are the columns of `_efforts`; `turns` the whole turns of a law that repeats.
        """
        self.solver, self._law_turns = solver, turns
        self.crank, self.speed, self.mean_power = crank, speed, mean_power
        self.driven = solver.structure.driven_link
        over = Across(angle_name(self.driven.name), 'deg', 180 / math.pi)
        if self.driven.slides:
            over = Across(f'Position of the {self.driven.driven_word}', 'm', 1.0)
        self.x, self.across = (crank, over) if time is None else (time, OVER_TIME)
        self.colors = colors_of(solver.links)
        self.columns: dict[str, Column] = {}
        self.gaps: dict[str, Array] = {}
        if time is not None:
            self.add('time', 's', time)
        if not self.driven.slides:
            self.add('crank_angle', 'rad', crank)
        self._add_links(state)
        self.columns |= efforts
        self._add_points(state)
        self._add_springs(state)

    def _add_links(self, state: State) -> None:
        """Adds the motion of each link."""
        for i, link in enumerate(self.solver.structure.links):
            names = SLIDING if link.slides else TURNING
            rows = state.position[i], state.velocity[i], state.acceleration[i]
            for (name, unit), values in zip(names, rows, strict=True):
                unwrapped = np.unwrap(values) if name == 'direction' else values
                self.add(f'{link.name}.{name}', unit, unwrapped)

    def _add_points(self, state: State) -> None:
        """Adds the motion of each traced point."""
        for point in self.solver.structure.traced:
            vectors = self.solver.point(state, point)
            for (name, unit), vector in zip(SLIDING, vectors, strict=True):
                self.add(f'{point}.{name}', unit, vector)

    def _add_springs(self, state: State) -> None:
        """Adds length, rate of the length and, of a load, tension of each spring and cylinder."""
        for name in self.springs:
            spring = self.solver.spring(state, name)
            self.add(f'{name}.length', 'm', spring.length)
            self.add(f'{name}.length_rate', 'm/s', spring.rate)
            if name not in self.cylinders:
                self.add(f'{name}.tension', 'N', spring.tension)

    @property
    def springs(self) -> list[str]:
        """Names of the loads of kind spring, and of the cylinders without a load."""
        return [*self.solver.springs]

    @property
    def cylinders(self) -> list[str]:
        """Names of the cylinders of a drawing without a load, which have no tension."""
        loads = {load.name for load in self.solver.mechanism.loads}
        return [name for name in self.springs if name not in loads]

    @property
    def effort(self) -> str:
        """Name of the column of the driving torque or force."""
        return _effort(self.driven)

    @property
    def effort_name(self) -> str:
        """The driving torque or force in words, for a diagram."""
        return self.effort.replace('_', ' ').capitalize()

    @property
    def effort_title(self) -> str:
        """The driving torque or force with its unit, for a diagram."""
        return f'{self.effort_name}, {self.columns[self.effort].unit}'

    @functools.cached_property
    def drawing(self) -> Picture:
        """Picture of the mechanism, on the arc of the first crank angle."""
        mechanism = self.solver.mechanism
        return Picture(mechanism, float(self.crank[0]), units=length_unit(mechanism))

    def with_gaps(self) -> dict[str, Column]:
        """Returns the columns, with NaN where they have no value."""
        columns = dict(self.columns)
        for name, is_gap in self.gaps.items():
            unit, values = columns[name]
            columns[name] = Column(unit, np.where(is_gap, np.nan, values))
        return columns

    def rows(self, quantity: str) -> Array:
        """Returns 'position', 'velocity' or 'acceleration' of all links, shape (n, links)."""
        columns = (self.motion(link, quantity).values for link in self.solver.links)
        return np.stack([*columns], axis=-1)

    def motion(self, link: str, quantity: str) -> Column:
        """Returns 'position', 'velocity' or 'acceleration' of a link."""
        return self.columns[self.motion_column(link, quantity)]

    def motion_column(self, link: str, quantity: str) -> str:
        """Returns the name of the column of 'position', 'velocity' or 'acceleration' of a link."""
        slides = self.solver.structure.links[self.solver.links.index(link)].slides
        names = SLIDING if slides else TURNING
        word, _ = names[('position', 'velocity', 'acceleration').index(quantity)]
        return f'{link}.{word}'

    @property
    def time(self) -> Array:
        """Time from the first crank angle to each crank angle, in either direction, s."""
        if self.across is OVER_TIME:
            return self.x
        speed = np.abs(self.motion(self.driven.name, 'velocity').values)
        steps = 2 * np.diff(self.crank) / (speed[1:] + speed[:-1])
        return np.concatenate([[0.0], np.cumsum(steps)])

    @property
    def gap_note(self) -> str:
        """Names the crank angles without forces in one line; empty if there are none."""
        is_gap = np.any([*self.gaps.values()], axis=0) if self.gaps else np.zeros(1, dtype=bool)
        (indices,) = np.nonzero(is_gap)
        if not indices.size:
            return ''
        runs = np.split(indices, np.flatnonzero(np.diff(indices) > 1) + 1)
        ranges = dict.fromkeys(self._range_in_degrees(run[0], run[-1]) for run in runs)
        return (
            f'no forces at {", ".join(ranges)} deg, where links are in line or friction locks them'
        )

    def _range_in_degrees(self, first: int, last: int) -> str:
        """Writes the range between the crank angles of two indices; one number if it is small."""
        low, high = (f'{math.degrees(self.crank[i]):.6g}' for i in (first, last))
        return low if low == high else f'{low} to {high}'

    @property
    def marks(self) -> Array:
        """The values of `x`, deg or s."""
        return self.x * self.across.scale

    @property
    def travel(self) -> Travel | None:
        """Stroke or swing over a whole period of a turning crank; otherwise None."""
        is_whole = self._is_whole or self._law_turns
        return travel(self.solver) if is_whole and self.solver.mobility else None

    @property
    def turns(self) -> float:
        """Number of crank turns of a whole period; otherwise 1."""
        return float(self.crank[-1]) / (2 * math.pi) if self._is_whole else 1.0

    @property
    def is_driven_by_loads(self) -> bool:
        """Whether the loads of a motion that repeats drive the crank on average.

        Errors of the mean, of loads that give back their work, do not count.
        """
        repeats = self._is_whole or self._law_turns is not None
        power = self.columns['driving_power'].values
        return repeats and self.mean_power < -_NET * math.sqrt(mean(self.x, power**2))

    @property
    def _is_whole(self) -> bool:
        reach = self.solver.mobility
        return self.across.unit == 'deg' and (reach is None or reach.turns_fully)

    def add(self, name: str, unit: str, values: Any) -> None:
        """Adds a column, or one for each component of a vector."""
        self.columns |= _columns(name, unit, values, len(self.crank))


def length_unit(mechanism: Mechanism) -> str:
    """Returns the unit of lengths in a picture: that of the drawing, or mm below 1 m."""
    if mechanism.drawn:
        return mechanism.drawn.units
    longest = max(abs(getattr(part, 'length', 0.0)) for part in mechanism.parts().values())
    return 'mm' if longest < 1 else 'm'


def _effort(driven: Any) -> str:
    return 'driving_force' if driven.slides else 'driving_torque'


def _columns(name: str, unit: str, values: Any, count: int) -> dict[str, Column]:
    """Returns a column of a number of values, or one for each component of a vector."""
    if not isinstance(values, tuple):
        return {name: Column(unit, np.broadcast_to(values, count))}
    parts = zip('xy', values, strict=True)
    return {f'{name}.{axis}': Column(unit, np.broadcast_to(x, count)) for axis, x in parts}


def _efforts(solver: Solver, state: State) -> dict[str, Column]:
    """Computes driving torque and power, forces 'LOAD.force', 'LOAD.2.force' ..., 'LINK.load'.

    The forces of loads are those of `Solver.exerted`, without opposites; see `_named_forces`.
    """
    structure, exerted = solver.structure, solver.exerted(state)
    driven, count = structure.driven_link, len(state.position[structure.driven])
    columns = _columns(_effort(driven), driven.units.effort, state.torque, count)
    power = state.torque * state.velocity[structure.driven]
    columns |= _columns('driving_power', 'W', power, count)
    for name, force in _named_forces(exerted.forces.values()):
        columns |= _columns(f'{name}.force', 'N', force, count)
    slides = {link.name: link.slides for link in structure.links}
    for name, effort in exerted.efforts.items():
        columns |= _columns(f'{name}.load', 'N' if slides[name] else 'N m', effort, count)
    return columns


def _named_forces(forces: Iterable[Any]) -> Iterator[tuple[str, Any]]:
    """Yields names LOAD, LOAD.2 ... and vectors, N, of the forces that loads exert at points.

    A force that is the opposite of an earlier one on another link, such as the second of a spring,
    is left out.
    """
    by_load = dict[str, list[Any]]()
    for force in forces:
        earlier = by_load.setdefault(force.load, [])
        if any(_are_opposite(force, other) for other in earlier):
            continue
        earlier.append(force)
        number = len(earlier)
        yield (force.load if number == 1 else f'{force.load}.{number}'), force.force


def _are_opposite(one: Any, other: Any) -> bool:
    """Returns whether a load pushes two links with opposite forces; see `Solver.exerted`."""
    pairs = zip(one.force, other.force, strict=True)
    return one.link != other.link and all(np.array_equal(x, -y) for x, y in pairs)


def period_to_show(
    source: str, design: Any, rpm: float | None, **options: Any
) -> tuple[Period, list[str]]:
    """Computes the period of a design with the user's options.

    Args:
        source: Name of the parameter file or preset.
        design: The configuration in this file.
        rpm: Crank speed, rpm; None to use the file's speed.
        **options: Further options of linkage_chart that the user gave, by name.

    Returns:
        The period, and its title: name, class, speed, and further lines.

    Raises:
        ConfigurationError: The mechanism or the options cannot be used.
    """
    solver = Solver(design.mechanism)
    reach, law = solver.mobility, design.drive.law(solver.structure.driven_link)
    if reach and reach.slides and rpm is not None:
        raise ConfigurationError(
            f'--rpm is for a crank, but {source} drives a {reach.driven}: leave it out'
        )
    if reach is None:  # the motor determines the motion
        period, description = _settled(source, design, rpm, options)
    elif rpm is None and law is not None:
        period, description = _along_law(source, design, options)
    elif reach.turns_fully:
        period, description = _at_given_speed(source, design, rpm, options)
    else:
        period, description = _over_arc(source, design, rpm, options)
    mobility_class, *lines = description
    name, kind = name_of(source, design), design.mechanism_words
    classes = [kind if kind != name else '', design.mechanism.assembly, mobility_class]
    return period, [name, ', '.join(filter(None, classes)), *lines]


def _at_given_speed(
    source: str, design: Any, rpm: float | None, options: dict[str, Any]
) -> tuple[Period, list[str]]:
    """Computes a period at a given speed; describes it by Grashof class, speed and travel.

    Raises:
        ConfigurationError: No speed is given, options exclude each other, or the reactions have
            no finite value.
    """
    rpm, words = _rpm(design, rpm)
    if 'fluctuation' in options and words:
        raise ConfigurationError(
            f'{source} has no crank speed of its own: give a speed, such as --rpm 60'
        )
    acceleration = options.get('acceleration', 0.0)
    if 'fluctuation' in options and (acceleration or not rpm):
        raise ConfigurationError(
            f'--fluctuation is for a steady speed other than 0, not for {rpm:g} rpm and '
            f'{acceleration:g} rad/s^2: change --rpm or --acceleration, or leave it out'
        )
    period = speed_driven_period(
        design.mechanism, radians_per_second(rpm), acceleration, reactions='reactions' in options
    )
    speed = f'{rpm:g} rpm{words}' + (f', {acceleration:g} rad/s^2' if acceleration else '')
    return period, [period.solver.reach.grashof, speed, *travel(period.solver).words()]


def logged_period(mechanism: Mechanism, time: Array, rows: Array, torque: Array) -> Period:
    """Converts logged states to a motion over time.

    Args:
        mechanism: The mechanism.
        time: Increasing times from 0, s.
        rows: Positions, rates and accelerations of the links, rad and m, shape (3, links, n).
        torque: Driving torque, N m, or force, N.

    Returns:
        The motion. Its torque is the logged one.
    """
    solver = Solver(mechanism)
    position, velocity, acceleration = map(tuple, rows)
    state = State(position, velocity, acceleration, torque, links=solver.links)
    driven = solver.structure.driven
    rate = state.velocity[driven]
    return Period(
        solver, state.position[driven], state, _efforts(solver, state),
        speed=mean(time, np.abs(rate)), mean_power=mean(time, torque * rate), time=time,
    )  # fmt: skip


def _along_law(source: str, design: Any, options: dict[str, Any]) -> tuple[Period, list[str]]:
    """Computes the motion along a law, from its start to its end or over one of its periods.

    Raises:
        ConfigurationError: An option does not apply to a law.
    """
    _require_no(options, f'the law of {source} determines its speed')
    drive, solver = design.drive, Solver(design.mechanism)
    period = law_period(solver, drive, reactions='reactions' in options)
    return period, [_mobility_class(solver), drive.words(period.driven), *_ranges(period)]


def _rpm(design: Any, given: float | None) -> tuple[float, str]:
    """Returns the crank speed, rpm, and ' (assumed)' if neither user nor drive gives it."""
    rpm = getattr(design.drive, 'rpm', None) if given is None else given
    return (_SLOW_RPM, ' (assumed)') if rpm is None else (rpm, '')


def _over_arc(
    source: str, design: Any, rpm: float | None, options: dict[str, Any]
) -> tuple[Period, list[str]]:
    """Computes the motion of a limited crank over its arc, at a constant speed.

    Raises:
        ConfigurationError: An option does not apply.
    """
    _require_no(options, f'the crank of {source} cannot turn fully')
    solver = Solver(design.mechanism)
    if solver.reach.slides:
        speed, words = _SLOW, f'{_SLOW:g} m/s over its stroke (assumed)'
    else:
        rpm, assumed = _rpm(design, rpm)
        speed, words = radians_per_second(rpm), f'{rpm:g} rpm over its arc{assumed}'
    low, high = solver.reach.arc_around(design.drive.drawn_angle(design.mechanism))
    margin = _MARGIN * (high - low)  # the rates are infinite at the ends
    crank = np.linspace(low + margin, high - margin, 721)
    unloaded = without_loads(solver)
    crank = with_breaks(crank, solver, lambda angles: unloaded.state(angles, speed))
    period = _at_speed(solver, crank, speed, reactions='reactions' in options)
    return period, [_mobility_class(solver), words, *_ranges(period)]


def _mobility_class(solver: Solver) -> str:
    """Describes the class of a mechanism with one degree of freedom."""
    return f'driven {solver.reach.driven}' if solver.reach.slides else solver.reach.grashof


def _require_no(options: Mapping[str, Any], reason: str) -> None:
    """Refuses the options that only a steady turning speed can have.

    Raises:
        ConfigurationError: One of these options is given.
    """
    for option in ('acceleration', 'fluctuation'):
        if option in options:
            raise ConfigurationError(
                f'--{option} is for a crank that turns at a given speed, but {reason}: leave '
                f'--{option} out'
            )


def _ranges(period: Period) -> list[str]:
    """Describes the ranges of the driven link and of the output link."""
    words = []
    for name in (period.driven.name, period.solver.output):
        unit, values = period.motion(name, 'position')
        low, high = float(values.min()), float(values.max())
        if unit == 'rad':
            unit, low, high = 'deg', math.degrees(low), math.degrees(high)
        words.append(f'{name} {low:.4g} to {high:.4g} {unit}')
    return words


def law_period(solver: Solver, drive: Any, *, reactions: bool = False) -> Period:
    """Computes the motion along a law, from its start to its end or over a period of the run.

    Each repetition of the law has 720 steps of equal time, the points of the law, and both sides
    of each corner or jump of a load.

    Args:
        solver: Solver of a mechanism with one degree of freedom.
        drive: A drive with a law.
        reactions: Whether to add pin forces, shaking force and shaking moment.

    Returns:
        The motion over time.
    """
    law = drive.law(solver.structure.driven_link)
    time, motion = law_samples(solver, law)
    return _period(
        solver, motion, time, speed=_mean_speed(law), is_periodic=law.repeats, reactions=reactions,
        law=law,
    )  # fmt: skip


class Driven(NamedTuple):
    """Position, rate and acceleration of the driven joint; its position without jumps."""

    q: Array
    u: Any
    a: Any
    unwrapped: Array


def law_samples(
    solver: Solver, law: Any, steps: int = 720
) -> tuple[Array, Callable[[Array], Driven]]:
    """Returns times over a law or, if it repeats, over a period of the run; and the motion.

    Args:
        solver: Solver of a mechanism with one degree of freedom.
        law: The law.
        steps: Number of steps of equal time in each repetition of the law, to which the points of
            the law and both sides of each corner or jump of a load are added.

    Returns:
        The times in increasing order, s; and a function that computes the motion of the driven
        joint at times.
    """
    time, motion = _law_times(law, law_duration(solver, law), steps)
    frictionless = without_loads(solver) if solver.model.joint_loads else solver
    time = with_breaks(time, solver, lambda places: frictionless.state(*motion(places)[:3]))
    return time, motion


@functools.lru_cache(1)
def _law_times(law: Any, last: int, steps: int) -> tuple[Array, Callable[[Array], Driven]]:
    """Returns the times and the motion of `law_samples`, without the times of loads.

    Args:
        law: The law.
        last: End of the motion, a multiple of the law's duration, ns.
        steps: Number of steps of equal time in each repetition of the law.
    """
    resolution = float(np.spacing(float(last)))
    repetitions = last // law.duration
    count = steps * repetitions
    even = {last * n // count for n in range(count)}
    points = getattr(law, 'times', (0, law.duration))
    inner = {law.duration * i + time for i in range(repetitions) for time in points} - {0, last}
    # At a point, the acceleration may jump: take the time just before it as well. At the end, the
    # law may begin again.
    before = np.array([*inner, last]) - _BEFORE * resolution
    return np.sort([*even | inner, *before]) / 1e9, _law_motion(law, resolution)


def _law_motion(law: Any, resolution: float) -> Callable[[Array], Driven]:
    """Returns a function that computes the motion of the driven joint at times, s.

    Times that differ from a whole nanosecond only by rounding count as whole.

    Args:
        law: The law.
        resolution: Difference of the last time from the next float, ns.
    """

    def motion(seconds: Array) -> Driven:
        time = seconds * 1e9
        whole = np.rint(time)
        is_whole = np.abs(time - whole) < 0.5 * _BEFORE * resolution
        turns, angle, rate, acceleration = _moments(law, np.where(is_whole, whole, time))
        if law.slides:
            return Driven(angle, rate, acceleration, angle)
        reduced = without_turns(angle, 0.0, 2) + math.tau * (turns % 2)
        return Driven(reduced, rate, acceleration, angle + math.tau * turns)

    return motion


def _moments(law: Any, times: Array) -> Array:
    """Returns turns, angles, rates and accelerations of a law at times, ns, shape (4, n).

    Between whole nanoseconds, they are extrapolated from the two before.
    """
    whole = np.floor(times)
    moments = np.array([law.at(int(time)) for time in whole.tolist()]).T
    between = np.flatnonzero(times > whole)
    earlier = np.array([law.at(max(int(time) - 1, 0)) for time in whole[between].tolist()])
    growth = moments[:, between] - earlier.reshape(-1, 4).T
    growth[1] += math.tau * growth[0]  # a period may have ended
    growth[0] = 0.0
    moments[:, between] += (times - whole)[between] * growth
    return np.asarray(moments)


def _mean_speed(law: Any) -> float:
    """Computes the mean magnitude of the speed of a law, rad/s or m/s, from its reversals."""
    times = sorted({0, law.duration, *law.extremes(math.inf, -math.inf)})
    angles = [moment.turns * math.tau + moment.angle for moment in map(law.at, times)]
    distance = math.fsum(abs(after - before) for before, after in itertools.pairwise(angles))
    return distance / float(law.duration * 1e-9)


def speed_driven_period(
    mechanism: Mechanism, speed: float, acceleration: float = 0.0, *, reactions: bool = False
) -> Period:
    """Computes one period with the same crank speed and acceleration at every crank angle.

    The crank angles are 0.5 deg apart, closer together near change points, and on both sides of
    each corner or jump of a load.

    Args:
        mechanism: A mechanism whose crank turns fully.
        speed: Crank speed, rad/s.
        acceleration: Crank acceleration, rad/s^2.
        reactions: Whether to add pin forces, shaking force and shaking moment.

    Returns:
        The period.

    Raises:
        MechanismError: The crank does not turn fully.
        ConfigurationError: The speed or acceleration is not finite.
    """
    solver = Solver(mechanism)
    solver.reach.require_full_turn()
    crank = samples(solver, speed, acceleration=acceleration)
    return _at_speed(solver, crank, speed, acceleration, reactions=reactions)


def _at_speed(
    solver: Solver, crank: Array, speed: float, acceleration: float = 0.0, *, reactions: bool
) -> Period:
    """Computes the motion at crank angles, rad; see `speed_driven_period`."""

    def motion(places: Array) -> Driven:
        return Driven(places, speed, acceleration, places)

    return _period(
        solver, motion, crank, speed=speed, is_periodic=solver.reach.turns_fully,
        acceleration=acceleration, reactions=reactions,
    )  # fmt: skip


def _period(
    solver: Solver,
    motion: Callable[[Array], Driven],
    x: Array,
    *,
    speed: float,
    is_periodic: bool,
    reactions: bool,
    acceleration: float = 0.0,
    law: Any = None,
) -> Period:
    """Computes a period.

    Args:
        solver: Solver of a mechanism with one degree of freedom.
        motion: Function that computes the motion of the driven joint at places.
        x: Increasing places: crank angles, positions or times, rad, m or s.
        speed: Mean speed of the driven joint; see `Period`.
        is_periodic: Whether weights and inertia have zero mean power.
        reactions: Whether to add pin forces, shaking force and shaking moment.
        acceleration: Acceleration of the crank if it is constant, rad/s^2.
        law: The law of the driven joint, if the places are times.

    Returns:
        The period. Forces are infinite at change points and where friction locks.
    """
    at_x = motion(x)
    speeds = np.broadcast_to(at_x.u, len(x))
    in_line = at_change_points(solver, at_x.q, speeds)
    fastest = float(np.abs(speeds).max()) if law else 0.0

    def efforts_at(places: Array) -> dict[str, Column]:
        driven = motion(places)
        state = solver.state(driven.q, driven.u, driven.a)
        columns = _efforts(solver, state)
        if is_periodic:
            columns[_NET_POWER] = Column('W', _net_power(solver, state, driven.q, acceleration))
        return columns

    has_friction = bool(solver.model.joint_loads)
    efforts, has_no_effort = around_gaps(efforts_at, x, in_line & has_friction, fastest)
    power = efforts.pop(_NET_POWER, efforts['driving_power']).values
    frictionless = without_loads(solver) if has_friction else solver
    period = Period(
        solver, at_x.unwrapped, frictionless.state(at_x.q, at_x.u, at_x.a), efforts, speed=speed,
        mean_power=mean(x, power), time=x if law else None, turns=law.turns if law else None,
    )  # fmt: skip
    _add_ratios(period, frictionless.state(period.crank, 1.0))
    period.gaps |= dict.fromkeys(efforts, has_no_effort)
    if reactions:
        forces, has_no_force = joint_forces(solver, motion, x, in_line | has_no_effort, fastest)
        period.columns |= forces
        period.gaps |= dict.fromkeys(forces, has_no_force)
    return period


def _net_power(solver: Solver, state: State, position: Array, acceleration: float) -> Array:
    """Returns the power of the loads and of a constant acceleration of the crank, W.

    Its mean over a period is that of the driving power, because weights and inertia have zero
    mean power. Leaving them out avoids cancellation.
    """
    power: Array = np.zeros_like(state.torque)
    for name, force in solver.load_forces(state).items():
        power = power - force * state.velocity[solver.links.index(name)]
    if acceleration:
        ((inertia,),) = solver.matrix(position)
        power = power + state.velocity[0] * acceleration * inertia
    return power


def _add_ratios(period: Period, unit_rate: State) -> None:
    """Adds the leverages of springs, and the transmission ratios (Mottola 2017, after eq. 33).

    They are the rates of `unit_rate`, the motion for a driven joint at 1 rad/s or 1 m/s.
    """
    solver, driven_unit = period.solver, period.driven.units.position
    for name in period.springs:
        period.add(f'{name}.leverage', f'm/{driven_unit}', solver.spring(unit_rate, name).rate)
    for link, ratio in zip(solver.structure.links, unit_rate.velocity, strict=True):
        if link != period.driven:
            link_unit = link.units.position
            unit = '1' if link_unit == driven_unit else f'{link_unit}/{driven_unit}'
            period.add(f'{link.name}.transmission_ratio', unit, ratio)


def joint_forces(
    solver: Solver,
    motion: Callable[[Array], Sequence[Any]],
    x: Array,
    is_in_line: Any,
    speed: float,
) -> tuple[dict[str, Column], Any]:
    """Computes pin forces, guide forces, shaking force and shaking moment; see `around_gaps`.

    Args:
        solver: Solver of a mechanism with one degree of freedom.
        motion: Function that computes position, rate and acceleration of the driven joint.
        x: Increasing places.
        is_in_line: Whether each place is at a change point.
        speed: Largest crank speed if the places are times, rad/s; otherwise 0.
    """
    return around_gaps(lambda at: _reactions(solver, motion(at)), x, is_in_line, speed)


def _reactions(solver: Solver, motion: Sequence[Any]) -> dict[str, Column]:
    """Computes the columns of `joint_forces` from position and rates of the driven joint."""
    position, *rates = motion[:3]
    reactions, count = solver.reactions(solver.state(position, *rates)), len(position)
    columns = dict[str, Column]()
    for pin, force in reactions.pins.items():
        columns |= _columns(f'pin_{pin}', 'N', force, count)
    for slider, guide in reactions.guides.items():
        columns |= _columns(f'{slider}.guide_force', 'N', guide.force, count)
        columns |= _columns(f'{slider}.guide_moment', 'N m', guide.moment, count)
    columns |= _columns('shaking_force', 'N', reactions.shaking_force, count)
    return columns | _columns('shaking_moment', 'N m', reactions.shaking_moment, count)


def stepped(period: Period, step: float, *, reactions: bool = False) -> dict[str, Column]:
    """Computes a table with equal steps of the crank angle; angles are in degrees.

    Args:
        period: Motion at a constant crank speed and acceleration.
        step: Step of the crank angle, deg.
        reactions: Whether to add pin forces, shaking force and shaking moment.

    Returns:
        The columns of the period, and the coordinates of the pins, by name.

    Raises:
        ConfigurationError: The crank has no constant speed.
    """
    speed, acceleration = _constant_rates(period)
    first, last = period.marks[0], period.marks[-1]
    degrees = first + step * np.arange(math.floor((last - first) / step + 1e-9) + 1)
    crank = np.radians(degrees)
    table = _at_speed(period.solver, crank, speed, acceleration, reactions=reactions)
    columns = {'crank_angle': Column('deg', degrees)}
    for name, (unit, values) in table.with_gaps().items():
        if name == 'crank_angle':
            continue
        if unit == 'rad':  # continuous, although the steps may be large
            near = np.interp(crank, period.crank, period.columns[name].values)
            turns = np.round((near - values) / math.tau)
            columns[name] = Column('deg', np.degrees(values + math.tau * turns))
        else:
            columns[name] = Column(unit, values)
    places = period.drawing.place(table.rows('position'))  # shape (n, pins, 2)
    for i, pin in enumerate(period.drawing.pins):
        columns[f'{pin}.x'] = Column('m', places[:, i, 0])
        columns[f'{pin}.y'] = Column('m', places[:, i, 1])
    return {name: Column(unit, _twelve_digits(values)) for name, (unit, values) in columns.items()}


def _constant_rates(period: Period) -> tuple[float, float]:
    """Returns the constant speed, rad/s, and acceleration, rad/s^2, of the crank.

    Raises:
        ConfigurationError: The speed or the acceleration varies, or no crank is driven.
    """
    velocity = period.motion(period.driven.name, 'velocity').values
    acceleration = period.motion(period.driven.name, 'acceleration').values
    if period.across.unit != 'deg' or np.ptp(velocity) or np.ptp(acceleration):
        raise ConfigurationError(
            '--csv is for a crank at a given speed: leave it out, or give --rpm if the crank has '
            'a law'
        )
    return float(velocity[0]), float(acceleration[0])


def _twelve_digits(values: Array) -> Array:
    """Removes the digits with rounding errors, such as those of 59.99999999999999 deg."""
    return np.array([float(f'{value:.12g}') for value in values])


def _settled(
    source: str, design: Any, rpm: float | None, options: dict[str, Any]
) -> tuple[Period, list[str]]:
    """Computes the steady motion of a wind pump, and describes it in lines of text.

    Raises:
        ConfigurationError: The pump does not settle, or an option does not apply to it.
    """
    from linkage_lab.pump.analysis import settle  # SciPy takes a third of the time of a chart

    drive: Any = design.drive
    for option in options:
        raise ConfigurationError(
            f'--{option} is for a crank at a given speed, but the motor of {source} determines '
            f'its speed: leave --{option} out'
        )
    name, start_rpm = ('start_rpm', drive.start_rpm) if rpm is None else ('--rpm', rpm)
    if not start_rpm > 0:
        raise ConfigurationError(
            f'{name} = {start_rpm:g}: must be above 0 rpm, because a wind_pump is started '
            'forwards before its motor drives it; try --rpm 20'
        )
    speed, mechanism = radians_per_second(start_rpm), cast('WindPump', design.mechanism)
    settled = settle(mechanism, drive.motor, speed)
    low, high = settled.turning_points.min(), settled.turning_points.max()
    repeats = f', repeats after {settled.turns} turns' if settled.turns > 1 else ''
    return settled_period(settled), [
        '', str(drive.motor), f'from {speed:.4g} rad/s',
        f'settled at {settled.speed:.4g} rad/s{repeats}',
        f'stroke {settled.stroke:.4g} m ({low:.4g} to {high:.4g} m)',
        f'flow (stroke x speed) {settled.flow:.4g} m/s',
    ]  # fmt: skip


def settled_period(motion: 'PeriodicMotion') -> Period:
    """Samples one period of a wind pump's steady state in steps of at most 0.5 deg."""
    crank = np.linspace(0, 2 * math.pi * motion.turns, 720 * motion.turns + 1)
    crank = with_breaks(crank, motion.shooting.solver, motion.states)
    state = motion.states(crank)
    power = mean(crank, state.torque) * motion.speed
    solver = motion.shooting.solver
    efforts = _efforts(solver, state)
    return Period(solver, crank, state, efforts, speed=motion.speed, mean_power=power)


def mean(crank: Array, values: Array) -> float:
    """Computes the mean of values over a period, given their crank angles in increasing order.

    It is infinite if values are.
    """
    if not np.isfinite(values).all():
        return math.inf
    return float(integral(crank, values)[-1]) / float(crank[-1] - crank[0])


def extent(x: Array, values: Array) -> Extent:
    """Finds the extreme values of a quantity over a period, and its root mean square.

    Args:
        x: Crank angles or times in increasing order, rad or s.
        values: Values at these angles or times, between which they are interpolated.
    """
    return extents(x, values[None])[0]


def extents(x: Array, values: Array) -> list[Extent]:
    """Finds the extents of m quantities, shape (m, n); see `extent`."""
    finite = values if np.isfinite(values).all() else _without_infinite(values)
    curves = interpolated(x, finite)

    def with_opposites(places: Array) -> Array:
        rows = curves(places)
        return np.concatenate([rows, -rows])

    # The smallest value of a quantity is that of its opposite's largest one.
    largest, at = peaks(x, np.concatenate([finite, -finite]), with_opposites)
    (high, opposite_low), (high_at, low_at) = np.split(largest, 2), np.split(at, 2)
    found = list[Extent]()
    for i, row in enumerate(values):
        rms = math.sqrt(mean(x, row * row))
        of_finite = Extent(0.0 - opposite_low[i], low_at[i], high[i], high_at[i], rms)
        found.append(_with_infinite(of_finite, x, row))
    return found


def _without_infinite(values: Array) -> Array:
    """Replaces infinite values in rows by values between those at their sides."""
    at, rows = np.arange(values.shape[1]), np.isfinite(values)
    return np.array([
        np.interp(at, at[is_finite], row[is_finite])
        for row, is_finite in zip(values, rows, strict=True)
    ])  # fmt: skip


def _with_infinite(extent: Extent, x: Array, values: Array) -> Extent:
    """Returns an extent of finite values, extended to the infinite ones."""
    (lowest,), (highest,) = np.nonzero(values == -np.inf), np.nonzero(values == np.inf)
    if lowest.size:
        extent = extent._replace(low=values[lowest[0]], low_at=x[lowest[0]])
    if highest.size:
        extent = extent._replace(high=values[highest[0]], high_at=x[highest[0]])
    return extent
