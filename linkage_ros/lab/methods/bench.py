# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Measures error, time and stability of a method on one linkage."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from linkage_ros.dynamics.solver import Solver
from linkage_ros.errors import LinkageError, UnreachableError
from linkage_ros.lab.methods.chain import (
    BATCH,
    ONE,
    OWN,
    QUANTITIES,
    Function,
    Method,
    Setting,
    Task,
    evaluate,
    function_of,
)
from linkage_ros.lab.methods.linkages import other_assembly
from linkage_ros.lab.methods.outcomes import (
    DIVERGED,
    FAILURES,
    LIMIT,
    NAN,
    REFUSED,
    RIGHT,
    WRONG_BRANCH,
    Outcome,
    Situation,
)
from linkage_ros.lab.reference.states import Reference
from linkage_ros.numeric import Array, within_two_turns, wrap

_EVEN = 48  # angles, over a period or an arc
_NOTHING = 1e-12  # of the largest value of a quantity
_BATCH = 4096  # states


class LinkageBench:
    """One linkage, and its true states.

    Errors are relative to the largest value that a quantity has at even angles or, next to a
    change point where it may be larger by many powers of ten, to the value itself. Errors of
    directions are absolute, in rad.

    Attributes:
        task: The mechanism and its motion.
        cranks: Angles at which methods are judged, in order, rad.
        decimal: See `Reference`.
        reference: The true states.
        rounds: Number of timings.
    """

    rounds = 15

    def __init__(
        self, task: Task, cranks: Sequence[float] | Array, *, decimal: bool = False
    ) -> None:
        """Prepares it.

        Args:
            task: The mechanism and its motion.
            cranks: Angles in order, rad.
            decimal: See `Reference`.
        """
        self.task, self.cranks, self.decimal = task, np.array(cranks), decimal
        self.reference = Reference(task.mechanism, task.speed, task.acceleration, decimal=decimal)
        self._states: dict[float, dict[str, list[tuple[float, float]]] | None] = {}

    @cached_property
    def _other(self) -> LinkageBench:
        """The bench of the other assembly."""
        task = replace(self.task, mechanism=other_assembly(self.task.mechanism))
        return LinkageBench(task, (), decimal=self.decimal)

    def _exact(self, crank: float) -> dict[str, list[tuple[float, float]]] | None:
        """The true values, each as the sum of two doubles; None: no state exists."""
        if crank not in self._states:
            self._states[crank] = None
            with suppress(UnreachableError):
                state = self.reference.state(crank)
                self._states[crank] = {
                    name: [(float(x), float(x - float(x))) for x in row]
                    for name, row in state.items()
                }
        return self._states[crank]

    @cached_property
    def _sizes(self) -> dict[str, list[float]]:
        """Largest value of each quantity at even angles inside the reach."""
        solver, parts = Solver(self.task.mechanism), (np.arange(_EVEN) + 0.5) / _EVEN
        turns = solver.reach.period_turns
        arcs = [(start, (end - start) * turns) for start, end in solver.reach.arcs]
        cranks = np.concatenate([start + width * parts for start, width in arcs])
        state = solver.state(cranks, self.task.speed, self.task.acceleration)
        rows = state.position[1:], state.velocity[1:], state.acceleration[1:], (state.torque,)
        largest = [[float(np.max(np.abs(row))) for row in each] for each in rows]
        # The rest of a rounding is no size.
        sizes = [[x if x > _NOTHING * max(each) else 0.0 for x in each] for each in largest]
        named = dict(zip(QUANTITIES, sizes, strict=True))
        output = sizes[0][1:] if self.reference.slides else [1.0, 1.0]
        return named | {'direction': [1.0, 1.0, *output]}

    def error(self, quantity: str, crank: float, values: Sequence[float]) -> float:
        """The largest relative error of values; inf if one is not finite or no state exists.

        A position is two numbers or, as unit vectors, more.
        """
        exact, worst = self._exact(crank), 0.0
        if exact is None:
            return math.inf
        slides = self.reference.slides
        if quantity == 'position' and len(values) > len(exact[quantity]):
            quantity = 'direction'
        pairs = zip(values, exact[quantity], self._sizes[quantity], strict=True)
        for i, (value, (high, low), size) in enumerate(pairs):
            if not math.isfinite(value):
                return math.inf
            is_angle = quantity == 'position' and not (i == 1 and slides)
            apart = value - high
            if is_angle and abs(apart) > 1:
                apart = wrap(within_two_turns(value)[0] - high)
            scale = 1.0 if is_angle or not size else max(size, abs(high))
            worst = max(worst, abs(apart - low) / scale)
        return worst

    def panels(self, method: Method, _: Setting) -> Iterable[tuple[str, str]]:
        """Quantities and modes that a method supports."""
        first = QUANTITIES.index(OWN[method.stage][0])
        return ((q, mode) for mode, q in itertools.product(method.modes, QUANTITIES[first:]))

    def worst_error(self, method: Method, setting: Setting, mode: str, quantity: str) -> float:
        """Largest error of a method over all angles; inf if it fails."""
        pairs = zip(
            self.cranks.tolist(), self._answers(method, setting, quantity, mode), strict=True
        )
        return max(
            math.inf if isinstance(found, str) else self.error(quantity, crank, found)
            for crank, found in pairs
        )

    def judge(self, method: Method, _: Situation) -> Iterator[Outcome]:
        """The outcome of a method's own stage, at every angle and in every mode."""
        for mode, quantity in itertools.product(method.modes, OWN[method.stage]):
            answers = self._answers(method, method.steady, quantity, mode)
            for crank, found in zip(self.cranks.tolist(), answers, strict=True):
                if isinstance(found, str):
                    yield found, None
                elif not all(map(math.isfinite, found)):
                    yield NAN, None
                else:
                    yield self._outcome(quantity, crank, found)

    def _outcome(self, quantity: str, crank: float, values: tuple[float, ...]) -> Outcome:
        error = self.error(quantity, crank, values)
        if error <= LIMIT:
            return RIGHT, error
        if quantity == 'position' and self._other.error(quantity, crank, values) <= LIMIT:
            return WRONG_BRANCH, error
        return DIVERGED, error

    def _answers(
        self, method: Method, setting: Setting, quantity: str, mode: str
    ) -> Sequence[tuple[float, ...] | str]:
        """Values at each angle, or the outcome for an error."""
        try:
            function = function_of(method, self.task, setting, quantity, mode)
        except LinkageError:
            return [REFUSED] * len(self.cranks)
        with np.errstate(all='ignore'):
            if mode == BATCH:
                # An array is refused for one of its angles: then each is asked by itself.
                with suppress(LinkageError, *FAILURES):
                    return evaluate(function, self.cranks, mode)
            return [_answer(function, crank, mode) for crank in self.cranks[:, None]]


def _answer(function: Function, crank: Array, mode: str) -> tuple[float, ...] | str:
    try:
        return evaluate(function, crank, mode)[0]
    except LinkageError:
        return REFUSED
    except FAILURES:
        return NAN


class PeriodBench(LinkageBench):
    """One period of a linkage whose crank turns fully, for errors and times.

    Its angles are close together where the motion is fast.
    """

    def __init__(self, task: Task, angles: int) -> None:
        """Prepares it.

        Args:
            task: The mechanism and its motion.
            angles: Number of even angles per turn.
        """
        reach = Solver(task.mechanism).reach
        turns = reach.period_turns
        fine = reach.samples(angles)
        even = np.linspace(0, fine[-1], angles * turns + 1)
        # No special angle flatters or fails a method by chance: half a step after 0.
        self._ones = even[:-1] + math.pi / angles
        fine = np.setdiff1d(fine, even)[:: 360 // angles]
        # The fast places themselves, even or not.
        middle = reach.fast + math.pi * np.arange(2 * turns)
        super().__init__(task, np.unique(np.concatenate([self._ones, fine, middle])))

    def timer(
        self, method: Method, setting: Setting, mode: str, quantity: str
    ) -> Callable[[], float]:
        """A function that returns the time per state, us."""
        function = function_of(method, self.task, setting, quantity, mode)
        asked = self._ones.tolist() if mode == ONE else np.resize(self._ones, _BATCH)
        return partial(_time_pass, function, asked)


def _time_pass(function: Function, cranks: list[float] | Array) -> float:
    """Time per state of one pass, us: one by one for a list, else all at once."""
    calls: Iterable[Any] = cranks if isinstance(cranks, list) else [cranks]
    start = time.perf_counter()
    for crank in calls:
        function(crank)
    return (time.perf_counter() - start) / len(cranks) * 1e6
