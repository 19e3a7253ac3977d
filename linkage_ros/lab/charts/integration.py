# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Speed against accuracy of integrators, as one picture of all mechanisms."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from linkage_ros.lab.charts.pareto_panel import (
    CEILING,
    Style,
    Wording,
    draw_panel,
    front_handles,
    method_handle,
)
from linkage_ros.lab.charts.sizes import DPI, SMALL, TEXT, TITLE, WIDTH
from linkage_ros.lab.methods.accuracy import Measurement
from linkage_ros.lab.methods.motion_accuracy import MEAN, SLOWEST
from linkage_ros.lab.methods.motion_bench import ENERGY, TRAJECTORY
from linkage_ros.lab.methods.registry import INTEGRATORS, LIVE, RECORDS, label
from linkage_ros.palette import BLUE, DARK, GREEN, PURPLE, VERMILION

_STYLES = {
    LIVE: Style('o', VERMILION),
    RECORDS: Style('*', VERMILION, filled=False, size=11, above=True),
    'DOP853': Style('s', BLUE),
    'RK4': Style('^', GREEN),
    'Radau': Style('D', PURPLE),
    'multipliers, unstabilised': Style('X', DARK, size=6),
}
_STAR = Style('*', VERMILION, size=13, above=True)
_PANELS = (
    (TRAJECTORY, MEAN, 'trajectory'),
    (ENERGY, MEAN, 'energy'),
    (TRAJECTORY, SLOWEST, 'trajectory, slowest ms'),
)


def draw_integration(points: Sequence[Measurement], title: str, path: Path) -> None:
    """Draws a row of panels for each mechanism.

    Args:
        points: Of all mechanisms.
        title: Of the picture.
        path: The PNG file; replaced if there is one.

    Raises:
        OSError: The picture cannot be written.
    """
    names = list(dict.fromkeys(point.mechanism for point in points))
    figure = Figure(figsize=(WIDTH, 2.6 + 2.6 * len(names)), dpi=DPI, layout='constrained')
    figure.suptitle(title, fontsize=TITLE)
    default = LIVE, label(INTEGRATORS[0].steady)
    # The settings stand in the legend: written at the points they would hide each other.
    wording = Wording(
        lambda point: point.method, lambda point: _STYLES[point.method], lambda _: '', (0.0, 0.0)
    )
    panels = figure.subplots(len(names), len(_PANELS), sharey=True, sharex='col', squeeze=False)
    for row, name in zip(panels, names, strict=True):
        for axes, (quantity, mode, caption) in zip(row, _PANELS, strict=True):
            chosen = [
                p for p in points if (p.mechanism, p.quantity, p.mode) == (name, quantity, mode)
            ]
            draw_panel(axes, chosen, wording)
            for point in chosen:
                if (point.method, point.setting) == default:
                    axes.plot([point.us_per_state], [point.max_error], zorder=6, **_STAR.look)
            axes.set_title(f'{name.replace("_", " ")}, {caption}', fontsize=TEXT)
            axes.set_ylim(2e-16, 2 * CEILING)
    for axes in panels[-1]:
        axes.set_xlabel('time per simulated ms, \N{MICRO SIGN}s', fontsize=TEXT)
    figure.supylabel('largest error: rad, crank lengths, or relative', fontsize=TEXT)
    _add_legend(figure)
    figure.savefig(path)


def _add_legend(figure: Figure) -> None:
    handles = [
        method_handle(method, _STYLES[method.name], _name(method.name)) for method in INTEGRATORS
    ]
    star = Line2D([], [], linewidth=0, label='its default: steps of 1 ms', **_STAR.look)
    figure.legend(
        handles=[handles[0], star, *handles[1:], *front_handles()], loc='outside lower center',
        ncols=3, fontsize=SMALL, frameon=False, title_fontsize=SMALL,
        title=textwrap.fill(f'From left to right: {_settings()}.', 110) + '\n'
        '1000 \N{MICRO SIGN}s would be real time.',
    )  # fmt: skip


def _settings() -> str:
    """What is set along the lines, those of a kind together."""
    kinds: dict[str, list[str]] = {}
    for method in INTEGRATORS:
        if len(method.settings) > 1:
            name, unit, scale = (
                ('step', ' ms', 1e3) if 'step' in method.settings[0] else ('tolerance', '', 1.0)
            )
            values = ', '.join(f'{setting[name] * scale:g}' for setting in method.settings)
            kinds.setdefault(f'{name} {values}{unit}', []).append(method.name.split(',')[0])
    return '; '.join(f'{", ".join(names)}: {words}' for words, names in kinds.items())


def _name(method: str) -> str:
    return {LIVE: f'{method} (live)', RECORDS: f'{method} (default for records)'}.get(
        method, method
    )
