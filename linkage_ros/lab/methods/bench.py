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
                self._states[crank] = {name: [*map(_split, row)] for name, row in state.items()}
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
        return dict(zip(QUANTITIES, sizes, strict=True))

    def error(self, quantity: str, crank: float, values: Iterable[float]) -> float:
        """The largest relative error of values; inf if one is not finite or no state exists."""
        exact, worst = self._exact(crank), 0.0
        if exact is None:
            return math.inf
        slides = self.reference.slides
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

    def places(self, method: Method, setting: Setting) -> Array:
        """The angles at which a method is asked."""
        del method, setting
        return self.cranks

    def panels(self, method: Method, _: Setting) -> Iterable[tuple[str, str]]:
        """Quantities and modes that a method supports."""
        first = QUANTITIES.index(OWN[method.stage][0])
        return ((q, mode) for mode, q in itertools.product(method.modes, QUANTITIES[first:]))

    def worst_error(self, method: Method, setting: Setting, mode: str, quantity: str) -> float:
        """Largest error of a method over all angles; inf if it fails."""
        cranks = self.places(method, setting)
        try:
            with np.errstate(all='ignore'):
                function = function_of(method, self.task, setting, quantity, mode)
                rows = evaluate(function, cranks, mode)
        except FAILURES:
            return math.inf
        # Of angles that a method goes through one by one, no more count than of others.
        pairs = list(zip(cranks.tolist(), rows, strict=True))
        pairs = pairs[:: math.ceil(len(cranks) / len(self.cranks))]
        return max(self.error(quantity, crank, row) for crank, row in pairs)

    def judge(self, method: Method, _: Situation) -> Iterator[Outcome]:
        """The outcome of a method's own stage, at every angle and in every mode."""
        for mode, quantity in itertools.product(method.modes, OWN[method.stage]):
            answers = self._answers(method, quantity, mode)
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
        self, method: Method, quantity: str, mode: str
    ) -> Sequence[tuple[float, ...] | str]:
        """Values at each angle, or the outcome for an error."""
        try:
            function = function_of(method, self.task, method.steady, quantity, mode)
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


def _split(number: Any) -> tuple[float, float]:
    high = float(number)
    return high, float(number - high)


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
        self._turns, self._angles = reach.period_turns, angles
        fine = reach.samples(angles)
        extra = np.setdiff1d(fine, np.linspace(0, fine[-1], angles * self._turns + 1))
        extra = extra[:: max(1, 360 // angles)]
        # The fast places themselves, even or not.
        middle = reach.fast + math.pi * np.arange(2 * self._turns)
        # No special angle flatters or fails a method by chance: half a step after 0.
        self._ones = self.even(angles) + math.pi / angles
        super().__init__(task, np.unique(np.concatenate([self._ones, extra, middle])))

    def even(self, steps: int) -> Array:
        """Even angles of one period, `steps` per turn."""
        return np.arange(float(steps * self._turns)) * (2 * math.pi / steps)

    def places(self, method: Method, setting: Setting) -> Array:
        """The angles at which a method is asked."""
        return self.even(int(setting['steps'])) if method.sequential else self.cranks

    def timer(
        self, method: Method, setting: Setting, mode: str, quantity: str
    ) -> Callable[[], float]:
        """A function that returns the time per state, us."""
        function = function_of(method, self.task, setting, quantity, mode)
        cranks = self.places(method, setting) if method.sequential else self._ones
        asked = cranks.tolist() if mode == ONE else np.resize(cranks, _BATCH)
        return partial(_time_pass, function, asked)


def _time_pass(function: Function, cranks: list[float] | Array) -> float:
    """Time per state of one pass, us: one by one for a list, else all at once."""
    start = time.perf_counter()
    if isinstance(cranks, list):
        for crank in cranks:
            function(crank)
    else:
        function(cranks)
    return (time.perf_counter() - start) / len(cranks) * 1e6
