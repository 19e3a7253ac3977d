# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How wrong and how slow a method is on one mechanism."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from linkage_ros.dynamics.solver import Solver
from linkage_ros.lab.methods.chain import FUNCTIONS, ONE, QUANTITIES, Function, Task
from linkage_ros.lab.methods.registry import Method, Setting
from linkage_ros.lab.reference.states import Reference
from linkage_ros.numeric import Array

_EVEN = 48  # angles, over a period or an arc
_NOTHING = 1e-12  # of the largest value of a quantity
LIMIT = 1e-6  # the error of a right answer at most
# What arithmetic raises where a formula has no answer.
FAILURES = (ArithmeticError, ValueError, np.linalg.LinAlgError)


class _Pair(NamedTuple):
    """A number in many digits, and as the sum of two doubles."""

    high: float
    low: float
    number: Any


class Truth:
    """The reference states of one mechanism, and how far values are from them.

    Errors are relative to the largest value that a quantity has at even angles or, next to a
    change point where it may be larger by many powers of ten, to the value itself. Directions
    count as they are, in rad.

    Attributes:
        task: The mechanism and its motion.
    """

    def __init__(self, task: Task, lengths: tuple[str, ...] | None = None) -> None:
        """Prepares it.

        Args:
            task: The mechanism and its motion.
            lengths: Lengths, as for `Reference`.
        """
        self.task = task
        self._reference = Reference(task.mechanism, task.speed, task.acceleration, lengths)
        self._solver = Solver(task.mechanism)
        self._slides = self._solver.structure.links[-1].slides
        self._states: dict[float, dict[str, list[_Pair]]] = {}

    def _exact(self, crank: float) -> dict[str, list[_Pair]]:
        """The reference state."""
        if crank not in self._states:
            state = self._reference.state(crank)._asdict()
            self._states[crank] = {name: [*map(_split, row)] for name, row in state.items()}
        return self._states[crank]

    @cached_property
    def _sizes(self) -> dict[str, tuple[float, ...]]:
        """The largest of each value of each quantity at even angles inside the reach."""
        reach = self._solver.reach
        arcs = [(start, start + (end - start) * reach.period_turns) for start, end in reach.arcs]
        parts = (np.arange(_EVEN) + 0.5) / _EVEN
        cranks = np.concatenate([start + (end - start) * parts for start, end in arcs])
        state = self._solver.state(cranks, self.task.speed, self.task.acceleration)
        sizes = {}
        for quantity, rows in zip(
            QUANTITIES, (state.position, state.velocity, state.acceleration, (0, state.torque)),
            strict=True,
        ):  # fmt: skip
            largest = [float(np.max(np.abs(row))) for row in rows[1:]]
            # The rest of a rounding is no size.
            sizes[quantity] = tuple(x if x > _NOTHING * max(largest) else 0.0 for x in largest)
        return sizes

    def error(self, quantity: str, crank: float, values: Iterable[float]) -> float:
        """The largest relative error of values; inf if one is not finite."""
        worst, exact, sizes = 0.0, self._exact(crank)[quantity], self._sizes[quantity]
        for i, (value, true, size) in enumerate(zip(values, exact, sizes, strict=True)):
            if not math.isfinite(value):
                return math.inf
            is_angle = quantity == 'position' and not (i == 1 and self._slides)
            apart = abs(value - true.high - true.low)
            if is_angle and apart > 1.0:
                apart = abs(Reference.difference(value, true.number, is_angle=True))
            scale = 1.0 if is_angle or not size else max(size, abs(true.high))
            worst = max(worst, apart / scale)
        return worst


def _split(number: Any) -> _Pair:
    high = float(number)
    return _Pair(high, -Reference.difference(high, number, is_angle=False), number)


class Bench(Truth):
    """One mechanism to measure methods on.

    Attributes:
        cranks: Angles of one period, rad; close together wherever the motion is fast.
    """

    def __init__(self, task: Task, angles: int) -> None:
        """Prepares it.

        Args:
            task: The mechanism and its motion; its crank turns fully.
            angles: Even ones per turn.
        """
        super().__init__(task)
        reach = self._solver.reach
        self._turns = reach.period_turns
        fine = reach.samples(angles)
        extra = np.setdiff1d(fine, np.linspace(0, fine[-1], angles * self._turns + 1))
        # The fast places themselves, even or not.
        middle = reach.fast + math.pi * np.arange(2 * self._turns)
        self.cranks: Array = np.unique(np.concatenate([self.aside(angles), extra, middle]))

    def aside(self, steps: int) -> Array:
        """Even angles of one period, the first half a step after 0.

        No special angle flatters or fails a method by chance.
        """
        return self.even(steps) + math.pi / steps

    def even(self, steps: int) -> Array:
        """Even angles of one period, `steps` per turn."""
        return np.arange(float(steps * self._turns)) * (2 * math.pi / steps)

    def worst_error(self, method: Method, setting: Setting, mode: str, quantity: str) -> float:
        """The largest error of a method over the period; inf where it fails.

        Args:
            method: From the registry.
            setting: Setting of the method.
            mode: 'one at a time' or 'batch'.
            quantity: One of QUANTITIES.

        Returns:
            The error.
        """
        cranks = self.even(int(setting['steps'])) if method.sequential else self.cranks
        try:
            with np.errstate(all='ignore'):
                function = getattr(method.make(self.task, setting, FUNCTIONS[mode]), quantity)
                rows = evaluate(function, cranks, mode)
        except FAILURES:
            return math.inf
        pairs = zip(cranks.tolist(), rows, strict=True)
        return max(self.error(quantity, crank, row) for crank, row in pairs)


def evaluate(function: Function, cranks: Array, mode: str) -> list[tuple[float, ...]]:
    """The values of a function at crank angles.

    Args:
        function: Function of the crank angle.
        cranks: rad.
        mode: 'one at a time' or 'batch': how it is called.

    Returns:
        A tuple for each angle.
    """
    if mode == ONE:
        return [function(crank) for crank in cranks.tolist()]
    columns = [np.broadcast_to(column, cranks.shape).tolist() for column in function(cranks)]
    return list(zip(*columns, strict=True))


def time_pass(function: Function, cranks: list[float] | Array) -> float:
    """One pass through crank angles: one by one if they are a list, else all at once.

    Args:
        function: Function of the crank angle.
        cranks: rad.

    Returns:
        Time per state, us.
    """
    start = time.perf_counter()
    if isinstance(cranks, list):
        for crank in cranks:
            function(crank)
    else:
        function(cranks)
    return (time.perf_counter() - start) / len(cranks) * 1e6
