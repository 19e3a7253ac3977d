# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Draws errors without each term over speed, reduced models, and savings."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator

from linkage_ros.lab.charts.sizes import DPI, NUMBERS, SMALL, TEXT, TITLE, WIDTH
from linkage_ros.lab.economy import POINT_MASSES, Cost, Saving, handover
from linkage_ros.lab.torque_models import STATIC, TERMS
from linkage_ros.model.load_kinds import LOADS
from linkage_ros.palette import (
    BLACK,
    BLUE,
    DARK,
    ORANGE,
    PURPLE,
    SKY,
    WHITE,
    color_of,
    fractions,
    mixed,
)

_LEAST = 1e-4  # smaller errors are not drawn
_ROOM = 0.88  # of the distance between two speeds, for bars
_OTHERS = {'gravity': DARK, STATIC: PURPLE}
_OTHERS |= zip((kind.group for kind in LOADS if kind.group), (ORANGE, SKY), strict=False)
_REDUCED = {'harmonic': ('o', BLUE), 'table': ('s', ORANGE), POINT_MASSES: ('*', PURPLE)}
_LABELS = {
    'harmonic': 'harmonics', 'table': 'nodes of a table', POINT_MASSES: 'two point masses',
}  # fmt: skip


def draw_economy(
    savings: Sequence[Saving], sentence: str, rpm: float, tolerance: float, path: Path
) -> None:
    """Draws bars over speed, reduced models beside them, and a table of the savings.

    Args:
        savings: The records of one mechanism, at all speeds.
        sentence: Summary of the records.
        rpm: The speed of the reduced models and of the table.
        tolerance: Allowed error.
        path: The PNG file, replaced if it exists.

    Raises:
        OSError: The picture cannot be written.
    """
    rows = len({x.left_out for x in savings} & TERMS.keys())
    heights = 3.7, 2.4 + 0.17 * rows
    figure = Figure(figsize=(WIDTH, sum(heights)), dpi=DPI, layout='constrained')
    words = f'{sentence[0].upper()}{sentence[1:]}.'
    figure.suptitle('\n'.join(textwrap.wrap(words, 88)), fontsize=TITLE)
    parts = figure.subplot_mosaic(
        [['bars', 'bars'], ['reduced', 'table']], width_ratios=(1, 1.1), height_ratios=heights
    )
    own = [x for x in savings if x.rpm == rpm]
    _draw_bars(parts['bars'], savings, tolerance)
    _draw_reduced(parts['reduced'], own, tolerance)
    _write_table(parts['table'], own)
    lines = parts['reduced'].get_legend_handles_labels()
    parts['table'].legend(*lines, fontsize=SMALL, loc='lower left', ncols=2, frameon=False)
    figure.savefig(path)


def _draw_bars(axes: Axes, savings: Sequence[Saving], tolerance: float) -> None:
    speeds = list(dict.fromkeys(x.rpm for x in savings))
    names = [x for x in dict.fromkeys(x.left_out for x in savings) if x in TERMS]
    errors = {(x.left_out, x.rpm): x.error for x in savings}
    width = _ROOM / len(names)
    for i, name in enumerate(names):
        places = np.arange(len(speeds)) + (i + 0.5) * width - _ROOM / 2
        heights = [max(errors[name, rpm], _LEAST) for rpm in speeds]
        axes.bar(places, heights, width, label=name, **_look(name))
    _draw_tolerance(axes, tolerance, (_LEAST, 1.5 * max(errors.values())))
    axes.set_xticks(range(len(speeds)), [f'{rpm:g} rpm' for rpm in speeds], fontsize=TEXT)
    axes.set_xlim(-0.5, len(speeds) - 0.5)
    axes.tick_params(axis='x', length=0)
    _draw_handover(axes, savings, speeds)
    axes.set_ylabel("Error, share of the torque's peak", fontsize=SMALL)
    axes.legend(
        title='left out', title_fontsize=SMALL, fontsize=SMALL, frameon=False,
        loc='center left', bbox_to_anchor=(1.0, 0.5), labelspacing=0.35,
    )  # fmt: skip


def _draw_handover(axes: Axes, savings: Sequence[Saving], speeds: Sequence[float]) -> None:
    """Draws a line at the speed at which weights and inertia contribute equally."""
    rpm = handover(savings)
    if rpm is None or not 0 < speeds[0] < rpm < speeds[-1]:
        return
    at = float(np.interp(rpm, speeds, range(len(speeds))))
    axes.axvline(at, color=fractions(BLACK), linewidth=0.9, linestyle=(0, (4, 3)))
    for words, side, shift in (('weights count more', 'right', -5), ('inertia', 'left', 5)):
        axes.annotate(
            words if side == 'right' else f'{words} counts more, from {rpm:.3g} rpm on', (at, 1),
            xycoords=('data', 'axes fraction'), xytext=(shift, 4), textcoords='offset points',
            ha=side, va='bottom', fontsize=SMALL, annotation_clip=False,
        )  # fmt: skip


def _draw_reduced(axes: Axes, own: Sequence[Saving], tolerance: float) -> None:
    full = own[0].full
    for kind, (marker, color) in _REDUCED.items():
        group = [x for x in own if kind in x.left_out and x.error > _LEAST]
        if not group:
            continue
        times = [full.microseconds - x.saved.microseconds for x in group]
        size = 9 if marker == '*' else 5
        axes.plot(
            times, [x.error for x in group], marker + '-', color=fractions(color), linewidth=0.9,
            markersize=size, label=_LABELS[kind],
        )  # fmt: skip
        for saving, time in zip(group, times, strict=True):
            axes.annotate(
                ''.join(re.findall(r'\d+', saving.left_out)), (time, saving.error), xytext=(6, 1),
                textcoords='offset points', fontsize=NUMBERS, va='center',
            )  # fmt: skip
    axes.axvline(full.microseconds, color=fractions(BLACK), linewidth=1.2, label='full model')
    _draw_tolerance(axes, tolerance, (_LEAST, 3.0))
    axes.set_xlim(0, 1.1 * full.microseconds)
    axes.set_xlabel(f'Time of one torque at {own[0].rpm:g} rpm, \N{MICRO SIGN}s', fontsize=SMALL)
    axes.set_ylabel('Error of reduced models', fontsize=SMALL)


def _write_table(axes: Axes, own: Sequence[Saving]) -> None:
    """Lists the costs of the full model, and the savings of each omitted term."""
    rows = {x.left_out: (x.error, x.saved) for x in own if x.left_out in (*TERMS, POINT_MASSES)}
    lines = [
        f'{"":17}{"":>8}{"oper-":>8}{"micro-":>8}{"para-":>8}',
        f'{f"at {own[0].rpm:g} rpm":17}{"error":>8}{"ations":>8}{"seconds":>8}{"meters":>8}',
        _row('full model', 0.0, own[0].full),
        'saved by leaving out',
        *(_row(_LABELS.get(name, name), *row) for name, row in rows.items()),
    ]
    axes.set_axis_off()
    axes.text(
        0, 1, '\n'.join(lines), family='monospace', fontsize=NUMBERS, va='top', linespacing=1.35,
        transform=axes.transAxes, parse_math=False,
    )  # fmt: skip


def _row(name: str, error: float, cost: Cost) -> str:
    count, spent, parameters = cost
    return f'{name:17}{error:>8.3g}{count:>8d}{spent:>8.2f}{parameters:>8d}'


def _draw_tolerance(axes: Axes, tolerance: float, limits: tuple[float, float]) -> None:
    axes.set_yscale('log')
    axes.set_ylim(*limits)
    axes.axhline(tolerance, color=fractions(BLACK), linewidth=1.0, linestyle=':', zorder=3)
    axes.yaxis.set_major_locator(LogLocator())
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f'{value:g}'))
    axes.tick_params(labelsize=SMALL)
    axes.grid(axis='y', color='0.9', linewidth=0.6)
    axes.set_axisbelow(True)


def _look(name: str) -> dict[str, Any]:
    """Style of a term's bars: the colour of its link, paler for a part of the link."""
    group, _, part = name.partition('.')
    color = _OTHERS.get(group) or color_of(group)
    hatch = {'': '', 'inertia': '', 'damping': 'xxx', 'stiffness': '...'}.get(part, '///')
    face = mixed(color, WHITE, 0.55) if part else color
    return {
        'color': fractions(face),
        'hatch': hatch,
        'edgecolor': fractions(mixed(color, BLACK, 0.4)),
    }
