# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Sizes the flywheel for a crank, and finds its speed under a motor.

Energy over the crank angle theta gives the speed u without integration in time: under a torque
tau on the crank,

    (M(theta) + J) u^2 / 2 = T0 + integral of tau - R over theta,

with the mechanism's inertia M at the crank, the flywheel's J, and the torque R of weights, loads
and friction. Where R depends on the motion, the speed is found by iteration.
"""

from __future__ import annotations

import functools
import itertools
import math
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from linkage_ros.dynamics.period import extent, mean
from linkage_ros.dynamics.solver import Solver
from linkage_ros.errors import ConfigurationError, LinkageError
from linkage_ros.lab.torque_models import inertia_program
from linkage_ros.model.structure import Mechanism
from linkage_ros.motion.drives import Motor
from linkage_ros.numeric import Array
from linkage_ros.quantities import build, flatten

_PARTS = 2880  # of a turn: four digits of a flywheel where load curves have corners
_CLOSE = 1e-11  # of the speed: two rounds so close are one
_ROUNDS = 200
_UNEVEN = 10.0  # the fluctuation of a crank that stops
# Starts of a motor, until its steady speed lies between two of them: up to 50 times the given
# speed, or down to 1/50 of it.
_STEP, _STARTS = 1.25, 19
_STOPPED = 1e-3  # of the speed at the start
_TOLERANCE = 1e-9
_EVALUATIONS = 20_000  # in one turn of a motor
_MASSLESS = 1e-9  # of the largest inertia at the crank: none


class UnsteadyError(LinkageError):
    """The crank would stop within a turn."""


class Cycle(NamedTuple):
    """One period of a steady motion under a torque.

    Attributes:
        crank: Crank angles, rad.
        velocity: Crank speed at these, rad/s.
        torque: Applied torque at these, N m.
        demand: Torque that the mechanism takes, N m; the flywheel takes the rest.
    """

    crank: Array
    velocity: Array
    torque: Array
    demand: Array

    @property
    def speed(self) -> float:
        """Mean speed over time, rad/s."""
        return 1 / mean(self.crank, 1 / self.velocity)

    @property
    def fluctuation(self) -> float:
        """Difference of largest and smallest speed, relative to the mean over time."""
        found = extent(self.crank, self.velocity)
        return (found.high - found.low) / abs(self.speed)


class EvenTorque:
    """The motion of a crank under a constant torque, at a given mean speed over time.

    Attributes:
        energy: Energy between the extreme speeds to first order: the range of the integral of mean
            torque less driving torque at a constant speed, J.
    """

    def __init__(self, mechanism: Mechanism, speed: float) -> None:
        """Solves the part that does not depend on the flywheel.

        Args:
            mechanism: A mechanism whose crank turns fully.
            speed: Mean speed over time, rad/s.

        Raises:
            ConfigurationError: The crank is at rest.
            MechanismError: The crank does not turn fully.
        """
        if not speed:
            raise ConfigurationError(
                'rpm = 0: a crank at rest has no fluctuation; give a speed (--rpm), or leave '
                '--fluctuation out'
            )
        self._full, self._bare = Solver(mechanism), inertia_program(mechanism)
        self._full.reach.require_full_turn()
        self._crank, self._speed = self._full.reach.samples(_PARTS), speed
        ((self._inertia,),) = self._full.matrix(self._crank)
        even = np.full_like(self._crank, self._speed)
        taken = extent(self._crank, self._work(self._full.state(self._crank, even).torque))
        self.energy = taken.high - taken.low

    def first_order(self, fluctuation: float) -> float:
        """The total inertia for a fluctuation, to first order, kg m^2."""
        return self.energy / (fluctuation * self._speed**2)

    def inertia_for(self, fluctuation: float) -> float:
        """Inertia to add to the crank for a fluctuation, kg m^2; 0: none is needed."""

        def excess(added: float) -> float:
            try:
                return self.cycle(added).fluctuation - fluctuation
            except UnsteadyError:
                return _UNEVEN

        if excess(0.0) <= 0:
            return 0.0
        enough = 2 * self.first_order(fluctuation)
        while excess(enough) > 0:
            enough *= 2
        return float(brentq(excess, 0.0, enough, xtol=1e-12 * enough, rtol=1e-12))

    def cycle(self, added: float) -> Cycle:
        """The motion with a flywheel.

        Args:
            added: Inertia added to the crank, kg m^2.

        Returns:
            One period.

        Raises:
            UnsteadyError: The crank would stop, or a moving coordinate has no mass.
        """
        speeds = np.full_like(self._crank, self._speed)
        for _ in range(_ROUNDS):
            changes = speeds * CubicSpline(self._crank, speeds)(self._crank, 1)
            (inertia,) = self._bare.arrays(self._crank, speeds, changes)
            last, taken = speeds, self._full.state(self._crank, speeds, changes).torque - inertia
            speeds = self._speeds(added, self._work(taken))
            if np.abs(speeds - last).max() <= _CLOSE * abs(self._speed):
                applied = np.full_like(taken, self._mean(taken))
                return Cycle(self._crank, speeds, applied, applied - added * changes)
        raise UnsteadyError('no steady cycle of its speed was found')

    def _work(self, taken: Array) -> Array:
        """Work of a constant torque since angle 0, minus the work taken, J."""
        curve = CubicSpline(self._crank, self._mean(taken) - taken).antiderivative()
        found: Array = curve(self._crank)
        return found

    def _mean(self, values: Array) -> float:
        """The mean over the angle, by the same rule as `_work`."""
        curve = CubicSpline(self._crank, values)
        return float(curve.integrate(0.0, self._crank[-1]) / self._crank[-1])

    def _speeds(self, added: float, work: Array) -> Array:
        """Speeds from the energy, with the given mean over time.

        Raises:
            UnsteadyError: No such speeds exist.
        """
        inertia = self._inertia + added
        if inertia.min() <= _MASSLESS * inertia.max():
            raise UnsteadyError('something moves without a mass at some angle')
        rest, speed = work - work.min(), abs(self._speed)

        def at(least: float) -> Array:
            found: Array = np.sqrt(2 * (least + rest) / inertia)
            return found

        def slow(least: float) -> float:
            return mean(self._crank, 1 / at(least)) * speed - 1

        most = float(inertia.max()) * self._speed**2
        if slow(1e-9 * most) <= 0:
            raise UnsteadyError('the crank would stop within a turn')
        found = brentq(slow, 1e-9 * most, most, xtol=1e-15 * most, rtol=1e-14)
        return math.copysign(1.0, self._speed) * at(found)


def motor_cycle(mechanism: Mechanism, motor: Motor, speed: float, added: float) -> Cycle | None:
    """The steady motion under a motor, found by integration over the crank angle.

    Args:
        mechanism: A mechanism whose crank turns fully.
        motor: The motor.
        speed: A speed near the steady one, with the sign of the rotation, rad/s.
        added: Inertia added to the crank, kg m^2.

    Returns:
        One period; None: the motor cannot turn the crank at any speed from 1/50 to 50 times the
        given one.

    Raises:
        LinkageError: A moving coordinate has no mass, or there is friction.
    """
    run = _MotorRun(mechanism, motor, speed, added)
    found = run.bracket(abs(speed))
    return run.cycle(float(brentq(run.gain, *found, rtol=1e-12))) if found else None


class _MotorRun:
    """Turns of a crank under a motor."""

    def __init__(self, mechanism: Mechanism, motor: Motor, speed: float, added: float) -> None:
        values = flatten(mechanism)
        values['crank.inertia'] = mechanism.crank.inertia + added
        self._solver, self._motor = Solver(build(type(mechanism), values)), motor
        self._sign, self._added = math.copysign(1.0, speed), added
        self._solver.accelerations(0.0, speed, 0.0)  # refuses friction
        self._angles = self._solver.reach.samples()
        rising = self._angles if self._sign > 0 else self._angles[-1] - self._angles[::-1]
        self._at = np.clip(rising, 0.0, self._angles[-1])

    @functools.lru_cache(maxsize=8)  # noqa: B019
    def gain(self, speed: float) -> float:
        """Gain of speed over a turn, rad/s; minus the initial speed if the crank stops."""
        speeds = self._turn(speed)
        return float(speeds[-1]) - speed if len(speeds) == len(self._angles) else -speed

    def bracket(self, start: float) -> tuple[float, float] | None:
        """Finds two initial speeds of a turn: a slower one that gains, a faster one that loses.

        Faster turns gain less energy, unless the crank stops.
        """
        step = _STEP if self.gain(start) > 0 or self._stops(start) else 1 / _STEP
        for one, other in itertools.pairwise(start * step**i for i in range(_STARTS)):
            slow, fast = min(one, other), max(one, other)
            if self.gain(slow) > 0 >= self.gain(fast) and not self._stops(fast):
                return slow, fast
        return None

    def _stops(self, speed: float) -> bool:
        return self.gain(speed) == -speed

    def cycle(self, speed: float) -> Cycle:
        """The turn that begins at a speed, at increasing crank angles."""
        turned = self._turn(speed)
        velocity = self._sign * (turned if self._sign > 0 else turned[::-1])
        applied = np.broadcast_to(self._motor.at(velocity), velocity.shape)
        changes = self._solver.accelerations(self._angles, velocity, applied)
        return Cycle(self._angles, velocity, applied, applied - self._added * changes)

    def _turn(self, speed: float) -> Array:
        """Absolute speeds over a turn from an initial one; fewer if the crank stops.

        Raises:
            UnsteadyError: They change too quickly for the integration.
        """
        left = iter(range(_EVALUATIONS))

        def slope(turned: float, y: Array) -> float:
            if next(left, None) is None:
                raise UnsteadyError('its speed changes too quickly to be followed')
            u = self._sign * float(y[0])
            torque = float(self._motor.at(u))
            return self._solver.forward((self._sign * turned, u), torque)[0] / u

        def stops(_: float, y: Array) -> float:
            return float(y[0]) - _STOPPED * speed

        stops.terminal = True  # type: ignore[attr-defined]
        with np.errstate(under='ignore'):  # SciPy's first step
            found: Array = solve_ivp(
                slope, (0.0, self._at[-1]), [speed], 'DOP853', self._at, events=stops,
                rtol=_TOLERANCE, atol=_TOLERANCE * speed,
            ).y[0]  # fmt: skip
        return found
