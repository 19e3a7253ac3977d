# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_chart motion: curves of one mechanism over a period, or of several side by side."""

import argparse
import cmath
import math
import re
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from linkage_lab.charts.curves import (
    DESIGN_COLORS,
    NOISE,
    Curve,
    Panel,
    compared,
    only_in_table,
    panels,
)
from linkage_lab.charts.linkage_picture import WIDE, proportion
from linkage_lab.charts.sketch import Sketched, draw_sketch, sketch_at
from linkage_lab.command_line import FORMATS
from linkage_lab.output import (
    LEADER,
    NAME,
    NUMBERS,
    TEXT,
    WIDTH,
    Pictures,
    box,
    chart,
    dash,
    doubts,
    name_ends,
    new_file,
    over,
    pictures,
    rounded,
    save_csv,
    shown_range,
)
from linkage_lab.period import Extent, Period, extent, extents, period_to_show, stepped
from linkage_ros import ConfigurationError, cli, load
from linkage_ros.palette import BLACK, fractions

# Heights, inches: picture, at most; sketch, at least, above the text, and more with dimensions;
# diagram, and its title with the gap above it; bottom margin; line of text; row of the table.
_TALLEST = 12.8
_SKETCH, _ABOVE, _LARGER = 3.3, 2.6, 1.2
_ROW, _TITLE = 1.5, 0.34
_FOOT, _LINE, _ROWS = 0.5, 0.2, 0.165
# Widths, inches: margins left of the diagrams, and right of those without names; sketch beside the
# text; sample of a line; character of the table, and of a name.
_LEFT, _RIGHT = 0.7, 0.2
_BESIDE, _SAMPLE = 4.2, 0.4
_CHARACTER, _LETTER = 0.072, 0.08
_SINGLE = 6  # most diagrams in one column
_LONGEST, _HEADING = 20, 26  # characters of a curve's name, and of a heading beside numbers
_SHOWN_AT = 45.0  # crank angle of the sketch without a drawing, deg; links rarely overlap there


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
    designs = [load(source).linkage(options.linkage) for source in options.params]
    stem = 'comparison' if len(names) > 1 else f'{names[0]}_motion'
    drawn, table = pictures(options, stem), new_file(options, options.out / f'{stem}.csv')
    flywheel = None
    if options.fluctuation is not None:
        flywheel = pictures(options, f'{names[0]}_flywheel')
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
    driven = [] if options.acceleration else _driven_by_loads(designs, periods)
    cli.print_notes([*doubts(*designs), *(x.gap_note for x in periods.values()), *driven])
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
        kind, about = designs[0].mechanism_words, title[1]
        about = about if about.startswith(kind) else f'{kind}, {about}'  # as in the file's name
        remarks = [about, *title[2:], f'mean power {rounded(_mean_power(period))} W',
                   f'shown at {_place(period)}']  # fmt: skip
    files = [*drawn.paths, table]
    if flywheel is not None:
        from linkage_lab.charts.flywheel_sheet import size_flywheel  # needs SciPy

        motor = getattr(designs[0].drive, 'motor', None)
        lines += size_flywheel(period, motor, options.fluctuation, names[0], flywheel)
        files = [*flywheel.paths, *files]
    sketches = {
        name: sketch_at(design, one, _shown(one))
        for design, (name, one) in zip(designs, periods.items(), strict=True)
    }
    _draw_motion(sketches, periods, remarks, options, drawn)
    if options.json:
        cli.print_json(_as_json(periods, lines, files))
    else:
        print(*lines, *files, sep='\n')


def _as_json(
    periods: Mapping[str, Period], lines: Sequence[str], files: Iterable[Path]
) -> dict[str, Any]:
    """Returns the mean power and the extent of each quantity over the period, by design."""
    found = {}
    for name, period in periods.items():
        values = np.array([column.values for column in period.columns.values()])
        found[name] = {
            'mean_power': _mean_power(period),
            'quantities': {
                quantity: {'unit': column.unit, **each._asdict()}
                for (quantity, column), each in zip(
                    period.columns.items(), extents(period.x, values), strict=True
                )
            },
        }
    return {'text': [*lines], 'files': [*map(str, files)], 'designs': found}


def _mean_power(period: Period) -> float:
    """Returns the mean power, W, or 0 if it is a rounding error."""
    mean, largest = period.mean_power, np.abs(period.columns['driving_power'].values).max()
    return mean if math.isinf(mean) or abs(mean) > NOISE * largest else 0.0


def _driven_by_loads(designs: Iterable[Any], periods: Mapping[str, Period]) -> list[str]:
    """Notes designs whose loads drive the crank on average, unless a gas does, as in an engine."""
    return [
        f'{name}: the loads drive the crank: mean power {rounded(period.mean_power)} W; did '
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
    for source in map(Path, options.params):
        if source.suffix in {'.csv', *(f'.{x}' for x in FORMATS)}:
            raise ConfigurationError(
                f'{source}: give parameter files alone; pictures and tables are named after them, '
                'and written into the folder --out'
            )
    names = [Path(source).stem for source in options.params]
    for name in names:
        if names.count(name) > 1:
            raise ConfigurationError(f'{name} is given twice: give each file another name')
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
        'mean power [W]': _mean_power(period),
        'peak shaking force [N]': extent(period.x, np.hypot(*force)).high if force else None,
    }


class _Row(NamedTuple):
    """A row of the table: its words, and the curve of whose line it shows a sample."""

    words: str
    curve: Curve | None = None


def _draw_motion(
    sketches: Mapping[str, Sketched],
    periods: Mapping[str, Period],
    lines: Sequence[str],
    options: argparse.Namespace,
    files: Pictures,
) -> None:
    """Draws the mechanisms, a table of extreme values, and diagrams over a period.

    For several mechanisms, shared diagrams show the motion of the output links and the torques.

    Args:
        sketches: The mechanisms by name; at most as many as `DESIGN_COLORS`.
        periods: Their periods.
        lines: Description of the mechanism; empty for several mechanisms.
        options: Parsed command-line options: diagrams and dimensions.
        files: The files, replaced if they exist.
    """
    first, *others = periods.values()
    found = compared(periods, options.show) if others else panels(first, options.show)
    drawn = [panel for panel in found if not panel.is_constant]
    lines = [*lines, *(_constant(panel) for panel in found if panel.is_constant)]
    table = _table(drawn, [] if others else only_in_table(first), first)
    # The sketch is beside the text, or above it if it is wide or if there are several.
    one = next(iter(sketches.values()))
    above = bool(others) or proportion(one.drawing, first.rows('position')) > WIDE
    notes = '\n'.join(_wrapped(line, 44 if above else 60) for line in lines)
    said = _LINE * (notes.count('\n') + 1) + 0.15 if notes else 0.0
    written = _ROWS * len(table) + 0.1
    sketch = _ABOVE + 0.4 * bool(others) if above else max(_SKETCH, said + written)
    sketch += _LARGER * options.dimensions
    top = sketch + max(said, written) if above else sketch
    columns = 1 if len(drawn) <= _SINGLE else 2
    down = math.ceil(len(drawn) / columns)
    row = min(_ROW, (_TALLEST - top - _FOOT) / max(1, down) - _TITLE)
    names = NAME * max((len(x.curves) for x in drawn if x.has_names), default=0)
    height = top + down * (max(row, names) + _TITLE) + _FOOT
    with chart(files, height, layout=None) as figure:
        wide = (WIDTH if above else _BESIDE) / len(sketches)
        for i, (name, sketched) in enumerate(sketches.items()):
            color = DESIGN_COLORS[i] if others else BLACK
            if others:  # the curves have the colours of the designs, not of their links
                sketched.drawing.colors = dict.fromkeys(sketched.drawing.joints, color)
            place = box(height, (i + 0.02) * wide, 0.35, 0.96 * wide, sketch - 0.4)
            draw_sketch(figure.add_axes(place), sketched, with_dimensions=options.dimensions)
            figure.text(
                (i * wide + 0.2) / WIDTH, 1 - 0.12 / height, textwrap.shorten(name, 40), va='top',
                color=fractions(color), weight='bold', fontsize=TEXT,
            )  # fmt: skip
        left, start = (0.4, sketch) if above else (_BESIDE + 0.1, 0.15)
        figure.text(
            left / WIDTH, 1 - start / height, notes, fontsize=TEXT, va='top', linespacing=1.3
        )
        if above:
            widest = _SAMPLE + _CHARACTER * max(len(x.words) for x in table)
            left = WIDTH - widest - 0.3 if notes else 0.5 * (WIDTH - widest)
        _write_table(figure, table, left, height - (start if above else start + said))
        _draw_panels(figure, drawn, first, (columns, down), (top, max(row, names)))


def _constant(panel: Panel) -> str:
    """Describes a diagram in which nothing changes, which is not drawn."""
    values = [rounded(float(curve.values[0])) for curve in panel.curves]
    if panel.has_names:
        names = (curve.name for curve in panel.curves)
        values = [f'{name} {value}' for name, value in zip(names, values, strict=True)]
    title = panel.title[0].lower() + panel.title[1:]
    return f'constant: {title} {", ".join(values)} {panel.curves[0].unit}'


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


def _table(drawn: Sequence[Panel], others: Sequence[Panel], period: Period) -> list[_Row]:
    """Makes the rows of the table, grouped by diagram, then those of quantities without one."""
    found = list[tuple[str, Curve | None, str]]()  # name, curve to show, numbers
    for panel in (*drawn, *others):
        alone = len(panel.curves) == 1 and len(panel.heading) <= _HEADING
        found += [] if alone else [(panel.heading, None, '')]
        for curve, extent_ in zip(panel.curves, panel.measured(), strict=True):
            name = panel.heading if alone else f'  {_short(curve.name)}'
            found.append((name, None if panel in others else curve, _numbers(period, extent_)))
    wide, at = max(len(name) for name, _, x in found if x), f'at {period.across.unit}'
    heading = f'{"":<{wide}}{"min":>10}{at:>7}{"max":>10}{at:>7}{"rms":>10}'
    return [_Row(heading), *(_Row(f'{name:<{wide}}{x}', curve) for name, curve, x in found)]


def _numbers(period: Period, found: Extent) -> str:
    """Writes extreme values with their places, and the rms."""
    scale, digits = period.across.scale, f'>7.{1 if period.across.unit == "deg" else 3}f'
    return (
        f'{rounded(found.low):>10}{scale * found.low_at:{digits}}'
        f'{rounded(found.high):>10}{scale * found.high_at:{digits}}{rounded(found.rms):>10}'
    )


def _write_table(figure: Figure, rows: Sequence[_Row], left: float, top: float) -> None:
    """Writes the table, each row after a sample of the line of its curve.

    Args:
        figure: The figure.
        rows: The rows.
        left: Left end, inches from the left edge.
        top: Upper end, inches from the lower edge.
    """
    inches = figure.dpi_scale_trans
    for i, (words, curve) in enumerate(rows):
        y = top - (i + 0.5) * _ROWS
        if curve:
            sample = _line(curve, [left, left + _SAMPLE], [y, y])
            sample.set_transform(inches)
            figure.add_artist(sample)
        figure.text(
            left + _SAMPLE + 0.08, y, words, family='monospace', fontsize=NUMBERS,
            va='center_baseline', transform=inches,
        )  # fmt: skip


def _line(curve: Curve, x: Any, y: Any) -> Line2D:
    """Makes a line in the style of a curve."""
    return Line2D(x, y, color=fractions(curve.color), linestyle=dash(curve.dash), linewidth=1.6)


def _draw_panels(
    figure: Figure,
    drawn: Sequence[Panel],
    period: Period,
    grid: tuple[int, int],
    place: tuple[float, float],
) -> None:
    """Draws diagrams below each other, in one or two columns.

    Args:
        figure: The figure.
        drawn: The diagrams.
        period: A period, for what it is drawn over.
        grid: Numbers of columns and of diagrams in one.
        place: Upper end of the first diagram with its title, and height of a diagram, inches.
    """
    (columns, down), (top, high), height = grid, place, figure.get_figheight()
    for column in range(columns):
        group = drawn[column * down : (column + 1) * down]
        letters = max((_letters(panel) for panel in group), default=0)
        names = LEADER + 0.05 + _LETTER * letters if letters else _RIGHT
        left, wide = column * WIDTH / columns + _LEFT, WIDTH / columns - _LEFT - names
        for i, panel in enumerate(group):
            y = top + i * (high + _TITLE) + _TITLE
            axes = figure.add_axes(box(height, left, y, wide, high))
            _draw_panel(axes, panel, (wide, high), 4 if columns > 1 else 8)
            axes.tick_params(labelbottom=i == len(group) - 1)
        if group:
            axes.set_xlabel(f'{period.across.name}, {period.across.unit}', labelpad=1)


def _letters(panel: Panel) -> int:
    """Returns the length of the longest name at the end of a curve."""
    return max(len(_short(curve.name)) for curve in panel.curves) if panel.has_names else 0


def _short(name: str) -> str:
    return name if len(name) <= _LONGEST else f'{name[: _LONGEST - 1]}\N{HORIZONTAL ELLIPSIS}'


def _draw_panel(axes: Axes, panel: Panel, size: tuple[float, float], parts: int) -> None:
    """Draws the curves of a diagram, with their names at the right ends.

    Args:
        axes: The axes.
        panel: The diagram.
        size: Width and height of the axes, inches.
        parts: Most intervals between ticks of the horizontal axis.
    """
    lines = {curve.name: _line(curve, curve.period.marks, curve.values) for curve in panel.curves}
    for line in lines.values():
        axes.add_line(line)
    axes.autoscale_view()
    axes.set_ylim(shown_range([curve.values for curve in panel.curves], axes.get_ylim()))
    widest = max((curve.period for curve in panel.curves), key=lambda x: float(x.marks[-1]))
    over(axes, widest, panel.heading, parts)
    if panel.has_names:
        name_ends(axes, {_short(name): line for name, line in lines.items()}, size)
