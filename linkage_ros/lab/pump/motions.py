# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Integrates motions of a wind pump from many starts at once.

Each motion is integrated by Dormand and Prince's method of order 5, with its own step lengths. A
step of many motions takes little longer than a step of one motion.
"""

import math
from collections.abc import Iterable
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
_FINE, _SAMPLES = 1e-7, 128  # tolerance of further turns, and samples per turn
_KEPT = 400  # steps that are searched for the last turns
_LONGEST = 75.0  # longest time for a further turn, relative to that for 1 rad at no load
# For motions that alternate between the assemblies.
_PERIODS = 1, 2, 4  # turns
_TURNS = 16  # last turns, all of which must repeat: a slowing motion repeats for a few turns
# Largest relative differences of the speeds of turns that repeat, and of the means of two halves.
_REPEATS, _DRIFT = 0.015, 0.001
_LEAST = 0.02  # smallest share of the starts; fewer starts may repeat by chance
# Largest relative difference in mean speed of equal motions, and of a motion and the state that it
# approaches.
_SAME, _ON_ITS_WAY = 0.005, 0.02


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
        """Advances all motions by a number of steps, including rejected steps."""
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
        rows = self._last_steps(number)
        inside = rows[0] > rows[0, -1] - 2 * math.pi * turns
        forwards = not inside[0] and rows[-2, inside].min() > 0
        return rows[:, inside] if forwards else None

    def _last_steps(self, number: int) -> Array:
        """Returns the phases of a motion after its last steps, of shape (k, steps)."""
        return np.array([phase[:, number] for phase in self.phases[-_KEPT:]]).T

    def next_turns(self, number: int, turns: int) -> Array | None:
        """Integrates further turns of a motion with small errors, without advancing it.

        Args:
            number: Number of the motion.
            turns: Number of turns of the crank.

        Returns:
            Phases at equal time intervals, of shape (k, n); None if the crank stops before.
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
        return course.sol(np.linspace(0, course.t[-1], _SAMPLES * turns, endpoint=False))

    def assembly(self, number: int) -> str:
        """Returns the assembly of a motion in its last turns."""
        phases = self._last_steps(number)
        return assembly(phases[1], phases[2])

    def speeds(self, number: int) -> Array:
        """Returns the mean speed of each of the last turns, rad/s; empty if one was backwards."""
        phases = self._last_steps(number)
        moved = np.insert(np.diff(phases[0]) != 0, 0, values=True)
        crank, speed = phases[0, moved], phases[-2, moved]
        times = np.array([time[number] for time in self.times[-_KEPT:]])[moved]
        if len(crank) == 1 or speed.min() <= 0:
            return np.zeros(0)
        turn = 2 * math.pi
        ends = turn * np.arange(math.ceil(crank[0] / turn), math.floor(crank[-1] / turn) + 1)
        return turn / np.diff(cubic(crank, times, 1 / speed, ends))


def cubic(at: Array, values: Array, slopes: Array, wanted: Array) -> Array:
    """Evaluates the piecewise cubic curve through given values with given slopes.

    Args:
        at: Increasing x of the values, of shape (n).
        values: The values.
        slopes: Slopes of the curve at the values.
        wanted: The x at which the curve is evaluated.
    """
    before = np.clip(np.searchsorted(at, wanted) - 1, 0, len(at) - 2)
    wide, rise = np.diff(at)[before], np.diff(values)[before]
    share = (wanted - at[before]) / wide
    bends = slopes[before] * wide - rise, rise - slopes[before + 1] * wide
    bulge = share * (1 - share) * ((1 - share) * bends[0] + share * bends[1])
    return values[before] + share * rise + bulge


def alternating_motions(
    courses: Iterable[Array], known: Iterable[float], starts: int
) -> list[dict[str, Any]]:
    """Groups motions that alternate between the assemblies and repeat after 1, 2 or 4 turns.

    They were not found as Fourier series, for example because the crank nearly stops in each
    period.

    Args:
        courses: For each alternating motion without a known state, the mean speeds of its last
            turns, rad/s.
        known: Mean speeds of the known states, rad/s; a motion near one of them may be approaching
            it.
        starts: Number of all starts.

    Returns:
        Records with the period in turns, the mean speed of the motion and of each turn of the
        period, rad/s, the slowest turn first, and the share of the starts.
    """
    found: list[dict[str, Any]] = []
    for speeds in filter(None, map(_period, courses)):
        period, mean = len(speeds), len(speeds) / sum(1 / speed for speed in speeds)
        same = [
            one for one in found
            if one['period'] == period and abs(mean / one['speed'] - 1) < _SAME
        ]  # fmt: skip
        if same:
            same[0]['share_of_starts'] += 1 / starts
        elif all(abs(mean / speed - 1) > _ON_ITS_WAY for speed in known):
            found.append({
                'period': period, 'speed': mean, 'speeds': speeds, 'share_of_starts': 1 / starts,
            })  # fmt: skip
    return [one for one in found if one['share_of_starts'] >= _LEAST]


def _period(speeds: Array) -> list[float]:
    """Returns the speeds of the turns of a period, the slowest first; empty without a period."""
    if len(speeds) < _TURNS:
        return []
    last = speeds[-_TURNS:]
    early, late = last.reshape(2, -1).mean(axis=1)
    for period in _PERIODS:
        turns = last[-period:]
        repeats = np.abs(last.reshape(-1, period) / turns - 1).max() < _REPEATS
        if repeats and abs(early / late - 1) < _DRIFT:
            return np.roll(turns, -turns.argmin()).tolist()
    return []
