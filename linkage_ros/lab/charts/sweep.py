# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Designs: their Pareto front, and how far each measure spreads."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from linkage_ros.lab.charts.sizes import DPI, NUMBERS, SMALL, TITLE, WIDTH
from linkage_ros.lab.sweep.measures import MEASURES
from linkage_ros.lab.sweep.results import FRONT, OUTSIDE, VALID, Results
from linkage_ros.palette import BLACK, BLUE, GREY, SKY, VERMILION, fractions

_FRONT, _ROW = 4.6, 2.3  # inches
_COLUMNS, _BINS = 3, 60
_MARGIN = 0.08  # of the span of the good designs
_LOOKS: dict[str, dict[str, Any]] = {
    OUTSIDE: {'color': fractions(GREY), 's': 4, 'alpha': 0.5},
    VALID: {'color': fractions(SKY), 's': 6},
    FRONT: {'color': fractions(BLUE), 's': 22},
}


def draw_sweep(results: Results, name: str, path: Path) -> None:
    """Draws the two goals over each other, and the distribution of every measure.

    Args:
        results: Results of a study.
        name: Its name.
        path: The PNG file; replaced if there is one.

    Raises:
        OSError: The picture cannot be written.
    """
    goals, measures = [*results.study.goals], [*results.of]
    rows = math.ceil(len(measures) / _COLUMNS)
    heights = [_FRONT] * bool(goals) + [_ROW] * rows
    figure = Figure(figsize=(WIDTH, sum(heights)), dpi=DPI, layout='constrained')
    words = 'Below: valid designs; solid line: base; 99 % lie between the dashed lines'
    figure.suptitle(f'{name}: {results.summary()}\n{words}', fontsize=TITLE, parse_math=False)
    grid = figure.add_gridspec(len(heights), _COLUMNS, height_ratios=heights)
    if goals:
        _draw_front(figure.add_subplot(grid[0, :]), results, *goals)
    for i, measure in enumerate(measures):
        row, column = divmod(i, _COLUMNS)
        _draw_spread(figure.add_subplot(grid[row + bool(goals), column]), results, measure)
    figure.savefig(path)


def _draw_front(axes: Axes, results: Results, first: str, second: str) -> None:
    for outcome, look in _LOOKS.items():
        chosen = results.outcomes == outcome
        x, y = (results.of[name][chosen] for name in (first, second))
        axes.scatter(x, y, label=outcome, linewidths=0, **look)
    look = {'color': fractions(VERMILION), 'markersize': 11, 'label': 'base'}
    axes.plot(results.base[first], results.base[second], '*', **look)
    axes.set(xlim=_limits(results, first), ylim=_limits(results, second))
    axes.legend(fontsize=SMALL)
    axes.set_ylabel(_words(second), fontsize=SMALL)
    _finish(axes, first)


def _limits(results: Results, measure: str) -> tuple[float, float]:
    """The values of the good designs and of the base: others may lie far away."""
    values = np.append(results.spread(measure), results.base[measure])
    low, high = np.nanmin(values), np.nanmax(values)
    margin = _MARGIN * (high - low) or 1.0
    return low - margin, high + margin


def _draw_spread(axes: Axes, results: Results, measure: str) -> None:
    values = results.spread(measure)
    axes.hist(values, _BINS, color=fractions(SKY))
    axes.axvline(results.base[measure], color=fractions(VERMILION), linewidth=1.4)
    for at in np.quantile(values, (0.005, 0.995)) if len(values) else ():
        axes.axvline(at, color=fractions(BLACK), linewidth=0.9, linestyle=(0, (4, 3)))
    _finish(axes, measure)


def _words(measure: str) -> str:
    words = f'{measure.replace("_", " ").capitalize()}, {MEASURES[measure].unit}'
    return words.removesuffix(', ')


def _finish(axes: Axes, measure: str) -> None:
    axes.set_xlabel(_words(measure), fontsize=SMALL)
    axes.tick_params(labelsize=NUMBERS)
    axes.xaxis.set_major_locator(MaxNLocator(5))
    axes.grid(color='0.88', linewidth=0.6)
    axes.set_axisbelow(True)
