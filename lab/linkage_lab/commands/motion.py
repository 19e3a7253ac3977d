# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_chart motion: curves of one mechanism over a period, or of several side by side."""

import argparse
import cmath
import math
import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from itertools import cycle
from pathlib import Path
from typing import NamedTuple, TypeAlias

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from linkage_lab.commands.movie import LinkagePicture
from linkage_lab.flywheel import size_flywheel
from linkage_lab.output import NUMBERS, TEXT, WIDTH, chart, folder, over, save_csv
from linkage_lab.period import OVER_CRANK, Period, extent, period_to_show
from linkage_ros import ConfigurationError, load, palette
from linkage_ros.formulas import Array
from linkage_ros.palette import BLACK, COLORS, DARK, Color, color_of, fractions

# Inches. Heights: linkage, diagram, gap for tick labels below a diagram, bottom margin. Widths:
# margin left of the diagrams, text right of them.
_LINKAGE, _ROW, _GAP, _FOOT = 2.8, 1.35, 0.5, 0.1
_LEFT, _TEXT = 0.8, 4.86
_DRAWN_AT = 45.0  # crank angle of the drawing, deg, at which links rarely overlap
_TITLES = {
    'deg': 'Direction', 'rad/s': 'Rate', 'rad/s^2': 'Accel.', 'N m': 'Driving torque',
    'm': 'Slider position', 'm/s': 'Slider velocity', 'm/s^2': 'Slider accel.',
}  # fmt: skip
_DASHES = ('-', (0, (6, 3)), (0, (3, 3)), (0, (1, 2)))
# A pin's force has the colour of the link on which it acts; the force at B0 has the colour of the
# ground. Shaking force, shaking moment and guide force have colours of their own.
_FORCES: dict[str, Color] = {
    'A0': COLORS['crank'], 'A': COLORS['coupler'], 'B': COLORS['rocker'], 'B0': DARK,
    'guide': BLACK, 'x': BLACK, 'y': DARK, 'moment': BLACK, 'torque': COLORS['crank'],
}  # fmt: skip
# Colours of the designs, in order.
DESIGN_COLORS = (
    palette.SKY, palette.ORANGE, BLACK, palette.PURPLE, palette.GREEN, palette.BLUE,
    palette.VERMILION,
)  # fmt: skip


class _Curve(NamedTuple):
    """A quantity over a period."""

    name: str
    color: Color
    unit: str
    period: Period
    values: Array


# A diagram: the title, with quantity and unit; the curves; lines of text below the legend.
_Panel: TypeAlias = tuple[str, Sequence[_Curve], Sequence[str]]


def motion(options: argparse.Namespace) -> None:
    """Draws one period of a mechanism, or of several mechanisms side by side; writes a table.

    Args:
        options: Parsed command-line options.

    Raises:
        ConfigurationError: A mechanism or an option is invalid, or a file cannot be written.
    """
    names = _names(options)
    given = {
        name: value
        for name in ('acceleration', 'reactions', 'fluctuation')
        if (value := getattr(options, name))
    }
    designs = [load(source) for source in options.params]
    shown = [
        period_to_show(source, design, options.rpm, **given)
        for source, design in zip(options.params, designs, strict=True)
    ]
    periods = dict(zip(names, (period for period, _ in shown), strict=True))
    period, title = shown[0]
    if len({one.across for one in periods.values()}) > 1:
        raise ConfigurationError(
            'a motion along a law is drawn over time, the others over the crank angle: draw them '
            'separately, or give --rpm'
        )
    stem = 'comparison' if len(names) > 1 else f'{names[0]}_motion'
    picture, table = (options.out / f'{stem}.{suffix}' for suffix in ('png', 'csv'))
    with folder(options.out):
        if len(names) > 1:
            lines, notes = _compare(periods, table), []
        else:
            head = [f'{name} [{unit}]' for name, (unit, _) in period.columns.items()]
            columns = [values.tolist() for _, values in period.columns.values()]
            save_csv(table, head, zip(*columns, strict=True))
            lines = [', '.join(title)]
            angle = math.degrees(period.crank[_drawn(period)])
            notes = [*title[1:], f'drawn at crank angle {angle:.4g} deg']
        if options.fluctuation is not None:
            motor = getattr(designs[0].drive, 'motor', None)
            flywheel = options.out / f'{names[0]}_flywheel.png'
            lines += size_flywheel(period, motor, options.fluctuation, names[0], flywheel)
            lines.append(str(flywheel))
        _draw_motion(periods, notes, picture)
    print(*lines, picture, table, sep='\n')


def _names(options: argparse.Namespace) -> list[str]:
    """Returns the name of each mechanism's parameter file.

    Raises:
        ConfigurationError: There are too many mechanisms, or two have the same name.
    """
    count, most = len(options.params), len(DESIGN_COLORS)
    if count > most or (count > 1 and options.fluctuation is not None):
        raise ConfigurationError(
            f'{count} mechanisms: must be at most {most}, and only one with --fluctuation'
        )
    names = [Path(source).stem for source in options.params]
    if len(set(names)) < count:
        raise ConfigurationError(f'{", ".join(names)}: give each file another name')
    return names


def _compare(periods: Mapping[str, Period], path: Path) -> list[str]:
    """Writes a CSV file with a row per design; returns a table with a line per measure."""
    rows = {name: _measures(period) for name, period in periods.items()}
    measures = next(iter(rows.values())).keys()
    save_csv(path, ['design', *measures], ([name, *row.values()] for name, row in rows.items()))
    width = 2 + max(12, *map(len, rows))
    lines = [' ' * 32 + ''.join(f'{name:>{width}}' for name in rows)]
    for name in measures:
        cells = ['-' if row[name] is None else f'{row[name]:.4g}' for row in rows.values()]
        if set(cells) != {'-'}:
            lines.append(f'{name:<32}' + ''.join(f'{cell:>{width}}' for cell in cells))
    return lines


def _measures(period: Period) -> dict[str, float | None]:
    """Computes the measures of a design by name and unit; None if a measure does not apply."""
    solver, columns = period.solver, period.columns
    link, found = solver.structure.links[-1], period.travel
    way, torque = (
        extent(period.x, columns[name].values)
        for name in (f'{link.name}.position', 'driving_torque')
    )
    angles = found.transmission if found else None
    force = [columns[name].values for name in columns if name.startswith('shaking_force')]
    return {
        'swing [deg]': None if link.slides else math.degrees(way.high - way.low),
        'stroke [m]': way.high - way.low if link.slides else None,
        'time ratio': found.time_ratio if found else None,
        'least transmission angle [deg]': (
            math.degrees(min(angles[0], math.pi - angles[1])) if angles else None
        ),
        'peak torque [N m]': max(-torque.low, torque.high),
        'rms torque [N m]': torque.rms,
        'mean power [W]': period.mean_power,
        'peak shaking force [N]': float(np.hypot(*force).max()) if force else None,
    }


def _draw_motion(periods: Mapping[str, Period], lines: Sequence[str], path: Path) -> None:
    """Draws position, rate, acceleration, torque and, if present, reactions over a period.

    For several mechanisms, shared diagrams show the motion of the output links and the torques.

    Args:
        periods: Periods by mechanism name; at most as many as `DESIGN_COLORS`.
        lines: Description of the mechanism; empty for several mechanisms.
        path: The PNG file, replaced if it exists.
    """
    first, *others = periods.values()
    panels = [*(_compared(periods) if others else _panels(first))]
    height = _LINKAGE + (_ROW + _GAP) * len(panels) + _FOOT
    cells = max(2, len(periods))
    with chart(path, height, layout=None) as figure:
        for i, (name, period) in enumerate(periods.items()):
            bottom, color = 1 - (_LINKAGE - 0.2) / height, DESIGN_COLORS[i] if others else BLACK
            axes = figure.add_axes(((i + 0.1) / cells, bottom, 0.8 / cells, 2.0 / height))
            LinkagePicture(axes, period, [_drawn(period)])
            axes.set_title(
                textwrap.shorten(name, 40), pad=16, color=fractions(color), weight='bold',
                fontsize=TEXT,
            )  # fmt: skip
        text, place = (
            '\n'.join(map(_wrapped, lines)),
            (1 - (_TEXT - 0.15) / WIDTH, 1 - 0.3 / height),
        )
        figure.text(*place, text, fontsize=TEXT, va='top', linespacing=1.45)
        grid = figure.add_gridspec(
            len(panels), 1, hspace=_GAP / _ROW, left=_LEFT / WIDTH, right=1 - _TEXT / WIDTH,
            top=1 - _LINKAGE / height, bottom=(_GAP + _FOOT) / height,
        )  # fmt: skip
        for axes, panel in zip(grid.subplots(squeeze=False).flat, panels, strict=True):
            _draw(axes, *panel)
        axes.set_xlabel(f'{first.across.name}, {first.across.unit}', labelpad=1)


def _drawn(period: Period) -> int:
    """Returns the sample of the drawing."""
    apart = np.exp(1j * period.crank) - cmath.rect(1.0, math.radians(_DRAWN_AT))
    return int(np.abs(apart).argmin())


def _wrapped(text: str) -> str:
    """Wraps the text next to the linkage; keeps numbers and units together."""
    bound = re.sub(r'(?<=\d) (?=[a-zA-Z])', '\N{NO-BREAK SPACE}', text)
    return textwrap.fill(bound, 48).replace('\N{NO-BREAK SPACE}', ' ')


def _panels(period: Period) -> Iterator[_Panel]:
    """Yields the diagrams of one mechanism."""
    columns, links = period.columns, period.solver.links
    even = not np.ptp(columns['crank.velocity'].values)
    for quantity in ('position', 'velocity', 'acceleration'):
        is_known = period.across is OVER_CRANK and (even or quantity == 'position')
        shown = links[1:] if is_known else links
        yield from _by_unit([_curve(period, f'{link}.{quantity}', link) for link in shown])
    power = _extent(_curve(period, 'driving_power', 'power, W'))
    words = power, f'mean power {period.mean_power:.4g} W', ''
    yield 'Driving torque, N m', [_curve(period, 'driving_torque', 'torque')], words
    loads = [name for name in columns if name.endswith('.load')]
    yield from _by_unit([_curve(period, name, name.split('.')[0]) for name in loads], 'Load')
    if 'shaking_moment' in columns:
        pins = dict.fromkeys(name[4:-2] for name in columns if name.startswith('pin_'))
        forces = [_curve(period, f'pin_{pin}.x', pin, f'pin_{pin}.y') for pin in pins]
        forces += [_curve(period, name, 'guide') for name in columns if name == 'guide_force']
        yield 'Joint forces, N', forces, ()
        yield 'Shaking force, N', [_curve(period, f'shaking_force.{x}', x) for x in 'xy'], ()
        yield 'Shaking moment, N m', [_curve(period, 'shaking_moment', 'moment')], ()


def _compared(periods: Mapping[str, Period]) -> Iterator[_Panel]:
    """Yields the shared diagrams of several mechanisms: motion of the outputs, and torques."""
    for quantity in ('{}.position', '{}.acceleration', 'driving_torque'):
        yield from _by_unit([
            _curve(period, quantity.format(period.solver.links[-1]), name)._replace(color=color)
            for (name, period), color in zip(periods.items(), DESIGN_COLORS, strict=False)
        ])  # fmt: skip


def _curve(period: Period, column: str, name: str, across: str = '') -> _Curve:
    """Makes the curve of a column, or of the magnitude of a vector with two columns."""
    unit, values = period.columns[column]
    if across:
        values = np.hypot(values, period.columns[across].values)
    if unit == 'rad':
        unit, values = 'deg', np.degrees(values)
    values = np.round(values, 12) + 0.0  # hides rounding errors of constant values
    return _Curve(name, _FORCES.get(name) or color_of(name), unit, period, values)


def _by_unit(curves: Sequence[_Curve], title: str = '') -> Iterator[_Panel]:
    """Groups curves into one diagram per unit."""
    for unit in dict.fromkeys(curve.unit for curve in curves):
        group = [curve for curve in curves if curve.unit == unit]
        yield f'{title or _TITLES[unit]}, {unit}', group, ()


def _draw(axes: Axes, title: str, curves: Sequence[_Curve], words: Sequence[str]) -> None:
    """Draws the curves; writes their peaks, the angles of the peaks, and rms next to them."""
    unit, at = curves[0].unit, f'at {curves[0].period.across.unit}'
    heading = f'{unit:<13}{"min":>11}{at:>7}{"max":>11}{at:>7}{"rms":>10}'
    lines = [Line2D([], [], color='0.4', linestyle='none')]
    # Force curves may coincide: dashes let the curve below show through.
    dashes = cycle(_DASHES if unit == 'N' else _DASHES[:1])
    for curve, dash in zip(curves, dashes, strict=False):
        marks, color = curve.period.marks, fractions(curve.color)
        lines += axes.plot(marks, curve.values, linestyle=dash, color=color, linewidth=1.6)
    lines += [Line2D([], [], color='0.1', linestyle='none')] * len(words)
    axes.legend(
        lines, [heading, *map(_extent, curves), *words], loc='upper left',
        bbox_to_anchor=(1.0, 1.1), labelcolor='linecolor',
        prop={'family': 'monospace', 'size': NUMBERS},
        labelspacing=0.35, borderaxespad=1.2, borderpad=0.0, handletextpad=0.5,
    )  # fmt: skip
    over(axes, max((curve.period.marks for curve in curves), key=np.max), title, 4)


def _extent(curve: _Curve) -> str:
    low, low_at, high, high_at, rms = extent(curve.period.x, curve.values)
    across = curve.period.across
    digits = f'>7.{1 if across.unit == "deg" else 3}f'
    return (
        f'{curve.name:<13.13}{low:>11.4g}{across.scale * low_at:{digits}}'
        f'{high:>11.4g}{across.scale * high_at:{digits}}{rms:>10.4g}'
    )
