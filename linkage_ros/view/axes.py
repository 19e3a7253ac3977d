# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Two axes of a diagram that grow with what they show: Rerun has plots over time alone."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from linkage_ros.numeric import Array

MARKS = 5  # on each axis
ASPECT = 1.6  # width of the diagram over its height
_INTERVALS = MARKS - 1
_ROUND = (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 15.0)
_HEADROOM = 0.05  # of the range, at each growth


class Axis(NamedTuple):
    """One axis: its marks are at whole multiples of a round step.

    Attributes:
        first: Which multiple the first mark is.
        step: From mark to mark.
    """

    first: int
    step: float

    @property
    def ends(self) -> tuple[float, float]:
        """Its first and its last mark."""
        return self.first * self.step, (self.first + _INTERVALS) * self.step

    @property
    def labels(self) -> list[str]:
        """What is written at the marks."""
        return [f'{(self.first + i) * self.step:.6g}' for i in range(MARKS)]


def axis(low: float, high: float) -> Axis:
    """The shortest axis that holds a range.

    Args:
        low: The least value.
        high: The largest, above it.

    Returns:
        The axis.
    """
    decade = 10.0 ** math.floor(math.log10((high - low) / _INTERVALS))
    for step in (factor * decade for factor in _ROUND):
        found = Axis(math.floor(low / step), step)
        if found.ends[1] >= high:
            break
    return found


class GrowingAxes:
    """Axes of x and y that hold all points so far."""

    def __init__(self, low: Array, high: Array) -> None:
        """Takes the range that they hold in any case.

        Args:
            low: Least x and y, shape (2,).
            high: Largest x and y, above these.
        """
        self._low, self._high = low, high
        # Nothing fits in until there is a first point.
        self._ends = np.array([[math.inf] * 2, [-math.inf] * 2])

    def follow(self, points: Array) -> Iterator[tuple[int, list[Axis]]]:
        """Makes room for points, one after the other.

        Args:
            points: Finite; shape (n, 2).

        Yields:
            Which point did not fit in, or is the very first, and the axes from there on.
        """
        done = 0
        while True:
            rest = points[done:]
            outside = np.flatnonzero(((rest < self._ends[0]) | (rest > self._ends[1])).any(axis=1))
            if not outside.size:
                break
            done += int(outside[0])
            room = _HEADROOM * (self._high - self._low)
            low = np.minimum(self._low, points[done] - room)
            high = np.maximum(self._high, points[done] + room)
            self._low, self._high = low, high
            axes = [axis(*ends) for ends in zip(low.tolist(), high.tolist(), strict=True)]
            self._ends = np.array([one.ends for one in axes]).T
            yield done, axes
