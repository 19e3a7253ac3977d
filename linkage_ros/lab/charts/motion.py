# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The curves of one mechanism over a period, as a picture."""

from __future__ import annotations

import itertools
import math
import re
import textwrap
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from linkage_ros.dynamics.period import Period, extent
from linkage_ros.lab.charts.linkage import draw_linkage
from linkage_ros.lab.charts.page import MARGIN, Line, Page, Shade, Words
from linkage_ros.lab.charts.sizes import NUMBERS, SMALL, TEXT, WIDTH
from linkage_ros.numeric import Array
from linkage_ros.palette import BLACK, COLORS, DARK, Color, color_of, fractions

# Inches: the parts of the picture from top to bottom.
_HEADER, _ROW, _FOOT = 2.6, 1.85, 0.2
_LEFT, _GAP = 0.8, 0.5  # for the labels of each diagram, and for those below it
_TORQUE = 'Driving torque'
_DRAWN_AT = 45.0  # deg, of the crank: links of most mechanisms stand apart there
# What is drawn, and its title for what turns and for a slider.
_MOTION = (
    ('position', 'Direction', 'Slider position'),
    ('velocity', 'Rate', 'Slider velocity'),
    ('acceleration', 'Accel.', 'Slider accel.'),
)
_STYLES: tuple[Line, ...] = ('-', (0, (6, 3)), (0, (3, 3)), (0, (1, 2)))
# That of the link on which the pin's force acts; B0's has the ground's, so that B and B0 differ.
# What belongs to no link has none's.
_FORCES: dict[str, Color] = {
    'A0': COLORS['crank'], 'A': COLORS['coupler'], 'B': COLORS['rocker'], 'B0': DARK,
    'guide': BLACK, 'x': BLACK, 'y': DARK, 'moment': BLACK, 'power, W': BLACK,
}  # fmt: skip


class _Panel(NamedTuple):
    """A diagram over the crank angle: curves by name, in one unit."""

    title: str
    unit: str
    curves: dict[str, Array]


def draw_motion(period: Period, title: Sequence[str], path: Path) -> None:
    """Draws a period: position, rate, acceleration, torque, and reactions if there are any.

    Args:
        period: Period to draw.
        title: What it is: a name, and lines that say more.
        path: The PNG file; replaced if there is one.
    """
    rows = [*_motion_rows(period), *_reaction_rows(period)]
    page = Page(_HEADER + _ROW * len(rows) + _FOOT)
    width = WIDTH - MARGIN - _LEFT
    drawn_at = math.radians(_DRAWN_AT)
    draw_linkage(page.axes(_LEFT, 0.1, width, _HEADER - 0.2), period, drawn_at)
    first, *others = title
    others = [*others, f'drawn at crank angle {_DRAWN_AT:g} deg']
    words = [Words(line) for text in others for line in _wrapped(text)]
    page.write(0.15, TEXT, [Words(textwrap.shorten(first, 40), weight='bold'), *words])
    for number, row in enumerate(rows):
        top = _HEADER + _ROW * number
        share = (width + _LEFT) / len(row)
        for place, panel in enumerate(row):
            axes = page.axes(_LEFT + place * share, top, share - _LEFT, _ROW - _GAP)
            # Numbers where the panel below has another width, or there is none.
            below = rows[number + 1] if number + 1 < len(rows) else []
            _draw(axes, period, panel, numbered=len(below) != len(row))
        page.write(top, NUMBERS, [line for panel in row for line in _margin(period, panel)])
    page.figure.savefig(path)


def _wrapped(text: str) -> list[str]:
    """The lines of a text beside the linkage; a number keeps its unit."""
    bound = re.sub(r'(?<=\d) (?=[a-zA-Z])', '\N{NO-BREAK SPACE}', text)
    return [line.replace('\N{NO-BREAK SPACE}', ' ') for line in textwrap.wrap(bound, 48)]


def _motion_rows(period: Period) -> list[list[_Panel]]:
    rows = []
    _, *joints = period.solver.structure.links
    speed = period.columns['crank.velocity'].values
    for quantity, turning, sliding in _MOTION:
        row = []
        for slides, title in ((False, turning), (True, sliding)):
            found = [period.columns[f'{j.name}.{quantity}'] for j in joints if j.slides == slides]
            if not slides and quantity != 'position' and np.ptp(speed):
                found.insert(0, period.columns[f'crank.{quantity}'])
            if found:
                in_degrees = not slides and quantity == 'position'
                unit = 'deg' if in_degrees else found[0].unit
                values = {
                    column.name.split('.')[0]: np.degrees(column.values)
                    if in_degrees else column.values
                    for column in found
                }  # fmt: skip
                size = np.abs(period.columns['slider.position'].values).max() if slides else 1.0
                values = {n: _quieted(period, quantity, size, v) for n, v in values.items()}
                row.append(_Panel(title, unit, values))
        rows.append(row)
    torque = period.columns['driving_torque']
    rows.append([_Panel(_TORQUE, torque.unit, {'crank': torque.values})])
    return rows


def _quieted(period: Period, quantity: str, size: float, values: Array) -> Array:
    """0 for what rounding alone keeps from 0, as the rate of a parallelogram's coupler."""
    acceleration = period.columns['crank.acceleration'].values
    natural = {
        'position': 1.0,
        'velocity': abs(period.speed),
        'acceleration': period.speed**2 + np.abs(acceleration).max(),
    }[quantity]
    return values if np.abs(values).max() > 1e-12 * (size * natural) else np.zeros_like(values)


def _reaction_rows(period: Period) -> list[list[_Panel]]:
    if 'shaking_moment' not in period.columns:
        return []
    columns = {name: column.values for name, column in period.columns.items()}
    pins = [name[4:-2] for name in columns if name.startswith('pin_') and name.endswith('.x')]
    forces = {pin: np.hypot(columns[f'pin_{pin}.x'], columns[f'pin_{pin}.y']) for pin in pins}
    if 'guide_force' in columns:
        forces['guide'] = columns['guide_force']
    shaking = {axis: columns[f'shaking_force.{axis}'] for axis in 'xy'}
    return [
        [_Panel('Joint forces', 'N', forces)],
        [_Panel('Shaking force', 'N', shaking)],
        [_Panel('Shaking moment', 'N m', {'moment': columns['shaking_moment']})],
    ]


def _draw(axes: Axes, period: Period, panel: _Panel, *, numbered: bool) -> None:
    degrees = np.degrees(period.crank)
    for (name, values), style in zip(panel.curves.items(), _styles(panel), strict=False):
        axes.plot(degrees, values, linestyle=style, color=_color(name), linewidth=1.6)
    axes.set_xlim(0, degrees[-1])
    axes.set_xticks(np.linspace(0, degrees[-1], 9), minor=True)
    axes.set_xticks(np.linspace(0, degrees[-1], 5))
    axes.grid(color='0.88', linewidth=0.6)
    if any(values.min() < 0 < values.max() for values in panel.curves.values()):
        axes.axhline(0, color='0.6', linewidth=0.8, zorder=0)
    axes.set_ylabel(f'{panel.title}, {panel.unit}', fontsize=SMALL)
    axes.tick_params(labelsize=NUMBERS, labelbottom=numbered)
    axes.yaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 2.5, 5, 10], min_n_ticks=3))
    axes.yaxis.set_major_formatter(lambda value, _: f'{value:.5g}')
    if numbered:
        axes.set_xlabel('Crank angle, deg', fontsize=SMALL, labelpad=1)


def _styles(panel: _Panel) -> Iterator[Line]:
    # Forces may coincide: dashed, they show what lies below.
    return itertools.cycle(_STYLES if panel.unit == 'N' else _STYLES[:1])


def _margin(period: Period, panel: _Panel) -> list[Words]:
    """Peaks, where they are, and rms of every curve of a panel, in the curve's colour."""
    heading = f'{panel.unit:<8}{"min":>11}{"at deg":>7}{"max":>11}{"at deg":>7}{"rms":>10}'
    lines = [Words(heading, '0.4', family='monospace')]
    rows: list[tuple[str, Array, Shade, Line | None]] = [
        (name, values, _color(name), style)
        for (name, values), style in zip(panel.curves.items(), _styles(panel), strict=False)
    ]
    if panel.title == _TORQUE:
        power = period.columns['driving_power'].values
        rows = [('torque', *rows[0][1:]), ('power, W', power, _color('power, W'), None)]
    for name, values, color, style in rows:
        found = extent(period.crank, values)
        low_at, high_at = math.degrees(found.low_at), math.degrees(found.high_at)
        words = (
            f'{name:<8}{found.low:>11.4g}{low_at:>7.1f}{found.high:>11.4g}{high_at:>7.1f}'
            f'{found.rms:>10.4g}'
        )
        lines.append(Words(words, color, family='monospace', style=style))
    if panel.title == _TORQUE:
        lines.append(Words(f'mean power {period.mean_power:.4g} W', family='monospace'))
    return [*lines, Words('')]


def _color(name: str) -> Shade:
    return fractions(_FORCES.get(name) or color_of(name))
