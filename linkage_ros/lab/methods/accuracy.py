# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Speed against accuracy: every method and setting, measured on three mechanisms."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from linkage_ros.lab.methods.bench import LIMIT, Bench, time_pass
from linkage_ros.lab.methods.chain import (
    FUNCTIONS,
    ONE,
    OWN,
    QUANTITIES,
    Function,
    Task,
    make_task,
)
from linkage_ros.lab.methods.loop import Linkage
from linkage_ros.lab.methods.registry import METHODS, Method, label
from linkage_ros.model.four_bar import FourBar
from linkage_ros.model.slider_crank import SliderCrank
from linkage_ros.numeric import Array

NEAR = 'near a change point'
_QUICK_STEPS = 360


@dataclass
class Measurement:
    """Speed and error of a method with a setting: a point of the chart.

    Attributes:
        method: Name from the registry.
        setting: In words; empty where there is nothing to set.
        mechanism: What it was measured on.
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
    point: Measurement
    function: Function
    cranks: list[float] | Array  # for the time


def tasks(quadrilateral: FourBar, slider_crank: SliderCrank) -> dict[str, Task]:
    """The three mechanisms of the chart.

    Args:
        quadrilateral: The four-bar of document 1.
        slider_crank: Of document 4.

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
    """Measures all points.

    Args:
        benches: By name of the mechanism.
        quick: Whether fewer rounds and settings will do.
        progress: Wraps what is gone through, with a word for it: a progress bar.

    Returns:
        The points, fronts marked.
    """
    timed: list[_Timed] = []
    for name, bench in benches.items():
        for method in progress(METHODS, f'errors, {name}'):
            timed += _points(name, bench, method, quick=quick)
    times = []
    for _ in progress(range(2 if quick else 15), 'times'):
        with np.errstate(all='ignore'):
            times.append([time_pass(one.function, one.cranks) for one in timed])
    points = [one.point for one in timed]
    for point, fastest in zip(points, np.min(times, axis=0).tolist(), strict=True):
        point.us_per_state = fastest
    mark_fronts(points)
    return points


def _points(name: str, bench: Bench, method: Method, *, quick: bool) -> Iterable[_Timed]:
    first = min(QUANTITIES.index(quantity) for quantity in OWN[method.stage])
    ones, batch = bench.aside(72 if quick else 360), 1024 if quick else 4096
    for setting in method.settings:
        if quick and setting.get('steps', 0) > _QUICK_STEPS:
            continue
        for mode in method.modes:
            for quantity in QUANTITIES[first:]:
                error = bench.worst_error(method, setting, mode, quantity)
                point = Measurement(
                    method.name, label(setting), name, quantity, mode, math.nan, error
                )
                cranks = bench.even(int(setting['steps'])) if method.sequential else ones
                made = method.make(bench.task, setting, FUNCTIONS[mode])
                yield _Timed(
                    point,
                    getattr(made, quantity),
                    cranks.tolist() if mode == ONE else np.resize(cranks, batch),
                )


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
