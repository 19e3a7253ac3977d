# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Ticks: the times at which states are computed."""

from fractions import Fraction
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from linkage_ros.units import NS_PER_S

# Integers of any size; arrays of them have dtype object.
Whole = TypeVar('Whole', int, npt.NDArray[np.object_])


class TickRate:
    """Times of ticks at a constant rate, without accumulated error."""

    def __init__(self, rate_hz: float) -> None:
        # Use the decimal value, so that ticks at 0.1 Hz are exactly 10 s apart.
        self._rate = Fraction(repr(rate_hz)).as_integer_ratio()

    def elapsed(self, tick: Whole) -> Whole:
        """Returns the time from tick 0 to a tick, ns, without accumulated error."""
        numerator, denominator = self._rate
        elapsed: Whole = tick * NS_PER_S * denominator // numerator
        return elapsed

    def tick_at(self, elapsed: Whole) -> Whole:
        """Returns the last tick at or before an elapsed time, ns."""
        numerator, denominator = self._rate
        tick: Whole = elapsed * numerator // (NS_PER_S * denominator)
        # Because `elapsed` rounds down, the next tick may already be due.
        tick += self.elapsed(tick + 1) <= elapsed
        return tick
