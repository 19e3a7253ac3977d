# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One panel of speed against accuracy, with the front of the points that nothing beats."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Hashable, Sequence
from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.path import Path as MplPath
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator
from matplotlib.transforms import Bbox

from linkage_ros.lab.charts.sizes import SMALL
from linkage_ros.lab.methods.accuracy import Measurement
from linkage_ros.lab.methods.bench import LIMIT
from linkage_ros.lab.methods.registry import Way
from linkage_ros.palette import BLACK, Color, fractions

_Across: TypeAlias = Literal['left', 'center', 'right']
_Up: TypeAlias = Literal['bottom', 'center', 'top']

CEILING = 10.0  # where errors without bound are drawn
_LEAST = 1e-17  # an error of nothing, on a logarithmic axis
# Where words may stand beside a point: how far off, and how they are aligned.
_SIDES: tuple[tuple[tuple[float, float], _Across, _Up], ...] = (
    ((6, 0), 'left', 'center'), ((-6, 0), 'right', 'center'),
    ((0, 5), 'center', 'bottom'), ((0, -6), 'center', 'top'),
    ((5, 4), 'left', 'bottom'), ((-5, 4), 'right', 'bottom'),
)  # fmt: skip


class Style(NamedTuple):
    """How a method is drawn.

    Attributes:
        marker: Of its points.
        color: Of markers and line.
        filled: Whether markers are.
        size: Of the markers.
        dotted: Whether the line is.
        above: Whether it is drawn above the others.
    """

    marker: str
    color: Color
    filled: bool = True
    size: float = 6.0
    dotted: bool = False
    above: bool = False

    @property
    def look(self) -> dict[str, Any]:
        """For matplotlib."""
        color = fractions(self.color)
        return {
            'marker': self.marker,
            'color': color,
            'markersize': self.size,
            'markerfacecolor': color if self.filled else 'white',
            'linestyle': ':' if self.dotted else '-',
        }


class Wording(NamedTuple):
    """How the points of a panel are joined and written at.

    Attributes:
        series: Of a point: those with the same one are joined.
        style: Of a series' first point.
        words: Written at the first and the last point of a series; empty: nothing.
        span: Errors of which these points are: beyond, points lie close together.
    """

    series: Callable[[Measurement], Hashable]
    style: Callable[[Measurement], Style]
    words: Callable[[Measurement], str]
    span: tuple[float, float]


def draw_panel(axes: Axes, points: Sequence[Measurement], wording: Wording) -> None:
    """Draws one panel.

    Args:
        axes: To draw in.
        points: Of the panel, series by series.
        wording: How they are joined and written at.
    """
    axes.set_xscale('log')
    axes.set_yscale('log')
    axes.grid(visible=True, which='major', color='0.9', linewidth=0.6)
    axes.axhspan(LIMIT, 1e30, color='0.94', zorder=0)
    drawn = [p for p in points if math.isfinite(p.max_error) and math.isfinite(p.us_per_state)]
    for _, group in itertools.groupby(drawn, key=wording.series):
        _draw_series(axes, list(group), wording)
    front = sorted((p for p in points if p.pareto), key=lambda p: p.us_per_state)
    if front:
        # Steps with corners of their own, so that words see where they run.
        x = np.repeat([p.us_per_state for p in front], 2)[1:]
        y = np.repeat([max(p.max_error, _LEAST) for p in front], 2)[:-1]
        axes.plot(x, y, color=fractions(BLACK), linewidth=1.2, alpha=0.7, zorder=2)
    failed = dict.fromkeys(p.method for p in points if p not in drawn)
    if failed:
        axes.text(
            0.98, 0.565, 'no answer at some angle, in some setting:\n' + '\n'.join(failed),
            fontsize=SMALL, ha='right', va='top', transform=axes.transAxes, color='0.3',
        )  # fmt: skip
    axes.set_ylim(2e-17, 30 * CEILING)
    axes.set_yticks([10.0**exponent for exponent in range(-15, 1, 3)])
    axes.yaxis.set_minor_locator(NullLocator())
    axes.tick_params(labelsize=SMALL)
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f'{value:g}'))
    axes.xaxis.set_minor_locator(NullLocator())


def _draw_series(axes: Axes, points: Sequence[Measurement], wording: Wording) -> None:
    style = wording.style(points[0])
    axes.plot(
        [p.us_per_state for p in points],
        [min(max(p.max_error, _LEAST), CEILING) for p in points],
        linewidth=0.9, zorder=5 if style.above else 3, **style.look,
    )  # fmt: skip


def write_words(axes: Axes, points: Sequence[Measurement], wording: Wording) -> None:
    """Writes at the first and the last point of each series, where there is room.

    Args:
        axes: With its points drawn, and placed for good.
        points: As drawn.
        wording: What to write.
    """
    least, most = wording.span
    drawn = [p for p in points if math.isfinite(p.max_error) and math.isfinite(p.us_per_state)]
    places = axes.transData.transform([(p.us_per_state, p.max_error) for p in drawn])
    taken = [Bbox.from_bounds(x - 6, y - 6, 12, 12) for x, y in places]
    taken += [text.get_window_extent() for text in axes.texts]
    lines = [line.get_transform().transform_path(line.get_path()) for line in axes.lines]
    for _, group in itertools.groupby(drawn, key=wording.series):
        named = [p for p in group if wording.words(p) and least < p.max_error < most]
        for point in (*named[:1], *named[1:][-1:]):
            if box := _write(axes, point, wording, taken, lines):
                taken.append(box)


def _write(
    axes: Axes,
    point: Measurement,
    wording: Wording,
    taken: Sequence[Bbox],
    lines: Sequence[MplPath],
) -> Bbox | None:
    """Writes beside a point, on the first side where nothing is; returns where, if anywhere."""
    inside, color = axes.get_window_extent(), fractions(wording.style(point).color)
    for shift, across, up in _SIDES:
        text = axes.annotate(
            wording.words(point), (point.us_per_state, point.max_error), xytext=shift,
            textcoords='offset points', fontsize=SMALL, color=color, ha=across, va=up,
        )  # fmt: skip
        box = text.get_window_extent()
        free = inside.x0 < box.x0 and box.x1 < inside.x1
        free = free and inside.y0 < box.y0 and box.y1 < inside.y1
        free = free and not any(box.overlaps(other) for other in taken)
        if free and not any(line.intersects_bbox(box, filled=False) for line in lines):
            return box
        text.remove()
    return None


def method_handle(method: Way[Any], style: Style, name: str) -> Line2D:
    """For a legend: a method, with a line if its settings are joined by one."""
    width = 0.9 if len(method.settings) > 1 else 0
    return Line2D([], [], linewidth=width, label=name, **style.look)


def front_handles() -> list[Line2D]:
    """For a legend: the front, and where no front goes."""
    return [
        Line2D([], [], color=fractions(BLACK), linewidth=1.0, label='front of right answers'),
        Line2D([], [], color='0.85', linewidth=7, label=f'worse than {LIMIT:g}: not on the front'),
    ]
