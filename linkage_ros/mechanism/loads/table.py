# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Piecewise linear functions of a position, or of an angle with a period of whole turns."""

import bisect
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from linkage_ros.numeric import Array, Real, without_turns

TURN = 2 * math.pi
TURN_ROUNDING = 8 * math.ulp(TURN)  # rad; tolerance for points that are one turn apart


class _Lines(NamedTuple):
    """Lines between points, as lists or arrays; line i ends at point i.

    Attributes:
        at: x of the points.
        start: x at the start of each line.
        value: Value there.
        integral: Integral from the first point to the start of each line.
        slope: Slope of each line.
    """

    at: Any
    start: Any
    value: Any
    integral: Any
    slope: Any


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
        period_end = at[0] + turns * TURN
        if turns and period_end - at[-1] > turns * TURN_ROUNDING:
            at, value = (*at, period_end), (*value, value[0])
        widths = np.diff(at)
        slopes = np.diff(value) / widths
        areas = 0.5 * widths * np.add(value[1:], value[:-1])
        # Slopes outside the points, because rounding may put a direction just beyond the ends.
        slope_before = slopes[-1] if turns else 0.0
        slope_after = slopes[0] if turns else 0.0
        self._arrays = _Lines(
            at=np.array(at),
            start=np.array([at[0], *at]),
            value=np.array([value[0], *value]),
            integral=np.array([0.0, 0.0, *np.cumsum(areas)]),
            slope=np.array([slope_before, *slopes, slope_after]),
        )
        self._lists = _Lines._make(row.tolist() for row in self._arrays)

    @property
    def ends(self) -> tuple[float, float] | None:
        """First and last x of the points; None for a single point or a periodic function."""
        at = self._lists.at
        return None if self._turns or len(at) < 2 else (at[0], at[-1])

    def __call__(self, x: Real) -> Real:
        """Evaluates the function at x, a float or an array."""
        is_float = isinstance(x, float)
        lines = self._lists if is_float else self._arrays
        if self._turns:
            x = without_turns(x, lines.at[0], self._turns)
        i = bisect.bisect_right(lines.at, x) if is_float else np.searchsorted(lines.at, x, 'right')
        return lines.value[i] + lines.slope[i] * (x - lines.start[i])

    def integral(self, x: Real) -> Real:
        """Integrates the function of a position from the first point to x, a float or an array."""
        is_float = isinstance(x, float)
        lines = self._lists if is_float else self._arrays
        i = bisect.bisect_right(lines.at, x) if is_float else np.searchsorted(lines.at, x, 'right')
        width = x - lines.start[i]
        mean = lines.value[i] + 0.5 * lines.slope[i] * width
        return lines.integral[i] + mean * width

    def line(self, x: Array) -> Any:
        """Returns the number of points up to x, in all turns."""
        at = self._arrays.at
        if not self._turns:
            return np.searchsorted(at, x, 'right')
        within, period = without_turns(x, at[0], self._turns), self._turns * TURN
        return np.searchsorted(at, within, 'right') + len(at) * np.rint((x - within) / period)
