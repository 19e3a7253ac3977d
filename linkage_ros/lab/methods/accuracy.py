# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Speed against accuracy: every method and setting, on three mechanisms and on motions.

A motion's time, `us_per_state`, is that of one simulated ms, at which the live default makes one
state: 1000 us would be real time. Its error is the largest at all of its times; a state is asked
for every 50 ms, and read by the method's own means if its steps are longer.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from linkage_ros.errors import LinkageError
from linkage_ros.lab.methods.bench import FAILURES, LIMIT, Bench, time_pass
from linkage_ros.lab.methods.chain import FUNCTIONS, ONE, OWN, QUANTITIES, Task, make_task
from linkage_ros.lab.methods.loop import Linkage
from linkage_ros.lab.methods.motion_bench import ENERGY, TRAJECTORY, MotionBench, even
from linkage_ros.lab.methods.registry import (
    INTEGRATORS,
    METHODS,
    Integrator,
    Method,
    Setting,
    label,
)
from linkage_ros.lab.reference.problems import ChartMechanisms
from linkage_ros.model.four_bar import FourBar
from linkage_ros.model.slider_crank import SliderCrank

NEAR = 'near a change point'
# Of a whole motion; and what a live node has to be ready for, the slowest of its ticks.
MEAN, MIN_RATE = 'motion', 'motion, slowest ms'
_QUICK_STEPS = 360
_TICK = 1e-3  # s


@dataclass
class Measurement:
    """Speed and error of a method with a setting: a point of the chart.

    Attributes:
        method: Name from the registry.
        setting: In words; empty where there is nothing to set.
        mechanism: Name of the mechanism.
        quantity: 'position', 'rate', 'acceleration' or 'torque'; of a motion under a torque
            'trajectory' or 'energy'.
        mode: 'one at a time' or 'batch'; 'motion' or 'motion, slowest ms'.
        us_per_state: Time, us, the work for all that the quantity needs included; of a motion,
            of one simulated ms; nan where the method fails.
        max_error: Over one period or motion, relative (`bench.Truth`, `motion_bench`); inf
            where the method fails.
        pareto: Whether no other right answer is both faster and closer.
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
        """For JSON, which has neither infinity nor nan: null."""
        return {
            name: None if isinstance(value, float) and not math.isfinite(value) else value
            for name, value in asdict(self).items()
        }


class _Timed(NamedTuple):
    """A point, and a run that returns its time, us."""

    point: Measurement
    run: Callable[[], float]


def tasks(quadrilateral: FourBar, slider_crank: SliderCrank) -> dict[str, Task]:
    """The three mechanisms of the chart.

    Args:
        quadrilateral: The four-bar of document 1.
        slider_crank: The slider-crank of document 4.

    Returns:
        Tasks by name; the third is nearly a kite: its crank pin passes the rocker pivot at
        1e-12 m, with the bodies of the first.
    """
    q = quadrilateral
    kite = replace(
        q,
        crank=replace(q.crank, length=0.3),
        frame=replace(q.frame, length=0.3 + 1e-12),
        coupler=replace(q.coupler, length=0.5),
        rocker=replace(q.rocker, length=0.5),
    )
    named: dict[str, Linkage] = {'quadrilateral': q, 'slider_crank': slider_crank, NEAR: kite}
    return {name: make_task(mechanism, 0.1) for name, mechanism in named.items()}


def measure_accuracy(
    benches: dict[str, Bench], *, quick: bool, progress: Callable[[Iterable[Any], str], Any]
) -> list[Measurement]:
    """Measures the methods that solve a linkage.

    Args:
        benches: By name of the mechanism.
        quick: Whether fewer rounds and settings will do.
        progress: Wraps an iterable in a progress bar with a word for it.

    Returns:
        The points, fronts marked.
    """
    timed: list[_Timed] = []
    for name, bench in benches.items():
        for method in progress(METHODS, f'errors, {name}'):
            timed += _points(name, bench, method, quick=quick)
    return _take_times(timed, 1 if quick else 15, progress)


def _points(name: str, bench: Bench, method: Method, *, quick: bool) -> Iterator[_Timed]:
    first = min(QUANTITIES.index(quantity) for quantity in OWN[method.stage])
    ones, batch = bench.aside(36 if quick else 360), 1024 if quick else 4096
    for setting in method.settings:
        if quick and setting.get('steps', 0) > _QUICK_STEPS:
            continue
        for mode, quantity in itertools.product(method.modes, QUANTITIES[first:]):
            error = bench.worst_error(method, setting, mode, quantity)
            cranks = bench.even(int(setting['steps'])) if method.sequential else ones
            asked = cranks.tolist() if mode == ONE else np.resize(cranks, batch)
            function = getattr(method.make(bench.task, setting, FUNCTIONS[mode]), quantity)
            yield _Timed(
                Measurement(method.name, label(setting), name, quantity, mode, math.nan, error),
                partial(time_pass, function, asked),
            )


def measure_motion_accuracy(
    mechanisms: ChartMechanisms,
    *,
    quick: bool,
    progress: Callable[[Iterable[Any], str], Any],
    methods: Sequence[Integrator] = INTEGRATORS,
) -> list[Measurement]:
    """Measures the integrators: the pump at its fast speed, the quadrilateral coasting.

    Args:
        mechanisms: The mechanisms that move.
        quick: Whether a tenth of the time and fewer rounds will do.
        progress: Wraps an iterable in a progress bar with a word for it.
        methods: The integrators.

    Returns:
        The points, fronts marked.
    """
    seconds = 1.0 if quick else 10.0
    coasting = MotionBench(mechanisms.coasting(5 * math.pi), even(seconds * 0.4))
    driven = MotionBench(mechanisms.driven(6.0), even(seconds))
    free = MotionBench(mechanisms.freed(6.0), even(seconds))
    kinds = [(method, setting) for method in methods for setting in method.settings]
    timed: list[_Timed] = []
    for name, moved, kept in (('wind_pump', driven, free), ('quadrilateral', coasting, coasting)):
        for method, setting in progress(kinds, f'motions, {name}'):
            timed += _motion_points(name, moved, kept, method, setting, 300 if quick else 1000)
    return _take_times(timed, 1 if quick else 3, progress)


def _motion_points(
    name: str, moved: MotionBench, kept: MotionBench, method: Integrator, setting: Setting,
    ticks: int,
) -> Iterator[_Timed]:  # fmt: skip
    def timed(bench: MotionBench, quantity: str, mode: str, run: Callable[[], float]) -> _Timed:
        error = bench.worst_error(method, setting, quantity)
        point = Measurement(method.name, label(setting), name, quantity, mode, math.nan, error)
        return _Timed(point, run)

    yield timed(moved, TRAJECTORY, MEAN, partial(_mean_time, method, setting, moved))
    if setting.get('step', 0) <= _TICK:
        run = partial(_slowest_time, method, setting, moved, ticks)
        yield timed(moved, TRAJECTORY, MIN_RATE, run)
    yield timed(kept, ENERGY, MEAN, partial(_mean_time, method, setting, kept))


def _mean_time(method: Integrator, setting: Setting, bench: MotionBench) -> float:
    """The time of a simulated ms of the whole motion, us."""
    follower = method.make(bench.problem, setting)
    start = time.perf_counter()
    for moment in bench.times:
        follower.at(moment)
    return (time.perf_counter() - start) / bench.times[-1] * 1e3


def _slowest_time(method: Integrator, setting: Setting, bench: MotionBench, count: int) -> float:
    """The time of the slowest ms of the first ones, asked for every ms, us."""
    fastest = [math.inf] * count
    for _ in range(3):
        follower = method.make(bench.problem, setting)
        for i in range(count):
            start = time.perf_counter()
            follower.at((i + 1) * _TICK)
            fastest[i] = min(fastest[i], time.perf_counter() - start)
    return max(fastest) * 1e6


def _take_times(
    timed: list[_Timed], rounds: int, progress: Callable[[Iterable[Any], str], Any]
) -> list[Measurement]:
    """The points with the shortest times of all rounds; no time where a method fails."""
    for point, _ in timed:
        point.us_per_state = math.inf
    with np.errstate(all='ignore'):
        for _ in progress(range(rounds), 'times'):
            for point, run in timed:
                point.us_per_state = min(_time(run), point.us_per_state)
    points = [one.point for one in timed]
    mark_fronts(points)
    return points


def _time(run: Callable[[], float]) -> float:
    try:
        return run()
    except (LinkageError, *FAILURES):
        return math.nan


def mark_fronts(points: list[Measurement]) -> None:
    """Marks the points of each panel that no other right one beats in both time and error."""
    panels: dict[tuple[str, str, str], list[Measurement]] = {}
    for point in points:
        panels.setdefault((point.mechanism, point.quantity, point.mode), []).append(point)
    for panel in panels.values():
        # What is not right is fast for nothing: no front goes through it.
        right = [point for point in panel if point.max_error <= LIMIT]
        for point in right:
            point.pareto = not any(_beats(other, point) for other in right)


def _beats(one: Measurement, other: Measurement) -> bool:
    no_worse = one.us_per_state <= other.us_per_state and one.max_error <= other.max_error
    return no_worse and (one.us_per_state, one.max_error) != (other.us_per_state, other.max_error)
