# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Integrates motions of a wind pump from many starts at once.

Each motion has its own step lengths, by Dormand and Prince's method of order 5. A step of many
motions takes little longer than a step of one.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, cast

import numpy as np

from linkage_ros.dynamics.solver import Solver
from linkage_ros.errors import MotionError
from linkage_ros.model.wind_pump import WindPump
from linkage_ros.motion.driven_mechanism import DrivenMechanism
from linkage_ros.motion.drives import Motor
from linkage_ros.motion.fixed_step_integrator import DORMAND_PRINCE
from linkage_ros.numeric import Array

_TOLERANCE = 1e-4  # of a step, in rad, crank lengths, and these per second at the motor's speed
_SHORTEST = 1e-7  # step, of the time of a radian
_FASTEST = 1e3  # rates, in the same units: beyond, a motion has ended
_EDGE = 1e-9  # relative, of the square of the dyad's length
_KEPT = 300  # steps in which last turns are looked for


class Motions:
    """Motions from many starts.

    Attributes:
        ended: Whether each motion has left the range of the coordinates; shape (n).
        times: At all steps, s; each of shape (n).
        phases: Crank angle, rad, slider position, m, and their rates; each of shape (4, n).
    """

    def __init__(self, solver: Solver, motor: Motor, starts: Array) -> None:
        """Begins.

        Args:
            solver: Solver of the pump.
            motor: Motor of the pump.
            starts: Crank angle, rad, slider position, m, and their rates, of shape (4, n).
        """
        self._solver, self._motor = solver, motor
        pump = cast('WindPump', solver.mechanism)
        b, c, self._length = pump.coupler.length, pump.rod.length, pump.crank.length
        self._within = (b - c) ** 2 + _EDGE * (b + c) ** 2, (b + c) ** 2 * (1 - _EDGE)
        pace = max(starts[2].max(), motor.torque / motor.damping if motor.damping else 0.0)
        self._units = np.array((1.0, self._length, pace, pace * self._length))[:, None]
        self._safe = starts[:, :1]
        self._slope = self._slopes(starts)
        self._step, self._shortest = np.full(starts.shape[1], 0.1 / pace), _SHORTEST / pace
        self.ended: Any = np.isnan(self._slope).any(axis=0)
        self.times, self.phases = [np.zeros(starts.shape[1])], [starts]

    def advance(self, steps: int) -> None:
        """Advances all motions by a number of steps, some of which are repeated."""
        with np.errstate(all='ignore'):  # what is not finite has no slope
            for _ in range(steps):
                self._try()

    def _try(self) -> None:
        h, start, slopes = self._step, self.phases[-1], [self._slope]
        for row in DORMAND_PRINCE.stages:
            slopes.append(self._slopes(start + h * _sum(row, slopes)))
        end = start + h * _sum(DORMAND_PRINCE.end, slopes)
        slopes.append(self._slopes(end))
        error = h * _sum(DORMAND_PRINCE.error, slopes) / self._units
        worst = np.nan_to_num(np.abs(error).max(axis=0) / _TOLERANCE, nan=np.inf)
        good = (worst <= 1) & ~self.ended
        self.times.append(self.times[-1] + np.where(good, h, 0.0))
        self.phases.append(np.where(good, end, start))
        self._slope = np.where(good, slopes[-1], self._slope)
        self._step = h * np.clip(0.9 * np.maximum(worst, 1e-9) ** -0.2, 0.2, 4.0)
        self.ended |= self._step < self._shortest

    def _slopes(self, phases: Array) -> Array:
        """Rates and accelerations; nan outside the range of the coordinates."""
        angle, x, w, v = phases
        low, high = self._within
        square = x * x - 2 * self._length * x * np.cos(angle) + self._length**2
        known = (square > low) & (square < high)
        known &= (np.abs(phases[2:]) < _FASTEST * self._units[2:]).all(axis=0)
        angle, x, w, v = np.where(known, phases, self._safe)
        rates = self._solver.accelerations((angle, x), (w, v), self._motor.at(w))
        found: Array = np.where(known, np.array((w, v, *rates)), np.nan)
        return found

    def last_turns(self, number: int, turns: int) -> Array | None:
        """The last turns of a motion.

        Args:
            number: Number of the motion.
            turns: Of the crank, forwards.

        Returns:
            Phases, of shape (4, steps); None if it has ended or turned backwards meanwhile.
        """
        if self.ended[number]:
            return None
        rows = np.array([phase[:, number] for phase in self.phases[-_KEPT:]])
        inside = rows[:, 0] > rows[-1, 0] - 2 * math.pi * turns
        forwards = not inside[0] and rows[inside, 2].min() > 0
        return rows[inside].T if forwards else None

    def require_going(self, number: int) -> None:
        """Checks that a motion has not ended.

        Raises:
            MotionError: It has ended; names time and place, and what to do.
        """
        if self.ended[number]:
            driven = DrivenMechanism(self._solver, self._motor.at)
            time, phase = self.times[-1][number], self.phases[-1][:, number]
            driven.fail(float(time), tuple(phase.tolist()), None)

    def reason(self, number: int) -> str | None:
        """The reason why a motion has ended; None: it has not."""
        try:
            self.require_going(number)
        except MotionError as error:
            return str(error)
        return None


def _sum(weights: Iterable[float], slopes: Iterable[Array]) -> Any:
    """The weighted sum of slopes."""
    return sum(weight * slope for weight, slope in zip(weights, slopes, strict=False) if weight)
