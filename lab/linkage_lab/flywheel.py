# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Flywheel sizing, and the crank's speed under a motor.

With the mechanism's inertia M at the crank, the flywheel's inertia J and the crank speed u, the
kinetic energy E = (M + J) u^2 / 2 changes with the crank angle:

    dE/dtheta = c + motor(u) - R,

where R is the torque of weights, loads and friction, and c is a constant torque. Each iteration
linearises R and the motor's torque in E, and solves the linear equation for one period, with the
same energy at its start and end. Without a motor, c keeps a given mean speed. With a motor, c is
0.
"""

import functools
import math
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import trapezoid
from scipy.optimize import brentq, newton

from linkage_lab.gaps import beside_change_points
from linkage_lab.period import extent, mean
from linkage_lab.sampling import derivative, integral, samples
from linkage_ros import ConfigurationError, LinkageError, Mechanism, MechanismError, Solver
from linkage_ros.formulas import Array
from linkage_ros.internals import Motor

# Angles per turn; enough for six digits of a flywheel's inertia, also if a load has corners.
_PARTS = 2880
_ROUNDS, _CLOSE = 30, 1e-9  # maximum iterations; relative speed change at convergence
_HEAVIEST = 64.0  # largest flywheel that is tried, relative to that of a constant torque
_UNEVEN = 10.0  # fluctuation assigned to a crank without a steady cycle
_MEAN_SPEED_ERROR = 1e-5  # largest, relative
_APART = 1e-6  # relative speed step of a finite difference
_DROP = 0.25  # smallest ratio of the energies of two iterations under a motor
# Margin above the start energy that stops the crank, relative to the bracket.
_ABOVE_STANDSTILL = 1e-13
_MASSLESS = 1e-9  # inertia treated as 0, relative to the largest at the crank


class Cycle(NamedTuple):
    """One period of a steady motion under a torque.

    Attributes:
        crank: Crank angles, rad.
        velocity: Crank speed at these angles, rad/s.
        torque: Applied torque at these angles, N m.
        demand: Torque required by the mechanism at these angles, N m; the difference from the
            applied torque accelerates the flywheel.
    """

    crank: Array
    velocity: Array
    torque: Array
    demand: Array

    @property
    def speed(self) -> float:
        """Mean speed over time, rad/s."""
        return 1 / slowness(self.crank, self.velocity)

    @property
    def fluctuation(self) -> float:
        """Difference between the largest and the smallest speed, relative to the mean speed."""
        found = extent(self.crank, self.velocity)
        return (found.high - found.low) / abs(self.speed)


def slowness(crank: Array, velocity: Array) -> float:
    """Computes the mean time per angle, s/rad; near standstill, a spline would overshoot."""
    return float(trapezoid(1 / velocity, crank) / (crank[-1] - crank[0]))


class Crank:
    """Computes the steady cycles of a crank, with or without a flywheel."""

    def __init__(self, mechanism: Mechanism) -> None:
        """Prepares the solver.

        Raises:
            MechanismError: The crank does not turn fully.
        """
        self._solver = Solver(mechanism)
        self._solver.reach.require_full_turn()

    @functools.cache  # noqa: B019
    def _period(self, speed: float) -> tuple[Array, Array, Array]:
        """Computes the inertia at the crank over a period, for corners of loads at a speed, rad/s.

        Returns:
            Crank angles, rad; the inertia there, kg m^2; and its derivative, kg m^2/rad.
        """
        angles = samples(self._solver, speed, _PARTS)
        ((inertia,),) = self._solver.matrix(angles)
        return angles, inertia, derivative(angles, inertia)

    def energy(self, speed: float) -> float:
        """Estimates the range of the kinetic energy over a period to first order, J.

        The mean driving torque minus the driving torque, at a constant speed, is integrated over
        the crank angle. The result is the difference between the largest and the smallest value
        of this integral.
        """
        angles, *_ = self._period(speed)
        torque = self._torque(angles, np.full_like(angles, speed))
        work = extent(angles, integral(angles, mean(angles, torque) - torque))
        return work.high - work.low

    def inertia_for(self, fluctuation: float, speed: float, motor: Motor | None = None) -> float:
        """Computes the inertia to add for a given fluctuation, kg m^2; 0 if none is needed.

        Args:
            fluctuation: The fluctuation; see `Cycle`.
            speed: Mean speed over time, rad/s; with a motor, an estimate of it.
            motor: The motor; None for a constant torque.

        Raises:
            MechanismError: The mechanism has neither masses nor loads, or the motor cannot drive
                it with any flywheel.
        """

        def excess(added: float) -> float:
            try:
                return self.cycle(speed, added, motor).fluctuation - fluctuation
            except LinkageError:
                return _UNEVEN

        if excess(0.0) <= 0:
            return 0.0
        enough = 2 * self.energy(speed) / (fluctuation * speed**2)
        if not enough:
            raise MechanismError(
                'no torque varies over a turn, so that a flywheel has nothing to do: give links '
                'masses or loads'
            )
        most = enough * _HEAVIEST
        while excess(enough) > 0:
            enough *= 2
            if enough > most:
                raise MechanismError('the motor cannot drive the cycle with any flywheel')
        return float(brentq(excess, 0.0, enough, xtol=1e-12 * enough, rtol=1e-12))

    def motor_for(self, speed: float, added: float, motor: Motor) -> Motor:
        """Computes the motor torque at rest that keeps a mean speed; the damping remains.

        Args:
            speed: Mean speed over time, rad/s.
            added: Inertia added to the crank, kg m^2.
            motor: A motor with this damping.

        Raises:
            MechanismError: No torque keeps this speed.
        """

        def speed_error(torque: float) -> float:
            driven = self.cycle(speed, added, Motor(torque, motor.damping))
            return driven.speed / speed - 1

        steady = self.cycle(speed, added)
        guess = float(steady.torque.mean()) + motor.damping * speed
        try:
            torque = newton(speed_error, guess, tol=_CLOSE * abs(guess))
        except RuntimeError as error:
            raise MechanismError('no motor torque keeps this speed') from error
        return Motor(float(torque), motor.damping)

    @np.errstate(all='ignore')  # an iteration that fails may overflow or underflow
    def cycle(self, speed: float, added: float, motor: Motor | None = None) -> Cycle:
        """Computes the steady cycle under a constant torque, or under a motor.

        Args:
            speed: Mean speed over time, with the sign of the rotation, rad/s; with a motor, an
                estimate of it.
            added: Inertia added to the crank, kg m^2.
            motor: The motor; None for the constant torque that keeps the mean speed.

        Returns:
            One period of the cycle.

        Raises:
            MechanismError: No steady cycle was found.
            ConfigurationError: The inertia at the crank is 0 at some angle.
        """
        angles, own, _ = self._period(speed)
        inertia = own + added
        if inertia.min() <= _MASSLESS * inertia.max():
            raise ConfigurationError('the inertia at the crank is 0 at some crank angle')
        velocity, drive = np.full_like(angles, speed), motor or Motor()
        for _ in range(_ROUNDS):
            if not np.isfinite(velocity).all():
                break
            energy = inertia * velocity * velocity / 2
            acceleration = velocity * derivative(angles, velocity)
            resistance = self._resistance(speed, velocity, acceleration, drive)
            of_faster = self._resistance(speed, (1 + _APART) * velocity, acceleration, drive)
            slope = (of_faster - resistance) / (2 * _APART * energy)  # with the energy
            try:
                new_energy, constant = self._solve(
                    resistance, slope, energy, inertia, speed, motor
                )
            except (ValueError, RuntimeError):  # not finite, or the crank almost stops
                break
            last = velocity
            velocity = math.copysign(1.0, speed) * np.sqrt(2 * new_energy / inertia)
            if np.abs(velocity - last).max() <= _CLOSE * abs(speed):
                applied = constant + drive.at(velocity)
                return Cycle(angles, velocity, applied, applied - added * acceleration)
        raise MechanismError(
            'the motor cannot drive the cycle'
            if motor
            else 'no steady cycle of the crank speed was found'
        )

    def _torque(self, angles: Array, *rates: Array) -> Any:
        """Computes the driving torque at given speeds and accelerations of the crank, N m."""
        return self._solver.state(beside_change_points(self._solver, angles), *rates).torque

    def _resistance(
        self, speed: float, velocity: Array, acceleration: Array, motor: Motor
    ) -> Array:
        """Computes the torque of weights, loads and friction, minus the motor's torque, N m."""
        angles, inertia, growth = self._period(speed)
        driving = self._torque(angles, velocity, acceleration)
        inertial = inertia * acceleration + growth * velocity * velocity / 2
        return np.asarray(driving - inertial - motor.at(velocity))

    def _solve(
        self,
        resistance: Array,
        slope: Array,
        last: Array,
        inertia: Array,
        speed: float,
        motor: Motor | None,
    ) -> tuple[Array, float]:
        """Solves dE/dtheta = c - resistance - slope (E - last) over a period for E and c.

        Args:
            resistance: See `_resistance`, N m, shape (n,), as the next three.
            slope: Derivative of the resistance with respect to the kinetic energy, N m/J.
            last: Kinetic energy of the last iteration, J.
            inertia: Inertia at the crank, including a flywheel, kg m^2.
            speed: Mean speed over time, rad/s; with a motor, an estimate of it.
            motor: The motor, with which c is 0; None for the constant torque c.

        Returns:
            The kinetic energy E, J, and c, N m.

        Raises:
            ValueError: No solution has the given mean speed, or the motor does not limit it.
            RuntimeError: The mean speed was not reached.
        """  # fmt: skip
        # All arrays are put in the direction of motion, in which disturbances decay.
        sign = 1 if speed > 0 else -1
        crank = sign * self._period(speed)[0][::sign]
        slope, torque = sign * slope[::sign], sign * (slope * last - resistance)[::sign]
        # With E at the start unknown, E = start / factor + of_torque + c * of_unit.
        factor = np.exp(integral(crank, slope))  # integrating factor
        of_torque = integral(crank, factor * torque) / factor
        of_unit = integral(crank, factor) / factor
        # E is periodic for c = c_per_start * start + c_at_0.
        c_per_start = (1 - 1 / factor[-1]) / of_unit[-1]
        c_at_0 = -of_torque[-1] / of_unit[-1]
        # Hence E = offset + gain * start.
        offset = of_torque + c_at_0 * of_unit
        gain = 1 / factor + c_per_start * of_unit
        if motor is None:
            start = _start_energy(crank, offset, gain, inertia[::sign], speed)
            energy = offset + start * gain
            return energy[::sign], sign * float(start * c_per_start + c_at_0)
        if not c_per_start > 0:
            raise ValueError('nothing limits the speed')
        energy = offset - c_at_0 / c_per_start * gain  # c is 0
        return np.maximum(energy[::sign], _DROP * last), 0.0


def _start_energy(
    crank: Array, offset: Array, gain: Array, inertia: Array, mean_speed: float
) -> float:
    """Finds the kinetic energy at the start of the period that gives the required mean speed, J.

    Args:
        crank: Crank angles in the direction of motion, rad.
        offset: Kinetic energy at these angles for an energy of 0 at the start, J.
        gain: Derivative of the kinetic energy at these angles with respect to that at the start.
        inertia: Inertia at these angles, including a flywheel, kg m^2.
        mean_speed: Mean speed over time, with the sign of the rotation, rad/s.

    Raises:
        ValueError: No energy gives this speed.
        RuntimeError: The crank almost stops, so that rounding errors dominate.
    """

    def excess_time(start: float) -> float:
        """Returns the excess of the period's duration, relative to the required one."""
        velocity = np.sqrt(2 * (offset + start * gain) / inertia)
        return slowness(crank, velocity) * abs(mean_speed) - 1

    # With less energy than `stops`, the crank stops at some angle: the period lasts too long. With
    # `too_fast`, the crank is nowhere slower than the mean speed: it ends too early.
    stops = float((-offset / gain).max())
    too_fast = float(((inertia * mean_speed**2 / 2 - offset) / gain).max())
    least = stops + _ABOVE_STANDSTILL * (too_fast - stops)
    start = float(brentq(excess_time, least, too_fast, rtol=1e-14))
    if abs(excess_time(start)) > _MEAN_SPEED_ERROR:
        raise RuntimeError('the mean speed was not reached')
    return start
