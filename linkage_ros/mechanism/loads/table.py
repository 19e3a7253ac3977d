# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Piecewise linear functions of a position, or of an angle with a period of whole turns."""

import bisect
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from linkage_ros.numeric import Array, Real, without_turns

TURN = 2 * math.pi
TURN_ROUNDING = 8 * math.ulp(TURN)  # rad; tolerance for points that are one turn apart


class Table:
    """A piecewise linear function; results are bit-identical for floats and arrays."""

    def __init__(self, at: Sequence[float], value: Sequence[float], *, turns: int = 0) -> None:
        """Computes the slopes between the points.

        Args:
            at: Values of x at the points, in increasing order.
            value: Values of the function at the points; the end values also apply outside.
            turns: Number of turns after which the function repeats, where x is an angle, rad; 0
                if it does not repeat.
        """
        self._turns = turns
        if turns and at[0] + turns * TURN - at[-1] > turns * TURN_ROUNDING:
            at, value = (*at, at[0] + turns * TURN), (*value, value[0])
        slopes = np.diff(value) / np.diff(at)
        # Slopes outside the points, because rounding may put a direction just beyond the ends.
        before, after = (slopes[-1], slopes[0]) if turns else (0.0, 0.0)
        # The integral from the first point to the start of each line.
        areas = np.cumsum(0.5 * np.diff(at) * np.add(value[1:], value[:-1]))
        starts = [at[0], *at], [value[0], *value], [0.0, 0.0, *areas]
        rows = at, *starts, [before, *slopes, after]
        self._arrays = [np.array(row) for row in rows]
        self._lists = [row.tolist() for row in self._arrays]

    @property
    def ends(self) -> tuple[float, float] | None:
        """First and last x of the points; None for a single point or a periodic function."""
        at = self._lists[0]
        return None if self._turns or len(at) < 2 else (at[0], at[-1])

    def __call__(self, x: Real) -> Real:
        """Evaluates the function at x, a float or an array."""
        is_float = isinstance(x, float)
        at, start, value, _, slope = self._lists if is_float else self._arrays
        if self._turns:
            x = without_turns(x, at[0], self._turns)
        i = bisect.bisect_right(at, x) if is_float else np.searchsorted(at, x, 'right')
        return value[i] + slope[i] * (x - start[i])

    def integral(self, x: Real) -> Real:
        """Integrates the function of a position from the first point to x, a float or an array."""
        is_float = isinstance(x, float)
        at, start, value, area, slope = self._lists if is_float else self._arrays
        i = bisect.bisect_right(at, x) if is_float else np.searchsorted(at, x, 'right')
        return area[i] + (value[i] + 0.5 * slope[i] * (x - start[i])) * (x - start[i])

    def line(self, x: Array) -> Any:
        """Returns the number of points up to x, in all turns."""
        at = self._arrays[0]
        if not self._turns:
            return np.searchsorted(at, x, 'right')
        within, period = without_turns(x, at[0], self._turns), self._turns * TURN
        return np.searchsorted(at, within, 'right') + len(at) * np.rint((x - within) / period)
