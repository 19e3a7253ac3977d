# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Draws several mechanisms beside each other, and their curves in common diagrams."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from linkage_ros.dynamics.period import Column, Period
from linkage_ros.lab.charts.linkage import LinkagePicture
from linkage_ros.lab.charts.sizes import DPI, NUMBERS, SMALL, TEXT, WIDTH
from linkage_ros.palette import BLACK, BLUE, GREEN, ORANGE, PURPLE, SKY, VERMILION, fractions

# Of the designs, in their order.
COLORS = SKY, ORANGE, BLACK, PURPLE, GREEN, BLUE, VERMILION
_LINKAGES, _ROW = 2.7, 1.7  # inches
_DRAWN_AT = 45.0  # deg
_OUTPUTS = {
    'rad': 'Output link, deg', 'm': 'Slider, m',
    'rad/s^2': 'Accel. of link, rad/s^2', 'm/s^2': 'Accel. of slider, m/s^2',
}  # fmt: skip


def draw_comparison(periods: Mapping[str, Period], path: Path) -> None:
    """Draws mechanisms, the motion of their outputs, and their driving torques.

    Args:
        periods: A period of each design by name; at most as many as `COLORS`.
        path: The PNG file, replaced if it exists.
    """
    rows = dict(_rows(periods))
    height = _LINKAGES + _ROW * len(rows)
    figure = Figure(figsize=(WIDTH, height), dpi=DPI, layout='constrained')
    parts: Any = figure.subfigures(2, 1, height_ratios=(_LINKAGES, _ROW * len(rows)))
    top, below = parts
    colors = {name: fractions(color) for name, color in zip(periods, COLORS, strict=False)}
    for place, (name, period) in enumerate(periods.items()):
        axes = top.add_subplot(1, len(periods), place + 1)
        title: dict[str, Any] = {'fontsize': TEXT, 'weight': 'bold', 'parse_math': False}
        axes.set_title(name, pad=16, color=colors[name], **title)
        drawn_at = np.abs(period.crank - math.radians(_DRAWN_AT)).argmin()
        LinkagePicture(axes, period, [int(drawn_at)])
    with rc_context({'xtick.labelsize': NUMBERS, 'ytick.labelsize': NUMBERS}):
        diagrams = below.subplots(len(rows), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (words, columns) in zip(diagrams, rows.items(), strict=True):
        for name, column in columns.items():
            values = np.degrees(column.values) if column.unit == 'rad' else column.values
            axes.plot(np.degrees(periods[name].crank), values, color=colors[name], linewidth=1.4)
        axes.set_ylabel(words, fontsize=SMALL)
        axes.yaxis.set_major_locator(MaxNLocator(5))
        axes.grid(color='0.88', linewidth=0.6)
    end = max(math.degrees(period.crank[-1]) for period in periods.values())
    diagrams[-1].set(xlim=(0, end), xticks=np.linspace(0, end, 9))
    diagrams[-1].set_xlabel('Crank angle, deg', fontsize=SMALL)
    figure.savefig(path)


def _rows(periods: Mapping[str, Period]) -> Iterator[tuple[str, dict[str, Column]]]:
    """The columns of each diagram by design, and the diagram's title."""
    outputs = {name: period.solver.links[-1] for name, period in periods.items()}
    for quantity in ('position', 'acceleration'):
        columns = {
            name: period.columns[f'{outputs[name]}.{quantity}'] for name, period in periods.items()
        }
        for unit, words in _OUTPUTS.items():
            if found := {name: column for name, column in columns.items() if column.unit == unit}:
                yield words, found
    yield (
        'Driving torque, N m',
        {name: period.columns['driving_torque'] for name, period in periods.items()},
    )
