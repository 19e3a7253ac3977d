# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Integrators for motion under a torque.

Each integrator starts at the initial values of a problem. `at(time)` integrates to a time, s, not
earlier than the previous one, and returns the phase: coordinates, then rates, with an unwrapped
crank angle. `Multipliers` returns positions, then rates, of all links. The package has one method
for live runs and one for records (motion/steps.py).
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy import integrate

from linkage_lab.reference.motions import InitialValueProblem, Phase, halves
from linkage_lab.reference.multibody import Multibody
from linkage_ros.formulas import Array, Vector
from linkage_ros.internals import published

_FIRST_STEP = 1e-4  # s
_END = 1e10  # s, longer than any run
_MOST_STEPS = 500  # maximum between two times; a solver that needs more is considered stuck


class OfPackage:
    """The package's own integrators, which switch coordinates and count crank turns."""

    def __init__(self, problem: InitialValueProblem, begin: Callable[..., Any]) -> None:
        self._steps = begin(problem.driven, problem.start)

    def at(self, time: float) -> Phase:
        """See the module docstring."""
        steps = self._steps
        steps.advance(time)
        moment = published(steps.driven, steps.phase, steps.pairs)
        return moment.unwrapped, *moment.q[1:], *moment.u


class RungeKutta4:
    """The classical fourth-order Runge-Kutta method, with equal steps and no error control."""

    def __init__(self, problem: InitialValueProblem, step: float) -> None:
        self._slope, self._longest = problem.driven.slope, step
        self._time, self._phase = 0.0, problem.start

    def at(self, time: float) -> Phase:
        """See the module docstring."""
        span, slope, y = time - self._time, self._slope, self._phase
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


def _moved(phase: Phase, h: float, slope: Sequence[float]) -> Phase:
    """Advances a phase by `h` along a slope; a sixth faster than `runge_kutta.moved`."""
    return tuple([value + h * rate for value, rate in zip(phase, slope, strict=True)])


class OfScipy:
    """A SciPy solver; its dense output interpolates between steps."""

    def __init__(
        self,
        problem: InitialValueProblem,
        solver: str,
        tolerance: float,
        start: Phase | None = None,
        units: Phase | None = None,
    ) -> None:
        """Starts a solver of scipy.integrate by name.

        If the values to integrate are a phase, `tolerance` is relative to `units`: rad and crank
        lengths, and the same per second for rates.
        """
        self._driven = problem.driven
        self._steps: Any = getattr(integrate, solver)(
            lambda _, values: self._slope(values), 0.0, np.array(start or problem.start), _END,
            first_step=_FIRST_STEP, rtol=tolerance,
            atol=tolerance * np.array(units or problem.driven.units),
        )  # fmt: skip
        self._between: Callable[[float], Array]

    def _slope(self, values: Array) -> Array:
        return np.array(self._driven.slope(tuple(values.tolist())))

    def _correct(self, steps: Any) -> None:
        """Corrects the values after a step; does nothing by default."""

    def at(self, time: float) -> Phase:
        """See the module docstring.

        Raises:
            ArithmeticError: The solver makes no progress.
        """
        steps = self._steps
        for _ in range(_MOST_STEPS):
            if steps.t >= time:
                return tuple(self._between(time).tolist())
            with np.errstate(all='ignore'):  # the caller detects values that are not finite
                message = steps.step()
            if steps.status == 'failed':
                raise ArithmeticError(message)
            self._between = steps.dense_output()
            self._correct(steps)
        raise ArithmeticError(f'the steps from {steps.t} s on are too short to make progress')


class Multipliers(OfScipy):
    """The multibody equations in doubles, integrated by DOP853.

    The unstabilised equations enforce only the second derivative of the constraints: a position
    error persists, and a velocity error opens the loop steadily. Baumgarte stabilisation,
    gap'' + 2 k gap' + k^2 gap = 0, makes the gap decay. A projection after every step closes the
    loop with the smallest change in the mass metric.
    """

    def __init__(
        self,
        problem: InitialValueProblem,
        tolerance: float,
        *,
        closing: float = 0.0,
        projects: bool = False,
    ) -> None:
        """Starts the integration.

        Args:
            problem: The motion and its start.
            tolerance: Relative and absolute tolerance; see `OfScipy`.
            closing: Parameter k of Baumgarte stabilisation, 1/s; 0 disables it.
            projects: Whether to project onto the closed loop after every step.
        """
        self._bodies = Multibody(problem.mechanism, float, Vector.at)
        self._closing, self._projects = closing, projects
        state = problem.driven.solver.state(*halves(problem.start))
        length = problem.mechanism.crank.length
        units = tuple(length if slides else 1.0 for slides in self._bodies.slides)
        start = *state.position, *state.velocity
        super().__init__(problem, 'DOP853', tolerance, start, units * 2)

    def _split(self, values: Sequence[float]) -> tuple[list[Vector], list[float]]:
        """Splits values into the links' positions, as `Multibody.gap` needs them, and rates."""
        half = len(values) // 2
        pairs = zip(values, self._bodies.slides, strict=False)
        places = [Vector(x, 0.0) if slides else Vector.at(x) for x, slides in pairs]
        return places, list(values[half:])

    def _slope(self, values: Array) -> Array:
        places, rates = self._split(values.tolist())
        count, k = len(rates), self._closing
        # The first rows and columns are those of the links, the others those of the gaps.
        matrix, right = self._bodies.system(places, rates)
        right[0] += self._driven.torque(rates[0])
        if k:
            for i, gap in enumerate(self._bodies.gap(places), start=count):
                gap_rate = np.dot(matrix[i][:count], rates)
                right[i] -= k * (2 * gap_rate + k * gap)
        return np.array([*rates, *np.linalg.solve(matrix, right)[:count]])

    def _correct(self, steps: Any) -> None:
        steps.y = self._projected(steps.y)
        if self._projects:
            steps.f = self._slope(steps.y)

    def _projected(self, values: Array) -> Array:
        """Projects values onto the closed loop, unless projection is disabled."""
        if not self._projects:
            return values
        for _ in range(2):  # the second step corrects the first's nonlinearity
            places, rates = self._split(values.tolist())
            count, (matrix, _) = len(rates), self._bodies.system(places, rates)
            jacobian: Array = np.array(matrix)[count:, :count]
            # A column for the positions, and one for the rates.
            gaps = np.zeros((len(matrix), 2))
            gaps[count:, 0] = self._bodies.gap(places)
            gaps[count:, 1] = jacobian @ rates
            values = values - np.linalg.solve(matrix, gaps)[:count].T.ravel()
        return values

    def at(self, time: float) -> Phase:
        """See the module docstring."""
        return tuple(self._projected(np.array(super().at(time))).tolist())
