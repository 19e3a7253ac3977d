# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Outcome of each method in each situation, by one rule.

A method is judged by what it computes itself, against `reference`, at every crank angle of every
case, one at a time and as an array; a cell of the chart is its worst outcome, in this order:

    right         every value within 1e-6, relative to its size (`bench.Truth`)
    refused       an error that says why; where no state exists, this is the right answer
    diverged      a finite value that is wrong, or any value where no state exists
    wrong branch  wrong, but within 1e-6 of the other assembly's position
    NaN           no number, or an arithmetic error
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from linkage_ros.errors import LinkageError
from linkage_ros.lab.methods.bench import FAILURES, LIMIT, Truth, evaluate
from linkage_ros.lab.methods.chain import BATCH, FUNCTIONS, OWN, Function
from linkage_ros.lab.methods.linkages import other_assembly
from linkage_ros.lab.methods.registry import METHODS, Method
from linkage_ros.lab.methods.situations import Case, Situation

RIGHT, REFUSED, DIVERGED, WRONG_BRANCH, NAN = OUTCOMES = (
    'right', 'refused', 'diverged', 'wrong branch', 'NaN',
)  # fmt: skip


@dataclass(frozen=True)
class Cell:
    """A cell of the chart of numerical stability.

    Attributes:
        method: Name from the registry.
        situation: Name of the situation.
        outcome: One of OUTCOMES: the worst.
        worst_error: The largest error of a finite value, of motions what `motion_outcomes`
            says; None: there is none.
    """

    method: str
    situation: str
    outcome: str
    worst_error: float | None

    def record(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)


class _Trial:
    """One case, with the truth of its own assembly and of the other."""

    def __init__(self, case: Case) -> None:
        self.case = case
        mechanism = case.task.mechanism
        other = other_assembly(mechanism)
        self.own = Truth(case.task, case.lengths)
        self.other = Truth(replace(case.task, mechanism=other), case.lengths)

    def outcome(self, quantity: str, crank: float, values: tuple[float, ...]) -> tuple[str, float]:
        """The outcome of values at a crank angle, and their error."""
        error = self.own.error(quantity, crank, values)
        if error <= LIMIT:
            return RIGHT, error
        if quantity == 'position' and self.other.error(quantity, crank, values) <= LIMIT:
            return WRONG_BRANCH, error
        return DIVERGED, error


def measure_outcomes(
    situations: Iterable[Situation],
    *,
    cases: int,
    progress: Callable[[Iterable[Any], str], Iterable[Any]],
    methods: Sequence[Method] = METHODS,
) -> list[Cell]:
    """Runs every method through every situation.

    Args:
        situations: Situations to run through.
        cases: Number of cases of each.
        progress: Wraps what is gone through, with a word for it: a progress bar.
        methods: Methods to run.

    Returns:
        The cells, situation by situation.
    """
    cells = []
    every = progress(list(itertools.product(situations, methods)), 'situations')
    for situation, pairs in itertools.groupby(every, key=lambda pair: pair[0]):
        trials = [_Trial(case) for case in situation.cases(cases)]
        cells += [_cell(method, situation, trials) for _, method in pairs]
    return cells


def _cell(method: Method, situation: Situation, trials: list[_Trial]) -> Cell:
    found = [_judge(method, trial, exists=situation.exists) for trial in trials]
    outcome = max((outcome for outcome, _ in found), key=OUTCOMES.index)
    errors = [error for _, error in found if error is not None]
    return Cell(method.name, situation.name, outcome, max(errors, default=None))


def _judge(method: Method, trial: _Trial, *, exists: bool) -> tuple[str, float | None]:
    """The worst outcome and error of one case, one at a time and as an array."""
    outcomes, errors = {RIGHT}, []
    for mode in method.modes:
        for quantity in OWN[method.stage]:
            for crank, found in zip(
                trial.case.cranks, _answers(method, trial.case, quantity, mode), strict=True
            ):
                if isinstance(found, str):
                    outcomes.add(found)
                elif not all(map(math.isfinite, found)):
                    outcomes.add(NAN)
                elif not exists:
                    outcomes.add(DIVERGED)
                else:
                    outcome, error = trial.outcome(quantity, crank, found)
                    outcomes.add(outcome)
                    errors.append(error)
    if not exists and outcomes == {RIGHT, REFUSED}:
        return REFUSED, None
    return max(outcomes, key=OUTCOMES.index), max(errors, default=None)


def _answers(
    method: Method, case: Case, quantity: str, mode: str
) -> list[tuple[float, ...] | str]:
    """The values at each crank angle, or the outcome that stands for an error."""
    try:
        function = getattr(method.make(case.task, method.steady, FUNCTIONS[mode]), quantity)
    except LinkageError:
        return [REFUSED] * len(case.cranks)
    with np.errstate(all='ignore'):
        if mode == BATCH:
            # An array is refused for one of its angles: then each is asked by itself.
            with suppress(LinkageError, *FAILURES):
                return [*evaluate(function, np.array(case.cranks), mode)]
        return [_answer(function, crank, mode) for crank in case.cranks]


def _answer(function: Function, crank: float, mode: str) -> tuple[float, ...] | str:
    try:
        return evaluate(function, np.array([crank]), mode)[0]
    except LinkageError:
        return REFUSED
    except FAILURES:
        return NAN
