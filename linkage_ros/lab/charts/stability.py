# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Numerical stability: what comes of methods in situations, as a picture; motions stand below."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle

from linkage_ros.lab.charts.sizes import DPI, NUMBERS, SMALL, TITLE, WIDTH
from linkage_ros.lab.methods.motion_situations import MOTION_SITUATIONS
from linkage_ros.lab.methods.outcomes import (
    DIVERGED,
    NAN,
    REFUSED,
    RIGHT,
    WRONG_BRANCH,
    Cell,
)
from linkage_ros.lab.methods.registry import DEFAULT, INTEGRATORS, LIVE, METHODS, RECORDS
from linkage_ros.lab.methods.situations import SITUATIONS
from linkage_ros.palette import BLACK, BLUE, GREEN, ORANGE, PURPLE, SKY, WHITE, fractions, mixed

# Fill and text. In grey they are still told apart, and each cell says its outcome in words.
_COLORS = {
    RIGHT: (mixed(GREEN, WHITE, 0.9), mixed(GREEN, BLACK, 0.7)),
    REFUSED: (mixed(SKY, WHITE, 0.6), mixed(BLUE, BLACK, 0.7)),
    DIVERGED: (ORANGE, BLACK),
    WRONG_BRANCH: (mixed(PURPLE, BLACK, 0.3), WHITE),
    NAN: (BLACK, WHITE),
}
_WORDS = {
    RIGHT: 'right', REFUSED: 'refused: an error says why',
    DIVERGED: 'wrong: a value that diverged',
    WRONG_BRANCH: "wrong branch: the other assembly's", NAN: 'NaN, an arithmetic error, or stuck',
}  # fmt: skip
_SHORT = {DIVERGED: 'wrong', WRONG_BRANCH: 'branch'}  # in a cell
_DEFAULTS = {DEFAULT: 'default', LIVE: 'default, live', RECORDS: 'default for records'}
# Sizes in inches: a cell; the names to the left; those above, aslant; what is above and below all.
# Cells of whole pixels are alike: the file is smaller by a third.
_HIGH = 53 / DPI
_LEFT, _RIGHT, _ABOVE = 1.2, 0.53, 1.4
_TOP, _FOOT = 0.35, 0.75
_NAMES, _SAID = 16, 52  # letters in a line, of situations and of what is said of them


class _Grid(NamedTuple):
    """A part of the picture.

    Attributes:
        columns: Names of methods.
        rows: Names of situations, and what they are called.
        good: Of each row, the outcomes that are no failure.
        words: Of each row, what is written to its right.
    """

    columns: list[str]
    rows: dict[str, str]
    good: dict[str, tuple[str, ...]]
    words: dict[str, str]

    @property
    def height(self) -> float:
        """With the names above, inches."""
        return _ABOVE + _HIGH * len(self.rows)


def draw_stability(cells: Sequence[Cell], motions: Sequence[Cell], title: str, path: Path) -> None:
    """Draws both grids.

    Args:
        cells: Of the methods for linkages.
        motions: Of the integrators.
        title: Of the picture.
        path: Where to write it; replaced if it exists.

    Raises:
        OSError: The picture cannot be written.
    """
    grids = [
        (_of_linkages(), cells),
        (_of_motions(), motions),
    ]
    height = _TOP + sum(grid.height for grid, _ in grids) + _FOOT
    figure = Figure(figsize=(WIDTH, height), dpi=DPI)
    y, wide = height - _TOP, (WIDTH - _LEFT - _RIGHT) / len(METHODS)
    for grid, chosen in grids:
        y -= grid.height
        across, down = wide * len(grid.columns), _HIGH * len(grid.rows)
        axes = figure.add_axes((_LEFT / WIDTH, y / height, across / WIDTH, down / height))
        _draw_grid(axes, grid, chosen)
    figure.suptitle(title, fontsize=TITLE, y=1 - 0.15 / height)
    figure.legend(
        handles=[
            Patch(facecolor=fractions(fill), label=_WORDS[name])
            for name, (fill, _) in _COLORS.items()
        ],
        loc='lower center', ncols=3, fontsize=SMALL, frameon=False,
    )  # fmt: skip
    figure.savefig(path)


def _of_linkages() -> _Grid:
    exists = {situation.name: situation.exists for situation in SITUATIONS}
    return _Grid(
        [method.name for method in METHODS],
        {name: name if exists[name] else f'{name}, no state exists' for name in exists},
        {name: (RIGHT,) if exists[name] else (REFUSED,) for name in exists},
        {},
    )


def _of_motions() -> _Grid:
    return _Grid(
        [method.name for method in INTEGRATORS],
        {situation.name: situation.name for situation in MOTION_SITUATIONS},
        # Beyond the end of the coordinates another assembly goes on: who follows it is right too.
        {s.name: (RIGHT,) if s.exists else (RIGHT, REFUSED) for s in MOTION_SITUATIONS},
        {situation.name: situation.words for situation in MOTION_SITUATIONS},
    )


def _draw_grid(axes: Axes, grid: _Grid, cells: Sequence[Cell]) -> None:
    rows = list(grid.rows)
    axes.set_xlim(0, len(grid.columns))
    axes.set_ylim(len(rows), 0)
    for cell in cells:
        x, y = grid.columns.index(cell.method), rows.index(cell.situation)
        fill, ink = map(fractions, _COLORS[cell.outcome])
        axes.add_patch(Rectangle((x, y), 1, 1, facecolor=fill, edgecolor='white', linewidth=1.5))
        good = cell.outcome in grid.good[cell.situation]
        axes.text(
            x + 0.5, y + 0.3, _SHORT.get(cell.outcome, cell.outcome), ha='center', va='center',
            color=ink, fontsize=NUMBERS, fontweight='normal' if good else 'bold',
        )  # fmt: skip
        if cell.worst_error is not None:
            words = f'{cell.worst_error:.0e}' + (' s' if cell.outcome == REFUSED else '')
            axes.text(
                x + 0.5, y + 0.74, words, ha='center', va='center', color=ink, fontsize=NUMBERS
            )
    for name, words in grid.words.items():
        axes.text(
            len(grid.columns) + 0.15, rows.index(name) + 0.5, textwrap.fill(words, _SAID),
            va='center', fontsize=SMALL, color='0.3',
        )  # fmt: skip
    axes.set_xticks([i + 0.5 for i in range(len(grid.columns))])
    axes.set_xticklabels(map(_name, grid.columns), rotation=52, ha='left', fontsize=SMALL)
    axes.xaxis.tick_top()
    axes.set_yticks([i + 0.5 for i in range(len(rows))])
    axes.set_yticklabels(
        [textwrap.fill(words, _NAMES) for words in grid.rows.values()], fontsize=SMALL
    )
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)


def _name(method: str) -> str:
    if method in _DEFAULTS:
        return f'{method}\n({_DEFAULTS[method]})'
    return method.replace(', ', ',\n').replace('constrained ', 'constrained\n')
