# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Draws the curves of one mechanism over a period."""

from __future__ import annotations

import itertools
import math
import re
import textwrap
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from linkage_ros.dynamics.period import Column, Period, extent
from linkage_ros.lab.charts.linkage import LinkagePicture
from linkage_ros.lab.charts.sizes import DPI, NUMBERS, SMALL, TEXT, WIDTH
from linkage_ros.numeric import Array
from linkage_ros.palette import BLACK, COLORS, DARK, Color, color_of, fractions

# Inches. From top to bottom: linkage, for each row diagrams and the numbers below them, title of
# the last. From left to right: numbers, diagrams, text.
_LINKAGE, _ROW, _GAP, _FOOT = 2.6, 1.35, 0.5, 0.1
_LEFT, _TEXT = 0.8, 4.5
_DRAWN_AT = 45.0  # deg, of the crank: links of most mechanisms stand apart there
_TITLES = {
    'rad': 'Direction', 'rad/s': 'Rate', 'rad/s^2': 'Accel.',
    'm': 'Slider position', 'm/s': 'Slider velocity', 'm/s^2': 'Slider accel.',
}  # fmt: skip
_DASHES = ('-', (0, (6, 3)), (0, (3, 3)), (0, (1, 2)))
# That of the link on which the pin's force acts; B0's has the ground's, so that B and B0 differ.
# What belongs to no link has none's.
_FORCES: dict[str, Color] = {
    'A0': COLORS['crank'], 'A': COLORS['coupler'], 'B': COLORS['rocker'], 'B0': DARK,
    'guide': BLACK, 'x': BLACK, 'y': DARK, 'moment': BLACK, 'torque': COLORS['crank'],
}  # fmt: skip
_STYLE: dict[Any, Any] = {
    'axes.labelsize': SMALL, 'xtick.labelsize': NUMBERS, 'ytick.labelsize': NUMBERS,
    'axes.grid': True, 'grid.color': '0.88', 'grid.linewidth': 0.6,
}  # fmt: skip


class _Panel(NamedTuple):
    """A diagram over the crank angle: curves by name in one unit, and further lines of figures."""

    title: str
    unit: str
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
    figure = Figure(figsize=(WIDTH, height), dpi=DPI)
    linkage = _LEFT / WIDTH, 1 - (_LINKAGE - 0.1) / height, width / WIDTH, 2.3 / height
    drawn_at = np.abs(period.crank - math.radians(_DRAWN_AT)).argmin()
    LinkagePicture(figure.add_axes(linkage), period, [int(drawn_at)])
    first, *others = title
    others.append(f'drawn at crank angle {_DRAWN_AT:g} deg')
    text: dict[str, Any] = {
        'x': 1 - (_TEXT - 0.15) / WIDTH, 'fontsize': TEXT, 'va': 'top', 'parse_math': False,
    }  # fmt: skip
    figure.text(y=1 - 0.15 / height, s=textwrap.shorten(first, 40), weight='bold', **text)
    lines = '\n'.join(map(_wrapped, others))
    figure.text(y=1 - 0.37 / height, s=lines, linespacing=1.45, **text)
    grid = figure.add_gridspec(
        len(rows), 2, hspace=_GAP / _ROW, wspace=2 * _LEFT / (width - _LEFT),
        left=_LEFT / WIDTH, right=1 - _TEXT / WIDTH,
        top=1 - _LINKAGE / height, bottom=(_GAP + _FOOT) / height,
    )  # fmt: skip
    with rc_context(_STYLE):
        for number, row in enumerate(rows):
            legend: list[tuple[Line2D, str]] = []
            for column, panel in enumerate(row):
                cell = grid[number, :] if len(row) == 1 else grid[number, column]
                axes = figure.add_subplot(cell)
                _format(axes, period, panel)
                legend += _draw(axes, period, panel)
            axes.legend(
                *zip(*legend, strict=True), loc='upper left', bbox_to_anchor=(1.0, 1.1),
                frameon=False, labelcolor='linecolor',
                prop={'family': 'monospace', 'size': NUMBERS}, labelspacing=0.35,
                borderaxespad=1.2, borderpad=0.0, handletextpad=0.5,
            )  # fmt: skip
        axes.set_xlabel('Crank angle, deg', labelpad=1)
    figure.savefig(path)


def _wrapped(text: str) -> str:
    """Wraps a text beside the linkage; keeps numbers and units together."""
    bound = re.sub(r'(?<=\d) (?=[a-zA-Z])', '\N{NO-BREAK SPACE}', text)
    return textwrap.fill(bound, 48).replace('\N{NO-BREAK SPACE}', ' ')


def _motion_rows(period: Period) -> Iterator[list[_Panel]]:
    crank, *links = (link.name for link in period.solver.structure.links)
    if np.ptp(period.columns['crank.velocity'].values):
        links = [crank, *links]
    for order, quantity in enumerate(('position', 'velocity', 'acceleration')):
        columns = [
            period.columns[f'{link}.{quantity}'] for link in links if order or link != crank
        ]
        groups = itertools.groupby(columns, key=lambda column: column.unit)
        yield [_motion_panel(period, order, unit, list(group)) for unit, group in groups]


def _motion_panel(period: Period, order: int, unit: str, columns: Sequence[Column]) -> _Panel:
    curves = {column.name.split('.')[0]: column.values for column in columns}
    positions = [np.abs(period.columns[f'{link}.position'].values).max() for link in curves]
    natural = abs(period.speed) ** order * (max(positions) if unit[0] == 'm' else 1.0)
    if order == 2:
        natural += np.abs(period.columns['crank.acceleration'].values).max()
    for link, values in curves.items():
        if (
            np.abs(values).max() < 1e-12 * natural
        ):  # rounding: a parallelogram's coupler is at rest
            curves[link] = np.zeros_like(values)
        elif unit == 'rad':
            curves[link] = np.degrees(values)
    return _Panel(_TITLES[unit], unit if order else unit.replace('rad', 'deg'), curves)


def _load_rows(period: Period) -> Iterator[list[_Panel]]:
    columns = {name: column.values for name, column in period.columns.items()}
    power = _extent(period, 'power, W', columns['driving_power'])
    words = power, f'mean power {period.mean_power:.4g} W'
    yield [_Panel('Driving torque', 'N m', {'torque': columns['driving_torque']}, words)]
    loads = [column for column in period.columns.values() if column.name.endswith('.load')]
    for unit, group in itertools.groupby(loads, key=lambda column: column.unit):
        yield [
            _Panel('Load', unit, {column.name.split('.')[0]: column.values for column in group})
        ]
    if 'shaking_moment' not in columns:
        return
    pins = [name[4:-2] for name in columns if name.startswith('pin_') and name.endswith('.x')]
    forces = {pin: np.hypot(columns[f'pin_{pin}.x'], columns[f'pin_{pin}.y']) for pin in pins}
    if 'guide_force' in columns:
        forces['guide'] = columns['guide_force']
    shaking = {axis: columns[f'shaking_force.{axis}'] for axis in 'xy'}
    yield [_Panel('Joint forces', 'N', forces)]
    yield [_Panel('Shaking force', 'N', shaking)]
    yield [_Panel('Shaking moment', 'N m', {'moment': columns['shaking_moment']})]


def _draw(axes: Axes, period: Period, panel: _Panel) -> Iterator[tuple[Line2D, str]]:
    """Draws the curves; yields the lines of the legend: peaks with their angles, and rms."""
    heading = f'{panel.unit:<8}{"min":>11}{"at deg":>7}{"max":>11}{"at deg":>7}{"rms":>10}'
    yield Line2D([], [], color='0.4', linestyle='none'), heading
    # Forces may coincide: dashed, they show what lies below.
    dashes = itertools.cycle(_DASHES if panel.unit == 'N' else _DASHES[:1])
    for (name, values), dash in zip(panel.curves.items(), dashes, strict=False):
        color = fractions(_FORCES.get(name) or color_of(name))
        degrees = np.degrees(period.crank)
        (line,) = axes.plot(degrees, values, linestyle=dash, color=color, linewidth=1.6)
        yield line, _extent(period, name, values)
    for text in (*panel.words, ''):
        yield Line2D([], [], color='0.1', linestyle='none'), text


def _extent(period: Period, name: str, values: Array) -> str:
    found = extent(period.crank, values)
    low_at, high_at = math.degrees(found.low_at), math.degrees(found.high_at)
    return (
        f'{name:<8}{found.low:>11.4g}{low_at:>7.1f}{found.high:>11.4g}{high_at:>7.1f}'
        f'{found.rms:>10.4g}'
    )


def _format(axes: Axes, period: Period, panel: _Panel) -> None:
    end = math.degrees(period.crank[-1])
    axes.set_xticks(np.linspace(0, end, 9), minor=True)
    axes.set(xlim=(0, end), xticks=np.linspace(0, end, 5), ylabel=f'{panel.title}, {panel.unit}')
    if any(values.min() < 0 < values.max() for values in panel.curves.values()):
        axes.axhline(0, color='0.6', linewidth=0.8, zorder=0)
    axes.yaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 2.5, 5, 10], min_n_ticks=3))
    axes.yaxis.set_major_formatter(lambda value, _: f'{value:.5g}')
