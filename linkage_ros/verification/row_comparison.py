# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Compares logged rows with recomputed ones, and names the first value that differs."""

from __future__ import annotations

from collections import defaultdict

import numpy as np

from linkage_ros.numeric import Array
from linkage_ros.wire.rows import MESSAGE_HEAD, RowLayout
from linkage_ros.wire.template import Place

# The sine of another machine's library may differ in its last bit, and with it all that follows.
TOLERANCE = 4  # ulp of the largest value of a field


class RowComparison:
    """Compares the rows of one log.

    Attributes:
        ulp: Largest difference so far, in ulp of the largest value of the field.
    """

    def __init__(self, layout: RowLayout, names: list[str]) -> None:
        """Prepares a comparison.

        Args:
            layout: Layout of the rows.
            names: Names of the topics, one for each message of a row.
        """
        self.ulp = 0.0
        self._layout, self._names = layout, names
        self._largest: defaultdict[int, float] = defaultdict(float)  # by offset

    def equal(self, logged: bytes, recomputed: bytearray) -> int:
        """The number of rows at the beginning that are equal.

        Args:
            logged: Some rows.
            recomputed: The same number of recomputed rows.

        Returns:
            The number of rows that are equal to the bit, or within the tolerance; 0.0 equals -0.0.
        """
        wrong = np.zeros(len(logged) // self._layout.size, bool)
        if logged == recomputed:  # as they are but for a machine with other sines
            for place in self._layout.places:
                if place.code == 'd':
                    self._largest_of(place, self._layout.column(recomputed, place))
            return len(wrong)
        differences = []
        for place in self._layout.places:
            found, due = (self._layout.column(rows, place) for rows in (logged, recomputed))
            if place.code == 'd':
                difference = self._in_ulp(place, found, due)
                differences.append(difference)
                wrong |= ~(difference <= TOLERANCE)
            else:
                wrong |= found != due
        wrong |= self._layout.differs(logged)
        count = int(wrong.argmax()) if wrong.any() else len(wrong)
        largest = (difference[:count].max(initial=0.0) for difference in differences)
        self.ulp = max(self.ulp, *map(float, largest))
        return count

    def _in_ulp(self, place: Place, found: Array, due: Array) -> Array:
        """Differences of values, in ulp of the field's largest value so far."""
        largest = self._largest_of(place, due)
        with np.errstate(all='ignore'):  # what is logged may be anything
            difference: Array = np.abs(found - due) / np.spacing(largest)
        return difference

    def _largest_of(self, place: Place, due: Array) -> float:
        largest = max(self._largest[place.offset], float(due.max()), -float(due.min()))
        self._largest[place.offset] = largest
        return largest

    def difference(self, logged: bytes, recomputed: bytearray) -> str:
        """Names the first value that differs in the first of some rows.

        Args:
            logged: Logged rows.
            recomputed: Recomputed rows.

        Returns:
            The topic, the value, and the size of the difference.
        """
        logged, recomputed = logged[: self._layout.size], recomputed[: self._layout.size]
        for place in self._layout.places:
            found, due = (self._layout.column(rows, place) for rows in (logged, recomputed))
            size = self._in_ulp(place, found, due)[0] if place.code == 'd' else 0.0
            if not size <= TOLERANCE or (place.code != 'd' and found != due):
                off = f'off by {abs(found[0].item() - due[0].item()):.3g}'
                ulp = f', {size:.6g} ulp' if place.code == 'd' else ''
                values = f'{found[0].item()!r} logged, {due[0].item()!r} recomputed'
                return f'{self._topic(place.offset)}: {place.name} = {values}: {off}{ulp}'
        at = next(i for i in self._layout.constant if logged[i] != recomputed[i])
        start = self._layout.starts[self._layout.message_of(at)] + MESSAGE_HEAD.size
        values = f'{logged[at]:#04x} logged, {recomputed[at]:#04x} recomputed'
        return f'{self._topic(at)}: byte {at - start} = {values}'

    def _topic(self, offset: int) -> str:
        return self._names[self._layout.message_of(offset)]
