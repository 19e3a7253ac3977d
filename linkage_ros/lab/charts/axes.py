# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Frame of a chart: style, title and file, and axes over the crank angle."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from linkage_ros.lab.charts.sizes import DPI, NUMBERS, SMALL, TEXT, TITLE, WIDTH
from linkage_ros.numeric import Array

STYLE: dict[Any, Any] = {
    'font.size': SMALL, 'figure.titlesize': TITLE, 'axes.titlesize': TEXT,
    'xtick.labelsize': NUMBERS, 'ytick.labelsize': NUMBERS, 'text.parse_math': False,
    'axes.grid': True, 'axes.axisbelow': True, 'grid.color': '0.88', 'grid.linewidth': 0.6,
    'legend.frameon': False, 'axes.formatter.useoffset': False,
}  # fmt: skip


@contextmanager
def chart(
    path: Path, height: float, title: str | None = None, layout: Any = 'constrained'
) -> Iterator[Figure]:
    """Makes a chart in the common style, and saves it.

    Args:
        path: The PNG file, replaced if it exists.
        height: Height, inches.
        title: Title of the whole chart.
        layout: Layout engine of matplotlib.

    Yields:
        The empty figure.

    Raises:
        OSError: The file cannot be written.
    """
    with rc_context(STYLE):
        figure = Figure(figsize=(WIDTH, height), dpi=DPI, layout=layout)
        figure.suptitle(title or '')
        yield figure
        figure.savefig(path)


def over_crank(axes: Axes, crank: Array, label: str, parts: int = 8) -> None:
    """Finishes a diagram over the crank angle: ticks at even parts of it, and a line at 0."""
    end = math.degrees(crank[-1])
    axes.set(xlim=(0, end), xticks=np.linspace(0, end, parts + 1), ylabel=label)
    low, high = axes.get_ylim()
    if low < 0 < high:
        axes.axhline(0, color='0.6', linewidth=0.8, zorder=0)
