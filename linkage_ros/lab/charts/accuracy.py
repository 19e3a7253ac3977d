# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Speed against accuracy: a picture for each linkage, and one for all motions."""

from __future__ import annotations

import itertools
import math
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from linkage_ros.lab.charts.sizes import DPI, SMALL, TEXT, TITLE, WIDTH
from linkage_ros.lab.methods.accuracy import NEAR, Measurement
from linkage_ros.lab.methods.chain import BATCH, ONE, QUANTITIES, Method, label
from linkage_ros.lab.methods.motion_bench import ENERGY, MEAN, SLOWEST, TRAJECTORY
from linkage_ros.lab.methods.outcomes import LIMIT
from linkage_ros.lab.methods.registry import DEFAULT, INTEGRATORS, LIVE, METHODS, RECORDS
from linkage_ros.palette import (
    BLACK,
    BLUE,
    DARK,
    GREEN,
    ORANGE,
    PURPLE,
    SKY,
    VERMILION,
    Color,
    fractions,
)

_CEILING = 10.0  # where larger errors are drawn
_LEAST = 1e-17  # where an error of 0 is drawn


class _Style(NamedTuple):
    """The style of a method; the defaults have the most prominent colour."""

    marker: str
    color: Color
    filled: bool = True
    size: float = 6.0

    @property
    def options(self) -> dict[str, Any]:
        """Options for matplotlib."""
        color = fractions(self.color)
        face = color if self.filled else 'white'
        return {
            'marker': self.marker, 'color': color, 'markersize': self.size,
            'markerfacecolor': face,
        }  # fmt: skip


_STYLES = {
    DEFAULT: _Style('*', VERMILION, size=13),
    'factored, float32': _Style('*', VERMILION, filled=False, size=9),
    'two circles': _Style('D', BLACK),
    'half-angle': _Style('s', BLUE),
    'Newton-Raphson': _Style('^', GREEN),
    "document 1's listing": _Style('v', SKY, size=7),
    'table, cubic Hermite': _Style('o', PURPLE),
    '2x2 solve': _Style('P', ORANGE, size=7),
    'central differences': _Style('.', DARK, size=7),
    LIVE: _Style('o', VERMILION),
    RECORDS: _Style('*', VERMILION, filled=False, size=11),
    'DOP853': _Style('s', BLUE),
    'RK4': _Style('^', GREEN),
    'Radau': _Style('D', PURPLE),
    'multipliers, unstabilised': _Style('X', DARK),
    'multipliers, Baumgarte': _Style('P', SKY, size=7),
    'multipliers, projected': _Style('v', ORANGE),
}
_OTHER = _Style('d', DARK, filled=False)  # of a method from outside the package
_STEADY = _Style('*', VERMILION, size=13)  # of the live default at its own setting
_ROLES = {DEFAULT: 'default', LIVE: 'live; star: steps of 1 ms', RECORDS: 'default for records'}


def draw_accuracy(points: Sequence[Measurement], title: str, path: Path) -> None:
    """Draws one linkage, quantity by quantity in both modes; or all motions, row by row.

    Args:
        points: Points of a linkage, or of all motions.
        title: Title of the picture.
        path: The PNG file, replaced if it exists.

    Raises:
        OSError: The picture cannot be written.
    """
    if points[0].quantity in QUANTITIES:
        methods: Sequence[Method] = METHODS
        wide, columns = 2, [*itertools.product(QUANTITIES, (ONE, BATCH))]
        named = '{1}, {2}'
        time, error = 'time per state', 'relative (angles: rad)'
    else:
        wide, columns = 3, [(TRAJECTORY, MEAN), (ENERGY, MEAN), (TRAJECTORY, SLOWEST)]
        methods, named = INTEGRATORS, '{0}, {1}, {2}'
        time, error = 'time per simulated ms', 'rad, crank lengths, or relative'
    mechanisms = dict.fromkeys(point.mechanism for point in points)
    panels = [(name, *column) for name in mechanisms for column in columns]
    high = len(panels) // wide
    figure = Figure(figsize=(WIDTH, 2.6 + 2.2 * high), dpi=DPI, layout='constrained')
    figure.suptitle(title, fontsize=TITLE)
    grid = figure.subplots(high, wide, sharey=True, sharex='col')
    for axes, panel in zip(grid.flat, panels, strict=True):
        _draw_panel(axes, [p for p in points if (p.mechanism, p.quantity, p.mode) == panel])
        words = named.format(*panel).replace('_', ' ').replace(f', {MEAN}', '')
        axes.set_title(words, fontsize=TEXT)
    for axes in grid[-1]:
        axes.set_xlabel(f'{time}, \N{MICRO SIGN}s', fontsize=TEXT)
        low, high = axes.get_xlim()
        # Axes of more than two decades have no room for labels at 2 and 5.
        axes.xaxis.set_major_locator(
            LogLocator(subs=(1.0, 2.0, 5.0) if high < 200 * low else (1,))
        )
    figure.supylabel(f'largest error: {error}', fontsize=TEXT)
    handles = [
        Line2D([], [], linewidth=0.9 if len(method.settings) > 1 else 0, label=_name(method.name),
               **_STYLES.get(method.name, _OTHER).options)
        for method in methods
    ]  # fmt: skip
    handles += [
        Line2D([], [], color=fractions(BLACK), linewidth=1.0, label='front of right answers'),
        Line2D([], [], color='0.85', linewidth=7, label=f'worse than {LIMIT:g}: not on the front'),
    ]
    figure.legend(
        handles=handles, loc='outside lower center', ncols=3, fontsize=SMALL, frameon=False,
        title_fontsize=SMALL, title=textwrap.fill(_settings(methods), 115),
    )  # fmt: skip
    figure.savefig(path)


def _draw_panel(axes: Axes, points: Sequence[Measurement]) -> None:
    axes.set_xscale('log')
    axes.set_yscale('log')
    axes.grid(visible=True, which='major', color='0.9', linewidth=0.6)
    axes.axhspan(LIMIT, 1e30, color='0.94', zorder=0)
    drawn = [p for p in points if math.isfinite(p.max_error) and math.isfinite(p.us_per_state)]
    for method, group in itertools.groupby(drawn, key=lambda point: point.method):
        found = list(group)
        axes.plot(
            [p.us_per_state for p in found], [_height(p) for p in found], linewidth=0.9,
            zorder=5 if method in _ROLES else 3,
            **_STYLES.get(method, _OTHER).options,
        )  # fmt: skip
    for point in drawn:
        if (point.method, point.setting) == (LIVE, label(INTEGRATORS[0].steady)):
            axes.plot([point.us_per_state], [_height(point)], zorder=6, **_STEADY.options)
    front = sorted((p for p in points if p.pareto), key=lambda p: p.us_per_state)
    axes.step(
        [p.us_per_state for p in front], [_height(p) for p in front], where='post',
        color=fractions(BLACK), linewidth=1.2, alpha=0.7, zorder=2,
    )  # fmt: skip
    failed = dict.fromkeys(p.method for p in points if p not in drawn)
    if failed:
        height = 0.565 if points[0].mechanism == NEAR else 0.97  # clear of the curves
        axes.text(
            0.98, height, 'no answer at some angle, in some setting:\n' + '\n'.join(failed),
            fontsize=SMALL, ha='right', va='top', transform=axes.transAxes, color='0.3',
        )  # fmt: skip
    axes.set_ylim(2e-17, 30 * _CEILING)
    axes.set_yticks([10.0**exponent for exponent in range(-15, 1, 3)])
    axes.tick_params(labelsize=SMALL)
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f'{value:g}'))
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_minor_locator(NullLocator())


def _height(point: Measurement) -> float:
    return float(np.clip(point.max_error, _LEAST, _CEILING))


def _settings(methods: Sequence[Method]) -> str:
    """Labels the points with their settings."""
    kinds: dict[str, list[str]] = {}
    for method in methods:
        for name in dict.fromkeys(itertools.chain(*method.settings)):
            values = sorted({setting[name] for setting in method.settings if name in setting})
            if len(values) > 1:
                words = f'{name} ' + ', '.join(f'{value:g}' for value in values)
                kinds.setdefault(words, []).append(method.name)
    joined = '; '.join(f'{", ".join(names)}: {words}' for words, names in kinds.items())
    return f'Settings along the lines: {joined}. Errors above {_CEILING:g} are drawn there.'


def _name(method: str) -> str:
    return f'{method} ({_ROLES[method]})' if method in _ROLES else method
