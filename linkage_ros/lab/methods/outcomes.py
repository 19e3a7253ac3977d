# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Outcome of each method in each situation, by one rule.

The result of a method's own stage is compared with `reference`: for a linkage, at every crank
angle of every case, one at a time and as an array; for a motion, at one time after another. A cell
of the chart shows its worst outcome, in this order:

    right         every value within 1e-6, relative to its size (`bench`, `motion_bench`)
    refused       an error that says why; where no state exists, this is the right answer
    diverged      a finite value that is wrong, or any value where no state exists
    wrong branch  wrong, but within 1e-6 of the other assembly's position
    NaN           no number, or an arithmetic error
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from linkage_ros.lab.methods.chain import Method

RIGHT, REFUSED, DIVERGED, WRONG_BRANCH, NAN = OUTCOMES = (
    'right', 'refused', 'diverged', 'wrong branch', 'NaN',
)  # fmt: skip
_SEED = 20_261_121
LIMIT = 1e-6  # the error of a right answer at most
# What arithmetic raises where a formula has no answer.
FAILURES = (ArithmeticError, ValueError, np.linalg.LinAlgError)
Outcome: TypeAlias = tuple[str, float | None]  # of OUTCOMES, with its number if there is one


@dataclass(frozen=True)
class Situation:
    """A kind of trouble.

    Attributes:
        name: As charts and docs call it.
        words: What it is.
        cases: Makes so many cases, the same at every call; motions, the longer, the fewer.
        exists: Whether there is a state to be found; otherwise the right answer is a refusal.
        judged: Of motions, 'trajectory', 'energy' or 'loop' (how far it is open).
    """

    name: str
    words: str
    cases: Callable[[int], Sequence[Any]]
    exists: bool = True
    judged: str = ''


def one_by_one(
    name: str, words: str, make: Callable[[Any, int], Any], *, exists: bool = True
) -> Situation:
    """Makes a situation from a function of random numbers and a case's number."""

    def cases(count: int) -> list[Any]:
        random = np.random.default_rng([_SEED, *name.encode()])
        return [make(random, i) for i in range(count)]

    return Situation(name, words, cases, exists)


@dataclass(frozen=True)
class Cell:
    """A cell of the chart of numerical stability.

    Attributes:
        method: Name from the registry.
        situation: Name of the situation.
        outcome: One of OUTCOMES: the worst.
        worst_error: Largest error of a finite value; for refusals of a motion see
            `MotionBench.judge`; None: no such value.
    """

    method: str
    situation: str
    outcome: str
    worst_error: float | None


def measure_outcomes(
    situations: Iterable[Situation],
    methods: Sequence[Method],
    *,
    cases: int,
    progress: Callable[[Iterable[Any], str], Iterable[Any]],
) -> list[Cell]:
    """Runs every method in every situation.

    Args:
        situations: The situations.
        methods: The methods.
        cases: Number of cases of each situation.
        progress: Wraps an iterable in a progress bar with a label.

    Returns:
        The cells, situation by situation.
    """
    cells = []
    every = progress(list(itertools.product(situations, methods)), 'situations')
    for situation, pairs in itertools.groupby(every, key=lambda pair: pair[0]):
        benches = situation.cases(cases)
        for _, method in pairs:
            found = [outcome for bench in benches for outcome in bench.judge(method, situation)]
            worst = max((outcome for outcome, _ in found), key=OUTCOMES.index)
            errors = [error for _, error in found if error is not None and math.isfinite(error)]
            cells.append(Cell(method.name, situation.name, worst, max(errors, default=None)))
    return cells
