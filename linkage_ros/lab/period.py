# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The motion of a mechanism over one period, as columns of numbers."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from linkage_ros.dynamics.solver import Solver
from linkage_ros.dynamics.state import State
from linkage_ros.errors import ConfigurationError
from linkage_ros.model.structure import Mechanism
from linkage_ros.numeric import Array


class Column(NamedTuple):
    """One quantity over the period.

    Attributes:
        name: Name, such as 'coupler.position'.
        unit: SI unit.
        values: Values at the crank angles.
    """

    name: str
    unit: str
    values: Array


class Extent(NamedTuple):
    """Smallest, largest and mean values of a quantity over the period.

    Attributes:
        low: Smallest value.
        low_at: Crank angle of the smallest value, rad.
        high: Largest value.
        high_at: Crank angle of the largest value, rad.
        mean: Mean over the crank angle.
        rms: Root mean square over the crank angle.
    """

    low: float
    low_at: float
    high: float
    high_at: float
    mean: float
    rms: float


class Period:
    """One period of a periodic motion.

    Attributes:
        solver: Solver of the mechanism.
        crank: Crank angles from 0 to the end of the period, rising, rad.
        speed: Mean crank speed, rad/s.
        mean_power: Mean driving power over time, W.
        columns: All quantities, by name; angles without jumps.
    """

    def __init__(
        self, solver: Solver, crank: Array, state: State, *, speed: float, mean_power: float
    ) -> None:
        """Stores the motion.

        Args:
            solver: Solver of the mechanism that moves.
            crank: Crank angles, rad.
            state: State at the crank angles.
            speed: Mean crank speed, rad/s.
            mean_power: Mean driving power over time, W.
        """
        self.solver = solver
        self.crank, self.speed, self.mean_power = crank, speed, mean_power
        columns = [
            Column('crank_angle', 'rad', crank),
            *self._links(state),
            Column('driving_torque', 'N m', state.torque),
            Column('driving_power', 'W', state.torque * state.velocity[0]),
            *self._loads(state),
        ]
        if 'C' in solver.structure.points:
            columns += self._coupler_point(state)
        self.columns: dict[str, Column] = {column.name: column for column in columns}

    def _links(self, state: State) -> list[Column]:
        columns = []
        for i, link in enumerate(self.solver.structure.links):
            unit = 'm' if link.slides else 'rad'
            position, velocity, acceleration = (
                np.broadcast_to(x[i], self.crank.shape) for x in state[:3]
            )
            columns += [
                Column(f'{link.name}.position', unit,
                       position if link.slides else np.unwrap(position)),
                Column(f'{link.name}.velocity', f'{unit}/s', velocity),
                Column(f'{link.name}.acceleration', f'{unit}/s^2', acceleration),
            ]  # fmt: skip
        return columns

    def _loads(self, state: State) -> list[Column]:
        units = {link.name: 'N' if link.slides else 'N m' for link in self.solver.structure.links}
        return [
            Column(f'{link}.load', units[link], np.broadcast_to(force, self.crank.shape))
            for link, force in self.solver.load_forces(state).items()
        ]

    def _coupler_point(self, state: State) -> list[Column]:
        motion = self.solver.point(state, 'C')
        units = ('position', 'm'), ('velocity', 'm/s'), ('acceleration', 'm/s^2')
        return [
            Column(f'coupler_point.{name}.{axis}', unit, values)
            for (name, unit), vector in zip(units, motion, strict=True)
            for axis, values in zip('xy', vector, strict=True)
        ]


class SpeedDrivenPeriod(Period):
    """One period of a mechanism, with the same speed and acceleration at every angle.

    The crank angles are 0.5 deg apart, and closer next to change points.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        speed: float,
        acceleration: float = 0.0,
        *,
        reactions: bool = False,
    ) -> None:
        """Solves the period.

        Args:
            mechanism: A mechanism whose crank turns fully.
            speed: Crank speed, rad/s.
            acceleration: Crank acceleration, rad/s^2.
            reactions: Whether to add pin forces, shaking force and shaking moment.

        Raises:
            MechanismError: The crank does not turn fully.
            ConfigurationError: The speed or acceleration is not finite, or the requested
                reactions are infinite at a change point.
        """
        solver = Solver(mechanism)
        solver.reach.require_full_turn()
        crank = solver.reach.samples()
        state = solver.state(crank, speed, acceleration)
        power = _mean_power(solver, crank, state, acceleration)
        super().__init__(solver, crank, state, speed=speed, mean_power=power)
        self.columns.update({column.name: column for column in self._ratios()})
        if reactions:
            self.columns.update({column.name: column for column in self._reactions(state)})

    def _ratios(self) -> list[Column]:
        """The rate of each link per rate of the crank (document 2, after eq. 33)."""
        _, *links = zip(
            self.solver.structure.links, self.solver.state(self.crank, 1.0).velocity, strict=True
        )
        return [
            Column(f'{link.name}.transmission_ratio', 'm/rad' if link.slides else '1', ratio)
            for link, ratio in links
        ]

    def _reactions(self, state: State) -> list[Column]:
        if self.solver.reach.has_change_point:
            raise ConfigurationError(
                'this mechanism passes a change point, where the forces in its joints have no '
                'finite value: leave the reactions out'
            )
        reactions = self.solver.reactions(state)
        columns = [
            Column(f'pin_{pin}.{axis}', 'N', values)
            for pin, force in reactions.pins.items()
            for axis, values in zip('xy', force, strict=True)
        ]
        if reactions.guide_force is not None:
            columns.append(Column('guide_force', 'N', reactions.guide_force))
        columns += [
            Column(f'shaking_force.{axis}', 'N', values)
            for axis, values in zip('xy', reactions.shaking_force, strict=True)
        ]
        return [*columns, Column('shaking_moment', 'N m', reactions.shaking_moment)]


def _mean_power(solver: Solver, crank: Array, state: State, acceleration: float) -> float:
    """Mean driving power over the crank angle, W.

    At a constant speed, weights and inertia have a mean power of 0. Only the power of the loads
    and of the crank's acceleration remain, which are summed without cancellation.
    """
    ((inertia,),) = solver.matrix(crank)
    power = state.velocity[0] * acceleration * inertia
    for link, force in solver.load_forces(state).items():
        power = power - force * state.velocity[solver.links.index(link)]
    return mean(crank, np.broadcast_to(power, crank.shape))


def extent(crank: Array, values: Array) -> Extent:
    """Finds smallest, largest and mean values of a quantity over the period.

    Args:
        crank: Crank angles in rising order, over the whole period, rad.
        values: Values at these.

    Returns:
        The extent; peaks between the angles by the parabola through the three nearest values.
    """
    low, low_at = _peak(crank, -values)
    high, high_at = _peak(crank, values)
    rms = math.sqrt(mean(crank, values * values))
    return Extent(-low, low_at, high, high_at, mean(crank, values), rms)


def mean(crank: Array, values: Array) -> float:
    """The mean of a quantity over the crank angle.

    Args:
        crank: Crank angles in rising order, over the whole period, rad.
        values: Values at these.

    Returns:
        The mean, by the trapezoidal rule.
    """
    integral = float(np.sum(np.diff(crank) * (values[1:] + values[:-1])) / 2)
    return integral / float(crank[-1] - crank[0])


def _peak(crank: Array, values: Array) -> tuple[float, float]:
    top = int(np.argmax(values))
    # The end of the period coincides with its start.
    if top in (0, len(values) - 1):
        return float(values[top]), 0.0
    slope, bend = _parabola(crank, values, top)
    around = [_parabola(crank, values, i)[1] for i in (top - 1, top + 1) if 0 < i < len(crank) - 1]
    # No parabola is fitted at a corner of a load curve.
    if not bend < 0 or any(not 2 * bend < other < 0.5 * bend for other in around):
        return float(values[top]), float(crank[top])
    aside = -0.5 * slope / bend
    return float(values[top] - 0.25 * slope * slope / bend), float(crank[top] + aside)


def _parabola(crank: Array, values: Array, i: int) -> tuple[float, float]:
    """Slope and curvature, at a sample, of the parabola through it and its neighbours."""
    x, y = crank[i - 1 : i + 2] - crank[i], values[i - 1 : i + 2] - values[i]
    left, right = y[0] / x[0], y[2] / x[2]
    bend = (right - left) / (x[2] - x[0])
    return left - bend * x[0], bend
