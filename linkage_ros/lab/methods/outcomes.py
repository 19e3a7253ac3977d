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
from dataclasses import asdict, dataclass
from typing import Any, TypeAlias

import numpy as np

from linkage_ros.errors import LinkageError
from linkage_ros.lab.methods.chain import Method

RIGHT, REFUSED, DIVERGED, WRONG_BRANCH, NAN = OUTCOMES = (
    'right', 'refused', 'diverged', 'wrong branch', 'NaN',
)  # fmt: skip
LIMIT = 1e-6  # the error of a right answer at most
# What arithmetic raises where a formula has no answer.
FAILURES = (ArithmeticError, ValueError, np.linalg.LinAlgError)
Outcome: TypeAlias = tuple[str, float | None]  # of OUTCOMES, with its number if there is one


@dataclass(frozen=True)
class Situation:
    """A kind of trouble.

    Attributes:
        name: Name in charts and docs.
        words: Description.
        cases: Makes a number of cases, the same at every call; fewer cases for longer motions.
        exists: Whether a state exists; otherwise the right answer is a refusal or, beyond the end
            of coordinates, the motion continued in another assembly.
        judged: For motions, 'trajectory', 'energy' or 'loop' (the gap of the loop).
    """

    name: str
    words: str
    cases: Callable[[int], Sequence[Any]]
    exists: bool = True
    judged: str = ''


def judged(
    solve: Callable[[], float], exact: float, size: float, *, exists: bool = True
) -> Outcome:
    """The outcome of a method that computes one number.

    Args:
        solve: Computes the number.
        exact: The right answer.
        size: Scale of relative errors.
        exists: See `Situation`.

    Returns:
        The outcome, with the relative error.
    """
    try:
        error = abs(solve() - exact) / size
    except LinkageError:
        return REFUSED, None
    return (RIGHT if exists and error <= LIMIT else DIVERGED), error


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

    def record(self) -> dict[str, Any]:
        """The record for JSON."""
        return asdict(self)


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
