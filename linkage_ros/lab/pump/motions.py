# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Integrates motions of a wind pump from many starts at once.

Each motion is integrated by Dormand and Prince's method of order 5, with its own step lengths. A
step of many motions takes little longer than a step of one motion.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from linkage_ros.lab.pump.equations import PumpSolver, assembly
from linkage_ros.motion.drives import Motor
from linkage_ros.motion.runge_kutta import DORMAND_PRINCE
from linkage_ros.numeric import Array

_STAGES = *map(np.array, DORMAND_PRINCE.stages), np.array(DORMAND_PRINCE.end)
_ERROR = np.array(DORMAND_PRINCE.error)
# Tolerance of a step: rad and crank lengths; for rates, relative to the motor's speed.
_TOLERANCE = 5e-4
_FINE, _SAMPLES = 1e-7, 128  # tolerance of further turns, and samples of each
_KEPT = 400  # steps that are searched for the last turns
_LONGEST = 75.0  # longest time for a further turn, relative to that for 1 rad at no load


class Motions:
    """Motions from many starts.

    Attributes:
        active: Numbers of the motions that are still integrated.
        pace: Largest speed of the motor and of the cranks at the start, rad/s.
        times: Times, s, of all motions after each step; arrays of shape (n).
        phases: Phases of the solver after each step; arrays of shape (k, n).
    """

    def __init__(self, solver: PumpSolver, motor: Motor, starts: Array) -> None:
        """Starts the motions at t = 0.

        Args:
            solver: Solver of the pump.
            motor: Motor of the pump.
            starts: Phases of the solver, of shape (k, n).
        """
        self._solver, self._motor = solver, motor
        still = motor.torque / motor.damping if motor.damping else 0.0
        self.pace = max(starts[-2].max(), still)
        *places, rate = solver.units
        self._units = np.array((1.0, *places, self.pace, self.pace * rate))[:, None]
        self._slope = self._slopes(starts)
        self._step = np.full(starts.shape[1], 0.1 / self.pace)
        self.active: Any = np.arange(starts.shape[1])
        self.times, self.phases = [np.zeros(starts.shape[1])], [starts.copy()]

    def advance(self, steps: int) -> None:
        """Advances all motions by a number of steps; rejected steps count, too."""
        with np.errstate(all='ignore'):  # non-finite values have no slope
            for _ in range(steps):
                self._try()

    def _try(self) -> None:
        on, there, times = self.active, self.phases[-1].copy(), self.times[-1].copy()
        h, start = self._step[on], there[:, on]
        slopes = np.empty((7, start.size))
        slopes[0] = self._slope[:, on].ravel()
        for stage, row in enumerate(_STAGES, 1):
            end = start + h * (row @ slopes[:stage]).reshape(start.shape)
            slopes[stage] = self._slopes(end).ravel()
        error = h * (_ERROR @ slopes).reshape(start.shape) / self._units
        worst = np.nan_to_num(np.abs(error).max(axis=0) / _TOLERANCE, nan=np.inf)
        self._solver.close(end)
        good = worst <= 1
        times[on] += np.where(good, h, 0.0)
        there[:, on] = np.where(good, end, start)
        self.times.append(times)
        self.phases.append(there)
        self._slope[:, on] = np.where(good, slopes[-1].reshape(start.shape), self._slope[:, on])
        self._step[on] = h * np.clip(0.9 * np.maximum(worst, 1e-9) ** -0.2, 0.2, 4.0)

    def _slopes(self, there: Array) -> Array:
        return self._solver.slopes(self._motor.at(there[-2]), *there)

    def last_turns(self, number: int, turns: int) -> Array | None:
        """Returns the last turns of a motion.

        Args:
            number: Number of the motion.
            turns: Number of forward turns of the crank.

        Returns:
            Phases, of shape (k, steps); None if the crank has turned backwards.
        """
        rows = np.array([phase[:, number] for phase in self.phases[-_KEPT:]])
        inside = rows[:, 0] > rows[-1, 0] - 2 * math.pi * turns
        forwards = not inside[0] and rows[inside, -2].min() > 0
        return rows[inside].T if forwards else None

    def next_turns(self, number: int, turns: int) -> Array | None:
        """Integrates further turns of a motion with small errors, without advancing it.

        Args:
            number: Number of the motion.
            turns: Number of turns of the crank.

        Returns:
            Phases at equal times, of shape (k, n); None if the crank does not turn so far.
        """
        from scipy.integrate import solve_ivp

        start = self.phases[-1][:, number]
        end = start[0] + 2 * math.pi * turns

        def slopes(_: float, phase: Array) -> Array:
            return self._slopes(phase)

        def is_left(_: float, phase: Array) -> float:
            return float(min(end - phase[0], phase[-2]))

        is_left.terminal = True  # type: ignore[attr-defined]  # as SciPy requires
        span = 0.0, _LONGEST * turns / self.pace
        with np.errstate(all='ignore'):
            course = solve_ivp(
                slopes, span, start, 'DOP853', dense_output=True, events=is_left, rtol=_FINE,
                atol=_FINE,
            )  # fmt: skip
        if course.status != 1 or course.y[0, -1] < end - math.pi:
            return None
        found: Array = course.sol(np.linspace(0, course.t[-1], _SAMPLES * turns, endpoint=False))
        return found

    def assembly(self, number: int) -> str:
        """Returns the assembly of a motion in its last turns."""
        phases = np.array([phase[:, number] for phase in self.phases[-_KEPT:]]).T
        return assembly(phases[1], phases[2])

    def speeds(self, number: int) -> Array:
        """Returns the mean speed of each of the last turns, rad/s; empty if one was backwards."""
        kept = self.phases[-_KEPT:], self.times[-_KEPT:]
        crank, speed, times = np.array([
            (phase[0, number], phase[-2, number], time[number])
            for phase, time in zip(*kept, strict=True)
        ]).T  # fmt: skip
        moved = np.insert(np.diff(crank) != 0, 0, values=True)
        crank, speed, times = crank[moved], speed[moved], times[moved]
        if len(crank) == 1 or speed.min() <= 0:
            return np.zeros(0)
        turn = 2 * math.pi
        ends = turn * np.arange(math.ceil(crank[0] / turn), math.floor(crank[-1] / turn) + 1)
        # Cubic curves through the times, with slopes 1 / speed.
        before = np.clip(np.searchsorted(crank, ends) - 1, 0, len(crank) - 2)
        wide, late = np.diff(crank)[before], np.diff(times)[before]
        share = (ends - crank[before]) / wide
        bends = wide / speed[before] - late, late - wide / speed[before + 1]
        bulge = share * (1 - share) * ((1 - share) * bends[0] + share * bends[1])
        found: Array = turn / np.diff(times[before] + share * late + bulge)
        return found
