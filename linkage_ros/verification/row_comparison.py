# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Compares logged rows with recomputed ones, and names the first value that differs."""

import math
import struct
from bisect import bisect_right

import numpy as np

from linkage_ros.numeric import Array
from linkage_ros.wire.rows import MESSAGE_HEAD, RowLayout

# Sines of another machine may differ in the last bit, and so may all results.
TOLERANCE = 4  # ulp of the largest value of a field


class RowComparison:
    """Compares the rows of one log.

    Attributes:
        ulp: Largest difference so far, in ulp of the largest value of the field.
    """

    def __init__(self, layout: RowLayout, names: list[str]) -> None:
        self._names, self.ulp, self._layout = names, 0.0, layout
        self._doubles = [place for place in layout.places if place.code == 'd']
        self._largest = np.zeros((len(self._doubles), 1))

    def compare(self, logged: bytes, recomputed: bytearray) -> tuple[int, str]:
        """Compares rows.

        Args:
            logged: Some rows.
            recomputed: The same number of recomputed rows.

        Returns:
            The number of rows at the beginning that are equal to the bit, or within the
            tolerance, where 0.0 equals -0.0; and the difference of the next row.
        """
        due, size = self._values(recomputed), self._layout.size
        number = len(logged) // size
        self._largest = np.maximum(self._largest, abs(due).max(axis=1, keepdims=True))
        if logged == recomputed:  # equal unless another machine has different sines
            return number, ''
        with np.errstate(all='ignore'):  # logged values may be arbitrary
            ulp = abs(self._values(logged) - due) / np.spacing(self._largest)
        found, made = (np.frombuffer(x, np.uint8) for x in (logged, recomputed))
        differs = np.not_equal(found, made).reshape(-1, size)
        for place, near in zip(self._doubles, ulp <= TOLERANCE, strict=True):
            differs[near, place.offset : place.offset + 8] = False
        wrong = differs.any(axis=1)
        count = int(wrong.argmax()) if wrong.any() else number
        self.ulp = max(self.ulp, float(ulp[:, :count].max(initial=0.0)))
        if count == number:
            return count, ''
        at, row = int(differs[count].argmax()), slice(count * size, (count + 1) * size)
        return count, self._describe(at, logged[row], recomputed[row])

    def _values(self, rows: bytes | bytearray) -> Array:
        """The doubles of rows, one row of the array for each field."""
        return np.array([self._layout.column(rows, place) for place in self._doubles])

    def _describe(self, at: int, logged: bytes, recomputed: bytearray) -> str:
        """Describes the difference between two rows at their first different byte."""
        message = bisect_right(self._layout.starts, at) - 1
        byte = at - self._layout.starts[message] - MESSAGE_HEAD.size
        words = f'byte {byte} = {logged[at]:#04x} logged, {recomputed[at]:#04x} recomputed'
        for place in self._layout.places:
            if place.offset <= at < place.offset + struct.calcsize(place.code):
                found, due = (self._layout.column(x, place).item() for x in (logged, recomputed))
                words = f'{place.name} = {found!r} logged, {due!r} recomputed: off by '
                words += f'{abs(found - due):.3g}'
                if place in self._doubles:
                    (largest,) = self._largest[self._doubles.index(place)].tolist()
                    words += f', {abs(found - due) / math.ulp(largest):.6g} ulp'
        return f'{self._names[message]}: {words}'
