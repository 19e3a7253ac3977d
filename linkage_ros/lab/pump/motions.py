# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Motions of a wind pump over time, from many starts at once.

Each motion has steps of its own, of Dormand and Prince's method of order 5. A step of many motions
takes little longer than that of one.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable
from typing import Any, NamedTuple, cast

import numpy as np

from linkage_ros.dynamics.solver import Solver
from linkage_ros.errors import MotionError
from linkage_ros.model.wind_pump import WindPump
from linkage_ros.motion.driven_mechanism import DrivenMechanism
from linkage_ros.motion.drives import Motor
from linkage_ros.motion.fixed_step_integrator import DORMAND_PRINCE
from linkage_ros.numeric import Array

TURN = 2 * math.pi
_TOLERANCE = 1e-5  # of a step, in rad, crank lengths, and these per second at the motor's speed
_SHORTEST = 1e-7  # step, of the time of a radian
_FASTEST = 1e3  # rates, in the same units: beyond, a motion has ended
_EDGE = 1e-9  # relative, of the square of the dyad's length
_KEPT = 500  # steps


class Course(NamedTuple):
    """Values over the crank angle, by cubic polynomials between some angles.

    Attributes:
        angles: Rising, of shape (n), rad.
        values: There, of shape (n, m).
        rates: Their derivatives by the angle.
    """

    angles: Array
    values: Array
    rates: Array

    def at(self, angles: Array) -> Array:
        """The values at other angles, of shape (k, m)."""
        last = len(self.angles) - 2
        one = np.clip(np.searchsorted(self.angles, angles, side='right') - 1, 0, last)
        width = np.diff(self.angles)[one, None]
        t = (angles[:, None] - self.angles[one, None]) / width
        start, end = self.values[one], self.values[one + 1]
        way = end - start
        before, after = self.rates[one] * width - way, way - self.rates[one + 1] * width
        found: Array = start + t * way + t * (1 - t) * ((1 - t) * before + t * after)
        return found


class Motions:
    """Motions from many starts.

    Attributes:
        ended: Whether each motion has left what the coordinates describe; of shape (n).
        times: Times of the first `shown` motions at all steps, s; each of shape (shown).
        speeds: Their crank speeds, rad/s.
    """

    def __init__(self, solver: Solver, motor: Motor, starts: Array, shown: int = 0) -> None:
        """Begins.

        Args:
            solver: Solver of the pump.
            motor: Motor of the pump.
            starts: Crank angle, rad, slider position, m, and their rates, of shape (4, n).
            shown: Number of motions of which all steps are kept.
        """
        self._solver, self._motor, self._shown = solver, motor, shown
        pump = cast('WindPump', solver.mechanism)
        b, c, length = pump.coupler.length, pump.rod.length, pump.crank.length
        self._within = (b - c) ** 2, (b + c) ** 2
        pace = max(starts[2].max(), motor.torque / motor.damping if motor.damping else 0.0)
        self._units = np.array((1.0, length, pace, pace * length))[:, None]
        self._safe = starts[:, :1]
        self._time, self._phase = np.zeros(starts.shape[1]), starts
        self._slope = self._slopes(starts)
        self._step = np.full(starts.shape[1], 0.1 / pace)
        self._shortest = _SHORTEST / pace
        self.ended: Any = np.isnan(self._slope).any(axis=0)
        self.times, self.speeds = [self._time[:shown]], [starts[2, :shown]]
        self._rows: deque[tuple[Array, Array, Array]] = deque(maxlen=_KEPT)

    def advance(self, steps: int) -> None:
        """Follows all motions by so many steps, some of which are tried again."""
        with np.errstate(all='ignore'):  # what is not finite has no slope
            for _ in range(steps):
                self._try()
                self._rows.append((self._time, self._phase, self._slope))
                self.times.append(self._time[: self._shown])
                self.speeds.append(self._phase[2, : self._shown])

    def _try(self) -> None:
        h, slopes = self._step, [self._slope]
        for row in DORMAND_PRINCE.stages:
            moved = _sum(row, slopes)
            slopes.append(self._slopes(self._phase + h * moved))
        end = self._phase + h * _sum(DORMAND_PRINCE.end, slopes)
        slopes.append(self._slopes(end))
        error = h * _sum(DORMAND_PRINCE.error, slopes) / self._units
        worst = np.nan_to_num(np.abs(error).max(axis=0) / _TOLERANCE, nan=np.inf)
        good = (worst <= 1) & ~self.ended
        self._time = np.where(good, self._time + h, self._time)
        self._phase = np.where(good, end, self._phase)
        self._slope = np.where(good, slopes[-1], self._slope)
        self._step = h * np.clip(0.9 * np.maximum(worst, 1e-9) ** -0.2, 0.2, 4.0)
        self.ended |= self._step < self._shortest

    def _slopes(self, phases: Array) -> Array:
        """The rates and accelerations; not a number where the coordinates describe nothing."""
        angle, x, w, v = phases
        low, high = self._within
        length = self._solver.mechanism.crank.length
        square = x * x - 2 * length * x * np.cos(angle) + length * length
        known = (square > low + _EDGE * high) & (square < high * (1 - _EDGE))
        known &= (np.abs(phases[2:]) < _FASTEST * self._units[2:]).all(axis=0)
        angle, x, w, v = np.where(known, phases, self._safe)
        slopes = np.array(
            (w, v, *self._solver.accelerations((angle, x), (w, v), self._motor.at(w)))
        )
        found: Array = np.where(known, slopes, np.nan)
        return found

    def rows(self, back: int) -> Array:
        """Phases of all motions at the last few steps.

        Args:
            back: The number of steps before the last, from which on 10 are given.

        Returns:
            Of shape (4, 10, n), or fewer.
        """
        count = len(self._rows)
        chosen = range(max(count - back - 10, 0), max(count - back, 0))
        found: Array = np.array([self._rows[i][1] for i in chosen]).swapaxes(0, 1)
        return found

    def course(self, number: int) -> Course | None:
        """The last steps of a motion over the crank angle.

        Args:
            number: Of the motion.

        Returns:
            Time, slider position, and the rates of crank and slider; None if the crank does not
            turn forwards.
        """
        times, phases, slopes = (
            np.array([row[part][..., number] for row in self._rows]) for part in range(3)
        )
        moved = np.append(True, np.diff(times) > 0)
        phases, slopes, times = phases[moved], slopes[moved], times[moved]
        turning = np.flatnonzero(phases[:, 2] <= 0)
        first = turning[-1] + 1 if len(turning) else 0
        phases, slopes, times = phases[first:], slopes[first:], times[first:]
        if self.ended[number] or len(phases) < 2:
            return None
        w = phases[:, 2:3]
        values = np.column_stack((times, phases[:, 1:]))
        rates = np.column_stack((np.ones(len(w)), slopes[:, 1:])) / w
        return Course(phases[:, 0], values, rates)

    def turns(self, number: int) -> float:
        """How often the crank of a motion has turned."""
        return float(self._phase[0, number] / TURN)

    def require_going(self, number: int) -> None:
        """Passes if a motion has not ended.

        Raises:
            MotionError: It has; with time, place and what to do.
        """
        if self.ended[number]:
            driven = DrivenMechanism(self._solver, self._motor.at)
            driven.fail(float(self._time[number]), tuple(self._phase[:, number].tolist()), None)

    def reason(self, number: int) -> str | None:
        """Why a motion has ended, in words; None: it has not."""
        try:
            self.require_going(number)
        except MotionError as error:
            return str(error)
        return None


def _sum(weights: Iterable[float], slopes: Iterable[Array]) -> Any:
    """The weighted sum of slopes."""
    return sum(weight * slope for weight, slope in zip(weights, slopes, strict=False) if weight)
