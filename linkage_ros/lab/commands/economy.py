# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_chart economy: the torque of one mechanism without each of its terms, over speed."""

from __future__ import annotations

import argparse
import re
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from linkage_ros.errors import ConfigurationError
from linkage_ros.lab.charts.axes import chart
from linkage_ros.lab.charts.sizes import NUMBERS, SMALL, TEXT
from linkage_ros.lab.commands.output import folder, progress, save_records
from linkage_ros.lab.economy import POINT_MASSES, Economy, Saving, handover
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
from linkage_ros.parameters.configuration import load
from linkage_ros.parameters.presets import find_file

_FACTORS = 0.25, 0.5, 1.0, 2.0, 4.0  # default speeds, relative to the mechanism's own
_LEAST = 1e-4  # smaller errors are not drawn
_ROOM = 0.88  # width of the bars, relative to the distance between two speeds
_OTHERS = {'gravity': DARK, STATIC: PURPLE}
_OTHERS |= zip((kind.group for kind in LOADS if kind.group), (ORANGE, SKY), strict=False)
_HATCHES = {'': '', 'inertia': '', 'damping': 'xxx', 'stiffness': '...'}
# Marker, size, colour and name of the reduced models, by a word in their names.
_REDUCED = {
    'harmonic': ('o-', 5, BLUE, 'harmonics'),
    'table': ('s-', 5, ORANGE, 'nodes of a table'),
    POINT_MASSES: ('*-', 9, PURPLE, 'two point masses'),
}


def economy(options: argparse.Namespace) -> None:
    """Leaves out each term at each speed, draws the errors and writes the records.

    Args:
        options: Options of the command line.

    Raises:
        ConfigurationError: No speed is given, or the folder cannot be written.
        MechanismError: The crank angle does not determine the motion, or nothing needs a torque.
    """
    configuration, name = load(options.params), find_file(options.params).stem
    given = options.rpm or []
    own = getattr(configuration.drive, 'rpm', given[0] if given else 0.0)  # of the summary
    rpms = sorted({own, *(given or (own * factor for factor in _FACTORS))})
    measured = Economy(configuration.mechanism, name)
    if 0.0 in rpms:
        raise ConfigurationError(
            f'{options.params} at 0 rpm: a crank at rest, or without a speed of its own, has no '
            'turn to compare; choose speeds, such as --rpm 30 60'
        )
    records, picture = (options.out / f'{name}_economy.{suffix}' for suffix in ('json', 'png'))
    with folder(options.out):
        savings = measured.measure(rpms, 20 if options.quick else 200, progress)
        sentence = measured.sentence(own, options.tolerance, savings)
        save_records(records, [saving._asdict() for saving in savings])
        _draw(savings, sentence, own, options.tolerance, picture)
    print(f'{name}: {sentence}', records, picture, sep='\n')


def _draw(
    savings: Sequence[Saving], sentence: str, rpm: float, tolerance: float, path: Path
) -> None:
    """Draws bars over speed, reduced models beside them, and a table of the savings.

    Args:
        savings: The records of one mechanism, at all speeds.
        sentence: Summary of the records.
        rpm: The speed of the reduced models and of the table.
        tolerance: Allowed error.
        path: The PNG file, replaced if it exists.
    """
    terms = [x for x in dict.fromkeys(x.left_out for x in savings) if x in TERMS]
    own, heights = [x for x in savings if x.rpm == rpm], (3.7, 2.4 + 0.17 * len(terms))
    words = textwrap.fill(f'{sentence[0].upper()}{sentence[1:]}.', 88)
    with chart(path, sum(heights), words) as figure:
        bars, reduced, table = figure.subplot_mosaic(
            [['bars', 'bars'], ['reduced', 'table']], width_ratios=(1, 1.1), height_ratios=heights
        ).values()
        _draw_bars(bars, savings, terms)
        _draw_reduced(reduced, own)
        worst = max(x.error for x in savings)
        for axes, most in (bars, 1.5 * worst), (reduced, 3.0):
            axes.set(yscale='log', ylim=(_LEAST, most))
            axes.axhline(tolerance, color=fractions(BLACK), linewidth=1.0, linestyle=':', zorder=3)
            axes.yaxis.set_major_formatter('{x:g}')
            axes.grid(visible=False, axis='x')
        _write_table(table, own, terms)
        table.legend(*reduced.get_legend_handles_labels(), loc='lower left', ncols=2)


def _draw_bars(axes: Axes, savings: Sequence[Saving], terms: Sequence[str]) -> None:
    """Draws the errors without each term, and the speed above which inertia dominates."""
    speeds = list(dict.fromkeys(x.rpm for x in savings))
    width = _ROOM / len(terms)
    for i, name in enumerate(terms):
        places = np.arange(len(speeds)) + (i + 0.5) * width - _ROOM / 2
        heights = [max(x.error, _LEAST) for x in savings if x.left_out == name]
        group, _, part = name.partition('.')
        color = _OTHERS.get(group) or color_of(group)
        axes.bar(
            places, heights, width, label=name, hatch=_HATCHES.get(part, '///'),
            color=fractions(mixed(color, WHITE, 0.55) if part else color),
            edgecolor=fractions(mixed(color, BLACK, 0.4)),
        )  # fmt: skip
    rpm = handover(savings) or 0.0
    if 0 < speeds[0] < rpm < speeds[-1]:
        at = float(np.interp(rpm, speeds, range(len(speeds))))
        axes.axvline(at, color=fractions(BLACK), linewidth=0.9, linestyle=(0, (4, 3)))
        inertia = f'inertia counts more, from {rpm:.3g} rpm on'
        for words, side in (('weights count more  ', 'right'), (f'  {inertia}', 'left')):
            axes.text(at, 1.01, words, ha=side, va='bottom', transform=axes.get_xaxis_transform())
    axes.set_xticks(range(len(speeds)), [f'{rpm:g} rpm' for rpm in speeds], fontsize=TEXT)
    axes.tick_params(axis='x', length=0)
    axes.set(xlim=(-0.5, len(speeds) - 0.5), ylabel="Error, share of the torque's peak")
    axes.legend(
        title='left out', title_fontsize=SMALL, loc='center left', bbox_to_anchor=(1.0, 0.5),
        labelspacing=0.35,
    )  # fmt: skip


def _draw_reduced(axes: Axes, own: Sequence[Saving]) -> None:
    """Draws the errors of the reduced models over the time that they take."""
    full = own[0].full_microseconds
    for kind, (style, size, color, label) in _REDUCED.items():
        group = [x for x in own if kind in x.left_out and x.error > _LEAST]
        points = [(full - x.microseconds, x.error) for x in group]
        if points:
            shade = fractions(color)
            times, errors = zip(*points, strict=True)
            axes.plot(times, errors, style, color=shade, lw=0.9, ms=size, label=label)
        for saving, point in zip(group, points, strict=True):
            axes.annotate(
                ''.join(re.findall(r'\d+', saving.left_out)), point, xytext=(6, 1),
                textcoords='offset points', fontsize=NUMBERS, va='center',
            )  # fmt: skip
    axes.axvline(full, color=fractions(BLACK), linewidth=1.2, label='full model')
    axes.set(
        xlim=(0, 1.1 * full), ylabel='Error of reduced models',
        xlabel=f'Time of one torque at {own[0].rpm:g} rpm, \N{MICRO SIGN}s',
    )  # fmt: skip


def _write_table(axes: Axes, own: Sequence[Saving], terms: Sequence[str]) -> None:
    """Lists the costs of the full model, and the savings of each omitted term."""
    lines = [
        f'{"":17}{"":>8}{"oper-":>8}{"micro-":>8}{"para-":>8}',
        f'{f"at {own[0].rpm:g} rpm":17}{"error":>8}{"ations":>8}{"seconds":>8}{"meters":>8}',
        _row('full model', 0.0, *own[0][7:]),
        'saved by leaving out',
        *(_row(x.left_out, *x[3:7]) for x in own if x.left_out in terms),
        *(_row('two point masses', *x[3:7]) for x in own if x.left_out == POINT_MASSES),
    ]
    axes.set_axis_off()
    style: dict[str, Any] = {'family': 'monospace', 'fontsize': NUMBERS, 'linespacing': 1.35}
    axes.text(0, 1, '\n'.join(lines), va='top', transform=axes.transAxes, **style)


def _row(name: str, error: float, operations: int, microseconds: float, parameters: int) -> str:
    return f'{name:17}{error:>8.3g}{operations:>8d}{microseconds:>8.2f}{parameters:>8d}'
