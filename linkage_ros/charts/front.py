# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One panel of speed against accuracy, with the front of the points that nothing beats."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Hashable, Sequence
from typing import Any, NamedTuple

from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator
from matplotlib.transforms import Bbox

from linkage_ros.methods.accuracy import RIGHT, Point
from linkage_ros.palette import BLACK, Color, fractions

CEILING = 10.0  # where errors without bound are drawn
_LEAST = 1e-17  # an error of nothing, on a logarithmic axis


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
    size: float = 5.0
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
        words: Written at a point; empty: nothing.
        span: Errors between which anything is written; beyond, points lie close together.
    """

    series: Callable[[Point], Hashable]
    style: Callable[[Point], Style]
    words: Callable[[Point], str]
    span: tuple[float, float]


def draw_panel(axes: Axes, points: Sequence[Point], wording: Wording) -> None:
    """Draws one panel.

    Args:
        axes: To draw in.
        points: Of the panel, series by series.
        wording: How they are joined and written at.
    """
    axes.set_xscale('log')
    axes.set_yscale('log')
    axes.grid(visible=True, which='major', color='0.9', linewidth=0.6)
    axes.axhspan(RIGHT, 1e30, color='0.94', zorder=0)
    drawn = [p for p in points if math.isfinite(p.max_error) and math.isfinite(p.us_per_state)]
    for _, group in itertools.groupby(drawn, key=wording.series):
        _draw_series(axes, list(group), wording)
    front = sorted((p for p in points if p.pareto), key=lambda p: p.us_per_state)
    if front:
        axes.step(
            [p.us_per_state for p in front], [max(p.max_error, _LEAST) for p in front],
            where='post', color=fractions(BLACK), linewidth=1.0, alpha=0.7, zorder=2,
        )  # fmt: skip
    failed = dict.fromkeys(p.method for p in points if p not in drawn)
    if failed:
        axes.text(
            0.98, 0.55, 'no answer at some angle,\nin some setting:\n' + '\n'.join(failed),
            fontsize=7.5, ha='right', va='top', transform=axes.transAxes, color='0.3',
        )  # fmt: skip
    axes.set_ylim(2e-17, 2 * CEILING)
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f'{value:g}'))
    axes.xaxis.set_minor_locator(NullLocator())


def _draw_series(axes: Axes, points: Sequence[Point], wording: Wording) -> None:
    style = wording.style(points[0])
    axes.plot(
        [p.us_per_state for p in points],
        [min(max(p.max_error, _LEAST), CEILING) for p in points],
        linewidth=0.7, zorder=5 if style.above else 3, **style.look,
    )  # fmt: skip


def write_words(axes: Axes, points: Sequence[Point], wording: Wording) -> None:
    """Writes at the points of a panel, where there is room.

    Args:
        axes: With its points drawn, and placed for good.
        points: As drawn.
        wording: What to write.
    """
    least, most = wording.span
    drawn = [p for p in points if math.isfinite(p.max_error) and math.isfinite(p.us_per_state)]
    places = axes.transData.transform([(p.us_per_state, p.max_error) for p in drawn])
    taken = [Bbox.from_bounds(x - 4, y - 4, 8, 8) for x, y in places]
    for point in drawn:
        if not ((words := wording.words(point)) and least < point.max_error < most):
            continue
        color = fractions(wording.style(point).color)
        text = axes.annotate(
            words, (point.us_per_state, point.max_error), fontsize=7, xytext=(5, 1),
            color=color, textcoords='offset points', annotation_clip=True,
        )  # fmt: skip
        box = text.get_window_extent()
        if any(box.overlaps(other) for other in taken):
            text.remove()
        else:
            taken.append(box)


def front_handles() -> list[Line2D]:
    """For a legend: the front, and where no front goes."""
    return [
        Line2D([], [], color=fractions(BLACK), linewidth=1.0, label='front of right answers'),
        Line2D([], [], color='0.85', linewidth=7, label=f'worse than {RIGHT:g}: not on the front'),
    ]
