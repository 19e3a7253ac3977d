# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Bytes of a fixed size in which only numbers at fixed places vary: one at a time, or thousands.

Filling a template is several times faster than serialising messages, and leaves every padding
byte zero: Fast DDS would leave there whatever was on the heap, so that equal states gave unequal
files.
"""

from __future__ import annotations

import operator
import struct
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from linkage_ros.numeric import Real


class Field(NamedTuple):
    """A number in a message.

    Attributes:
        name: Name in the message, such as 'velocity[coupler]'.
        code: Its type, as in `struct`.
        source: The number that it takes.
    """

    name: str
    code: str
    source: str


class Place(NamedTuple):
    """A field of a template: its name and type, the index of its source, its first byte."""

    name: str
    code: str
    source: int
    offset: int


Part: TypeAlias = bytes | Field


class Template:
    """A run of bytes and fields.

    Attributes:
        blank: The bytes, with zeros in the fields.
        places: The fields, in order.
        constant: Offsets of the bytes that belong to no field.
    """

    def __init__(self, parts: Iterable[Part], sources: Sequence[str]) -> None:
        """Lays out the parts.

        Args:
            parts: Constant bytes and fields, in order.
            sources: Names of the numbers that fill it.
        """
        self.blank, self.places = b'', list[Place]()
        constants, order, form = list[bytes](), list[int](), '<'
        for part in parts:
            if isinstance(part, Field):
                source = sources.index(part.source)
                self.places.append(Place(part.name, part.code, source, len(self.blank)))
                order.append(source)
                form += part.code
                self.blank += bytes(struct.calcsize(part.code))
            else:
                order.append(len(sources) + len(constants))
                constants.append(part)
                form += f'{len(part)}s'
                self.blank += part
        self._struct, self._constants = struct.Struct(form), tuple(constants)
        self._arrange = operator.itemgetter(*order)
        fields = {p.offset + i for p in self.places for i in range(struct.calcsize(p.code))}
        self.constant = np.array([i for i in range(len(self.blank)) if i not in fields])

    @property
    def size(self) -> int:
        """Its bytes."""
        return len(self.blank)

    def pack(self, *numbers: float) -> bytes:
        """The bytes for numbers, one for each source."""
        return self._struct.pack(*self._arrange((*numbers, *self._constants)))

    def fill(self, count: int, numbers: Sequence[Real]) -> bytearray:
        """The bytes for many times as many numbers.

        Args:
            count: How many times.
            numbers: For each source an array of so many numbers, or one number for all.

        Returns:
            The bytes, one after the other.
        """
        rows = bytearray(self.blank * count)
        for place in self.places:
            self.column(rows, place)[:] = numbers[place.source]
        return rows

    def column(self, rows: Any, place: Place) -> npt.NDArray[Any]:
        """A view of one field.

        Args:
            rows: Bytes of any number of filled templates.
            place: The field.

        Returns:
            Its value in each of them.
        """
        kind = np.dtype(
            {
                'names': ['value'], 'formats': [f'<{place.code}'], 'offsets': [place.offset],
                'itemsize': self.size,
            }
        )  # fmt: skip
        values: npt.NDArray[Any] = np.ndarray(len(rows) // self.size, kind, rows)['value']
        return values

    def differs(self, rows: bytes | bytearray) -> npt.NDArray[np.bool_]:
        """Whether each of any number of filled templates differs from this one between fields."""
        found = np.frombuffer(rows, np.uint8).reshape(-1, self.size)
        blank = np.frombuffer(self.blank, np.uint8)
        differs: npt.NDArray[np.bool_] = (found != blank)[:, self.constant].any(axis=1)
        return differs
