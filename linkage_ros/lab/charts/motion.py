# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Draws the curves of one mechanism over a period, or of several beside each other."""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from itertools import cycle, groupby
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from linkage_ros.dynamics.period import Column, Period, extent
from linkage_ros.lab.charts.axes import chart, over_crank
from linkage_ros.lab.charts.linkage import LinkagePicture
from linkage_ros.lab.charts.sizes import NUMBERS, TEXT, WIDTH
from linkage_ros.numeric import Array
from linkage_ros.palette import (
    BLACK,
    BLUE,
    COLORS,
    DARK,
    GREEN,
    ORANGE,
    PURPLE,
    SKY,
    VERMILION,
    Color,
    color_of,
    fractions,
)

# Inches. From top to bottom: linkage, for each row diagrams and the numbers below them, title of
# the last. From left to right: numbers, diagrams, text.
_LINKAGE, _ROW, _GAP, _FOOT = 2.6, 1.35, 0.5, 0.1
_LEFT, _TEXT = 0.8, 4.5
_DRAWN_AT = 45.0  # deg, of the crank: links of most mechanisms stand apart there
_TITLES = {
    'rad': 'Direction, deg', 'rad/s': 'Rate, rad/s', 'rad/s^2': 'Accel., rad/s^2',
    'm': 'Slider position, m', 'm/s': 'Slider velocity, m/s', 'm/s^2': 'Slider accel., m/s^2',
}  # fmt: skip
_OUTPUTS = {
    'rad': 'Output link, deg', 'm': 'Slider, m',
    'rad/s^2': 'Accel. of link, rad/s^2', 'm/s^2': 'Accel. of slider, m/s^2',
}  # fmt: skip
_DASHES = ('-', (0, (6, 3)), (0, (3, 3)), (0, (1, 2)))
# That of the link on which the pin's force acts; B0's has the ground's, so that B and B0 differ.
# What belongs to no link has none's.
_FORCES: dict[str, Color] = {
    'A0': COLORS['crank'], 'A': COLORS['coupler'], 'B': COLORS['rocker'], 'B0': DARK,
    'guide': BLACK, 'x': BLACK, 'y': DARK, 'moment': BLACK, 'torque': COLORS['crank'],
}  # fmt: skip
# Of the designs, in their order.
DESIGN_COLORS = SKY, ORANGE, BLACK, PURPLE, GREEN, BLUE, VERMILION


class _Panel(NamedTuple):
    """A diagram over the crank angle: curves by name, and further lines of figures."""

    title: str  # quantity and unit
    curves: dict[str, Array]
    words: Sequence[str] = ()


def draw_motion(period: Period, title: Sequence[str], path: Path) -> None:
    """Draws a period: position, rate, acceleration, torque, and reactions if there are any.

    Args:
        period: Period to draw.
        title: A name, and lines of description.
        path: The PNG file, replaced if it exists.
    """
    rows = [*_motion_rows(period), *_load_rows(period)]
    height = _LINKAGE + (_ROW + _GAP) * len(rows) + _FOOT
    width = WIDTH - _LEFT - _TEXT
    with chart(path, height, layout=None) as figure:
        place = _LEFT / WIDTH, 1 - (_LINKAGE - 0.1) / height, width / WIDTH, 2.3 / height
        LinkagePicture(figure.add_axes(place), period, [_sample(period)])
        _write_title(figure, [*title, f'drawn at crank angle {_DRAWN_AT:g} deg'], height)
        grid = figure.add_gridspec(
            len(rows), 2, hspace=_GAP / _ROW, wspace=2 * _LEFT / (width - _LEFT),
            left=_LEFT / WIDTH, right=1 - _TEXT / WIDTH,
            top=1 - _LINKAGE / height, bottom=(_GAP + _FOOT) / height,
        )  # fmt: skip
        for number, row in enumerate(rows):
            cells = [grid[number, :]] if len(row) == 1 else [grid[number, 0], grid[number, 1]]
            legend: list[tuple[Line2D, str]] = []
            for cell, panel in zip(cells, row, strict=True):
                axes = figure.add_subplot(cell)
                legend += _draw(axes, period, panel)
            axes.legend(
                *zip(*legend, strict=True), loc='upper left', bbox_to_anchor=(1.0, 1.1),
                labelcolor='linecolor', prop={'family': 'monospace', 'size': NUMBERS},
                labelspacing=0.35, borderaxespad=1.2, borderpad=0.0, handletextpad=0.5,
            )  # fmt: skip
        axes.set_xlabel('Crank angle, deg', labelpad=1)


def _sample(period: Period) -> int:
    """The sample at which a linkage is drawn."""
    return int(np.abs(period.crank - math.radians(_DRAWN_AT)).argmin())


def _write_title(figure: Figure, title: Sequence[str], height: float) -> None:
    """Writes the title beside the linkage, in lines that keep numbers and units together."""
    first, *others = title
    lines = []
    for text in others:
        bound = re.sub(r'(?<=\d) (?=[a-zA-Z])', '\N{NO-BREAK SPACE}', text)
        lines.append(textwrap.fill(bound, 48).replace('\N{NO-BREAK SPACE}', ' '))
    style: dict[str, Any] = {'x': 1 - (_TEXT - 0.15) / WIDTH, 'fontsize': TEXT, 'va': 'top'}
    figure.text(y=1 - 0.15 / height, s=textwrap.shorten(first, 40), weight='bold', **style)
    figure.text(y=1 - 0.37 / height, s='\n'.join(lines), linespacing=1.45, **style)


def _motion_rows(period: Period) -> Iterator[list[_Panel]]:
    crank, *links = (link.name for link in period.solver.structure.links)
    even = not np.ptp(period.columns['crank.velocity'].values)
    for order, quantity in enumerate(('position', 'velocity', 'acceleration')):
        shown = links if even or not order else [crank, *links]
        columns = [period.columns[f'{link}.{quantity}'] for link in shown]
        groups = groupby(columns, key=lambda column: column.unit)
        yield [_motion_panel(period, order, unit, list(group)) for unit, group in groups]


def _motion_panel(period: Period, order: int, unit: str, columns: Sequence[Column]) -> _Panel:
    curves = {column.name.split('.')[0]: column.values for column in columns}
    positions = [np.abs(period.columns[f'{link}.position'].values).max() for link in curves]
    natural = abs(period.speed) ** order * (max(positions) if unit[0] == 'm' else 1.0)
    if order == 2:
        natural += np.abs(period.columns['crank.acceleration'].values).max()
    for link, values in curves.items():
        if np.abs(values).max() < 1e-12 * natural:  # rounding: a parallelogram's coupler rests
            curves[link] = np.zeros_like(values)
        elif unit == 'rad':
            curves[link] = np.degrees(values)
    return _Panel(_TITLES[unit], curves)


def _load_rows(period: Period) -> Iterator[list[_Panel]]:
    columns = {name: column.values for name, column in period.columns.items()}
    power = _extent(period, 'power, W', columns['driving_power'])
    words = power, f'mean power {period.mean_power:.4g} W'
    torque = {'torque': columns['driving_torque']}
    yield [_Panel('Driving torque, N m', torque, words)]
    loads = [column for column in period.columns.values() if column.name.endswith('.load')]
    for unit, group in groupby(loads, key=lambda column: column.unit):
        curves = {column.name.split('.')[0]: column.values for column in group}
        yield [_Panel(f'Load, {unit}', curves)]
    if 'shaking_moment' not in columns:
        return
    pins = [name[4:-2] for name in columns if name.startswith('pin_') and name.endswith('.x')]
    forces = {pin: np.hypot(columns[f'pin_{pin}.x'], columns[f'pin_{pin}.y']) for pin in pins}
    if 'guide_force' in columns:
        forces['guide'] = columns['guide_force']
    shaking = {axis: columns[f'shaking_force.{axis}'] for axis in 'xy'}
    yield [_Panel('Joint forces, N', forces)]
    yield [_Panel('Shaking force, N', shaking)]
    yield [_Panel('Shaking moment, N m', {'moment': columns['shaking_moment']})]


def _draw(axes: Axes, period: Period, panel: _Panel) -> Iterator[tuple[Line2D, str]]:
    """Draws the curves; yields the lines of the legend: peaks with their angles, and rms."""
    unit = panel.title.rpartition(', ')[2]
    heading = f'{unit:<8}{"min":>11}{"at deg":>7}{"max":>11}{"at deg":>7}{"rms":>10}'
    yield Line2D([], [], color='0.4', linestyle='none'), heading
    # Forces may coincide: dashed, they show what lies below.
    dashes = cycle(_DASHES if unit == 'N' else _DASHES[:1])
    for (name, values), dash in zip(panel.curves.items(), dashes, strict=False):
        color, degrees = fractions(_FORCES.get(name) or color_of(name)), np.degrees(period.crank)
        (line,) = axes.plot(degrees, values, linestyle=dash, color=color, linewidth=1.6)
        yield line, _extent(period, name, values)
    for text in (*panel.words, ''):
        yield Line2D([], [], color='0.1', linestyle='none'), text
    over_crank(axes, period.crank, panel.title, 4)


def _extent(period: Period, name: str, values: Array) -> str:
    found = extent(period.crank, values)
    low_at, high_at = math.degrees(found.low_at), math.degrees(found.high_at)
    return (
        f'{name:<8}{found.low:>11.4g}{low_at:>7.1f}{found.high:>11.4g}{high_at:>7.1f}'
        f'{found.rms:>10.4g}'
    )


# ---------------------------------------------------------------- several mechanisms


def draw_comparison(periods: Mapping[str, Period], path: Path) -> None:
    """Draws mechanisms, the motion of their outputs, and their driving torques.

    Args:
        periods: A period of each design by name; at most as many as `DESIGN_COLORS`.
        path: The PNG file, replaced if it exists.
    """
    rows = _comparison_rows(periods)
    heights = 2.7, 1.7 * len(rows)  # inches
    colors = dict(zip(periods, map(fractions, DESIGN_COLORS), strict=False))
    longest = max((period.crank for period in periods.values()), key=lambda crank: crank[-1])
    with chart(path, sum(heights)) as figure:
        parts: Any = figure.subfigures(2, 1, height_ratios=heights)
        top, below = parts
        for axes, (name, period) in zip(
            top.subplots(1, len(periods)), periods.items(), strict=True
        ):
            axes.set_title(name, pad=16, color=colors[name], weight='bold')
            LinkagePicture(axes, period, [_sample(period)])
        diagrams = below.subplots(len(rows), 1)
        for axes, (words, columns) in zip(diagrams, rows.items(), strict=True):
            for name, column in columns.items():
                values = np.degrees(column.values) if column.unit == 'rad' else column.values
                axes.plot(np.degrees(periods[name].crank), values, color=colors[name])
            over_crank(axes, longest, words)
        axes.set_xlabel('Crank angle, deg')


def _comparison_rows(periods: Mapping[str, Period]) -> dict[str, dict[str, Column]]:
    """The columns of each diagram by design, and the diagrams by title."""
    rows: dict[str, dict[str, Column]] = {}
    for quantity in ('position', 'acceleration'):
        for name, period in periods.items():
            column = period.columns[f'{period.solver.links[-1]}.{quantity}']
            rows.setdefault(_OUTPUTS[column.unit], {})[name] = column
    torques = {name: period.columns['driving_torque'] for name, period in periods.items()}
    return rows | {'Driving torque, N m': torques}
