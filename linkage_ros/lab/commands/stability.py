# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_chart stability: the outcome of each method in each situation, in several grids."""

import argparse
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.patches import Patch, Rectangle

from linkage_ros.lab.methods.loads import (
    CURVE_METHODS,
    CURVE_SITUATIONS,
    FRICTION_METHODS,
    FRICTION_SITUATIONS,
    GROWN,
    STRAIGHT,
)
from linkage_ros.lab.methods.measure import (
    DIVERGED,
    NAN,
    REFUSED,
    RIGHT,
    WRONG_BRANCH,
    Situation,
    measure_outcomes,
)
from linkage_ros.lab.methods.motion_cases import MOTION_SITUATIONS
from linkage_ros.lab.methods.registry import DEFAULT, INTEGRATORS, LIVE, METHODS, RECORDS
from linkage_ros.lab.methods.situations import SITUATIONS
from linkage_ros.lab.output import (
    DPI,
    NUMBERS,
    SMALL,
    WIDTH,
    chart,
    folder,
    save_records,
)
from linkage_ros.palette import BLACK, BLUE, GREEN, ORANGE, PURPLE, SKY, WHITE, fractions, mixed

# Colours of cell and text; the cells also differ in greyscale.
_COLORS = {
    RIGHT: (mixed(GREEN, WHITE, 0.9), mixed(GREEN, BLACK, 0.7)),
    REFUSED: (mixed(SKY, WHITE, 0.6), mixed(BLUE, BLACK, 0.7)),
    DIVERGED: (ORANGE, BLACK),
    WRONG_BRANCH: (mixed(PURPLE, BLACK, 0.3), WHITE),
    NAN: (BLACK, WHITE),
}
_WORDS = {
    RIGHT: 'right', REFUSED: 'refused: an error states the reason',
    DIVERGED: 'wrong: a finite value',
    WRONG_BRANCH: "wrong branch: the other assembly's", NAN: 'NaN, arithmetic error, no progress',
}  # fmt: skip
_SHORT = {DIVERGED: 'wrong', WRONG_BRANCH: 'branch'}  # in a cell
_DEFAULTS = {
    DEFAULT: 'default', LIVE: 'default, live', RECORDS: 'default for records', GROWN: 'default',
    STRAIGHT: 'default',
}  # fmt: skip
# The grids from top to bottom: linkages, load curves, friction, motions.
GRIDS = (
    (METHODS, SITUATIONS),
    (CURVE_METHODS, CURVE_SITUATIONS),
    (FRICTION_METHODS, FRICTION_SITUATIONS),
    (INTEGRATORS, MOTION_SITUATIONS),
)
# Inches: size of a cell; space for names to the left and above; top and bottom margins. Cells of
# whole pixels make the PNG file a third smaller.
_WIDE, _HIGH = 92 / DPI, 53 / DPI
_LEFT, _ABOVE = 1.2, 1.4
_TOP, _FOOT = 0.5, 0.75
_NAMES, _SAID = 16, 42  # characters per line of a situation's name and of its description


def stability(options: argparse.Namespace) -> None:
    """Runs all methods in all situations, draws the outcomes, and writes the records.

    Args:
        options: Parsed command-line options.

    Raises:
        ConfigurationError: The folder cannot be written.
    """
    records, picture = options.out / 'stability.json', options.out / 'stability.png'
    with folder(options.out):
        cases = 2 if options.quick else 30
        cells = [
            cell for methods, situations in GRIDS
            for cell in measure_outcomes(situations, methods, cases=cases)
        ]  # fmt: skip
        save_records(records, cells)
        title = (
            'Outcome of each method in each situation\n'
            f'worst outcome of {cases} cases, or of a few motions, and largest relative error'
        )
        draw_stability(cells, title, picture)
    print(records, picture, sep='\n')


def draw_stability(cells: Sequence[dict[str, Any]], title: str, path: Path) -> None:
    """Draws all grids, one below the other.

    Args:
        cells: Cells of all grids.
        title: Title of the picture.
        path: The PNG file, replaced if it exists.

    Raises:
        OSError: The picture cannot be written.
    """
    height = _TOP + sum(_ABOVE + _HIGH * len(places) for _, places in GRIDS) + _FOOT
    y = height - _TOP
    with chart(path, height, title, layout=None) as figure:
        for methods, situations in GRIDS:
            across, down = _WIDE * len(methods), _HIGH * len(situations)
            y -= _ABOVE + down
            axes = figure.add_axes((_LEFT / WIDTH, y / height, across / WIDTH, down / height))
            _draw_grid(axes, [method.name for method in methods], situations, cells)
        figure.suptitle(title, y=1 - 0.15 / height)
        patches = [
            Patch(facecolor=fractions(fill), label=_WORDS[name])
            for name, (fill, _) in _COLORS.items()
        ]
        figure.legend(handles=patches, loc='lower center', ncols=3)


def _draw_grid(
    axes: Axes,
    methods: list[str],
    situations: Sequence[Situation],
    cells: Sequence[dict[str, Any]],
) -> None:
    axes.set(xlim=(0, len(methods)), ylim=(len(situations), 0))
    for y, situation in enumerate(situations):
        axes.text(
            len(methods) + 0.15, y + 0.5, textwrap.fill(situation.words, _SAID),
            va='center', color='0.3',
        )  # fmt: skip
        for cell in (cell for cell in cells if cell['situation'] == situation.name):
            x, outcome = methods.index(cell['method']), cell['outcome']
            fill, ink = map(fractions, _COLORS[outcome])
            square = Rectangle((x, y), 1, 1, facecolor=fill, edgecolor='white', linewidth=1.5)
            axes.add_patch(square)
            # If no state exists, a refusal is the correct outcome.
            is_good = outcome == RIGHT or (outcome == REFUSED and not situation.exists)
            words = _SHORT.get(outcome, outcome)
            if cell['worst_error'] is not None:
                words += f'\n{cell["worst_error"]:.0e}'
            axes.text(
                x + 0.5, y + 0.52, words, ha='center', va='center', color=ink, fontsize=NUMBERS,
                fontweight='normal' if is_good else 'bold',
            )  # fmt: skip
    axes.set_xticks(
        [i + 0.5 for i in range(len(methods))], map(_name, methods),
        rotation=52, ha='left', fontsize=SMALL,
    )  # fmt: skip
    axes.xaxis.tick_top()
    axes.set_yticks(
        [i + 0.5 for i in range(len(situations))],
        [textwrap.fill(situation.name, _NAMES) for situation in situations], fontsize=SMALL,
    )  # fmt: skip
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)


def _name(method: str) -> str:
    if method in _DEFAULTS:
        return f'{method}\n({_DEFAULTS[method]})'
    return method.replace(', ', ',\n')
