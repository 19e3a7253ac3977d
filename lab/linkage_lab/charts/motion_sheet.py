# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The sheet of a motion: sketch, description, table and diagrams."""

import argparse
import math
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from linkage_lab.charts.curves import DESIGN_COLORS, Curve, Panel, compared, only_in_table, panels
from linkage_lab.charts.linkage_picture import WIDE, proportion
from linkage_lab.charts.sketch import Sketched, draw_sketch
from linkage_lab.output import (
    LEADER,
    NAME,
    NUMBERS,
    TEXT,
    WIDTH,
    box,
    chart,
    dash,
    name_ends,
    over,
    rounded,
    shown_range,
    wrapped,
    write_title,
)
from linkage_lab.period import Extent, Period
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


class _Row(NamedTuple):
    """A row of the table: its words, and the curve of whose line it shows a sample."""

    words: str
    curve: Curve | None = None


class _Layout(NamedTuple):
    """Where the parts of a sheet are, inches from its upper left corner.

    Attributes:
        above: Whether the sketch is above the description and the table, not beside them.
        sketch: Height of the sketch with the name above it.
        said: Height of the description.
        top: Upper end of the diagrams.
        columns: Columns of diagrams.
        down: Diagrams in a column.
        row: Height of a diagram.
    """

    above: bool
    sketch: float
    said: float
    top: float
    columns: int
    down: int
    row: float

    @property
    def height(self) -> float:
        """Height of the sheet."""
        return self.top + self.down * (self.row + _TITLE) + _FOOT


def draw_sheet(
    sketches: Mapping[str, Sketched],
    periods: Mapping[str, Period],
    lines: Sequence[str],
    options: argparse.Namespace,
    files: Sequence[Path],
) -> None:
    """Draws the mechanisms, a table of extreme values, and diagrams over a period.

    For several mechanisms, shared diagrams show the motion of the output links and the torques.

    Args:
        sketches: The mechanisms by name; at most as many as `DESIGN_COLORS`.
        periods: Their periods.
        lines: Description of the mechanism; empty for several mechanisms.
        options: Parsed command-line options: diagrams and dimensions.
        files: The files.
    """
    first, is_comparison = next(iter(periods.values())), len(periods) > 1
    diagrams = compared(periods, options.show) if is_comparison else panels(first, options.show)
    drawn = [panel for panel in diagrams if not panel.is_constant]
    lines = [*lines, *(_constant(panel) for panel in diagrams if panel.is_constant)]
    table = _table(drawn, [] if is_comparison else only_in_table(first), first)
    # A wide sketch, or several, are above the text.
    sketched = next(iter(sketches.values()))
    is_wide = proportion(sketched.drawing, first.rows('position')) > WIDE
    above = is_comparison or is_wide
    notes = [part for line in lines for part in wrapped(line, 44 if above else 60)]
    least = _SKETCH
    if above:
        least = _ABOVE + 0.4 if is_comparison else _ABOVE
    if options.dimensions:
        least += _LARGER
    layout = _layout(drawn, len(notes), len(table), least, above=above)
    if is_comparison:  # the curves have the colours of the designs, not of their links
        for one, color in zip(sketches.values(), DESIGN_COLORS, strict=False):
            one.drawing.colors = dict.fromkeys(one.drawing.joints, color)
    with chart(files, layout.height, layout=None) as figure:
        _draw_sketches(figure, sketches, layout, with_dimensions=options.dimensions)
        _write_text(figure, notes, table, layout)
        _draw_panels(figure, drawn, first, layout)


def _write_text(
    figure: Figure, notes: Sequence[str], table: Sequence[_Row], layout: _Layout
) -> None:
    """Writes the description and the table: side by side below the sketch, or beside it."""
    left, top = (0.4, layout.sketch) if layout.above else (_BESIDE + 0.1, 0.15)
    figure.text(
        left / WIDTH, 1 - top / layout.height, '\n'.join(notes), fontsize=TEXT, va='top',
        linespacing=1.3,
    )  # fmt: skip
    if not layout.above:
        _write_table(figure, table, left, top + layout.said)
        return
    room = WIDTH - _SAMPLE - _CHARACTER * max((len(row.words) for row in table), default=0)
    _write_table(figure, table, room - 0.3 if notes else 0.5 * room, top)


def _layout(
    drawn: Sequence[Panel], notes: int, rows: int, least: float, *, above: bool
) -> _Layout:
    """Places the parts of a sheet.

    Args:
        drawn: The diagrams.
        notes: Lines of the description.
        rows: Rows of the table.
        least: Least height of the sketch, inches.
        above: See `_Layout`.
    """
    said = _LINE * notes + 0.15 if notes else 0.0
    table = _ROWS * rows + 0.1
    if above:
        sketch = least
        top = sketch + max(said, table)
    else:
        sketch = top = max(least, said + table)
    columns = 1 if len(drawn) <= _SINGLE else 2
    down = math.ceil(len(drawn) / columns)
    row = min(_ROW, (_TALLEST - top - _FOOT) / max(1, down) - _TITLE)
    names = NAME * max((len(panel.curves) for panel in drawn if panel.has_names), default=0)
    return _Layout(above, sketch, said, top, columns, down, max(row, names))


def _draw_sketches(
    figure: Figure, sketches: Mapping[str, Sketched], layout: _Layout, *, with_dimensions: bool
) -> None:
    """Draws the mechanisms beside each other, with their names."""
    wide = (WIDTH if layout.above else _BESIDE) / len(sketches)
    for i, (name, sketched) in enumerate(sketches.items()):
        place = box(layout.height, (i + 0.02) * wide, 0.35, 0.96 * wide, layout.sketch - 0.4)
        draw_sketch(
            figure.add_axes(place), sketched,
            with_dimensions=with_dimensions, with_centers=with_dimensions,
        )  # fmt: skip
        color = DESIGN_COLORS[i] if len(sketches) > 1 else BLACK
        title = textwrap.shorten(name, 40)
        write_title(figure, title, left=i * wide + 0.2, color=fractions(color))


def _constant(panel: Panel) -> str:
    """Describes a diagram in which nothing changes, which is not drawn."""
    values = [rounded(float(curve.values[0])) for curve in panel.curves]
    if panel.has_names:
        names = (curve.name for curve in panel.curves)
        values = [f'{name} {value}' for name, value in zip(names, values, strict=True)]
    title = panel.title[0].lower() + panel.title[1:]
    return f'constant: {title} {", ".join(values)} {panel.curves[0].unit}'


def _table(drawn: Sequence[Panel], others: Sequence[Panel], period: Period) -> list[_Row]:
    """Makes the rows of the table, grouped by diagram, then those of quantities without one."""
    entries = list[tuple[str, Curve | None, str]]()  # name, curve and, unless a heading, numbers
    for panel in (*drawn, *others):
        is_one_line = len(panel.curves) == 1 and len(panel.heading) <= _HEADING
        if not is_one_line:
            entries.append((panel.heading, None, ''))
        for curve, extent in zip(panel.curves, panel.measured(), strict=True):
            name = panel.heading if is_one_line else f'  {_short(curve.name)}'
            sample = None if panel in others else curve
            entries.append((name, sample, _numbers(period, extent, curve.unit)))
    if not entries:
        return []
    wide = max(len(name) for name, _, numbers in entries if numbers)
    at = f'at {period.across.unit}'
    rms = 'rms' if any(numbers[-1:].strip() for _, _, numbers in entries) else ''
    heading = f'{"":<{wide}}{"min":>10}{at:>7}{"max":>10}{at:>7}{rms:>10}'
    rows = [_Row(f'{name:<{wide}}{numbers}', curve) for name, curve, numbers in entries]
    return [_Row(heading), *rows]


def _numbers(period: Period, found: Extent, unit: str) -> str:
    """Writes extreme values with their places, and the rms, which a place does not have."""
    scale, digits = period.across.scale, f'>7.{1 if period.across.unit == "deg" else 3}f'
    rms = '' if unit in {'deg', 'm'} else rounded(found.rms)
    return (
        f'{rounded(found.low):>10}{scale * found.low_at:{digits}}'
        f'{rounded(found.high):>10}{scale * found.high_at:{digits}}{rms:>10}'
    )


def _write_table(figure: Figure, rows: Sequence[_Row], left: float, top: float) -> None:
    """Writes the table, each row after a sample of the line of its curve.

    It begins at `left` and `top`, inches from these edges of the figure.
    """
    inches = figure.dpi_scale_trans
    for i, (words, curve) in enumerate(rows):
        y = figure.get_figheight() - top - (i + 0.5) * _ROWS
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


def _draw_panels(figure: Figure, drawn: Sequence[Panel], period: Period, layout: _Layout) -> None:
    """Draws diagrams over a period below each other, in one or two columns."""
    columns, down, high = layout.columns, layout.down, layout.row
    for column in range(columns):
        group = drawn[column * down : (column + 1) * down]
        names = [_short(x.name) for panel in group if panel.has_names for x in panel.curves]
        letters = max(map(len, names), default=0)
        right = LEADER + 0.05 + _LETTER * letters if letters else _RIGHT
        left, wide = column * WIDTH / columns + _LEFT, WIDTH / columns - _LEFT - right
        for i, panel in enumerate(group):
            y = layout.top + i * (high + _TITLE) + _TITLE
            axes = figure.add_axes(box(layout.height, left, y, wide, high))
            _draw_panel(axes, panel, (wide, high), 4 if columns > 1 else 8)
            axes.tick_params(labelbottom=i == len(group) - 1)
        if group:
            axes.set_xlabel(f'{period.across.name}, {period.across.unit}', labelpad=1)


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
