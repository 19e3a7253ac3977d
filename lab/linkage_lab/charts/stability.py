# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_chart stability: the outcome of each method in each situation, in several grids.

`methods/registry.py` declares the methods, `methods/measure.py` defines the outcomes.
"""

import argparse
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Patch, Rectangle

from linkage_lab.methods import dyads, loads, measure, motion_cases, registry, situations
from linkage_lab.output import (
    DPI,
    NUMBERS,
    SMALL,
    WIDTH,
    box,
    chart,
    new_file,
    pictures,
    save_records,
)
from linkage_ros.palette import BLACK, BLUE, GREEN, ORANGE, PURPLE, SKY, WHITE, fractions, mixed

# Colours of cell and text; the cells also differ in greyscale.
_COLORS = {
    measure.RIGHT: (mixed(GREEN, WHITE, 0.9), mixed(GREEN, BLACK, 0.7)),
    measure.REFUSED: (mixed(SKY, WHITE, 0.6), mixed(BLUE, BLACK, 0.7)),
    measure.DIVERGED: (ORANGE, BLACK),
    measure.WRONG_BRANCH: (mixed(PURPLE, BLACK, 0.3), WHITE),
    measure.NAN: (BLACK, WHITE),
}
_WORDS = {
    measure.RIGHT: 'right', measure.REFUSED: 'refused: an error states the reason',
    measure.DIVERGED: 'wrong: a finite value',
    measure.WRONG_BRANCH: 'wrong branch: the other assembly',
    measure.NAN: 'NaN, arithmetic error, no progress',
}  # fmt: skip
_SHORT = {measure.DIVERGED: 'wrong', measure.WRONG_BRANCH: 'branch'}  # in a cell
_DEFAULTS = {
    registry.DEFAULT: 'default', registry.LIVE: 'default, live',
    registry.RECORDS: 'default for records', loads.GROWN: 'default', loads.STRAIGHT: 'default',
    dyads.DYAD: 'default',
}  # fmt: skip
# The grids from top to bottom: linkages, dyads, load curves, friction, motions.
GRIDS: Sequence[tuple[Sequence[Any], Sequence[measure.Situation]]] = (
    (registry.METHODS, situations.SITUATIONS),
    (dyads.DYAD_METHODS, dyads.DYAD_SITUATIONS),
    (loads.CURVE_METHODS, loads.CURVE_SITUATIONS),
    (loads.FRICTION_METHODS, loads.FRICTION_SITUATIONS),
    (registry.INTEGRATORS, motion_cases.MOTION_SITUATIONS),
)
# Inches: size of a cell; space for names to the left and above; top and bottom margins. Cells of
# whole pixels make the PNG file a third smaller.
_WIDE, _HIGH = 92 / DPI, 53 / DPI
_LEFT, _ABOVE = 1.2, 1.4
_TOP, _FOOT = 0.5, 0.75
_NAMES = 16  # characters per line of a situation's name
# Characters per line of a situation's description, also beside a narrow grid of few methods; width
# of a character, inches.
_SAID, _SAID_NARROW, _FEW, _CHARACTER = 42, 26, 3, 0.066


def stability(options: argparse.Namespace) -> None:
    """Runs all methods in all situations, draws the outcomes, and writes the records.

    Raises:
        ConfigurationError: A file cannot be written.
    """
    records = new_file(options, options.out / 'stability.json')
    drawn = pictures(options, 'stability')
    cases = 2 if options.quick else 30
    cells = [
        cell for methods, places in GRIDS
        for cell in measure.measure_outcomes(places, methods, cases=cases)
    ]  # fmt: skip
    save_records(records, cells)
    draw_stability(cells, heading(cases), drawn)
    print(records, *drawn, sep='\n')


def heading(cases: int) -> str:
    """Returns the title of the picture, given the number of cases."""
    return (
        'Outcome of each method in each situation\n'
        f'worst outcome of {cases} cases, or of a few motions, and largest relative error'
    )


def draw_stability(cells: Sequence[dict[str, Any]], title: str, files: Sequence[Path]) -> None:
    """Draws all grids, one below the other."""
    corners, bottom = _corners()
    height = bottom + _FOOT
    with chart(files, height, title, layout=None) as figure:
        for (left, top), (methods, rows) in zip(corners, GRIDS, strict=True):
            place = box(height, left, top, _WIDE * len(methods), _HIGH * len(rows))
            _draw_grid(figure.add_axes(place), [method.name for method in methods], rows, cells)
        figure.suptitle(title, y=1 - 0.15 / height)
        patches = [
            Patch(facecolor=fractions(fill), label=_WORDS[name])
            for name, (fill, _) in _COLORS.items()
        ]
        figure.legend(handles=patches, loc='lower center', ncols=3)


def _corners() -> tuple[list[tuple[float, float]], float]:
    """Places the grids; those that fit side by side share a row.

    Returns:
        The left and upper end of the cells of each grid, and the lower end of all, inches.
    """
    corners = list[tuple[float, float]]()
    left, top, bottom = 0.0, _TOP, _TOP
    for methods, rows in GRIDS:
        width = _LEFT + _WIDE * len(methods) + _CHARACTER * _said(methods)
        if left + width > WIDTH:
            left, top = 0.0, bottom
        corners.append((left + _LEFT, top + _ABOVE))
        left += width
        bottom = max(bottom, top + _ABOVE + _HIGH * len(rows))
    return corners, bottom


def _said(methods: Sequence[Any]) -> int:
    """Returns the number of characters per line of a description."""
    return _SAID if len(methods) > _FEW else _SAID_NARROW


def _draw_grid(
    axes: Axes,
    methods: list[str],
    rows: Sequence[measure.Situation],
    cells: Sequence[dict[str, Any]],
) -> None:
    """Draws a grid with a column for each method, and a row for each situation."""
    for y, situation in enumerate(rows):
        axes.text(
            len(methods) + 0.15, y + 0.5, textwrap.fill(situation.words, _said(methods)),
            va='center', color='0.3',
        )  # fmt: skip
        for cell in cells:
            if cell['situation'] == situation.name:
                _draw_cell(axes, methods.index(cell['method']), y, cell, exists=situation.exists)
    axes.set(xlim=(0, len(methods)), ylim=(len(rows), 0))
    names = [
        f'{name}\n({_DEFAULTS[name]})' if name in _DEFAULTS else name.replace(', ', ',\n')
        for name in methods
    ]
    axes.set_xticks(
        np.arange(len(methods)) + 0.5, names, rotation=52, ha='left', fontsize=SMALL,
    )  # fmt: skip
    axes.xaxis.tick_top()
    axes.set_yticks(
        np.arange(len(rows)) + 0.5,
        [textwrap.fill(situation.name, _NAMES) for situation in rows], fontsize=SMALL,
    )  # fmt: skip
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)


def _draw_cell(axes: Axes, x: int, y: int, cell: dict[str, Any], *, exists: bool) -> None:
    """Draws a cell with its outcome and error; bold unless the outcome is the correct one."""
    outcome = cell['outcome']
    fill, ink = map(fractions, _COLORS[outcome])
    axes.add_patch(Rectangle((x, y), 1, 1, facecolor=fill, edgecolor='white', linewidth=1.5))
    # If no state exists, a refusal is the correct outcome.
    is_good = outcome == (measure.RIGHT if exists else measure.REFUSED)
    words = _SHORT.get(outcome, outcome)
    if cell['worst_error'] is not None:
        words += f'\n{cell["worst_error"]:.0e}'
    axes.text(
        x + 0.5, y + 0.52, words, ha='center', va='center', color=ink, fontsize=NUMBERS,
        fontweight='normal' if is_good else 'bold',
    )  # fmt: skip
