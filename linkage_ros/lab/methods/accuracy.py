# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Speed against accuracy: every method and setting, on three linkages and on motions."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any, TypeAlias

from linkage_ros.lab.methods.linkage_cases import TurnCase
from linkage_ros.lab.methods.measure import LIMIT, Method, Progress, attempt, label
from linkage_ros.lab.methods.motion_cases import ENERGY, TRAJECTORY, MotionCase, even
from linkage_ros.lab.reference.problems import coasting, driven_pump, free_pump, preset

NEAR = 'near a change point'

# A method with a setting, as in the JSON file: names of 'method' and 'mechanism'; 'setting' as
# text; 'quantity' and 'mode'; 'us_per_state', us, including all preceding work, for a motion per
# simulated ms, so that 1000 us is real time; 'max_error', the largest relative error over the
# period or motion; None where the method fails; 'pareto': no right point is faster and closer.
Point: TypeAlias = dict[str, Any]


def linkages(*, quick: bool) -> list[tuple[str, TurnCase]]:
    """The three linkages of the chart, by name.

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
    return [(name, TurnCase(linkage, 36 if quick else 360)) for name, linkage in named]


def motions(*, quick: bool) -> list[tuple[str, MotionCase]]:
    """The motions: the fast pump, with and without motor and load, and a coasting four-bar."""
    seconds = 0.5 if quick else 10.0
    return [
        ('wind_pump', MotionCase(driven_pump(6.0), even(seconds))),
        ('wind_pump', MotionCase(free_pump(6.0), even(seconds), (ENERGY,))),
        ('quadrilateral', MotionCase(coasting(), even(seconds * 0.4), (TRAJECTORY, ENERGY))),
    ]


def measure_accuracy(
    cases: Iterable[tuple[str, TurnCase | MotionCase]],
    methods: Sequence[Method],
    *,
    quick: bool,
    progress: Progress,
) -> list[Point]:
    """Measures errors and times of methods.

    Args:
        cases: Linkages and motions by name.
        methods: The methods.
        quick: Whether to use one round.
        progress: Wraps an iterable in a progress bar with a label.

    Returns:
        The points of the chart, with marked Pareto fronts.
    """
    points: list[Point] = []
    for name, case in cases:
        asked = [
            (method, setting, *panel)
            for method in methods
            for setting in method.settings
            for panel in case.panels(method, setting)
        ]
        outcomes = [case.outcomes(*each) for each in progress(asked, f'errors, {name}')]
        timers = [case.timer(*each) for each in asked]
        rounds = progress(range(1 if quick else case.rounds), f'times, {name}')
        times = zip(*([attempt(timer) for timer in timers] for _ in rounds), strict=True)
        for (method, setting, quantity, mode), found, taken in zip(
            asked, outcomes, times, strict=True
        ):
            us = min(each[0] if each else math.nan for each in taken)
            error = max(error for _, error in found)
            points.append({
                'method': method.name, 'setting': label(setting), 'mechanism': name,
                'quantity': quantity, 'mode': mode,
                'us_per_state': us if math.isfinite(us) else None,
                'max_error': error if math.isfinite(error) else None,
            })  # fmt: skip
    return with_fronts(points)


def with_fronts(points: list[Point]) -> list[Point]:
    """Marks the Pareto front of each panel: right points that no other right point dominates."""
    # Wrong points are not part of any front.
    right = [
        point for point in points
        if None not in (point['us_per_state'], point['max_error']) and point['max_error'] <= LIMIT
    ]  # fmt: skip
    return [
        {**p, 'pareto': p in right and not any(_beats(other, p) for other in right)}
        for p in points
    ]


def _beats(one: Point, other: Point) -> bool:
    panel, figures = ('mechanism', 'quantity', 'mode'), ('us_per_state', 'max_error')
    return (
        all(one[name] == other[name] for name in panel)
        and all(one[name] <= other[name] for name in figures)
        and any(one[name] < other[name] for name in figures)
    )
