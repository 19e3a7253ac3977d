# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The ways to follow a motion under a torque, each asked for one time after another.

The package's own are those of live runs (motion/fixed_step_integrator.py) and of records
(motion/adaptive_integrator.py).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy import integrate

from linkage_ros.dynamics.state import loop_residual
from linkage_ros.lab.methods.cut_loop import CutLoop, Number, Row
from linkage_ros.lab.methods.problems import InitialValueProblem, Phase
from linkage_ros.motion.fixed_step_integrator import Integrate
from linkage_ros.numeric import Array, with_turns

_FIRST_STEP = 1e-4  # s
_END = 1e10  # s, which no run reaches
_MOST_STEPS = 500  # from one time to the next: with more it is stuck


class Follower:
    """A motion on its way.

    Attributes:
        problem: The motion and its start.
        phase: Where it is: coordinates, the crank with all its turns, then their rates.
    """

    def __init__(self, problem: InitialValueProblem) -> None:
        self.problem, self.phase = problem, problem.start

    def at(self, time: float) -> Phase:
        """Follows the motion to a time.

        Args:
            time: Not before the one before, s.

        Returns:
            The phase there.
        """
        self.phase = self._advance(time)
        return self.phase

    def gap(self) -> float:
        """By how much the loop does not close, m: from coordinates it is closed every time."""
        solver, count = self.problem.driven.solver, self.problem.count
        q, u = self.phase[:count], self.phase[count:]
        return loop_residual(solver.structure, solver.state(q, u, (0.0,) * count))

    def _advance(self, time: float) -> Phase:
        raise NotImplementedError


class OfPackage(Follower):
    """The package's own steps, which wind the crank angle and count its turns."""

    def __init__(self, problem: InitialValueProblem, begin: Integrate) -> None:
        """Begins at t = 0.

        Args:
            problem: The motion and its start.
            begin: Makes the steps.
        """
        super().__init__(problem)
        self._steps = begin(problem.driven, problem.start)

    def _advance(self, time: float) -> Phase:
        steps = self._steps
        steps.advance(time)
        return with_turns(steps.phase[0], steps.pairs), *steps.phase[1:]


class RungeKutta4(Follower):
    """The classical method of order 4 in equal steps, as textbooks have it: nothing is checked."""

    def __init__(self, problem: InitialValueProblem, step: float) -> None:
        """Begins at t = 0.

        Args:
            problem: The motion and its start.
            step: Longest, s.
        """
        super().__init__(problem)
        self._longest, self._time = step, 0.0

    def _advance(self, time: float) -> Phase:
        start, span, slope = self._time, time - self._time, self.problem.driven.slope
        steps = math.ceil(span / self._longest * (1 - 1e-9))
        y = self.phase
        for i in range(steps):
            h = span / steps
            t = start + i * h
            k1 = slope(t, y)
            k2 = slope(t + h / 2, _moved(y, h / 2, k1))
            k3 = slope(t + h / 2, _moved(y, h / 2, k2))
            k4 = slope(t + h, _moved(y, h, k3))
            sums = [a + 2 * (b + c) + d for a, b, c, d in zip(k1, k2, k3, k4, strict=True)]
            y = _moved(y, h / 6, sums)
        self._time = time
        return y


class OfScipy(Follower):
    """One of SciPy's solvers as it is, read between its steps by its own continuous solution."""

    def __init__(
        self,
        problem: InitialValueProblem,
        solver: str,
        tolerance: float,
        start: Phase | None = None,
        units: Phase | None = None,
    ) -> None:
        """Begins at t = 0.

        Args:
            problem: The motion and its start.
            solver: The class's name in scipy.integrate.
            tolerance: Relative, and absolute in rad and crank lengths.
            start: Another one than the problem's.
            units: Others than the problem's.
        """
        super().__init__(problem)
        self._steps: Any = getattr(integrate, solver)(
            self._slope, 0.0, np.array(start or problem.start), _END, first_step=_FIRST_STEP,
            rtol=tolerance, atol=tolerance * np.array(units or problem.driven.units),
        )  # fmt: skip
        self._between: Any = None

    def _slope(self, time: float, phase: Array) -> Array:
        return np.array(self.problem.driven.slope(time, tuple(phase.tolist())))

    def _advance(self, time: float) -> Phase:
        steps = self._steps
        for _ in range(_MOST_STEPS):
            if steps.t >= time:
                found: list[float] = self._between(time).tolist()
                return tuple(found)
            with np.errstate(all='ignore'):  # what is not finite is seen by who asked
                message = steps.step()
                if steps.status == 'failed':
                    raise ArithmeticError(message)
                self._between = steps.dense_output()
        raise ArithmeticError(f'the steps from {steps.t} s on are too short to get anywhere')


class Multipliers(OfScipy):
    """The loop cut open (`cut_loop`), followed by DOP853; nothing closes it again.

    Constraints hold in their second derivatives alone: what is lost stays lost, and a rate that
    is lost opens the loop further and further.
    """

    def __init__(self, problem: InitialValueProblem, tolerance: float) -> None:
        """Begins at t = 0, with the loop closed.

        Args:
            problem: The motion and its start.
            tolerance: Relative, and absolute in rad and crank lengths.
        """
        self._loop = CutLoop(problem.mechanism, float, lambda x: (math.cos(x), math.sin(x)))
        self._count = 4 if self._loop.slides else 3
        q, u = problem.start[: problem.count], problem.start[problem.count :]
        state = problem.driven.solver.state(q, u, (0.0,) * problem.count)
        start = *state.position[: self._count], *state.velocity[: self._count]
        units = (1.0, 1.0, 1.0, problem.mechanism.crank.length)[: self._count] * 2
        self._values: Sequence[float] = start
        super().__init__(problem, 'DOP853', tolerance, start, units)

    def _slope(self, _: float, phase: Array) -> Array:
        values, count, motor = phase.tolist(), self._count, self.problem.motor
        spins = values[count : count + 3]
        found = self._loop.accelerations(
            _directions(values), spins, values[-1] if self._loop.slides else None,
            motor.at(spins[0]), _solve,
        )  # fmt: skip
        return np.array([*values[count:], *found])

    def _advance(self, time: float) -> Phase:
        values = self._values = super()._advance(time)
        return tuple([values[i] for i in ((0, 3, 4, 7) if self._loop.slides else (0, 3))])

    def gap(self) -> float:
        """By how much the loop does not close by now, m."""
        place = self._values[3] if self._loop.slides else None
        return math.hypot(*self._loop.gap(_directions(self._values), place))


def _directions(values: Sequence[float]) -> list[tuple[float, float]]:
    return [(math.cos(angle), math.sin(angle)) for angle in values[:3]]


def _solve(rows: list[Row], right: Row) -> list[Number]:
    found: list[Number] = np.linalg.solve(np.array(rows), np.array(right)).tolist()
    return found


def _moved(phase: Phase, h: float, slope: Sequence[float]) -> Phase:
    """Along one slope: by the weighted sum of fixed_step_integrator.py it costs a sixth more."""
    return tuple([value + h * rate for value, rate in zip(phase, slope, strict=True)])
