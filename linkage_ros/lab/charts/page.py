# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A page of diagrams: parts placed in inches from the upper left, words in the right margin."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, NamedTuple, TypeAlias

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from linkage_ros.lab.charts.sizes import DPI, WIDTH

# As matplotlib has them: a line that is solid or dashed, and a colour.
Line: TypeAlias = Literal['-'] | tuple[int, tuple[int, ...]]
Shade: TypeAlias = tuple[float, float, float]

MARGIN = 4.5  # inches, on the right
_SAMPLE = 0.25  # inches, of a curve's line before its numbers


class Words(NamedTuple):
    """A line of text in the margin.

    Attributes:
        text: In monospace it is a row of a table, with room for a sample of a curve's line.
        color: As matplotlib has it.
        weight: Likewise.
        family: Likewise.
        style: Style of that sample; None: there is none.
    """

    text: str
    color: Shade | str = '0.1'
    weight: str = 'normal'
    family: str = 'sans-serif'
    style: Line | None = None


class Page:
    """A picture as wide as all, whose parts are placed in inches from its upper left corner.

    Attributes:
        figure: The picture.
    """

    def __init__(self, height: float) -> None:
        self.figure = Figure(figsize=(WIDTH, height), dpi=DPI)
        self._height = height

    def axes(self, left: float, top: float, width: float, height: float) -> Axes:
        """A place to draw in."""
        bottom = 1 - (top + height) / self._height
        return self.figure.add_axes((left / WIDTH, bottom, width / WIDTH, height / self._height))

    def write(self, top: float, size: float, lines: Sequence[Words]) -> None:
        """Writes lines into the margin.

        Args:
            top: Top of the first line, inches.
            size: Size of the letters, points.
            lines: From top to bottom.
        """
        left, step = WIDTH - MARGIN + 0.15, 1.45 * size / 72
        for number, line in enumerate(lines):
            indent = _SAMPLE + 0.08 if line.family == 'monospace' else 0.0
            y = 1 - (top + number * step) / self._height
            self.figure.text(
                (left + indent) / WIDTH, y, line.text, fontsize=size, family=line.family,
                color=line.color, weight=line.weight, va='top', parse_math=False,
            )  # fmt: skip
            if line.style is not None:
                x = left / WIDTH, (left + _SAMPLE) / WIDTH
                middle = y - 0.3 * step / self._height
                look: dict[str, Any] = {'linestyle': line.style, 'color': line.color}
                self.figure.add_artist(Line2D(x, (middle, middle), linewidth=1.6, **look))
