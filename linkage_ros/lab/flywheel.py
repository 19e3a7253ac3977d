# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_chart motion --fluctuation: flywheel sizing, and the crank's speed under a motor.

With the mechanism's inertia M at the crank, the flywheel's inertia J and the crank speed u, the
kinetic energy E = (M + J) u^2 / 2 changes with the crank angle:

    dE/dtheta = c + motor(u) - R,

where R is the torque of weights, loads and friction, and c is a constant torque. Each iteration
linearises R and the motor's torque in E, and solves the linear equation for one period. The energy
at the start of the period is chosen so that the mean speed has its given value. c follows from the
condition that the energy is periodic. At the mean speed for which c = 0, the motor alone drives
the cycle.
"""

import math
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from linkage_ros import ConfigurationError, LinkageError, MechanismError, Solver
from linkage_ros.lab.output import chart, over_crank
from linkage_ros.lab.period import Period, extent, mean
from linkage_ros.model.structure import Mechanism
from linkage_ros.motion.drives import Motor
from linkage_ros.numeric import Array
from linkage_ros.palette import BLACK, COLORS, FIRST, GREY, SECOND, Color, fractions
from linkage_ros.parameters.descriptions import motor_line
from linkage_ros.units import radians_per_second

_RPM = 1 / radians_per_second(1.0)
# Angles per turn; enough for four digits of a flywheel's inertia if a load curve has corners.
_PARTS = 2880
_ROUNDS, _CLOSE = 30, 1e-11  # maximum iterations; relative speed change at convergence
_UNEVEN = 10.0  # fluctuation assigned to a crank without a steady cycle
_APART = 1e-6  # relative speed step of a finite difference
# Ratio and number of the mean speeds that are tried, to bracket the speed under a motor between
# 1/50 and 50 times the given speed.
_NEXT, _STARTS = 1.25, 19
_SLOWEST = 1e-13  # margin above the start energy that stops the crank, relative to the bracket
_MASSLESS = 1e-9  # inertia treated as 0, relative to the largest at the crank
_NONE = 'no steady cycle of the crank speed was found'
_NO_MOTOR = Motor()


class Cycle(NamedTuple):
    """One period of a steady motion under a torque.

    Attributes:
        crank: Crank angles, rad.
        velocity: Crank speed at these angles, rad/s.
        torque: Applied torque at these angles, N m.
        demand: Torque needed by the mechanism at these angles, N m; the difference from the
            applied torque accelerates the flywheel.
        constant: Constant torque applied in addition to the motor's, N m.
    """

    crank: Array
    velocity: Array
    torque: Array
    demand: Array
    constant: float

    @property
    def speed(self) -> float:
        """Mean speed over time, rad/s."""
        return 1 / mean(self.crank, 1 / self.velocity)

    @property
    def fluctuation(self) -> float:
        """Difference between the largest and the smallest speed, relative to the mean speed."""
        found = extent(self.crank, self.velocity)
        return (found.high - found.low) / abs(self.speed)


class Crank:
    """Computes the steady cycles of a crank, with or without a flywheel."""

    def __init__(self, mechanism: Mechanism) -> None:
        """Computes the inertia at the crank over a period; the crank must turn fully."""
        self._solver = Solver(mechanism)
        self._solver.reach.require_full_turn()
        self._angles = self._solver.reach.samples(_PARTS)
        ((self._inertia,),) = self._solver.matrix(self._angles)
        self._growth = CubicSpline(self._angles, self._inertia)(self._angles, 1)

    def energy(self, speed: float) -> float:
        """Estimates the range of the kinetic energy over a period to first order, J.

        The mean driving torque minus the driving torque, at a constant speed, is integrated over
        the crank angle. The result is the difference between the largest and the smallest value
        of this integral.
        """
        taken = self._solver.state(self._angles, np.full_like(self._angles, speed)).torque
        found = extent(self._angles, self._integral(mean(self._angles, taken) - taken))
        return found.high - found.low

    def inertia_for(self, fluctuation: float, speed: float) -> float:
        """Computes the inertia to add for a given fluctuation, kg m^2; 0 if none is needed."""

        def excess(added: float) -> float:
            try:
                return self.cycle(speed, added).fluctuation - fluctuation
            except LinkageError:
                return _UNEVEN

        if excess(0.0) <= 0:
            return 0.0
        enough = 2 * self.energy(speed) / (fluctuation * speed**2)
        while excess(enough) > 0:
            enough *= 2
        return float(brentq(excess, 0.0, enough, xtol=1e-12 * enough, rtol=1e-12))

    def cycle(self, speed: float, added: float, motor: Motor = _NO_MOTOR) -> Cycle:
        """Computes the steady cycle under a motor and a constant torque.

        Args:
            speed: Mean speed over time, with the sign of the rotation, rad/s.
            added: Inertia added to the crank, kg m^2.
            motor: Motor whose torque is added to the constant torque.

        Returns:
            One period of the cycle.

        Raises:
            MechanismError: No steady cycle was found.
            ConfigurationError: The inertia at the crank is 0 at some angle.
        """
        inertia = self._inertia + added
        if inertia.min() <= _MASSLESS * inertia.max():
            raise ConfigurationError('the inertia at the crank is 0 at some crank angle')
        velocity = np.full_like(self._angles, speed)
        for _ in range(_ROUNDS):
            last, slope = velocity, CubicSpline(self._angles, velocity)(self._angles, 1)
            energy, change = inertia * last * last / 2, last * slope
            resistance = self._resistance(last, change, motor)
            faster = self._resistance((1 + _APART) * last, change, motor)
            slope = (faster - resistance) / (2 * _APART * energy)
            with np.errstate(all='ignore'):
                energy, constant = self._solve(resistance, slope, energy, inertia, speed)
            velocity = math.copysign(1.0, speed) * np.sqrt(2 * energy / inertia)
            if np.abs(velocity - last).max() <= _CLOSE * abs(speed):
                applied = constant + motor.at(velocity)
                return Cycle(self._angles, velocity, applied, applied - added * change, constant)
        raise MechanismError(_NONE)

    def under(self, motor: Motor, near: float, added: float) -> Cycle | None:
        """Finds the steady cycle under a motor alone; `added` is the flywheel's inertia, kg m^2.

        `near` is an estimate of the mean speed, with the sign of the rotation, rad/s. Returns None
        if the motor cannot turn the crank at any mean speed from 1/50 to 50 times the estimate.
        """
        way = math.copysign(1.0, near)

        @cache
        def lack(speed: float) -> float:
            """Returns the torque missing at a mean speed under the motor alone, N m."""
            try:
                return way * self.cycle(way * speed, added, motor).constant
            except MechanismError:  # the crank stops: try a higher speed
                return -math.inf

        step = _NEXT if lack(abs(near)) < 0 else 1 / _NEXT
        for pair in pairwise(abs(near) * step**i for i in range(_STARTS)):
            slow, fast = sorted(pair)
            if -math.inf < lack(slow) < 0 <= lack(fast):
                return self.cycle(way * brentq(lack, slow, fast, rtol=1e-12), added, motor)
        return None

    def _resistance(self, velocity: Array, change: Array, motor: Motor) -> Array:
        """Computes the torque of weights, loads and friction, minus the motor's, N m."""
        taken = self._solver.state(self._angles, velocity, change).torque
        inertia = self._inertia * change + self._growth * velocity * velocity / 2
        return np.asarray(taken - inertia - motor.at(velocity))

    def _solve(
        self, resistance: Array, slope: Array, energy: Array, inertia: Array, speed: float
    ) -> tuple[Array, float]:
        """Solves dE/dtheta = c - resistance - slope (E - energy) over a period for E and c.

        Raises:
            MechanismError: No solution has the given mean speed.
        """
        way = 1 if speed > 0 else -1  # disturbances decay in the direction of motion
        slope, rest = way * slope[::way], way * (slope * energy - resistance)[::way]
        growth = np.exp(self._integral(slope))
        fixed, even = (self._integral(growth * x) / growth for x in (rest, 1 + 0 * rest))
        # The energy is fixed + start * each; c makes it periodic.
        rise, fixed_c = (1 - 1 / growth[-1]) / even[-1], fixed[-1] / even[-1]
        fixed, each = fixed - fixed_c * even, 1 / growth + rise * even

        def slowness(start: float) -> float:
            time = np.sqrt(inertia[::way] / (2 * (fixed + start * each)))
            return mean(self._angles, time) * abs(speed) - 1

        least = float((-fixed / each).max())
        most = float(((inertia[::way] * speed**2 / 2 - fixed) / each).max())
        try:
            start = brentq(slowness, least + _SLOWEST * (most - least), most, rtol=1e-14)
        except (ValueError, RuntimeError):  # not finite, or the crank almost stops
            raise MechanismError(_NONE) from None
        return (fixed + start * each)[::way], way * float(start * rise - fixed_c)

    def _integral(self, values: Array) -> Array:
        """Integrates values over the crank angle, from 0 to each angle."""
        return np.asarray(CubicSpline(self._angles, values).antiderivative()(self._angles))


def size_flywheel(
    period: Period, motor: Motor | None, fluctuation: float, name: str, picture: Path
) -> list[str]:
    """Sizes a flywheel for a mechanism, plots its effect, and checks the motor, if any.

    `fluctuation` is the allowed difference between the largest and the smallest speed, relative to
    the mean speed; `name` is the name of the parameter file. Returns the summary, line by line.
    """
    crank, speed = Crank(period.solver.mechanism), period.speed
    added, energy = crank.inertia_for(fluctuation, speed), crank.energy(speed)
    cycles, total = {}, energy / (fluctuation * speed**2)
    try:
        cycles['without flywheel'] = crank.cycle(speed, 0.0)
        bare = f'{cycles["without flywheel"].fluctuation:.4g}'
    except LinkageError as error:
        bare = f'none: {error}'
    cycles['with the flywheel'] = steady = crank.cycle(speed, added)
    lines = [
        _demand(period, 'driving_torque', period.mean_power / speed),
        _demand(period, 'driving_power', period.mean_power),
        f'fluctuation {fluctuation:g}: add {added:.5g} kg m^2 to the crank (without: {bare})',
        f'to first order: {energy:.4g} J between the extremes, {total:.5g} kg m^2 in total',
    ]
    if motor:
        carried, words = _carried(crank, motor, speed, added)
        needed = f'and the cycle needs {period.mean_power / speed:.4g} N m'
        lines += [
            f'{motor_line(motor)}: {motor.at(speed):.4g} N m at this speed, {needed}',
            f'with the flywheel: {words}',
            f'without: {_carried(crank, motor, speed, 0.0)[1]}',
        ]
    with chart(picture, 9.2 if motor else 6.4, '\n'.join([name, *lines])) as figure:
        speeds, torques, *planes = figure.subplots(3 if motor else 2, 1)
        for (label, cycle), color in zip(cycles.items(), (SECOND, COLORS['crank']), strict=False):
            _plot(speeds, np.degrees(cycle.crank), _RPM * cycle.velocity, color, label)
        taken = period.columns['driving_torque'].values
        _plot(
            torques, np.degrees(period.crank), taken, FIRST, 'driving torque at a constant speed'
        )
        average = 'mean torque, with the flywheel'
        _plot(torques, np.degrees(steady.crank), steady.torque, BLACK, average)
        over_crank(speeds, period.crank, 'Crank speed, rpm')
        over_crank(torques, period.crank, 'Torque, N m')
        torques.set_xlabel('Crank angle, deg')
        if motor:
            _draw_plane(planes[0], motor, carried, steady)
        for axes in (speeds, torques, *planes):
            axes.legend(loc='lower left', bbox_to_anchor=(0, 0.98), ncols=3)
    return lines


def _demand(period: Period, name: str, average: float) -> str:
    """Describes peak, rms and mean of torque or power at a constant speed."""
    unit, values = period.columns[name]
    size = extent(period.crank, values)
    return (
        f'{name.replace("_", " ")}: peak {max(-size.low, size.high):.4g} {unit}, '
        f'rms {size.rms:.4g} {unit}, mean {average:.4g} {unit}'
    )


def _carried(crank: Crank, motor: Motor, speed: float, added: float) -> tuple[Cycle | None, str]:
    """Returns the cycle under the motor, or None, and its description."""
    try:
        cycle = crank.under(motor, speed, added)
    except LinkageError as error:
        return None, str(error)
    if cycle is None:
        return None, 'the motor cannot drive the cycle'
    at = f'at {_RPM * cycle.speed:.4g} rpm, fluctuation {cycle.fluctuation:.4g}'
    return cycle, f'the motor drives the cycle {at}'


def _draw_plane(axes: Axes, motor: Motor, carried: Cycle | None, steady: Cycle) -> None:
    """Plots torque against speed: the motor, the demand of the mechanism, the operating range."""
    cycle, label = carried or steady, 'needed by the mechanism, with the flywheel'
    _plot(axes, _RPM * cycle.velocity, cycle.demand, FIRST, label)
    point, slope = (_RPM * cycle.speed, motor.at(cycle.speed)), -motor.damping / _RPM
    axes.axline(point, slope=slope, color=fractions(GREY), label="the motor's line")
    if carried is not None:
        thick = {'linewidth': 4.0, 'solid_capstyle': 'butt'}
        speeds = _RPM * carried.velocity
        _plot(axes, speeds, carried.torque, BLACK, 'operating range', **thick)
    axes.set(xlabel='Crank speed, rpm', ylabel='Torque, N m')


def _plot(axes: Axes, x: Array, y: Array, color: Color, label: str, **style: Any) -> None:
    axes.plot(x, y, color=fractions(color), label=label, **style)
