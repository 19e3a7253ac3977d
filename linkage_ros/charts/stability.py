# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What comes of methods in situations, as a picture."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle

from linkage_ros.methods.situations import SITUATIONS
from linkage_ros.methods.stability import (
    DIVERGED,
    NAN,
    REFUSED,
    RIGHT,
    WRONG_BRANCH,
    Cell,
)
from linkage_ros.methods.table import DEFAULT, METHODS

# Fill and text. In grey they are still told apart, and each cell says its outcome in words.
_COLORS = {
    RIGHT: ('#e8f4ef', '#00543d'),
    REFUSED: ('#bfe0f5', '#003a5c'),
    DIVERGED: ('#e69f00', '#000000'),
    WRONG_BRANCH: ('#b0558a', '#ffffff'),
    NAN: ('#333333', '#ffffff'),
}
_WORDS = {
    RIGHT: 'right', REFUSED: 'refused: an error says why', DIVERGED: 'diverged: a wrong value',
    WRONG_BRANCH: "wrong branch: the other assembly's", NAN: 'NaN or an arithmetic error',
}  # fmt: skip


def draw_stability(cells: Sequence[Cell], title: str, path: Path) -> None:
    """Draws the grid.

    Args:
        cells: All of them.
        title: Of the picture.
        path: Where to write it; replaced if it exists.

    Raises:
        OSError: The picture cannot be written.
    """
    rows = [situation.name for situation in SITUATIONS]
    columns = [method.name for method in METHODS]
    exists = {situation.name: situation.exists for situation in SITUATIONS}
    figure = Figure(figsize=(4 + 0.95 * len(columns), 2.6 + 0.42 * len(rows)), dpi=110)
    axes = figure.add_axes((0.165, 0.075, 0.765, 0.74))
    axes.set_xlim(0, len(columns))
    axes.set_ylim(len(rows), 0)
    for cell in cells:
        x, y = columns.index(cell.method), rows.index(cell.situation)
        fill, ink = _COLORS[cell.outcome]
        axes.add_patch(Rectangle((x, y), 1, 1, facecolor=fill, edgecolor='white', linewidth=1.5))
        good = cell.outcome == (RIGHT if exists[cell.situation] else REFUSED)
        axes.text(
            x + 0.5, y + 0.36, cell.outcome, ha='center', va='center', color=ink, fontsize=8,
            fontweight='normal' if good else 'bold',
        )  # fmt: skip
        if cell.worst_error is not None:
            axes.text(
                x + 0.5, y + 0.72, f'{cell.worst_error:.0e}', ha='center', va='center',
                color=ink, fontsize=6.5,
            )  # fmt: skip
    axes.set_xticks([i + 0.5 for i in range(len(columns))])
    labels = [
        f'{name}\n(default)' if name == DEFAULT else name.replace(', ', ',\n') for name in columns
    ]
    axes.set_xticklabels(labels, rotation=35, ha='left', fontsize=8.5)
    axes.xaxis.tick_top()
    axes.set_yticks([i + 0.5 for i in range(len(rows))])
    axes.set_yticklabels(
        [name if exists[name] else f'{name} (no state exists)' for name in rows], fontsize=8.5
    )
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)
    figure.suptitle(title, fontsize=12, y=0.985)
    figure.legend(
        handles=[Patch(facecolor=fill, label=_WORDS[name]) for name, (fill, _) in _COLORS.items()],
        loc='lower center', ncols=len(_COLORS), fontsize=8.5, frameon=False,
    )  # fmt: skip
    figure.savefig(path)
