# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Motion, torque and forces of a mechanism over one period, as named columns."""

import functools
import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np

from linkage_lab.gaps import Column, around_gaps, at_change_points
from linkage_lab.output import name_of, progress
from linkage_lab.sampling import (
    integral,
    interpolated,
    law_duration,
    peaks,
    samples,
    with_breaks,
    without_loads,
)
from linkage_ros import (
    ConfigurationError,
    Mechanism,
    Solver,
    Spring,
    State,
    Travel,
    WindPump,
    travel,
)
from linkage_ros.formulas import Array
from linkage_ros.internals import Drawing, without_turns
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


OVER_CRANK = Across('Crank angle', 'deg', 180 / math.pi)
OVER_TIME = Across('Time', 's', 1.0)


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
        over = OVER_CRANK
        if self.driven.slides:
            over = Across(f'Position of the {self.driven.driven_word}', 'm', 1.0)
        self.x, self.across = (crank, over) if time is None else (time, OVER_TIME)
        self.colors = colors_of(solver.links)
        self.columns: dict[str, Column] = {}
        self.gaps: dict[str, Array] = {}
        links = dict(zip(solver.links, solver.structure.links, strict=True))
        if time is not None:
            self.add('time', 's', time)
        if not self.driven.slides:
            self.add('crank_angle', 'rad', crank)
        for i, link in enumerate(links.values()):
            names = SLIDING if link.slides else TURNING
            for (name, unit), rows in zip(names, state, strict=False):
                values = np.unwrap(rows[i]) if name == 'direction' else rows[i]
                self.add(f'{link.name}.{name}', unit, values)
        self.columns |= efforts
        for point in solver.structure.traced:
            for (name, unit), vector in zip(SLIDING, solver.point(state, point), strict=True):
                self.add(f'{point}.{name}', unit, vector)
        for name in self.springs:
            spring = solver.spring(state, name)
            self.add(f'{name}.length', 'm', spring.length)
            self.add(f'{name}.length_rate', 'm/s', spring.rate)
            self.add(f'{name}.tension', 'N', spring.tension)

    @property
    def springs(self) -> list[str]:
        """Names of the loads of kind spring."""
        return [load.name for load in self.solver.mechanism.loads if isinstance(load, Spring)]

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
    def drawing(self) -> Drawing:
        """Drawing of the mechanism, on the arc of the first crank angle."""
        return Drawing(self.solver.mechanism, float(self.crank[0]))

    def with_gaps(self) -> dict[str, Column]:
        """Returns the columns, with NaN where they have no value."""
        return {
            name: Column(unit, np.where(self.gaps[name], np.nan, values))
            if name in self.gaps else Column(unit, values)
            for name, (unit, values) in self.columns.items()
        }  # fmt: skip

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
        word, _ = (SLIDING if slides else TURNING)[State._fields.index(quantity)]
        return f'{link}.{word}'

    @property
    def crank_angles(self) -> Array:
        """The crank angles, unwrapped, rad."""
        return self.motion(self.solver.links[0], 'position').values

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
        (at,) = np.nonzero(is_gap)
        if not at.size:
            return ''
        runs = np.split(at, np.flatnonzero(np.diff(at) > 1) + 1)
        ends = [[f'{math.degrees(x):.6g}' for x in self.crank[run[[0, -1]]]] for run in runs]
        places = ', '.join(dict.fromkeys(' to '.join(dict.fromkeys(pair)) for pair in ends))
        return f'no forces at {places} deg, where links are in line or friction locks them'

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
        return self.across is OVER_CRANK and (reach is None or reach.turns_fully)

    def add(self, name: str, unit: str, values: Any) -> None:
        """Adds a column, or one for each component of a vector."""
        self.columns |= _columns(name, unit, values, len(self.crank))


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

    The forces of loads are those of `Solver.exerted`. A force that is the opposite of an earlier
    one on another link, such as the second of a spring, is left out.
    """
    exerted, driven = solver.exerted(state), solver.structure.driven
    links = dict(zip(solver.links, solver.structure.links, strict=True))
    link, count = solver.structure.driven_link, len(state.position[driven])
    found = _columns(_effort(link), link.units.effort, state.torque, count)
    found |= _columns('driving_power', 'W', state.torque * state.velocity[driven], count)
    shown = dict[str, list[Any]]()
    for new in exerted.forces.values():
        before = shown.setdefault(new.load, [])
        if not any(_are_opposite(new, old) for old in before):
            before.append(new)
            number = f'.{len(before)}' * (len(before) > 1)
            found |= _columns(f'{new.load}{number}.force', 'N', new.force, count)
    for name, effort in exerted.efforts.items():
        found |= _columns(f'{name}.load', 'N' if links[name].slides else 'N m', effort, count)
    return found


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
    name, kind = name_of(source, design), design.mechanism_words
    # If the crank angle does not determine the motion, the motor does.
    solver = Solver(design.mechanism)
    reach, law = solver.mobility, design.drive.law(solver.structure.driven_link)
    if reach and reach.slides and rpm is not None:
        raise ConfigurationError(
            f'--rpm is for a crank, but {source} drives a {reach.driven}: leave it out'
        )
    if reach is None:
        found = _settled(source, design, rpm, options)
    elif rpm is None and law is not None:
        found = _along_law(source, design, options)
    elif reach.turns_fully:
        found = _at_given_speed(source, design, rpm, options)
    else:
        found = _over_arc(source, design, rpm, options)
    period, (group, *lines) = found
    about = [kind if kind != name else '', design.mechanism.assembly, group]
    return period, [name, ', '.join(filter(None, about)), *lines]


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
        design.mechanism, rpm * math.pi / 30, acceleration, reactions='reactions' in options
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
    return period, [_group(solver), drive.words(period.driven), *_ranges(period)]


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
    (rpm, assumed), solver = _rpm(design, rpm), Solver(design.mechanism)
    low, high = solver.reach.arc_around(design.drive.drawn_angle(design.mechanism))
    margin = _MARGIN * (high - low)  # the rates are infinite at the ends
    speed, words = rpm * math.pi / 30, f'{rpm:g} rpm over its arc{assumed}'
    if solver.reach.slides:
        speed, words = _SLOW, f'{_SLOW:g} m/s over its stroke (assumed)'
    crank, moving = np.linspace(low + margin, high - margin, 721), without_loads(solver)
    crank = with_breaks(crank, solver, lambda angles: moving.state(angles, speed))
    period = _at_speed(solver, crank, speed, reactions='reactions' in options)
    return period, [_group(solver), words, *_ranges(period)]


def _group(solver: Solver) -> str:
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
        time=time, turns=law.turns,
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
    moving = without_loads(solver) if solver.model.joint_loads else solver
    return with_breaks(time, solver, lambda places: moving.state(*motion(places)[:3])), motion


@functools.lru_cache(1)
def _law_times(law: Any, last: int, steps: int) -> tuple[Array, Callable[[Array], Driven]]:
    """Returns the times of `law_samples` up to a time, ns, without those of loads."""
    each, moments = law.duration, law.curve()
    rounds, digit = last // each, np.spacing(float(last))
    even = {last * n // (steps * rounds) for n in range(steps * rounds)}
    inner = {
        each * i + time for i in range(rounds) for time in getattr(law, 'times', (0, each))
    } - {0, last}
    # At a point, the acceleration may jump: take the time just before it as well. At the end, the
    # law may begin again.
    before = np.array([*inner, last]) - _BEFORE * digit
    found = np.sort([*even | inner, *before]) / 1e9

    def motion(places: Array) -> Driven:
        time = places * 1e9
        whole = np.rint(time)
        is_whole = np.abs(time - whole) < 0.5 * _BEFORE * digit
        turns, angle, rate, acceleration = moments(np.where(is_whole, whole, time))
        if law.slides:
            return Driven(angle, rate, acceleration, angle)
        reduced = without_turns(angle, 0.0, 2) + math.tau * (turns % 2)
        return Driven(reduced, rate, acceleration, angle + math.tau * turns)

    return found, motion


def _mean_speed(law: Any) -> float:
    """Computes the mean magnitude of the speed of a law, rad/s or m/s, from its reversals."""
    times = sorted({0, law.duration, *law.extremes(math.inf, -math.inf)})
    angles = [moment.turns * math.tau + moment.angle for moment in map(law.at, times)]
    way = math.fsum(abs(after - before) for before, after in itertools.pairwise(angles))
    return way / float(law.duration * 1e-9)


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
    **options: Any,
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
        **options: Options of `Period`.

    Returns:
        The period. Forces are infinite at change points and where friction locks.
    """
    q, u, a, crank = motion(x)
    has_friction = bool(solver.model.joint_loads)
    moving = without_loads(solver) if has_friction else solver
    state = moving.state(q, u, a)
    rates = np.broadcast_to(u, len(x))
    in_line = at_change_points(solver, q, rates)
    fastest = float(np.abs(rates).max()) if 'time' in options else 0.0

    def efforts(places: Array) -> dict[str, Column]:
        now = motion(places)
        found = solver.state(*now[:3])
        columns = _efforts(solver, found)
        if is_periodic:
            # Summing only the power of the loads and of the crank's acceleration avoids
            # cancellation.
            power = _load_power(solver, found)
            if acceleration:
                ((inertia,),) = solver.matrix(now.q)
                power = power + found.velocity[0] * acceleration * inertia
            columns['power'] = Column('W', power)
        return columns

    needed, is_gap = around_gaps(efforts, x, in_line & has_friction, fastest)
    power = needed.pop('power', needed['driving_power']).values
    period = Period(
        solver, crank, state, needed, speed=speed, mean_power=mean(x, power), **options
    )
    unit_rate = moving.state(period.crank, 1.0)
    for name in period.springs:
        unit = 'm' if period.driven.slides else 'rad'
        leverage = solver.spring(unit_rate, name).rate
        period.add(f'{name}.leverage', f'm/{unit}', leverage)
    ratios = unit_rate.velocity  # Mottola 2017, after eq. 33
    for link, ratio in zip(solver.structure.links, ratios, strict=True):
        if link != period.driven:
            units = link.units.position, period.driven.units.position
            unit = '1' if units[0] == units[1] else '/'.join(units)
            period.add(f'{link.name}.transmission_ratio', unit, ratio)
    period.gaps |= dict.fromkeys(needed, is_gap)
    if reactions:
        found, is_gap = joint_forces(solver, motion, x, in_line | is_gap, fastest)
        period.columns |= found
        period.gaps |= dict.fromkeys(found, is_gap)
    return period


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
    q, *rates = motion[:3]
    found, columns = solver.reactions(solver.state(q, *rates)), dict[str, Column]()
    for pin, force in found.pins.items():
        columns |= _columns(f'pin_{pin}', 'N', force, len(q))
    for slider, (across, moment) in found.guides.items():
        columns |= _columns(f'{slider}.guide_force', 'N', across, len(q))
        columns |= _columns(f'{slider}.guide_moment', 'N m', moment, len(q))
    columns |= _columns('shaking_force', 'N', found.shaking_force, len(q))
    return columns | _columns('shaking_moment', 'N m', found.shaking_moment, len(q))


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
    driven = period.driven.name
    given = [period.motion(driven, name).values for name in ('velocity', 'acceleration')]
    if period.across is not OVER_CRANK or any(np.ptp(values) for values in given):
        raise ConfigurationError(
            '--csv is for a crank at a given speed: leave it out, or give --rpm if the crank has '
            'a law'
        )
    speed, acceleration = (float(values[0]) for values in given)
    first, last = period.marks[0], period.marks[-1]
    degrees = first + step * np.arange(math.floor((last - first) / step + 1e-9) + 1)
    crank, solver = np.radians(degrees), period.solver
    table = _at_speed(solver, crank, speed, acceleration, reactions=reactions)
    columns = {'crank_angle': Column('deg', degrees)}
    for name, (unit, values) in table.with_gaps().items():
        if name == 'crank_angle':
            continue
        if unit == 'rad':  # continuous, although the steps may be large
            near = np.interp(crank, period.crank, period.columns[name].values)
            turns = np.round((near - values) / math.tau)
            unit, values = 'deg', np.degrees(values + math.tau * turns)
        columns[name] = Column(unit, values)
    places = period.drawing.place(table.rows('position'))
    for pin, place in zip(period.drawing.pins, np.moveaxis(places, 1, 0), strict=True):
        columns |= {f'{pin}.{x}': Column('m', place[:, i]) for i, x in enumerate('xy')}
    # Without the digits that hold rounding errors, such as those of 59.99999999999999 deg.
    return {
        name: Column(unit, np.array([float(f'{x:.12g}') for x in values]))
        for name, (unit, values) in columns.items()
    }


def _load_power(solver: Solver, state: State) -> Array:
    """Returns the power that drives the loads, W.

    Over a period of a motion that repeats, weights and inertia have zero mean power.
    """
    power: Array = np.zeros_like(state.torque)
    for name, force in solver.load_forces(state).items():
        power = power - force * state.velocity[solver.links.index(name)]
    return power


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
    name, given = ('start_rpm', drive.start_rpm) if rpm is None else ('--rpm', rpm)
    if not given > 0:
        raise ConfigurationError(
            f'{name} = {given:g}: must be above 0 rpm, because a wind_pump is started '
            'forwards before its motor drives it; try --rpm 20'
        )
    speed, mechanism = given * math.pi / 30, cast('WindPump', design.mechanism)
    settled = settle(mechanism, drive.motor.torque, drive.motor.damping, speed, progress)
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


def extent(x: Array, values: Array, curve: Callable[[Array], Array] | None = None) -> Extent:
    """Finds the extreme values of a quantity over a period, and its root mean square.

    Args:
        x: Crank angles or times in increasing order, rad or s.
        values: Values at these angles or times.
        curve: The quantity as a function of them; None to interpolate the values.

    Returns:
        The extent; see `peaks`.
    """
    return extents(x, values[None], curve and (lambda places: curve(places)[None]))[0]


def extents(
    x: Array, values: Array, curves: Callable[[Array], Array] | None = None
) -> list[Extent]:
    """Finds the extents of m quantities, of shapes (m, n) and (m, k); see `extent`.

    If any value is infinite, values are interpolated and `curves` is not used.
    """
    count, finite = len(values), _without_infinite(values)
    if finite is not values or not curves:
        curves = interpolated(x, finite)
    both = np.concatenate([finite, -finite])
    found, at = peaks(x, both, lambda places: np.concatenate([(y := curves(places)), -y]))
    for i, sign in itertools.product(range(count), (1, -1)):
        (infinite,) = np.nonzero(values[i] == sign * np.inf)
        if infinite.size:
            row = i if sign > 0 else i + count
            found[row], at[row] = np.inf, x[infinite[0]]
    rms = [math.sqrt(mean(x, row * row)) for row in values]
    return [
        Extent(0.0 - found[i + count], at[i + count], found[i], at[i], rms[i])
        for i in range(count)
    ]


def _without_infinite(values: Array) -> Array:
    """Replaces infinite values in rows by values between those at their sides."""
    if np.isfinite(values).all():
        return values
    at, rows = np.arange(values.shape[1]), np.isfinite(values)
    return np.array([
        np.interp(at, at[is_finite], row[is_finite])
        for row, is_finite in zip(values, rows, strict=True)
    ])  # fmt: skip
