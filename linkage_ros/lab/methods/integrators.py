# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Methods of integrating motion under a torque, to one time after another.

The package's own are those of live runs (motion/fixed_step_integrator.py) and of records
(motion/adaptive_integrator.py).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy import integrate

from linkage_ros.dynamics.solver import Solver
from linkage_ros.dynamics.state import loop_residual
from linkage_ros.formulas import Vector
from linkage_ros.lab.reference.multibody import Multibody
from linkage_ros.lab.reference.problems import InitialValueProblem, Phase
from linkage_ros.motion.fixed_step_integrator import Integrate
from linkage_ros.motion.published import published
from linkage_ros.numeric import Array

_FIRST_STEP = 1e-4  # s
_END = 1e10  # s, which no run reaches
_MOST_STEPS = 500  # from one time to the next: with more it is stuck


class Follower:
    """A motion being integrated.

    Attributes:
        problem: The motion and its start.
        phase: Coordinates, the crank with all its turns, then their rates.
    """

    def __init__(self, problem: InitialValueProblem) -> None:
        self.problem, self.phase = problem, problem.start

    def at(self, time: float) -> Phase:
        """Integrates the motion to a time not before the last one, s; returns the phase."""
        self.phase = self._advance(time)
        return self.phase

    def gap(self) -> float:
        """Gap of the loop, m: 0, because coordinates always close it."""
        solver, count = self.problem.driven.solver, self.problem.count
        return _gap(solver, self.phase[:count], self.phase[count:])

    def _advance(self, time: float) -> Phase:
        raise NotImplementedError


def _gap(solver: Solver, q: Phase, u: Phase) -> float:
    return loop_residual(solver.structure, solver.state(q, u, (0.0,) * len(q)))


class OfPackage(Follower):
    """The package's own steps, which reduce the crank angle and count its turns."""

    def __init__(self, problem: InitialValueProblem, begin: Integrate) -> None:
        super().__init__(problem)
        self._steps = begin(problem.driven, problem.start)

    def _advance(self, time: float) -> Phase:
        steps = self._steps
        steps.advance(time)
        moment = published(steps.driven, steps.phase, steps.pairs)
        return moment.unwrapped, *moment.q[1:], *moment.u

    def gap(self) -> float:
        """See `Follower`: in the coordinates that describe it now."""
        phase, half = self._steps.phase, len(self._steps.phase) // 2
        return _gap(self._steps.driven.solver, phase[:half], phase[half:])


class RungeKutta4(Follower):
    """The classical textbook method of order 4 in equal steps, without error control."""

    def __init__(self, problem: InitialValueProblem, step: float) -> None:
        super().__init__(problem)
        self._longest, self._time = step, 0.0

    def _advance(self, time: float) -> Phase:
        span, slope = time - self._time, self.problem.driven.slope
        steps = math.ceil(span / self._longest * (1 - 1e-9))
        y, h = self.phase, span / max(steps, 1)
        for _ in range(steps):
            k1 = slope(y)
            k2 = slope(_moved(y, h / 2, k1))
            k3 = slope(_moved(y, h / 2, k2))
            k4 = slope(_moved(y, h, k3))
            sums = [a + 2 * (b + c) + d for a, b, c, d in zip(k1, k2, k3, k4, strict=True)]
            y = _moved(y, h / 6, sums)
        self._time = time
        return y


class OfScipy(Follower):
    """One of SciPy's solvers, with its own dense output between steps."""

    def __init__(self, problem: InitialValueProblem, solver: str, tolerance: float) -> None:
        """Begins at t = 0.

        Args:
            problem: The motion and its start.
            solver: Name of the class in scipy.integrate.
            tolerance: Tolerance, relative, and absolute in rad and crank lengths.
        """
        super().__init__(problem)
        start, units = self._begin()
        self._steps: Any = getattr(integrate, solver)(
            self._slope, 0.0, np.array(start), _END, first_step=_FIRST_STEP,
            rtol=tolerance, atol=tolerance * np.array(units),
        )  # fmt: skip
        self._between: Any = None

    def _begin(self) -> tuple[Phase, Phase]:
        """The values at t = 0, and their units."""
        return self.problem.start, self.problem.driven.units

    def _slope(self, _: float, values: Array) -> Array:
        return np.array(self.problem.driven.slope(tuple(values.tolist())))

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
                self._correct(steps)
        raise ArithmeticError(f'the steps from {steps.t} s on are too short to get anywhere')

    def _correct(self, steps: Any) -> None:
        """Changes the values at the end of a step."""


class Multipliers(OfScipy):
    """The multibody equations in doubles, followed by DOP853.

    As they are, constraints hold in their second derivatives alone: an error stays, and an error
    of a rate opens the loop further and further. Baumgarte's equation for the gap,
    gap'' + 2 k gap' + k^2 gap = 0, lets it close again; a projection closes it after every step,
    by the shortest way in the metric of the masses.
    """

    def __init__(
        self,
        problem: InitialValueProblem,
        tolerance: float,
        *,
        closing: float = 0.0,
        projects: bool = False,
    ) -> None:
        """Begins at t = 0, with the loop closed.

        Args:
            problem: The motion and its start.
            tolerance: See `OfScipy`.
            closing: Baumgarte's k, 1/s.
            projects: Whether to project after every step.
        """
        self._bodies = Multibody(problem.mechanism, float, Vector.at)
        self._closing, self._projects = closing, projects
        super().__init__(problem, 'DOP853', tolerance)

    def _begin(self) -> tuple[Phase, Phase]:
        problem, count = self.problem, self.problem.count
        q, u = problem.start[:count], problem.start[count:]
        state = problem.driven.solver.state(q, u, (0.0,) * count)
        length = problem.mechanism.crank.length
        units = tuple(length if slides else 1.0 for slides in self._bodies.slides)
        self._values = *state.position, *state.velocity
        return self._values, units * 2

    def _places(self, values: Sequence[float]) -> list[Vector]:
        pairs = zip(values, self._bodies.slides, strict=False)
        return [Vector(x, 0.0) if slides else Vector.at(x) for x, slides in pairs]

    def _slope(self, _: float, values: Array) -> Array:
        half, row = len(values) // 2, values.tolist()
        rates, places = row[half:], self._places(row)
        matrix, right = self._bodies.system(places, rates)
        right[0] += self.problem.motor.at(rates[0])
        k = self._closing
        for i, gap in enumerate(self._bodies.gap(places) if k else (), half):
            right[i] -= k * (2 * np.dot(matrix[i][:half], rates) + k * gap)
        return np.array([*rates, *np.linalg.solve(matrix, right)[:half]])

    def _correct(self, steps: Any) -> None:
        if self._projects:
            steps.y = self._projected(steps.y)
            steps.f = self._slope(steps.t, steps.y)

    def _projected(self, values: Array) -> Array:
        """The nearest values that close the loop."""
        half = len(values) // 2
        for _ in range(2):  # the second takes up what is not linear in the first
            row = values.tolist()
            places, rates = self._places(row), row[half:]
            matrix, _ = self._bodies.system(places, rates)
            gaps = np.zeros((len(matrix), 2))
            gaps[half:, 0] = self._bodies.gap(places)
            gaps[half:, 1] = np.array(matrix)[half:, :half] @ rates
            values = values - np.linalg.solve(matrix, gaps)[:half].T.ravel()
        return values

    def _advance(self, time: float) -> Phase:
        self._values = super()._advance(time)
        if self._projects:
            self._values = tuple(self._projected(np.array(self._values)).tolist())
        rates = self._values[len(self._values) // 2 :]
        places = self._values[: len(rates)]
        return places[0], *places[3:], rates[0], *rates[3:]

    def gap(self) -> float:
        """Present gap of the loop, m."""
        return math.hypot(*self._bodies.gap(self._places(self._values)))


def _moved(phase: Phase, h: float, slope: Sequence[float]) -> Phase:
    """Moves along one slope, a sixth faster than by the sums of fixed_step_integrator.py."""
    return tuple([value + h * rate for value, rate in zip(phase, slope, strict=True)])
