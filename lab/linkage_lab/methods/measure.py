# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Methods, the cases on which they are measured, and the measurements for both charts.

A case is one problem (a linkage, a motion, a load curve or friction) with a known answer. A method
returns rows: one per crank angle, one per time, or a single row. A situation generates cases. A
cell of the stability chart shows the worst outcome of all rows. From best to worst, the outcomes
are:

    right         every value within 1e-6, relative to its size (`Case.error`)
    refused       an error that states the reason; correct where no state exists
    diverged      a finite value that is wrong, or any value where no state exists
    wrong branch  wrong, but within 1e-6 of the other assembly's position
    NaN           no number, or an arithmetic error

A point of the accuracy chart shows the largest error and the time of a method with a setting.
"""

import itertools
import math
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from linkage_lab.output import progress
from linkage_ros import LinkageError

RIGHT, REFUSED, DIVERGED, WRONG_BRANCH, NAN = OUTCOMES = (
    'right', 'refused', 'diverged', 'wrong branch', 'NaN',
)  # fmt: skip
LIMIT = 1e-6  # largest error of a right answer
# Exceptions raised where a formula has no finite value.
FAILURES = (ArithmeticError, ValueError, np.linalg.LinAlgError)
ONE, BATCH = 'one at a time', 'batch'
_SEED = 20_261_121

Setting: TypeAlias = dict[str, float]
Row: TypeAlias = Sequence[float] | None  # an answer: not finite if it failed, None if refused
Panels: TypeAlias = Iterable[tuple[str, str]]  # quantities, each in a mode

# A method with a setting, as in the JSON file:
#   method, mechanism, setting: names and text
#   quantity, mode: the panel
#   us_per_state: time, us, per state with all prior stages, or per simulated ms of a motion (1000
#     us is real time); None if the method fails
#   max_error: largest relative error in the period or motion; None if the method fails
#   pareto: whether the point is on the Pareto front; see `with_fronts`
Point: TypeAlias = dict[str, Any]


@dataclass(frozen=True)
class Method:
    """A method that computes one stage of the solution, or the whole solution.

    Attributes:
        name: Name in charts and docs.
        stage: Result of the method: 'state' (everything), 'position', 'rates', 'motion', 'load'
            or 'friction'.
        needs: Input required in addition to the description of the case.
        source: Publication or file, with the equation number.
        solve: For linkages, the formula of its stage, as in `stages`. For motions, a function
            from the initial value problem and a setting to an integrator. For loads, a function
            of the case.
        settings: The settings for the accuracy chart, from coarse to fine.
        steady: The setting for the stability chart: the best practical setting.
        modes: For linkages: 'one at a time', 'batch' or both.
        tool: Function that makes an additional input of the formula from the case of a linkage and
            the setting.
        narrow: Whether the method computes in single precision, including crank angle and results.
        dyads: For linkages: the quantities that the method also computes for links of dyads.
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
    dyads: tuple[str, ...] = ()


def label(setting: Setting) -> str:
    """Formats a setting as text."""
    return ', '.join(f'{name} {value:g}' for name, value in setting.items())


def attempt(solve: Callable[..., Sequence[float]], *arguments: Any) -> Row:
    """Calls a function; returns its values, NaN after an arithmetic error, None if refused."""
    try:
        with np.errstate(all='ignore'):
            return solve(*arguments)
    except LinkageError:
        return None
    except FAILURES:
        return (math.nan,)


def elapsed(function: Callable[[Any], object], arguments: Iterable[Any]) -> float:
    """Measures the time, s, of calling a function with each argument in turn."""
    start = time.perf_counter()
    for argument in arguments:
        function(argument)
    return time.perf_counter() - start


class Case:
    """A problem with a known answer."""

    def panels(self, method: Method, _: Setting, /) -> Panels:
        """Returns the quantities on which a method is judged, in each of its modes."""
        return [(method.stage, ONE)]

    def rows(self, method: Method, setting: Setting, quantity: str, mode: str) -> Sequence[Row]:
        """Computes a method's answers, one per crank angle or time of the case."""
        raise NotImplementedError

    def error(self, quantity: str, place: int, row: Sequence[float]) -> float:
        """Computes the largest relative error of a finite row; inf if no state exists."""
        raise NotImplementedError

    def outcomes(self, method: Method, setting: Setting, *panel: str) -> list[tuple[str, float]]:
        """Returns outcome and error of each row; the error is inf if refused or not finite."""
        rows = self.rows(method, setting, *panel)
        return [self.outcome(panel[0], place, row) for place, row in enumerate(rows)]

    def outcome(self, quantity: str, place: int, row: Row) -> tuple[str, float]:
        """Returns outcome and error of a row."""
        if row is None:
            return REFUSED, math.inf
        if not all(map(math.isfinite, row)):
            return NAN, math.inf
        error = self.error(quantity, place, row)
        return RIGHT if error <= LIMIT else self.wrong(quantity, place, row), error

    def wrong(self, _quantity: str, _place: int, _row: Sequence[float]) -> str:
        """Classifies a finite row with wrong values."""
        return DIVERGED


@dataclass(frozen=True)
class Situation:
    """A situation in which some methods fail.

    Attributes:
        name: Name in charts and docs.
        words: Description in charts and docs.
        make: Function that makes a case from a random generator and the index of the case.
        exists: Whether a state exists; otherwise the right answer is a refusal.
        share: Divisor of the number of cases; above 1 for slow situations.
        fewest: Smallest number of cases.
        seed: Number and word that seed the random generator; by default the word is the name.
    """

    name: str
    words: str
    make: Callable[[np.random.Generator, int], Case]
    exists: bool = True
    share: int = 1
    fewest: int = 1
    seed: tuple[int, str] | None = None

    def cases(self, count: int) -> list[Case]:
        """Makes `count` / `share` cases, at least `fewest`; every call makes the same cases."""
        number, word = self.seed or (_SEED, self.name)
        random = np.random.default_rng([number, *word.encode()])
        return [self.make(random, i) for i in range(max(self.fewest, count // self.share))]


def measure_outcomes(
    situations: Iterable[Situation], methods: Sequence[Method], *, cases: int
) -> list[dict[str, Any]]:
    """Runs every method in a number of cases of every situation.

    Returns:
        The cells, grouped by situation. A cell has the names of method and situation, the worst
        outcome, and the largest error of all finite values, or None if no value is finite.
    """
    cells = []
    cases_of = lru_cache(1)(Situation.cases)  # all methods of a situation share its cases
    for situation, method in progress([*itertools.product(situations, methods)], 'situations'):
        outcomes = list[tuple[str, float]]()
        for case in cases_of(situation, cases):
            for quantity, mode in case.panels(method, method.steady):
                outcomes += case.outcomes(method, method.steady, quantity, mode)
        errors = [error for _, error in outcomes if math.isfinite(error)]
        cells.append({
            'method': method.name, 'situation': situation.name,
            'outcome': max((outcome for outcome, _ in outcomes), key=OUTCOMES.index),
            'worst_error': max(errors, default=None),
        })  # fmt: skip
    return cells


class _Measured(NamedTuple):
    """A method with a setting, in a panel of the accuracy chart."""

    method: Method
    setting: Setting
    quantity: str
    mode: str


def measure_accuracy(
    cases: Iterable[tuple[str, Any]], methods: Sequence[Method], *, quick: bool
) -> list[Point]:
    """Measures errors and times of methods.

    Args:
        cases: Pairs of a mechanism's name and its `TurnCase` or `MotionCase`.
        methods: Methods to measure in each case.
        quick: Whether to time each method only once.

    Returns:
        The points of the chart, with the Pareto fronts marked.
    """
    points: list[Point] = []
    for name, case in cases:
        measured = [
            _Measured(method, setting, quantity, mode)
            for method in methods
            for setting in method.settings
            for quantity, mode in case.panels(method, setting)
        ]
        errors = [
            max(error for _, error in case.outcomes(*one))
            for one in progress(measured, f'errors, {name}')
        ]
        times = _fastest(
            [case.timer(*one) for one in measured],
            progress(range(1 if quick else case.rounds), f'times, {name}'),
        )
        for one, error, us in zip(measured, errors, times, strict=True):
            points.append({
                'method': one.method.name, 'setting': label(one.setting), 'mechanism': name,
                'quantity': one.quantity, 'mode': one.mode,
                'us_per_state': us if math.isfinite(us) else None,
                'max_error': error if math.isfinite(error) else None,
            })  # fmt: skip
    return with_fronts(points)


def _fastest(timers: Sequence[Callable[[], float]], rounds: Iterable[int]) -> list[float]:
    """Calls timers in turn; returns the shortest time of each, NaN if it fails."""

    def time_of(timer: Callable[[], float]) -> float:
        row = attempt(lambda: (timer(),))
        return row[0] if row else math.nan

    times = [[time_of(timer) for timer in timers] for _ in rounds]
    shortest: list[float] = np.min(times, axis=0).tolist()
    return shortest


def with_fronts(points: list[Point]) -> list[Point]:
    """Marks the Pareto front of each panel.

    A right point is on the front unless another right point is at least as good in both speed and
    accuracy and better in one of them.
    """
    right = [
        point for point in points
        if None not in (point['us_per_state'], point['max_error']) and point['max_error'] <= LIMIT
    ]  # fmt: skip
    return [
        {**p, 'pareto': p in right and not any(_beats(other, p) for other in right)}
        for p in points
    ]


def _beats(one: Point, other: Point) -> bool:
    """Returns whether a point of the same panel is as good in both figures, better in one."""
    panel, figures = ('mechanism', 'quantity', 'mode'), ('us_per_state', 'max_error')
    is_in_panel = all(one[name] == other[name] for name in panel)
    is_as_good = all(one[name] <= other[name] for name in figures)
    is_better = any(one[name] < other[name] for name in figures)
    return is_in_panel and is_as_good and is_better
