# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Templates: bytes in which only numbers at fixed places vary; filled once or thousands of times.

Filling a template is several times faster than serialising messages, and its padding bytes are
zero. Fast DDS leaves uninitialised memory there, so that equal states would give unequal files.
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
        source: Name of the number that fills it.
    """

    name: str
    code: str
    source: str


class Place(NamedTuple):
    """A field of a template: name, type, index of its source, and first byte."""

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
        constant: Offsets of the bytes outside the fields.
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
        """Number of bytes."""
        return len(self.blank)

    def pack(self, *numbers: float) -> bytes:
        """Fills the template once."""
        return self._struct.pack(*self._arrange((*numbers, *self._constants)))

    def fill(self, count: int, numbers: Sequence[Real]) -> bytearray:
        """Fills the template many times.

        Args:
            count: Number of copies.
            numbers: For each source an array of that length, or one number for all.

        Returns:
            The bytes of all copies.
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
            The value in each of them.
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
