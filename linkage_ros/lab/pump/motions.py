# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Integrates motions of a wind pump from many starts at once.

Each motion has its own step lengths, by Dormand and Prince's method of order 5. A step of many
motions takes little longer than a step of one. A motion that stretches the dyad is continued
separately in other coordinates.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from linkage_ros.errors import LinkageError
from linkage_ros.lab.pump.equations import PumpSolver
from linkage_ros.motion.driven_mechanism import DrivenMechanism
from linkage_ros.motion.drives import Motor
from linkage_ros.motion.fixed_step_integrator import DORMAND_PRINCE, FixedSteps
from linkage_ros.numeric import Array

_TOLERANCE = 5e-4  # of a step, in rad, crank lengths, and these per second at the motor's speed
_SHORTEST = 1e-5  # step, of the time of a radian
_PAUSE = 10  # steps until motions outside the coordinates are continued in others
_KEPT = 400  # steps that are searched for the last turns
# In other coordinates: longest step, s, tolerance, and longest time, of the time of a radian.
_LONGEST, _ROUGH, _PATIENCE = 0.04, 1e-3, 6.0
_GONE = 150.0  # in the same unit; after this time, the motion is not continued
_CALM = 10  # steps in which the first coordinates must be suitable before they are used again


class Motions:
    """Motions from many starts.

    Attributes:
        active: Numbers of the motions still integrated; the others have stopped.
        ends: By number: the place of a motion outside this assembly, or the reason for its end.
        times: At all steps, s; each of shape (n).
        phases: Crank angle, rad, slider position, m, and their rates; each of shape (4, n).
    """

    def __init__(self, solver: PumpSolver, motor: Motor, starts: Array) -> None:
        """Starts the motions at t = 0.

        Args:
            solver: Solver of the pump.
            motor: Motor of the pump.
            starts: Crank angle, rad, slider position, m, and their rates, of shape (4, n).
        """
        self._solver, self._motor = solver, motor
        self._driven = DrivenMechanism(solver, motor.at)
        self._pace = max(starts[2].max(), motor.torque / motor.damping if motor.damping else 0.0)
        r = solver.mechanism.crank.length
        self._units = np.array((1.0, r, self._pace, self._pace * r))[:, None]
        self._slope = self._slopes(starts)
        self._step = np.full(starts.shape[1], 0.1 / self._pace)
        self._leaves: Any = np.isnan(self._slope).any(axis=0)
        self.active: Any = np.arange(starts.shape[1])
        self._away: dict[int, FixedSteps] = {}
        self.ends: dict[int, str] = {}
        self.times, self.phases = [np.zeros(starts.shape[1])], [starts.copy()]

    def advance(self, steps: int) -> None:
        """Advances all motions by a number of steps, some of which are repeated."""
        with np.errstate(all='ignore'):  # non-finite values have no slope
            for step in range(steps):
                self._try()
                if step % _PAUSE == 0:
                    for number in np.flatnonzero(self._leaves).tolist():
                        if number in self._away or number not in self.ends:
                            self._carry(number)

    def _try(self) -> None:
        on, phases, times = self.active, self.phases[-1].copy(), self.times[-1].copy()
        h, start, slopes = self._step[on], phases[:, on], np.empty((7, 4, len(on)))
        slopes[0] = self._slope[:, on]
        for stage, row in enumerate((*DORMAND_PRINCE.stages, DORMAND_PRINCE.end), 1):
            end = start + h * np.tensordot(row, slopes[:stage], 1)
            slopes[stage] = self._slopes(end)
        error = h * np.tensordot(DORMAND_PRINCE.error, slopes, 1) / self._units
        worst = np.nan_to_num(np.abs(error).max(axis=0) / _TOLERANCE, nan=np.inf)
        good = (worst <= 1) & ~self._leaves[on]
        times[on] += np.where(good, h, 0.0)
        phases[:, on] = np.where(good, end, start)
        self.times.append(times)
        self.phases.append(phases)
        self._slope[:, on] = np.where(good, slopes[-1], slopes[0])
        self._step[on] = h * np.clip(0.9 * np.maximum(worst, 1e-9) ** -0.2, 0.2, 4.0)
        self._leaves |= self._step < _SHORTEST / self._pace

    def _slopes(self, phases: Array) -> Array:
        return self._solver.slopes(self._motor.at(phases[2]), *phases)

    def _carry(self, number: int) -> None:
        """Follows one motion in other coordinates until the first ones are suitable again."""
        phase, calm = self.phases[-1][:, number], 0
        start = tuple(phase.tolist())
        try:
            steps = self._away.get(number) or FixedSteps(self._driven, start, _LONGEST, _ROUGH)
            begin = steps.time
            while calm < _CALM and steps.time < begin + _PATIENCE / self._pace:
                steps.advance(steps.time + _LONGEST)
                is_own = steps.driven.solver.description == self._solver.description
                calm = calm + 1 if is_own else 0
        except LinkageError as error:
            self.ends[number] = str(error)
            self._away.pop(number, None)
            return
        self._away[number], self.ends[number] = steps, 'it goes over to the other assembly'
        self.times[-1][number] += steps.time - begin
        if calm == _CALM:
            phase[:] = steps.driven.crank(steps.phase, steps.pairs), *steps.phase[1:]
            self._step[number], self._leaves[number] = 0.1 / self._pace, False
            self._slope[:, number] = self._slopes(phase[:, None])[:, 0]
            del self._away[number], self.ends[number]
        elif steps.time > _GONE / self._pace:
            del self._away[number]

    def last_turns(self, number: int, turns: int) -> Array | None:
        """The last turns of a motion.

        Args:
            number: Number of the motion.
            turns: Of the crank, forwards.

        Returns:
            Phases, of shape (4, steps); None if it has ended or has turned backwards.
        """
        if number in self.ends:
            return None
        rows = np.array([phase[:, number] for phase in self.phases[-_KEPT:]])
        inside = rows[:, 0] > rows[-1, 0] - 2 * math.pi * turns
        forwards = not inside[0] and rows[inside, 2].min() > 0
        return rows[inside].T if forwards else None
