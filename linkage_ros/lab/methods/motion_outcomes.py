# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Outcome of each integrator in each situation, by the rule of `outcomes`.

A motion is asked for at one time after another. A cell is its worst outcome:

    right         every value within 1e-6: of the trajectory in rad, crank lengths and the largest
                  rates, of the energy relative to the kinetic one at first, of the loop in crank
                  lengths
    refused       an error that says why; beyond the end of the coordinates a right answer
    diverged      a finite value that is wrong
    NaN           no number, or an arithmetic error

Its number is the largest error in the cases of that outcome; of refusals, how far the time that
they tell is from the one at which coupler and third link are in line, s.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from linkage_ros.errors import LinkageError, MotionError
from linkage_ros.lab.methods.bench import FAILURES, LIMIT
from linkage_ros.lab.methods.motion_bench import ENERGY, LOOP, MotionBench
from linkage_ros.lab.methods.motion_situations import (
    MOTION_SITUATIONS,
    MotionCase,
    MotionSituation,
)
from linkage_ros.lab.methods.outcomes import DIVERGED, NAN, OUTCOMES, REFUSED, RIGHT, Cell
from linkage_ros.lab.methods.registry import INTEGRATORS, Integrator
from linkage_ros.lab.reference.problems import ChartMechanisms, Phase


class _Followed(NamedTuple):
    """The motion as a method follows it.

    Attributes:
        phases: At the times that were asked for, as far as it came.
        gaps: Gaps of the loop at these times, m.
        failure: Why it stopped: REFUSED or NAN; None: it did not.
        end: The time of the end that a refusal reports, s; nan: none.
    """

    phases: list[Phase]
    gaps: list[float]
    failure: str | None = None
    end: float = math.nan


def measure_motion_outcomes(
    mechanisms: ChartMechanisms,
    *,
    cases: int,
    progress: Callable[[Iterable[Any], str], Iterable[Any]],
    situations: tuple[MotionSituation, ...] = MOTION_SITUATIONS,
    methods: Sequence[Integrator] = INTEGRATORS,
) -> list[Cell]:
    """Runs every integrator through every situation.

    Args:
        mechanisms: What moves.
        cases: Number of cases of each situation; long motions have fewer.
        progress: Wraps what is gone through, with a word for it: a progress bar.
        situations: Situations to run through.
        methods: Methods to run.

    Returns:
        The cells, situation by situation.
    """
    cells = []
    groups = [list(group) for _, group in itertools.groupby(situations, key=lambda s: s.generate)]
    every = progress(list(itertools.product(groups, methods)), 'motions')
    for group, pairs in itertools.groupby(every, key=lambda pair: pair[0]):
        found = group[0].cases(mechanisms, cases)
        benches = [MotionBench(case.problem, case.times, case.formula) for case in found]
        # Situations that share their motions share what comes of them.
        runs = [(method, [_follow(method, case) for case in found]) for _, method in pairs]
        for situation, (method, followed) in itertools.product(group, runs):
            judged = [
                _judge(situation, *parts) for parts in zip(found, benches, followed, strict=True)
            ]
            outcome = max((outcome for outcome, _ in judged), key=OUTCOMES.index)
            errors = [error for other, error in judged if other == outcome and error is not None]
            cells.append(Cell(method.name, situation.name, outcome, max(errors, default=None)))
    return cells


def _follow(method: Integrator, case: MotionCase) -> _Followed:
    phases: list[Phase] = []
    gaps: list[float] = []
    try:
        with np.errstate(all='ignore'):
            follower = method.make(case.problem, method.steady)
            for time in case.times:
                phase = follower.at(time)
                if not all(map(math.isfinite, phase)):
                    return _Followed(phases, gaps, NAN)
                # A phase that no position belongs to is refused here, as where it is published.
                gaps.append(follower.gap())
                phases.append(phase)
    except LinkageError as error:
        end = error.time if isinstance(error, MotionError) else math.nan
        return _Followed(phases, gaps, REFUSED, end)
    except FAILURES:
        return _Followed(phases, gaps, NAN)
    return _Followed(phases, gaps)


def _judge(
    situation: MotionSituation, case: MotionCase, bench: MotionBench, followed: _Followed
) -> tuple[str, float | None]:
    """The outcome of one motion, and its number."""
    end = math.inf if case.end is None else case.end
    errors: list[float] = []
    for i, time in enumerate(case.times):
        if (time < end) != situation.exists:
            continue
        if i < len(followed.phases):
            errors.append(_error(situation.judged, bench, followed, i))
            continue
        if max(errors, default=0.0) <= LIMIT:
            late = abs(followed.end - end)
            return followed.failure or NAN, late if math.isfinite(late) else None
        break
    worst = max(errors)
    return RIGHT if worst <= LIMIT else DIVERGED, worst


def _error(judged: str, bench: MotionBench, followed: _Followed, index: int) -> float:
    if judged == ENERGY:
        return bench.drift(followed.phases[index])
    if judged == LOOP:
        return followed.gaps[index] / bench.problem.mechanism.crank.length
    return bench.error(index, followed.phases[index])
