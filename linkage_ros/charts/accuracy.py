# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Speed against accuracy, as a picture for each mechanism."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from linkage_ros.methods.accuracy import RIGHT, Point
from linkage_ros.methods.chain import BATCH, ONE, QUANTITIES
from linkage_ros.methods.table import DEFAULT, METHODS

# The palette of Okabe and Ito; the default has the colour that stands out most.
_VERMILION, _ORANGE, _BLUE, _SKY = '#d55e00', '#e69f00', '#0072b2', '#56b4e9'
_GREEN, _PURPLE, _BLACK, _GREY = '#009e73', '#cc79a7', '#000000', '#666666'
_LEAST = 1e-17  # an error of nothing, on a logarithmic axis
_CEILING = 10.0  # where errors without bound are drawn
_FLOOR, _TOP = 3e-15, 0.2  # settings are written between them: beyond, points lie close together
_SHORT = {'tolerance': '', 'steps': 'n=', 'nodes': 'N=', 'harmonics': 'H=', 'step': 'h='}


class _Style(NamedTuple):
    """How a method is drawn."""

    marker: str
    color: str
    filled: bool = True
    size: float = 5.0


_STYLES = {
    DEFAULT: _Style('*', _VERMILION, size=13),
    'factored, float32': _Style('*', _VERMILION, filled=False, size=9),
    'half-angle': _Style('s', _BLUE),
    'inverse cosine': _Style('D', _SKY),
    'Newton-Raphson, warm': _Style('^', _GREEN),
    'Newton-Raphson, cold': _Style('v', _GREEN, filled=False),
    'table, cubic Hermite': _Style('o', _PURPLE),
    'Fourier series': _Style('o', _PURPLE, filled=False),
    '2x2 solve': _Style('P', _ORANGE, size=7),
    'sine formula': _Style('X', '#8b4513', size=7),
    'central differences': _Style('.', _GREY, size=7),
    'power balance': _Style('h', _BLACK, size=7),
    'constrained Newton-Euler': _Style('X', _BLACK, size=7),
}


def draw_accuracy(points: Sequence[Point], title: str, paths: Iterable[Path]) -> None:
    """Draws the panels of one mechanism.

    Args:
        points: Its points.
        title: Of the picture.
        paths: Where to write it, by ending .png or .svg; replaced if they exist.

    Raises:
        OSError: A picture cannot be written.
    """
    figure = Figure(figsize=(16, 9.6), dpi=110, layout='constrained')
    figure.suptitle(title, fontsize=12)
    panels = figure.subplots(2, 4, sharey=True, sharex='row')
    for row, mode in zip(panels, (ONE, BATCH), strict=True):
        for axes, quantity in zip(row, QUANTITIES, strict=True):
            chosen = [p for p in points if p.mode == mode and p.quantity == quantity]
            _draw_panel(axes, chosen)
            axes.set_title(f'{quantity}, {mode}', fontsize=10)
            axes.set_xlabel('time per state, \N{MICRO SIGN}s')
        row[0].set_ylabel('largest error, relative (angles: rad)')
    _add_legend(figure)
    for path in paths:
        figure.savefig(path)


def _draw_panel(axes: Axes, points: Sequence[Point]) -> None:
    axes.set_xscale('log')
    axes.set_yscale('log')
    axes.grid(visible=True, which='major', color='0.9', linewidth=0.6)
    axes.axhspan(RIGHT, 1e30, color='0.94', zorder=0)
    drawn = [p for p in points if math.isfinite(p.max_error) and math.isfinite(p.us_per_state)]
    for (method, swept), group in itertools.groupby(drawn, key=_series):
        _draw_series(axes, method, list(group), swept=swept)
    front = sorted((p for p in points if p.pareto), key=lambda p: p.us_per_state)
    if front:
        axes.step(
            [p.us_per_state for p in front], [max(p.max_error, _LEAST) for p in front],
            where='post', color=_BLACK, linewidth=1.0, alpha=0.7, zorder=2,
        )  # fmt: skip
    failed = dict.fromkeys(p.method for p in points if p not in drawn)
    if failed:
        axes.text(
            0.98, 0.5, 'no answer at some angle,\nin some setting:\n' + '\n'.join(failed),
            fontsize=6.5, ha='right', va='center', transform=axes.transAxes, color='0.3',
        )  # fmt: skip
    axes.set_ylim(2e-17, 2 * _CEILING)
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f'{value:g}'))
    axes.xaxis.set_minor_locator(NullLocator())


def _series(point: Point) -> tuple[str, bool]:
    """What is joined by a line: settings of one kind. Newton's steps are a kind of their own."""
    return point.method, _values(point.setting).get('steps', '360') != '360'


def _draw_series(axes: Axes, method: str, points: list[Point], *, swept: bool) -> None:
    style = _STYLES[method]
    axes.plot(
        [p.us_per_state for p in points],
        [min(max(p.max_error, _LEAST), _CEILING) for p in points],
        marker=style.marker, color=style.color, markersize=style.size, linewidth=0.7,
        linestyle=':' if swept else '-', zorder=5 if method == DEFAULT else 3,
        markerfacecolor=style.color if style.filled else 'white',
    )  # fmt: skip
    for point in points:
        if point.setting and _FLOOR < point.max_error < _TOP:
            axes.annotate(
                _short(point.setting, swept=swept), (point.us_per_state, point.max_error),
                fontsize=5.5, color=style.color, xytext=(3, 2), textcoords='offset points',
                annotation_clip=True,
            )  # fmt: skip


def _short(setting: str, *, swept: bool) -> str:
    """The value that is varied: '1e-06', 'n=36', 'N=256'."""
    values = _values(setting)
    name = 'steps' if swept else next(iter(values))
    return f'{_SHORT[name]}{values[name]}'


def _values(setting: str) -> dict[str, str]:
    """The names and values of a setting in words."""
    return dict(part.rsplit(' ', 1) for part in setting.split(', ')) if setting else {}


def _add_legend(figure: Figure) -> None:
    handles: list[Any] = [
        Line2D(
            [], [], marker=style.marker, color=style.color, markersize=style.size * 0.9,
            linewidth=0.7 if len(method.settings) > 1 else 0, label=_name(method.name),
            markerfacecolor=style.color if style.filled else 'white',
        )
        for method in METHODS
        for style in [_STYLES[method.name]]
    ]  # fmt: skip
    handles.append(Line2D([], [], color=_BLACK, linewidth=1.0, label='front of right answers'))
    handles.append(
        Line2D([], [], color='0.85', linewidth=7, label=f'worse than {RIGHT:g}: not on the front')
    )
    figure.legend(
        handles=handles, loc='outside lower center', ncols=5, fontsize=8.5, frameon=False,
        title_fontsize=8.5,
        title='Settings: N nodes, H harmonics, h step in rad, n steps a turn; a '
        f"bare number is Newton's tolerance. Errors above {_CEILING:g} are drawn at {_CEILING:g}.",
    )  # fmt: skip


def _name(method: str) -> str:
    return f'{method} (default)' if method == DEFAULT else method
