# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Motion, torque and forces of a mechanism over one period, as named columns."""

import math
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import trapezoid

from linkage_ros import ConfigurationError, Solver, State
from linkage_ros.model.structure import Mechanism
from linkage_ros.numeric import Array

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
        self._add('crank_angle', 'rad', crank)
        for i, link in enumerate(links.values()):
            for (name, per), rows in zip(_MOTION, state, strict=False):
                values = np.broadcast_to(rows[i], crank.shape)
                if name == 'position' and not link.slides:
                    values = np.unwrap(values)
                self._add(f'{link.name}.{name}', ('m' if link.slides else 'rad') + per, values)
        self._add('driving_torque', 'N m', state.torque)
        self._add('driving_power', 'W', state.torque * state.velocity[0])
        for name, force in solver.load_forces(state).items():
            self._add(f'{name}.load', 'N' if links[name].slides else 'N m', force)
        if 'C' in solver.structure.points:
            for (name, per), vector in zip(_MOTION, solver.point(state, 'C'), strict=True):
                self._add(f'coupler_point.{name}', 'm' + per, vector)

    def _add(self, name: str, unit: str, values: Any) -> None:
        """Adds a column, or one for each component of a vector."""
        if isinstance(values, tuple):
            for axis, component in zip('xy', values, strict=True):
                self._add(f'{name}.{axis}', unit, component)
        else:
            self.columns[name] = Column(unit, np.broadcast_to(values, self.crank.shape))


class SpeedDrivenPeriod(Period):
    """One period with the same crank speed and acceleration at every crank angle.

    The crank angles are 0.5 deg apart, and closer together near change points.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        speed: float,
        acceleration: float = 0.0,
        *,
        reactions: bool = False,
    ) -> None:
        """Computes the states and, on request, the reactions.

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
        ((inertia,),) = solver.matrix(crank)
        # At a constant speed, weights and inertia have zero mean power. Summing only the power of
        # the loads and of the crank's acceleration avoids cancellation.
        power = np.zeros_like(crank) + state.velocity[0] * acceleration * inertia
        for name, force in solver.load_forces(state).items():
            power = power - force * state.velocity[solver.links.index(name)]
        super().__init__(solver, crank, state, speed=speed, mean_power=mean(crank, power))
        ratios = solver.state(crank, 1.0).velocity  # document 2, after eq. 33
        for link, ratio in zip(solver.structure.links[1:], ratios[1:], strict=True):
            unit = 'm/rad' if link.slides else '1'
            self._add(f'{link.name}.transmission_ratio', unit, ratio)
        if reactions:
            self._add_reactions(state)

    def _add_reactions(self, state: State) -> None:
        if self.solver.reach.has_change_point:
            raise ConfigurationError(
                'this mechanism passes a change point, where the forces in its joints are '
                'infinite: leave --reactions out'
            )
        found = self.solver.reactions(state)
        for pin, force in found.pins.items():
            self._add(f'pin_{pin}', 'N', force)
        if found.guide_force is not None:
            self._add('guide_force', 'N', found.guide_force)
        self._add('shaking_force', 'N', found.shaking_force)
        self._add('shaking_moment', 'N m', found.shaking_moment)


def mean(crank: Array, values: Array) -> float:
    """Computes the mean of values over a period, given their crank angles in increasing order."""
    return float(trapezoid(values, crank)) / float(crank[-1] - crank[0])


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
    # No parabola is fitted at a corner of a load curve.
    if not (bend < 0 and np.all((2 * bend < around) & (around < 0.5 * bend))):
        return float(values[top]), float(crank[top])
    slope = slopes[top - 1] + bend * (crank[top] - crank[top - 1])
    aside = -0.5 * slope / bend
    return float(values[top] + 0.5 * slope * aside), float(crank[top] + aside)
