# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Measures error, time and stability of an integrator on one motion under a torque."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from decimal import Decimal
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np

from linkage_ros.errors import LinkageError
from linkage_ros.lab.methods.chain import Method, Setting, label
from linkage_ros.lab.methods.outcomes import (
    DIVERGED,
    FAILURES,
    LIMIT,
    NAN,
    REFUSED,
    RIGHT,
    Outcome,
    Situation,
)
from linkage_ros.lab.reference.motions import MotionReference
from linkage_ros.lab.reference.problems import InitialValueProblem, Phase

TRAJECTORY, ENERGY, LOOP = 'trajectory', 'energy', 'loop'  # what is judged
# Of a whole motion; and what a live node has to be ready for, the slowest of its ticks.
MEAN, SLOWEST = 'motion', 'motion, slowest ms'
_ASKED = 0.05  # s between two states that are compared
_TICK = 1e-3  # s
_TICKS = 300  # of which the slowest is looked for, in a second of motion


class Run(NamedTuple):
    """The motion computed by a method.

    Attributes:
        phases: At the times that were asked for, as far as it came.
        gaps: Gaps of the loop at these times, m.
        failure: Why it stopped: REFUSED or NAN; None: it did not.
    """

    phases: list[Phase]
    gaps: list[float]
    failure: str | None = None


class MotionBench:
    """One motion, and its true phases.

    Attributes:
        problem: The motion and its start.
        times: Times at which states are compared, in order, s.
        rounds: Number of timings.
    """

    rounds = 3

    def __init__(
        self,
        problem: InitialValueProblem,
        times: Sequence[float],
        quantities: Sequence[str] = (TRAJECTORY,),
        at: Callable[[float], Sequence[Any]] | None = None,
    ) -> None:
        """Prepares it.

        Args:
            problem: The motion and its start.
            times: At which states are compared, s.
            quantities: What accuracy is measured of: TRAJECTORY, ENERGY or both.
            at: The true motion; by default it is followed in many digits.
        """
        self.problem, self.times, self._quantities = problem, tuple(times), quantities
        self._at = at or MotionReference(problem).at
        self._kinetic, potential = problem.energy(problem.start)
        self._energy = self._kinetic + potential
        self._runs: dict[tuple[Callable[..., Any], str], Run] = {}

    @cached_property
    def _exact(self) -> list[tuple[Decimal, ...]]:
        return [tuple(map(Decimal, self._at(time))) for time in self.times]

    @cached_property
    def _sizes(self) -> Phase:
        rates = zip(*(state[self.problem.count :] for state in self._exact), strict=True)
        largest = (float(max(map(abs, rate))) for rate in rates)
        return (*self.problem.driven.units[: self.problem.count], *largest)

    def follow(self, method: Method, setting: Setting) -> Run:
        """Integrates the motion with a method."""
        key = method.solve, label(setting)
        if key not in self._runs:
            with np.errstate(all='ignore'):
                self._runs[key] = self._follow(method, setting)
        return self._runs[key]

    def _follow(self, method: Method, setting: Setting) -> Run:
        run = Run([], [])
        try:
            follower = method.solve(self.problem, setting)
            for moment in self.times:
                phase = follower.at(moment)
                if not all(map(math.isfinite, phase)):
                    return run._replace(failure=NAN)
                # A phase that no position belongs to is refused here, as where it is published.
                run.gaps.append(follower.gap())
                run.phases.append(phase)
        except LinkageError:
            return run._replace(failure=REFUSED)
        except FAILURES:
            return run._replace(failure=NAN)
        return run

    def error(self, quantity: str, index: int, run: Run) -> float:
        """Error of a run against the true motion.

        Args:
            quantity: TRAJECTORY, ENERGY or LOOP.
            index: Index of the time.
            run: The computed motion.

        Returns:
            TRAJECTORY: the largest error, in rad, crank lengths and, for rates, relative to the
            largest rate. ENERGY: the change of energy without motor and damping, relative to the
            initial kinetic energy. LOOP: the gap of the loop in crank lengths.
        """
        if quantity == LOOP:
            return run.gaps[index] / self.problem.mechanism.crank.length
        phase = run.phases[index]
        if quantity == ENERGY:
            return abs(sum(self.problem.energy(phase)) - self._energy) / self._kinetic
        values = zip(phase, self._exact[index], self._sizes, strict=True)
        return max(abs(float(Decimal(value) - true)) / size for value, true, size in values)

    def judge(self, method: Method, situation: Situation) -> Iterator[Outcome]:
        """The outcome at one time after another, up to a failure or a refusal.

        Args:
            method: An integrator.
            situation: What is judged.
        """
        run, is_right = self.follow(method, method.steady), True
        for i in range(len(self.times)):
            if i >= len(run.phases):
                if run.failure and is_right:
                    yield run.failure, math.nan
                return
            error = self.error(situation.judged, i, run)
            is_right &= error <= LIMIT
            yield (RIGHT if error <= LIMIT else DIVERGED), error

    def panels(self, _: Method, setting: Setting) -> Iterable[tuple[str, str]]:
        """Quantities and modes that a method supports."""
        pairs = [(quantity, MEAN) for quantity in self._quantities]
        has_ticks = TRAJECTORY in self._quantities and setting.get('step', 0) <= _TICK
        return [*pairs, (TRAJECTORY, SLOWEST)] if has_ticks else pairs

    def worst_error(self, method: Method, setting: Setting, _: str, quantity: str) -> float:
        """Largest error of an integrator over the motion; inf if it fails."""
        run = self.follow(method, setting)
        if run.failure:
            return math.inf
        return max(self.error(quantity, i, run) for i in range(len(self.times)))

    def timer(self, method: Method, setting: Setting, mode: str, _: str) -> Callable[[], float]:
        """A function that returns the time of a simulated ms, or of the slowest, us."""
        return partial(_mean_time if mode == MEAN else _slowest_time, method, setting, self)


def _mean_time(method: Method, setting: Setting, bench: MotionBench) -> float:
    """The time of a simulated ms of the whole motion, us."""
    follower = method.solve(bench.problem, setting)
    start = time.perf_counter()
    for moment in bench.times:
        follower.at(moment)
    return (time.perf_counter() - start) / bench.times[-1] * 1e3


def _slowest_time(method: Method, setting: Setting, bench: MotionBench) -> float:
    """Time of the slowest of the first 1000 ms, fewer for a short motion, us.

    Each is requested separately.
    """
    count = min(1000, round(bench.times[-1] * _TICKS))
    fastest = [math.inf] * count
    for _ in range(3):
        follower = method.solve(bench.problem, setting)
        for i in range(count):
            start = time.perf_counter()
            follower.at((i + 1) * _TICK)
            fastest[i] = min(fastest[i], time.perf_counter() - start)
    return max(fastest) * 1e6


def even(seconds: float) -> list[float]:
    """Even times at which states are compared, up to the last."""
    return [(i + 1) * _ASKED for i in range(round(seconds / _ASKED))]
