# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Speed against accuracy: a picture for each mechanism, and one for all integrators."""

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
from linkage_ros.lab.methods.accuracy import MEAN, MIN_RATE, Measurement
from linkage_ros.lab.methods.bench import LIMIT
from linkage_ros.lab.methods.chain import BATCH, ONE, QUANTITIES
from linkage_ros.lab.methods.motion_bench import ENERGY, TRAJECTORY
from linkage_ros.lab.methods.registry import (
    DEFAULT,
    INTEGRATORS,
    LIVE,
    METHODS,
    RECORDS,
    Way,
    label,
)
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
    """The look of a method; the defaults have the colour that stands out most."""

    marker: str
    color: Color
    filled: bool = True
    size: float = 6.0

    @property
    def options(self) -> dict[str, Any]:
        """For matplotlib."""
        color = fractions(self.color)
        face = color if self.filled else 'white'
        return {
            'marker': self.marker, 'color': color, 'markersize': self.size,
            'markerfacecolor': face,
        }  # fmt: skip


_STYLES = {
    DEFAULT: _Style('*', VERMILION, size=13),
    'factored, float32': _Style('*', VERMILION, filled=False, size=9),
    'half-angle': _Style('s', BLUE),
    'inverse cosine': _Style('D', SKY),
    'Newton-Raphson, warm': _Style('^', GREEN),
    'Newton-Raphson, cold': _Style('v', GREEN, filled=False),
    'table, cubic Hermite': _Style('o', PURPLE),
    'Fourier series': _Style('o', PURPLE, filled=False),
    '2x2 solve': _Style('P', ORANGE, size=7),
    'sine formula': _Style('X', SKY, size=7),
    'central differences': _Style('.', DARK, size=7),
    'power balance': _Style('h', BLACK, size=7),
    'constrained Newton-Euler': _Style('X', BLACK, size=7),
    LIVE: _Style('o', VERMILION),
    RECORDS: _Style('*', VERMILION, filled=False, size=11),
    'DOP853': _Style('s', BLUE),
    'RK4': _Style('^', GREEN),
    'Radau': _Style('D', PURPLE),
    'multipliers, unstabilised': _Style('X', DARK),
}
_OTHER = _Style('d', DARK, filled=False)  # of a method from outside the package
_STEADY = _Style('*', VERMILION, size=13)  # of the live default at its own setting
_ROLES = {DEFAULT: 'default', LIVE: 'live; star: steps of 1 ms', RECORDS: 'default for records'}


class _Panel(NamedTuple):
    title: str
    points: Sequence[Measurement]


def draw_accuracy(points: Sequence[Measurement], title: str, path: Path) -> None:
    """Draws a row for each quantity and a column for each mode, of one mechanism.

    Args:
        points: Points of the mechanism.
        title: Title of the picture.
        path: The PNG file; replaced if there is one.

    Raises:
        OSError: The picture cannot be written.
    """
    rows = [
        [
            _Panel(
                f'{quantity}, {mode}',
                [p for p in points if (p.quantity, p.mode) == (quantity, mode)],
            )
            for mode in (ONE, BATCH)
        ]
        for quantity in QUANTITIES
    ]
    _draw(rows, METHODS, ('time per state', 'relative (angles: rad)'), title, path)


def draw_integration(points: Sequence[Measurement], title: str, path: Path) -> None:
    """Draws a row for each mechanism: trajectory, energy, and the slowest millisecond.

    Args:
        points: Points of all mechanisms.
        title: Title of the picture.
        path: The PNG file; replaced if there is one.

    Raises:
        OSError: The picture cannot be written.
    """
    columns = (
        (TRAJECTORY, MEAN, 'trajectory'), (ENERGY, MEAN, 'energy'),
        (TRAJECTORY, MIN_RATE, 'trajectory, slowest ms'),
    )  # fmt: skip
    rows = [
        [
            _Panel(
                f'{name.replace("_", " ")}, {caption}',
                [p for p in points if (p.mechanism, p.quantity, p.mode) == (name, quantity, mode)],
            )
            for quantity, mode, caption in columns
        ]
        for name in dict.fromkeys(point.mechanism for point in points)
    ]
    axes = 'time per simulated ms', 'rad, crank lengths, or relative'
    _draw(rows, INTEGRATORS, axes, title, path)


def _draw(
    rows: list[list[_Panel]],
    methods: Sequence[Way[Any]],
    labels: tuple[str, str],
    title: str,
    path: Path,
) -> None:
    """Draws panels and a legend; the labels are those of time and error."""
    figure = Figure(figsize=(WIDTH, 2.6 + 2.2 * len(rows)), dpi=DPI, layout='constrained')
    figure.suptitle(title, fontsize=TITLE)
    grid = figure.subplots(len(rows), len(rows[0]), sharey=True, sharex='col', squeeze=False)
    for axes, panel in zip(grid.flat, itertools.chain(*rows), strict=True):
        _draw_panel(axes, panel.points)
        axes.set_title(panel.title, fontsize=TEXT)
    for axes in grid[-1]:
        axes.set_xlabel(f'{labels[0]}, \N{MICRO SIGN}s', fontsize=TEXT)
    figure.supylabel(f'largest error: {labels[1]}', fontsize=TEXT)
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
    for (method, by_steps), group in itertools.groupby(drawn, key=_series):
        found = list(group)
        axes.plot(
            [p.us_per_state for p in found], [_height(p) for p in found], ':' if by_steps else '-',
            linewidth=0.9, zorder=5 if method in _ROLES else 3,
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
        axes.text(
            0.98, 0.565, 'no answer at some angle, in some setting:\n' + '\n'.join(failed),
            fontsize=SMALL, ha='right', va='top', transform=axes.transAxes, color='0.3',
        )  # fmt: skip
    axes.set_ylim(2e-17, 30 * _CEILING)
    axes.set_yticks([10.0**exponent for exponent in range(-15, 1, 3)])
    axes.tick_params(labelsize=SMALL)
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f'{value:g}'))
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_minor_locator(NullLocator())


def _series(point: Measurement) -> tuple[str, bool]:
    """Points joined by a line: Newton's steps per turn are a series of their own."""
    return point.method, 'steps' in point.setting and not point.setting.endswith('steps 360')


def _height(point: Measurement) -> float:
    return float(np.clip(point.max_error, _LEAST, _CEILING))


def _settings(methods: Sequence[Way[Any]]) -> str:
    """The settings along the lines."""
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
