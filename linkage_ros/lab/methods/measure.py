# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Methods, the cases on which they are measured, and the situations in which some of them fail.

A case is one problem, of a linkage, a motion, a load curve or friction, whose true answer is
known. A method answers it row by row: at each crank angle, at one time after another, or once. A
situation makes cases. A cell of the chart of stability shows the worst outcome, in this order:

    right         every value within 1e-6, relative to its size (`Case.error`)
    refused       an error that says why; where no state exists, this is the right answer
    diverged      a finite value that is wrong, or any value where no state exists
    wrong branch  wrong, but within 1e-6 of the other assembly's position
    NaN           no number, or an arithmetic error
"""

from __future__ import annotations

import itertools
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np

from linkage_ros.errors import LinkageError

RIGHT, REFUSED, DIVERGED, WRONG_BRANCH, NAN = OUTCOMES = (
    'right', 'refused', 'diverged', 'wrong branch', 'NaN',
)  # fmt: skip
LIMIT = 1e-6  # largest error of a right answer
# Errors of arithmetic if a formula has no answer.
FAILURES = (ArithmeticError, ValueError, np.linalg.LinAlgError)
ONE, BATCH = 'one at a time', 'batch'
_SEED = 20_261_121

Setting: TypeAlias = dict[str, float]
Row: TypeAlias = Sequence[float] | None  # an answer; not finite: failure; None: refusal
Panel: TypeAlias = tuple[str, str]  # a quantity and a mode
Outcome: TypeAlias = tuple[str, float]  # from OUTCOMES, and the error; inf without a value
Progress: TypeAlias = Callable[[Iterable[Any], str], Iterable[Any]]


@dataclass(frozen=True)
class Method:
    """One way to solve a stage.

    Attributes:
        name: Name in charts and docs.
        stage: What it computes: 'state' (all of it), 'position', 'rates', 'motion', 'load' or
            'friction'.
        needs: Input besides the description of the case.
        source: Publication or file, with the equation number.
        solve: For linkages, the formula of its stage, as in `stages`. For motions, a function
            from the initial value problem and a setting to an integrator. For loads, a function
            of the case.
        settings: The settings for the accuracy chart, from coarse to fine.
        steady: The setting for the stability chart: the best practical one.
        modes: For linkages: 'one at a time', 'batch' or both.
        tool: Makes the additional input of its formula from linkage case and setting.
        narrow: Whether it computes in single precision, crank angle and results included.
    """

    name: str
    stage: str
    needs: str
    source: str
    solve: Callable[..., Any]
    settings: tuple[Setting, ...] = ({},)
    steady: Setting = field(default_factory=dict)
    modes: tuple[str, ...] = (ONE, BATCH)
    tool: Callable[..., Any] | None = None
    narrow: bool = False


def label(setting: Setting) -> str:
    """A setting as text."""
    return ', '.join(f'{name} {value:g}' for name, value in setting.items())


class Case(ABC):
    """One problem and its true answer."""

    @abstractmethod
    def own(self, method: Method) -> Iterable[Panel]:
        """Quantities that a method itself computes, in each of its modes."""

    @abstractmethod
    def rows(self, method: Method, setting: Setting, quantity: str, mode: str) -> Sequence[Row]:
        """The answers of a method."""

    @abstractmethod
    def error(self, quantity: str, place: int, row: Sequence[float]) -> float:
        """The largest relative error of finite values at a place; inf: no state exists there."""

    def wrong(self, quantity: str, place: int, row: Sequence[float]) -> str:
        """The outcome of wrong values."""
        del quantity, place, row
        return DIVERGED

    def outcomes(self, method: Method, setting: Setting, *panel: str) -> list[Outcome]:
        """The outcomes of a method at all places, for one quantity in one mode."""
        found: list[Outcome] = []
        for place, row in enumerate(self.rows(method, setting, *panel)):
            if row is None or not all(map(math.isfinite, row)):
                found.append((REFUSED if row is None else NAN, math.inf))
                continue
            error = self.error(panel[0], place, row)
            is_right = error <= LIMIT
            found.append((RIGHT if is_right else self.wrong(panel[0], place, row), error))
        return found


def attempt(solve: Callable[..., Sequence[float]], *given: Any) -> Row:
    """Calls a function that may fail."""
    try:
        with np.errstate(all='ignore'):
            return solve(*given)
    except LinkageError:
        return None
    except FAILURES:
        return (math.nan,)


@dataclass(frozen=True)
class Situation:
    """A situation in which some methods fail.

    Attributes:
        name: Name in charts and docs.
        words: Description in charts and docs.
        make: Makes a case from random numbers and the number of the case.
        exists: Whether a state exists; otherwise the right answer is a refusal.
        share: Number of cases of a cheaper situation for each case of this one.
        fewest: Number of cases at least.
        seed: Seed of the random numbers; by default its name.
    """

    name: str
    words: str
    make: Callable[[np.random.Generator, int], Case]
    exists: bool = True
    share: int = 1
    fewest: int = 1
    seed: tuple[int, str] | None = None

    def cases(self, count: int) -> list[Case]:
        """Makes this number of cases, fewer if they are large; the same at every call."""
        number, word = self.seed or (_SEED, self.name)
        random = np.random.default_rng([number, *word.encode()])
        return [self.make(random, i) for i in range(max(self.fewest, count // self.share))]


def measure_outcomes(
    situations: Iterable[Situation], methods: Sequence[Method], *, cases: int, progress: Progress
) -> list[dict[str, Any]]:
    """Runs every method in every situation.

    Args:
        situations: The situations.
        methods: The methods.
        cases: Number of cases of each situation.
        progress: Wraps an iterable in a progress bar with a label.

    Returns:
        The cells, situation by situation: names of method and situation, the worst outcome, and
        the largest error of a finite value, None without one.
    """
    cells = []
    every = progress(list(itertools.product(situations, methods)), 'situations')
    for situation, pairs in itertools.groupby(every, key=lambda pair: pair[0]):
        made = situation.cases(cases)
        for _, method in pairs:
            found = [
                outcome
                for case in made
                for panel in case.own(method)
                for outcome in case.outcomes(method, method.steady, *panel)
            ]
            worst = max((outcome for outcome, _ in found), key=OUTCOMES.index)
            errors = [error for _, error in found if math.isfinite(error)]
            cell = {'method': method.name, 'situation': situation.name, 'outcome': worst}
            cells.append({**cell, 'worst_error': max(errors, default=None)})
    return cells
