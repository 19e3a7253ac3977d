# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Integrators of motion under a torque, from one requested time to the next.

Each begins at the start of an initial value problem. `at` integrates to a time not before the last
one, s, and returns the phase: coordinates, the crank with all its turns, then their rates. `gap`
is then the gap of the loop, m. The package's own methods are those of live runs
(motion/fixed_step_integrator.py) and of records (motion/adaptive_integrator.py).
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
_END = 1e10  # s, longer than any run
_MOST_STEPS = 500  # between two times; with more the solver counts as stuck


def _gap(solver: Solver, phase: Phase) -> float:
    """The gap at coordinates; they close the loop up to rounding errors."""
    half = len(phase) // 2
    state = solver.state(phase[:half], phase[half:], (0.0,) * half)
    return loop_residual(solver.structure, state)


class OfPackage:
    """The package's own steps, which reduce the crank angle and count its turns."""

    def __init__(self, problem: InitialValueProblem, begin: Integrate) -> None:
        self._steps = begin(problem.driven, problem.start)

    def at(self, time: float) -> Phase:
        """See above."""
        steps = self._steps
        steps.advance(time)
        moment = published(steps.driven, steps.phase, steps.pairs)
        return moment.unwrapped, *moment.q[1:], *moment.u

    def gap(self) -> float:
        """See above; in the current coordinates."""
        return _gap(self._steps.driven.solver, self._steps.phase)


class RungeKutta4:
    """The classical textbook method of order 4 in equal steps, without error control."""

    def __init__(self, problem: InitialValueProblem, step: float) -> None:
        self._driven, self._phase = problem.driven, problem.start
        self._longest, self._time = step, 0.0

    def at(self, time: float) -> Phase:
        """See above."""
        span, slope, y = time - self._time, self._driven.slope, self._phase
        steps = max(1, math.ceil(span / self._longest * (1 - 1e-9)))
        h = span / steps
        for _ in range(steps):
            k1 = slope(y)
            k2 = slope(_moved(y, h / 2, k1))
            k3 = slope(_moved(y, h / 2, k2))
            k4 = slope(_moved(y, h, k3))
            sums = [a + 2 * (b + c) + d for a, b, c, d in zip(k1, k2, k3, k4, strict=True)]
            y = _moved(y, h / 6, sums)
        self._time, self._phase = time, y
        return y

    def gap(self) -> float:
        """See above."""
        return _gap(self._driven.solver, self._phase)


def _moved(phase: Phase, h: float, slope: Sequence[float]) -> Phase:
    """Moves along one slope; a sixth faster than the sums of fixed_step_integrator.py."""
    return tuple([value + h * rate for value, rate in zip(phase, slope, strict=True)])


class OfScipy:
    """One of SciPy's solvers, with its own dense output between steps."""

    def __init__(self, problem: InitialValueProblem, solver: str, tolerance: float) -> None:
        """Starts at t = 0.

        Args:
            problem: The motion and its start.
            solver: Name of the class in scipy.integrate.
            tolerance: Tolerance, relative, and absolute in rad and crank lengths.
        """
        self._problem = problem
        self._values, units = self._begin()
        self._steps: Any = getattr(integrate, solver)(
            self._slope, 0.0, np.array(self._values), _END, first_step=_FIRST_STEP,
            rtol=tolerance, atol=tolerance * np.array(units),
        )  # fmt: skip
        self._between: Any = None

    def _begin(self) -> tuple[Phase, Phase]:
        """The values at t = 0, and their units."""
        return self._problem.start, self._problem.driven.units

    def _slope(self, _: float, values: Array) -> Array:
        return np.array(self._problem.driven.slope(tuple(values.tolist())))

    def at(self, time: float) -> Phase:
        """See above.

        Raises:
            ArithmeticError: The solver makes no progress.
        """
        steps = self._steps
        for _ in range(_MOST_STEPS):
            if steps.t >= time:
                self._values = tuple(self._between(time).tolist())
                return self._values
            with np.errstate(all='ignore'):  # the caller detects values that are not finite
                message = steps.step()
            if steps.status == 'failed':
                raise ArithmeticError(message)
            self._between = steps.dense_output()
            self._correct(steps)
        raise ArithmeticError(f'the steps from {steps.t} s on are too short to get anywhere')

    def _correct(self, steps: Any) -> None:
        """Changes the values at the end of a step."""

    def gap(self) -> float:
        """See above."""
        return _gap(self._problem.driven.solver, self._values)


class Multipliers(OfScipy):
    """The multibody equations in doubles, integrated by DOP853.

    The unstabilised equations enforce only the second derivative of the constraints: a position
    error persists, and a velocity error opens the loop steadily. Baumgarte stabilisation,
    gap'' + 2 k gap' + k^2 gap = 0, makes the gap decay; a projection closes the loop after every
    step, by the shortest way in the metric of the masses.
    """

    def __init__(
        self,
        problem: InitialValueProblem,
        tolerance: float,
        *,
        closing: float = 0.0,
        projects: bool = False,
    ) -> None:
        """Starts at t = 0 and closes the loop.

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
        problem, count = self._problem, self._problem.count
        q, u = problem.start[:count], problem.start[count:]
        state = problem.driven.solver.state(q, u, (0.0,) * count)
        length = problem.mechanism.crank.length
        units = tuple(length if slides else 1.0 for slides in self._bodies.slides)
        return (*state.position, *state.velocity), units * 2

    def _places(self, values: Sequence[float]) -> list[Vector]:
        pairs = zip(values, self._bodies.slides, strict=False)
        return [Vector(x, 0.0) if slides else Vector.at(x) for x, slides in pairs]

    def _slope(self, _: float, values: Array) -> Array:
        half, row = len(values) // 2, values.tolist()
        rates, places = row[half:], self._places(row)
        matrix, right = self._bodies.system(places, rates)
        right[0] += self._problem.motor.at(rates[0])
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
        for _ in range(2):  # the second step corrects the nonlinearity of the first
            row = values.tolist()
            places, rates = self._places(row), row[half:]
            matrix, _ = self._bodies.system(places, rates)
            gaps = np.zeros((len(matrix), 2))
            gaps[half:, 0] = self._bodies.gap(places)
            gaps[half:, 1] = np.array(matrix)[half:, :half] @ rates
            values = values - np.linalg.solve(matrix, gaps)[:half].T.ravel()
        return values

    def at(self, time: float) -> Phase:
        """See above."""
        values = super().at(time)
        if self._projects:
            values = self._values = tuple(self._projected(np.array(values)).tolist())
        places, rates = values[: len(values) // 2], values[len(values) // 2 :]
        return places[0], *places[3:], rates[0], *rates[3:]

    def gap(self) -> float:
        """See above."""
        return math.hypot(*self._bodies.gap(self._places(self._values)))
