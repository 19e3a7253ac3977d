# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How late ticks came: counts in bins a few percent wide, for runs of any length."""

from __future__ import annotations

# Bins that share each power of two, as bits: neighbours differ by 3 %.
_BITS = 5
_FINE = 1 << _BITS


class Lateness:
    """Counts times; one thread adds, any may ask.

    Attributes:
        greatest: Of all, ns.
    """

    def __init__(self) -> None:
        self.greatest = 0
        # Each number below _FINE has its own; then each power of two up to 2**62 has _FINE.
        self._counts = [0] * ((63 - _BITS) * _FINE)

    def add(self, late: int) -> None:
        """Counts a time.

        Args:
            late: ns, from 0 to 2**62: a century and a half.
        """
        if late > self.greatest:
            self.greatest = late
        shift = max(0, late.bit_length() - _BITS - 1)
        self._counts[(shift << _BITS) + (late >> shift)] += 1

    def quantile(self, part: float) -> int:
        """A time that a part of all do not exceed.

        Args:
            part: From 0 to 1.

        Returns:
            ns, at most 3 % too long; 0: nothing has been counted.
        """
        left = part * sum(self._counts)
        for index, count in enumerate(self._counts):
            left -= count
            if count and left <= 0:
                return min(self.greatest, _upper(index))
        return self.greatest


def _upper(index: int) -> int:
    """The last number of a bin."""
    shift = max(0, (index >> _BITS) - 1)
    return (((index - (shift << _BITS)) + 1) << shift) - 1
