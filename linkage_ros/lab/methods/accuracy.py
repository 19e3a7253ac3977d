# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Speed against accuracy: every method and setting, on three mechanisms and on motions.

For a motion, `us_per_state` is the time of one simulated ms, so that 1000 us is real time. Its
error is the largest at all times; a state is requested every 50 ms, and interpolated by the method
itself if its steps are longer.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from linkage_ros.errors import LinkageError
from linkage_ros.lab.methods.bench import PeriodBench
from linkage_ros.lab.methods.chain import Method, Task, label
from linkage_ros.lab.methods.motion_bench import ENERGY, TRAJECTORY, MotionBench, even
from linkage_ros.lab.methods.outcomes import FAILURES, LIMIT
from linkage_ros.lab.reference.problems import coasting, driven_pump, free_pump, preset

NEAR = 'near a change point'


@dataclass
class Measurement:
    """Speed and error of a method with a setting: a point of the chart.

    Attributes:
        method: Name from the registry.
        setting: The setting as text; empty if there is none.
        mechanism: Name of the mechanism.
        quantity: 'position', 'rate', 'acceleration' or 'torque'; for a motion under a torque,
            'trajectory' or 'energy'.
        mode: 'one at a time' or 'batch'; 'motion' or 'motion, slowest ms'.
        us_per_state: Time including all preceding work, us; for a motion, per simulated ms; nan
            if the method fails.
        max_error: Largest relative error over a period or motion (`bench`, `motion_bench`); inf
            if the method fails.
        pareto: Whether no other correct point is both faster and more accurate.
    """

    method: str
    setting: str
    mechanism: str
    quantity: str
    mode: str
    us_per_state: float
    max_error: float
    pareto: bool = False

    def record(self) -> dict[str, Any]:
        """The record for JSON, with null for inf and nan."""
        return {
            name: None if isinstance(value, float) and not math.isfinite(value) else value
            for name, value in asdict(self).items()
        }


def linkages(*, quick: bool) -> list[tuple[str, PeriodBench]]:
    """The three mechanisms of the chart, by name.

    The third is nearly a kite: its crank pin passes the rocker pivot at 1e-12 m. Its bodies are
    those of the first.
    """
    q, slider_crank = preset('quadrilateral').mechanism, preset('slider_crank').mechanism
    kite = replace(
        q,
        crank=replace(q.crank, length=0.3),
        frame=replace(q.frame, length=0.3 + 1e-12),
        coupler=replace(q.coupler, length=0.5),
        rocker=replace(q.rocker, length=0.5),
    )
    named = ('quadrilateral', q), ('slider_crank', slider_crank), (NEAR, kite)
    angles = 36 if quick else 360
    return [(name, PeriodBench(Task.at(linkage, 0.1), angles)) for name, linkage in named]


def motions(*, quick: bool) -> list[tuple[str, MotionBench]]:
    """The motions: the fast pump, with and without motor and load, and a coasting four-bar."""
    seconds = 0.5 if quick else 10.0
    return [
        ('wind_pump', MotionBench(driven_pump(6.0), even(seconds))),
        ('wind_pump', MotionBench(free_pump(6.0), even(seconds), (ENERGY,))),
        ('quadrilateral', MotionBench(coasting(), even(seconds * 0.4), (TRAJECTORY, ENERGY))),
    ]


def measure_accuracy(
    benches: Iterable[tuple[str, PeriodBench | MotionBench]],
    methods: Sequence[Method],
    *,
    quick: bool,
    progress: Callable[[Iterable[Any], str], Any],
) -> list[Measurement]:
    """Measures errors and times of methods.

    Args:
        benches: Linkages and motions by name.
        methods: The methods.
        quick: Whether to use one round.
        progress: Wraps an iterable in a progress bar with a label.

    Returns:
        The points, with marked Pareto fronts.
    """
    kinds = [(method, setting) for method in methods for setting in method.settings]
    points = []
    for name, bench in benches:
        timed = []
        for method, setting in progress(kinds, f'errors, {name}'):
            for quantity, mode in bench.panels(method, setting):
                error = bench.worst_error(method, setting, mode, quantity)
                words = method.name, label(setting), name, quantity, mode
                point = Measurement(*words, math.inf, error)
                timed.append((point, bench.timer(method, setting, mode, quantity)))
        for _ in progress(range(1 if quick else bench.rounds), f'times, {name}'):
            for point, run in timed:
                point.us_per_state = min(_time(run), point.us_per_state)
        points += [point for point, _ in timed]
    mark_fronts(points)
    return points


def _time(run: Callable[[], float]) -> float:
    """Time of a run, us; nan if the method fails."""
    try:
        with np.errstate(all='ignore'):
            return run()
    except (LinkageError, *FAILURES):
        return math.nan


def mark_fronts(points: list[Measurement]) -> None:
    """Marks the points of each panel that no other correct one beats in both time and error."""
    # What is not right is fast for nothing: no front goes through it.
    right = [point for point in points if point.max_error <= LIMIT]
    for point in right:
        point.pareto = not any(_beats(other, point) for other in right)


def _beats(one: Measurement, other: Measurement) -> bool:
    (*panel, time, error), (*others, its_time, its_error) = (
        (point.mechanism, point.quantity, point.mode, point.us_per_state, point.max_error)
        for point in (one, other)
    )
    no_worse = panel == others and time <= its_time and error <= its_error
    return no_worse and (time, error) != (its_time, its_error)
