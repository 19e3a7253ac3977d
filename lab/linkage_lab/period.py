# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Motion, torque and forces of a mechanism over one period, as named columns."""

import math
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np

from linkage_lab.output import progress
from linkage_lab.pump.analysis import settle
from linkage_lab.pump.shooting import PeriodicMotion
from linkage_lab.sampling import SAME, integral, samples, with_breaks
from linkage_ros import ConfigurationError, Mechanism, Solver, State, WindPump, travel
from linkage_ros.formulas import Array

_MOTION = ('position', ''), ('velocity', '/s'), ('acceleration', '/s^2')


class Column(NamedTuple):
    """A quantity over the period: its SI unit, and its values at the crank angles."""

    unit: str
    values: Array


class Extent(NamedTuple):
    """Smallest and largest value of a quantity over the period.

    Attributes:
        low: Smallest value.
        low_at: Crank angle of the smallest value, rad.
        high: Largest value.
        high_at: Crank angle of the largest value, rad.
        rms: Root mean square over the crank angle.
    """

    low: float
    low_at: float
    high: float
    high_at: float
    rms: float


class Period:
    """One period of a periodic motion.

    Attributes:
        solver: Solver of the mechanism.
        crank: Crank angles from 0 to the end of the period, in increasing order, rad.
        speed: Mean crank speed, rad/s.
        mean_power: Mean driving power over time, W.
        columns: Quantities by name, such as 'coupler.position'; angles are unwrapped.
    """

    def __init__(
        self, solver: Solver, crank: Array, state: State, *, speed: float, mean_power: float
    ) -> None:
        """Converts the states at all crank angles to columns."""
        self.solver = solver
        self.crank, self.speed, self.mean_power = crank, speed, mean_power
        self.columns: dict[str, Column] = {}
        links = dict(zip(solver.links, solver.structure.links, strict=True))
        self.add('crank_angle', 'rad', crank)
        for i, link in enumerate(links.values()):
            for (name, per), rows in zip(_MOTION, state, strict=False):
                is_angle = name == 'position' and not link.slides
                values = np.unwrap(rows[i]) if is_angle else rows[i]
                self.add(f'{link.name}.{name}', ('m' if link.slides else 'rad') + per, values)
        self.add('driving_torque', 'N m', state.torque)
        self.add('driving_power', 'W', state.torque * state.velocity[0])
        for name, force in solver.load_forces(state).items():
            self.add(f'{name}.load', 'N' if links[name].slides else 'N m', force)
        if 'C' in solver.structure.points:
            for (name, per), vector in zip(_MOTION, solver.point(state, 'C'), strict=True):
                self.add(f'coupler_point.{name}', 'm' + per, vector)

    @property
    def time(self) -> Array:
        """Time from crank angle 0 to each crank angle, in either direction, s."""
        speed = np.abs(self.columns['crank.velocity'].values)
        steps = 2 * np.diff(self.crank) / (speed[1:] + speed[:-1])
        return np.concatenate([[0.0], np.cumsum(steps)])

    def add(self, name: str, unit: str, values: Any) -> None:
        """Adds a column, or one for each component of a vector."""
        if isinstance(values, tuple):
            for axis, component in zip('xy', values, strict=True):
                self.add(f'{name}.{axis}', unit, component)
        else:
            self.columns[name] = Column(unit, np.broadcast_to(values, self.crank.shape))


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
    name, kind = Path(source).stem, design.kind.mechanism
    # If the crank angle does not determine the motion, the motor does.
    is_pump = Solver(design.mechanism).mobility is None
    compute = _settled if is_pump else _at_given_speed
    period, (group, *lines) = compute(source, design, rpm, options)
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
    rpm = getattr(design.drive, 'rpm', None) if rpm is None else rpm
    if rpm is None:
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
    speed = f'{rpm:g} rpm' + (f', {acceleration:g} rad/s^2' if acceleration else '')
    return period, [period.solver.reach.grashof, speed, *travel(period.solver).words()]


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
        ConfigurationError: The speed or acceleration is not finite, or the requested reactions
            are infinite at a change point.
    """
    solver = Solver(mechanism)
    solver.reach.require_full_turn()
    crank = samples(solver)
    state = solver.state(crank, speed, acceleration)
    ((inertia,),) = solver.matrix(crank)
    # At a constant speed, weights and inertia have zero mean power. Summing only the power of the
    # loads and of the crank's acceleration avoids cancellation.
    power = np.zeros_like(crank) + state.velocity[0] * acceleration * inertia
    for name, force in solver.load_forces(state).items():
        power = power - force * state.velocity[solver.links.index(name)]
    period = Period(solver, crank, state, speed=speed, mean_power=mean(crank, power))
    ratios = solver.state(crank, 1.0).velocity  # document 2, after eq. 33
    for link, ratio in zip(solver.structure.links[1:], ratios[1:], strict=True):
        period.add(f'{link.name}.transmission_ratio', 'm/rad' if link.slides else '1', ratio)
    if reactions:
        _add_reactions(period, state)
    return period


def _add_reactions(period: Period, state: State) -> None:
    """Adds pin forces, shaking force and shaking moment to a period.

    Raises:
        ConfigurationError: They are infinite at a change point.
    """
    if period.solver.reach.has_change_point:
        raise ConfigurationError(
            'this mechanism passes a change point, where the forces in its joints are '
            'infinite: leave --reactions out'
        )
    found = period.solver.reactions(state)
    for pin, force in found.pins.items():
        period.add(f'pin_{pin}', 'N', force)
    if found.guide_force is not None:
        period.add('guide_force', 'N', found.guide_force)
    period.add('shaking_force', 'N', found.shaking_force)
    period.add('shaking_moment', 'N m', found.shaking_moment)


def _settled(
    source: str, design: Any, rpm: float | None, options: dict[str, Any]
) -> tuple[Period, list[str]]:
    """Computes the steady motion of a wind pump, and describes it in lines of text.

    Raises:
        ConfigurationError: The pump does not settle, or an option does not apply to it.
    """
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


def settled_period(motion: PeriodicMotion) -> Period:
    """Samples one period of a wind pump's steady state in steps of at most 0.5 deg."""
    crank = np.linspace(0, 2 * math.pi * motion.turns, 720 * motion.turns + 1)
    crank = with_breaks(crank, motion.shooting.solver, motion.states)
    state = motion.states(crank)
    power = mean(crank, state.torque) * motion.speed
    return Period(motion.shooting.solver, crank, state, speed=motion.speed, mean_power=power)


def mean(crank: Array, values: Array) -> float:
    """Computes the mean of values over a period, given their crank angles in increasing order."""
    return float(integral(crank, values)[-1]) / float(crank[-1] - crank[0])


def extent(crank: Array, values: Array) -> Extent:
    """Finds the extreme values of a quantity over a period, and its root mean square.

    Args:
        crank: Crank angles of the whole period in increasing order, rad.
        values: Values at these angles.

    Returns:
        The extent. A peak between two samples is interpolated by a parabola through the three
        nearest values.
    """
    low, low_at = _peak(crank, -values)
    high, high_at = _peak(crank, values)
    return Extent(-low, low_at, high, high_at, math.sqrt(mean(crank, values * values)))


def _peak(crank: Array, values: Array) -> tuple[float, float]:
    """Finds the largest value and its crank angle."""
    top = int(np.argmax(values))
    if top in (0, len(values) - 1):  # the end of the period coincides with its start
        return float(values[top]), 0.0
    slopes = np.diff(values) / np.diff(crank)
    bends = np.diff(slopes) / (crank[2:] - crank[:-2])  # at all samples but the first and last
    bend, around = bends[top - 1], bends[max(0, top - 2) : top + 1]
    # No parabola is fitted at a corner of a load.
    steps = np.diff(crank[top - 1 : top + 2])
    if not (
        steps.min() > SAME and bend < 0 and np.all((2 * bend < around) & (around < 0.5 * bend))
    ):
        return float(values[top]), float(crank[top])
    slope = slopes[top - 1] + bend * (crank[top] - crank[top - 1])
    aside = -0.5 * slope / bend
    return float(values[top] + 0.5 * slope * aside), float(crank[top] + aside)
