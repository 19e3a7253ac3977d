# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_chart motion: curves of one mechanism over a period, or of several side by side."""

import argparse
import cmath
import itertools
import math
import re
import textwrap
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from linkage_lab.charts.linkage_picture import WIDE, LinkagePicture, proportion
from linkage_lab.command_line import QUANTITIES
from linkage_lab.output import (
    NUMBERS,
    TEXT,
    WIDTH,
    Pictures,
    chart,
    dash,
    doubts,
    folder,
    over,
    pictures,
    print_notes,
    rounded,
    save_csv,
    shown_range,
)
from linkage_lab.period import OVER_TIME, Period, extent, period_to_show, stepped
from linkage_ros import ConfigurationError, load, palette
from linkage_ros.formulas import Array
from linkage_ros.palette import BLACK, DARK, GREY, SECOND, Color, dashes_of, fractions

# Inches. Heights: picture, at most; linkage; linkage above the text; diagram, at most; gap between
# diagrams; bottom margin; line of text; row of the table.
_TALLEST, _LINKAGE, _ABOVE, _ROW, _GAP, _FOOT, _LINE, _ROWS = (
    12.8,
    2.9,
    2.2,
    1.5,
    0.14,
    0.5,
    0.17,
    0.172,
)
# Widths: margin left of the diagrams, linkage beside the text, table.
_MARGIN, _LEFT_OF_TEXT, _TABLE = 1.05, 4.3, 5.4
_CHARACTER = 0.071  # width of a character of the table
_SINGLE = 6  # most diagrams in one column
_SHOWN_AT = 45.0  # crank angle of the picture without a drawing, deg; links rarely overlap there
_TITLES = {'deg': 'Direction', 'rad/s': 'Rate', 'rad/s\u00b2': 'Acceleration'}
_FORCES: dict[str, Color] = {
    'guide': BLACK, 'force.x': BLACK, 'force.y': DARK, 'moment': BLACK, 'power': BLACK,
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


class _Panel(NamedTuple):
    """A diagram: its title, with quantity and unit, and its curves."""

    title: str
    curves: Sequence[_Curve]


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
    if len({(one.across, one.effort) for one in periods.values()}) > 1:
        raise ConfigurationError(
            'a motion along a law is drawn over time, that of a driven slide over its position '
            'and with its force, the others over the crank angle: draw them separately, or give '
            '--rpm'
        )
    stem = 'comparison' if len(names) > 1 else f'{names[0]}_motion'
    drawn, table = pictures(options, stem, *options.params), options.out / f'{stem}.csv'
    print_notes(period.gap_note for period in periods.values())
    with folder(options.out):
        if len(names) > 1:
            lines, remarks = _compare(periods, table), []
        else:
            columns = period.with_gaps()
            if options.csv is not None:
                columns = stepped(period, options.csv, reactions=options.reactions)
            head = [f'{name} [{unit}]' for name, (unit, _) in columns.items()]
            rows = zip(*(values.tolist() for _, values in columns.values()), strict=True)
            save_csv(table, head, ([None if x != x else x for x in row] for row in rows))
            lines = [', '.join(title)]
            remarks = [*title[1:], f'mean power {rounded(period.mean_power)} W',
                       f'shown at {_place(period)}']  # fmt: skip
        if options.fluctuation is not None:
            from linkage_lab.flywheel import size_flywheel  # needs SciPy

            motor = getattr(designs[0].drive, 'motor', None)
            flywheel = pictures(options, f'{names[0]}_flywheel', *options.params)
            lines += size_flywheel(period, motor, options.fluctuation, names[0], flywheel)
            lines += map(str, flywheel.paths)
        _draw_motion(periods, remarks, options.show, drawn)
    driven = [] if options.acceleration else _driven_by_loads(designs, periods)
    print(*doubts(*designs), *driven, *lines, *drawn.paths, table, sep='\n')


def _driven_by_loads(designs: Iterable[Any], periods: Mapping[str, Period]) -> list[str]:
    """Notes designs whose loads drive the crank on average, unless a gas does, as in an engine."""
    return [
        f'note: {name}: the loads drive the crank: mean power {rounded(period.mean_power)} W; did '
        'you mean loads of the other sign?'
        for design, (name, period) in zip(designs, periods.items(), strict=True)
        if period.is_driven_by_loads
        and not any(getattr(load, 'bore', None) for load in design.mechanism.loads)
    ]


def _names(options: argparse.Namespace) -> list[str]:
    """Returns the name of each mechanism's parameter file.

    Raises:
        ConfigurationError: There are too many mechanisms, or two have the same name.
    """
    count, most = len(options.params), len(DESIGN_COLORS)
    single = [x for x in ('fluctuation', 'csv') if getattr(options, x) is not None]
    if count > most or (count > 1 and single):
        raise ConfigurationError(
            f'{count} mechanisms: must be at most {most}, and only one with --fluctuation or --csv'
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
        values = [row[name] for row in rows.values()]
        cells = ['-' if value is None else rounded(value) for value in values]
        if set(cells) != {'-'}:
            lines.append(f'{name:<32}' + ''.join(f'{cell:>{width}}' for cell in cells))
    return lines


def _measures(period: Period) -> dict[str, float | None]:
    """Computes the measures of a design by name and unit; None if a measure does not apply."""
    solver, columns = period.solver, period.columns
    link, found = solver.structure.links[solver.structure.output_index], period.travel
    way, torque = (
        extent(period.x, columns[name].values) for name in (f'{link.name}.position', period.effort)
    )
    ends = found.extremes if found else (way.low, way.high)
    span = ends and ends[1] - ends[0]  # None for a link that turns fully
    angles = found.transmission if found else None
    word, unit = period.effort.removeprefix('driving_'), period.driven.units.effort
    force = [columns[name].values for name in columns if name.startswith('shaking_force')]
    return {
        'swing [deg]': None if link.slides or span is None else math.degrees(span),
        'stroke [m]': span if link.slides else None,
        'time ratio': found.time_ratio if found else None,
        'least transmission angle [deg]': (
            math.degrees(min(angles[0], math.pi - angles[1])) if angles else None
        ),
        f'peak {word} [{unit}]': max(-torque.low, torque.high),
        f'rms {word} [{unit}]': torque.rms,
        'mean power [W]': period.mean_power,
        'peak shaking force [N]': extent(period.x, np.hypot(*force)).high if force else None,
    }


def _draw_motion(
    periods: Mapping[str, Period], lines: Sequence[str], show: Collection[str], files: Pictures
) -> None:
    """Draws the mechanisms, a table of extreme values, and diagrams over a period.

    For several mechanisms, shared diagrams show the motion of the output links and the torques.

    Args:
        periods: Periods by mechanism name; at most as many as `DESIGN_COLORS`.
        lines: Description of the mechanism; empty for several mechanisms.
        show: Quantities to draw, of `QUANTITIES`.
        files: The files, replaced if they exist.
    """
    first, *others = periods.values()
    panels = [*(_compared(periods, show) if others else _panels(first, show))]
    curves = [curve for panel in panels for curve in panel.curves]
    extra = [] if others else [
        *(_curve(first, f'{name}.length_rate', f'{name} rate') for name in first.springs),
        _curve(first, 'driving_power', 'power'),
    ]  # fmt: skip
    # The linkage is beside the text, or above it if it is wide or if there are several.
    above = bool(others) or proportion(first.drawing, first.rows('position')) > WIDE
    notes = '\n'.join(_wrapped(line, 44 if above else 60) for line in lines)
    said = 1.25 * _LINE * (notes.count('\n') + 1) + 0.1 if notes else 0.0
    written = _ROWS * (len(curves) + len(extra) + 2)
    beside = max(said, written) if above else said + written
    linkage = (_ABOVE if not others else _LINKAGE) if above else max(_LINKAGE, beside)
    top = linkage + beside * above
    columns = 1 if len(panels) <= _SINGLE else 2
    rows = math.ceil(len(panels) / columns)
    row = min(_ROW, (_TALLEST - top - _FOOT) / rows - _GAP)
    height = top + rows * (row + _GAP) + _FOOT
    with chart(files, height, layout=None) as figure:
        share = 1 / len(periods) if above else _LEFT_OF_TEXT / WIDTH
        for i, (name, period) in enumerate(periods.items()):
            color = DESIGN_COLORS[i] if others else BLACK
            axes = figure.add_axes((
                (i + 0.03) * share, 1 - (linkage - 0.05) / height, 0.94 * share,
                (linkage - 0.5) / height,
            ))  # fmt: skip
            positions, now = period.rows('position'), _shown(period)
            LinkagePicture(axes, period.drawing, positions, positions[now : now + 1])
            figure.text(
                (i + 0.5) * share, 1 - 0.12 / height, textwrap.shorten(name, 40), va='top',
                ha='center', color=fractions(color), weight='bold', fontsize=TEXT,
            )  # fmt: skip
        y = linkage if above else 0.15
        figure.text(
            (_MARGIN if above else _LEFT_OF_TEXT + 0.1) / WIDTH, 1 - y / height, notes,
            fontsize=TEXT, va='top', linespacing=1.3,
        )  # fmt: skip
        longer = max(0, max(len(curve.name) for curve in curves) - 13)
        left = (1.0 if not others else 0.5) * (WIDTH - _TABLE - _CHARACTER * longer)
        grid = figure.add_gridspec(
            rows, columns, hspace=_GAP / row, wspace=0.27, left=_MARGIN / WIDTH,
            right=1 - 0.2 / WIDTH, top=1 - (top + _GAP) / height, bottom=_FOOT / height,
        )  # fmt: skip
        handles: list[Line2D] = []
        subplots = grid.subplots(squeeze=False, sharex=True)
        for axes, panel in itertools.zip_longest(subplots.T.flat, panels):
            if panel is None:
                axes.remove()
            else:
                handles += _draw(axes, panel)
        for axes in (*subplots[-1], subplots.T.flat[len(panels) - 1]):  # the last of each column
            axes.tick_params(labelbottom=True)
            axes.set_xlabel(f'{first.across.name}, {first.across.unit}', labelpad=1)
        figure.align_ylabels()
        blank = Line2D([], [], linestyle='none')
        at = f'at {first.across.unit}'
        heading = f'{"":<{14 + longer}}{"":<7}{"min":>10}{at:>7}{"max":>10}{at:>7}{"rms":>10}'
        figure.legend(
            [blank, *handles, *(blank for _ in extra)],
            [heading, *(_extent(curve, 14 + longer) for curve in (*curves, *extra))],
            loc='upper left', bbox_to_anchor=(left / WIDTH, 1 - (y + said * (not above)) / height),
            prop={'family': 'monospace', 'size': NUMBERS}, labelspacing=0.35, borderpad=0.0,
            borderaxespad=0.0, handletextpad=0.5, handlelength=2.4,
        )  # fmt: skip


def _shown(period: Period) -> int:
    """Returns the index of the sample at which the mechanism is shown, the nearest to its drawing.

    A mechanism without a drawing is shown at a crank angle at which links rarely overlap.
    """
    drawn = period.solver.mechanism.drawn
    if drawn is None:
        apart = np.exp(1j * period.crank_angles) - cmath.rect(1.0, math.radians(_SHOWN_AT))
    elif period.driven.slides:
        apart = period.crank - drawn.position
    else:
        turns = period.solver.reach.period_turns
        apart = np.exp(1j * (period.crank - drawn.position) / turns) - 1.0
    return int(np.abs(apart).argmin())


def _place(period: Period) -> str:
    """Describes the position at which the mechanism is shown."""
    place = float(period.crank[_shown(period)])
    if period.driven.slides:
        return f'{period.driven.name} {place:.4g} m'
    return f'{period.driven.name} {math.degrees(place):.4g} deg'


def _wrapped(text: str, width: int) -> str:
    """Wraps text; keeps numbers and units together."""
    bound = re.sub(r'(?<=\d) (?=[a-zA-Z])', '\N{NO-BREAK SPACE}', text)
    return textwrap.fill(bound, width).replace('\N{NO-BREAK SPACE}', ' ')


def _panels(period: Period, show: Collection[str]) -> Iterator[_Panel]:
    """Yields the diagrams of one mechanism."""
    for quantity in QUANTITIES:
        if quantity not in show:
            continue
        if quantity == 'torque':
            word = period.effort.removeprefix('driving_')
            yield _Panel(period.effort_title, [_curve(period, period.effort, word)])
        elif quantity == 'load':
            yield from _load_panels(period)
        elif quantity == 'point':
            yield from _point_panels(period)
        else:
            yield from _link_panels(period, quantity)
    if 'shaking_moment' in period.columns:
        yield from _reaction_panels(period)


def _load_panels(period: Period) -> Iterator[_Panel]:
    """Yields the diagrams of loads: efforts on links, springs, and forces at points."""
    efforts = [column for column in period.columns if column.endswith('.load')]
    curves = [_curve(period, column, column.replace('.', ' ')) for column in efforts]
    yield from _by_unit(curves, 'Load')
    springs = period.springs if period.solver.mobility else []
    for spring in springs:
        for word in ('length', 'leverage', 'tension'):
            curve = _curve(period, f'{spring}.{word}', f'{spring} {word}')
            yield from _by_unit([curve._replace(color=SECOND)])
    for column in period.columns:
        load, ending, _ = column.partition('.force.x')
        if ending and load not in springs:
            components = _components(period, f'{load}.force', load, SECOND)
            yield _Panel(f'Force {load}, N', components)


def _point_panels(period: Period) -> Iterator[_Panel]:
    """Yields the diagrams of the positions of traced points."""
    for point, link in period.solver.structure.traced.items():
        components = _components(period, f'{point}.position', point, period.colors[link])
        yield _Panel(f'Point {point}, m', components)


def _link_panels(period: Period, quantity: str) -> Iterator[_Panel]:
    """Yields the diagrams of positions, velocities or accelerations of the links."""
    driven = period.driven.name
    has_constant_rate = not np.ptp(period.columns[f'{driven}.velocity'].values)
    # The position of the driven link is the variable of the diagrams, unless that is the time.
    says_nothing = has_constant_rate or quantity == 'position'
    omitted = driven if says_nothing and period.across is not OVER_TIME else None
    shown = [link for link in period.solver.links if link != omitted]
    yield from _by_unit([_curve(period, f'{link}.{quantity}', link) for link in shown])


def _reaction_panels(period: Period) -> Iterator[_Panel]:
    """Yields the diagrams of joint forces, shaking force and shaking moment."""
    columns = period.columns
    components = [name for name in columns if name.startswith('pin_')]  # such as pin_A.x
    pins = dict.fromkeys(name[len('pin_') : -len('.x')] for name in components)
    forces = [_curve(period, f'pin_{pin}.x', pin, f'pin_{pin}.y') for pin in pins]
    guides = [name for name in columns if name.endswith('.guide_force')]
    for column in guides:
        name = 'guide' if len(guides) == 1 else column.removesuffix('.guide_force')
        forces.append(_curve(period, column, name))
    yield _Panel('Joint forces, N', forces)
    shaking = [_curve(period, f'shaking_force.{axis}', f'force.{axis}') for axis in 'xy']
    yield _Panel('Shaking force, N', shaking)
    yield _Panel('Shaking moment, N m', [_curve(period, 'shaking_moment', 'moment')])


def _compared(periods: Mapping[str, Period], show: Collection[str]) -> Iterator[_Panel]:
    """Yields the shared diagrams of several mechanisms: motion of the outputs, and torques."""
    for quantity in QUANTITIES:
        if quantity not in show or quantity in {'load', 'point'}:
            continue
        curves, title = [], quantity.capitalize()
        for i, (design, period) in enumerate(periods.items()):
            column = f'{period.solver.output}.{quantity}'
            if quantity == 'torque':
                column, title = period.effort, period.effort_name
            curves.append(_curve(period, column, design)._replace(color=DESIGN_COLORS[i]))
        yield from _by_unit(curves, fallback=title)


def _components(period: Period, column: str, name: str, color: Color) -> list[_Curve]:
    """Makes the curves of both components of a vector, the x component in the colour."""
    along_x, along_y = (_curve(period, f'{column}.{axis}', f'{name}.{axis}') for axis in 'xy')
    return [along_x._replace(color=color), along_y._replace(color=DARK)]


def _curve(period: Period, column: str, name: str, across: str = '') -> _Curve:
    """Makes the curve of a column, or of the magnitude of a vector with two columns."""
    unit, values = period.columns[column]
    if across:
        values = np.hypot(values, period.columns[across].values)
    if unit == 'rad':
        unit, values = 'deg', np.degrees(values)
    unit = unit.replace('^2', '\N{SUPERSCRIPT TWO}')
    values = np.round(values, 12) + 0.0  # hides rounding errors of constant values
    return _Curve(name, _color(period, name), unit, period, values)


def _color(period: Period, name: str) -> Color:
    """Returns the colour of a curve: that of the link, of the driven link, or of a pin's force."""
    link = period.driven.name if name in {'torque', 'force'} else name.split()[0]
    known = _colors_of_pins(period) | _FORCES | period.colors
    return known.get(name) or known.get(link, GREY)


def _colors_of_pins(period: Period) -> dict[str, Color]:
    """Returns the colour of each pin's force: that of the link on which it acts, once."""
    found = dict[str, Color]()
    for pin in period.solver.structure.pins:
        color = period.colors[period.solver.links[pin.second]]
        found[pin.name] = DARK if color in found.values() else color
    return found


def _by_unit(curves: Sequence[_Curve], title: str = '', fallback: str = '') -> Iterator[_Panel]:
    """Groups curves into one diagram per unit.

    Args:
        curves: The curves.
        title: Title of all diagrams, without the unit.
        fallback: Title of diagrams whose unit has none; empty for the names of their curves.
    """
    for unit in dict.fromkeys(curve.unit for curve in curves):
        group = [curve for curve in curves if curve.unit == unit]
        names = ' and '.join(curve.name for curve in group).capitalize()
        yield _Panel(f'{title or _TITLES.get(unit) or fallback or names}, {unit}', group)


def _draw(axes: Axes, panel: _Panel) -> list[Line2D]:
    """Draws the curves of a diagram; returns their lines."""
    # Curves of forces may coincide: dashes let the curve below show through.
    numbers: Iterable[int] = range(len(panel.curves))
    if panel.curves[0].unit != 'N':
        numbers = dashes_of(curve.color for curve in panel.curves)
    lines: list[Line2D] = []
    for curve, number in zip(panel.curves, numbers, strict=True):
        marks, color = curve.period.marks, fractions(curve.color)
        lines += axes.plot(marks, curve.values, linestyle=dash(number), color=color, linewidth=1.6)
    axes.set_ylim(shown_range([curve.values for curve in panel.curves], axes.get_ylim()))
    label = textwrap.fill(panel.title, 14)  # not higher than a low diagram
    over(axes, max((curve.period.marks for curve in panel.curves), key=np.max), label, 4)
    return lines


def _extent(curve: _Curve, width: int) -> str:
    """Describes a curve by its extreme values, their crank angles, and rms; pads its name."""
    low, low_at, high, high_at, rms = extent(curve.period.x, curve.values)
    across = curve.period.across
    digits = f'>7.{1 if across.unit == "deg" else 3}f'
    return (
        f'{curve.name:<{width}}{curve.unit:<7}{rounded(low):>10}{across.scale * low_at:{digits}}'
        f'{rounded(high):>10}{across.scale * high_at:{digits}}{rounded(rms):>10}'
    )
