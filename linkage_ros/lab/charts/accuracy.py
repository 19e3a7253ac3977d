# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Speed against accuracy, as a picture for each mechanism."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure

from linkage_ros.lab.charts.pareto_panel import (
    CEILING,
    Style,
    Wording,
    draw_panel,
    front_handles,
    method_handle,
    write_words,
)
from linkage_ros.lab.charts.sizes import DPI, SMALL, TEXT, TITLE, WIDTH
from linkage_ros.lab.methods.accuracy import Measurement
from linkage_ros.lab.methods.chain import BATCH, ONE, QUANTITIES
from linkage_ros.lab.methods.registry import DEFAULT, METHODS
from linkage_ros.palette import BLACK, BLUE, DARK, GREEN, ORANGE, PURPLE, SKY, VERMILION

_SPAN = (3e-15, 0.2)  # errors between which settings are written
_SHORT = {'tolerance': '', 'steps': 'n=', 'nodes': 'N=', 'harmonics': 'H=', 'step': 'h='}

# The default has the colour that stands out most.
_STYLES = {
    DEFAULT: Style('*', VERMILION, size=13, above=True),
    'factored, float32': Style('*', VERMILION, filled=False, size=9),
    'half-angle': Style('s', BLUE),
    'inverse cosine': Style('D', SKY),
    'Newton-Raphson, warm': Style('^', GREEN),
    'Newton-Raphson, cold': Style('v', GREEN, filled=False),
    'table, cubic Hermite': Style('o', PURPLE),
    'Fourier series': Style('o', PURPLE, filled=False),
    '2x2 solve': Style('P', ORANGE, size=7),
    'sine formula': Style('X', SKY, size=7),
    'central differences': Style('.', DARK, size=7),
    'power balance': Style('h', BLACK, size=7),
    'constrained Newton-Euler': Style('X', BLACK, size=7),
}
_OTHER = Style('d', DARK, filled=False)  # of a method from outside the package


def draw_accuracy(points: Sequence[Measurement], title: str, path: Path) -> None:
    """Draws the panels of one mechanism.

    Args:
        points: Its points.
        title: Of the picture.
        path: The PNG file; replaced if there is one.

    Raises:
        OSError: The picture cannot be written.
    """
    figure = Figure(figsize=(WIDTH, 10.8), dpi=DPI, layout='constrained')
    figure.suptitle(title, fontsize=TITLE)
    wording = Wording(_series, _style, _words, _SPAN)
    # One row for each quantity, one column for each way to ask: what all share is written once.
    panels = figure.subplots(len(QUANTITIES), 2, sharey=True, sharex='col')
    drawn = []
    for row, quantity in zip(panels, QUANTITIES, strict=True):
        for axes, mode in zip(row, (ONE, BATCH), strict=True):
            chosen = [p for p in points if p.mode == mode and p.quantity == quantity]
            draw_panel(axes, chosen, wording)
            drawn.append((axes, chosen))
            axes.set_title(f'{quantity}, {mode}', fontsize=TEXT)
    for axes in panels[-1]:
        axes.set_xlabel('time per state, \N{MICRO SIGN}s', fontsize=TEXT)
    figure.supylabel('largest error, relative (angles: rad)', fontsize=TEXT)
    _add_legend(figure)
    figure.draw_without_rendering()  # places the panels
    for axes, chosen in drawn:
        write_words(axes, chosen, wording)
    figure.savefig(path)


def _series(point: Measurement) -> tuple[str, bool]:
    """What is joined by a line: settings of one kind. Newton's steps are a kind of their own."""
    return point.method, _values(point.setting).get('steps', '360') != '360'


def _style(point: Measurement) -> Style:
    return _STYLES.get(point.method, _OTHER)._replace(dotted=_series(point)[1])


def _words(point: Measurement) -> str:
    """The value that is varied: '1e-06', 'n=36', 'N=256'."""
    values = _values(point.setting)
    if not values:
        return ''
    name = 'steps' if _series(point)[1] else next(iter(values))
    return f'{_SHORT.get(name, f"{name}=")}{values[name]}'


def _values(setting: str) -> dict[str, str]:
    """The names and values of a setting in words."""
    return dict(part.rsplit(' ', 1) for part in setting.split(', ')) if setting else {}


def _add_legend(figure: Figure) -> None:
    handles = [
        method_handle(method, style._replace(size=style.size * 0.9), _name(method.name))
        for method in METHODS
        for style in [_STYLES.get(method.name, _OTHER)]
    ]
    figure.legend(
        handles=[*handles, *front_handles()], loc='outside lower center', ncols=3, fontsize=SMALL,
        frameon=False, title_fontsize=SMALL,
        title=f'Settings, the first of a line and the last with an error above {_SPAN[0]:g}: '
        'N nodes, H harmonics, h step in rad,\nn steps a turn; a bare number is '
        f"Newton's tolerance. Errors above {CEILING:g} are drawn at {CEILING:g}.",
    )  # fmt: skip


def _name(method: str) -> str:
    return f'{method} (default)' if method == DEFAULT else method
