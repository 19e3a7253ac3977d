# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Byte templates: constant bytes with numbers at fixed offsets.

The messages of a topic differ only in such numbers. Filling a template, once or thousands of
times, is several times faster than serialising each message. Padding bytes are zero. Fast DDS
leaves them uninitialised, which would make files of equal states differ.
"""

import operator
import struct
from collections.abc import Sequence
from itertools import accumulate
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from linkage_ros.numeric import Array, Real
from linkage_ros.units import NS_PER_S


class Field(NamedTuple):
    """A number in a template.

    Attributes:
        name: Name of the number, such as 'velocity[coupler]'; fields with the same name hold the
            same number.
        code: Type of the number, as in `struct`.
        offset: Offset of the number in the template, bytes.
    """

    name: str
    code: str
    offset: int = 0


Part: TypeAlias = bytes | Field
STAMP_FIELDS = Field('header.stamp.sec', 'i'), Field('header.stamp.nanosec', 'I')


class Template:
    """A byte template that consists of constant bytes and fields.

    Attributes:
        size: Number of bytes.
        places: The fields, in order.
        fields: The fields by name; if several have the same name, the last of them.
    """

    def __init__(self, parts: Sequence[Part], names: Sequence[str] = ()) -> None:
        """Computes the offsets of the fields.

        Args:
            parts: Constant bytes and fields, in order.
            names: Names of the numbers that fill the template; by default, the names of the
                fields, in order.
        """
        names = names or [part.name for part in parts if isinstance(part, Field)]
        self._constants = [part for part in parts if isinstance(part, bytes)]
        # `pack` arranges its numbers and the constants in the order of the parts.
        values: list[str | bytes] = [*names, *self._constants]
        order = [values.index(part.name if isinstance(part, Field) else part) for part in parts]
        self._arrange = operator.itemgetter(*order)
        formats = [part.code if isinstance(part, Field) else f'{len(part)}s' for part in parts]
        self._struct = struct.Struct('<' + ''.join(formats))
        self.size = self._struct.size
        offsets = accumulate((struct.calcsize('<' + x) for x in formats), initial=0)
        self.places = [
            part._replace(offset=offset)
            for part, offset in zip(parts, offsets, strict=False)
            if isinstance(part, Field)
        ]
        self.fields = {place.name: place for place in self.places}
        self._numbers = [names.index(place.name) for place in self.places]
        self._blank = self.pack(*[0] * len(names))

    def pack(self, *numbers: float) -> bytes:
        """Returns the template filled with numbers."""
        return self._struct.pack(*self._arrange((*numbers, *self._constants)))

    def fill(self, count: int, numbers: Sequence[Real]) -> bytearray:
        """Fills many copies of the template.

        Args:
            count: Number of copies.
            numbers: For each name, an array with one value per copy, or one number for all.
        """
        rows = bytearray(self._blank * count)
        for place, number in zip(self.places, self._numbers, strict=True):
            self.column(rows, place)[:] = numbers[number]
        return rows

    def read(self, data: bytes) -> tuple[npt.NDArray[np.int64], Array]:
        """Reads one or more messages that match the template, which has a stamp.

        Returns:
            The stamps, ns, shape (n,), and the other numbers, shape (n, numbers).

        Raises:
            ValueError: The bytes do not match the template.
        """
        count = len(data) // self.size
        columns = [self.column(data, place) for place in self.places] if count else []
        if not count or self.fill(count, columns) != data:
            fields = ', '.join(place.name for place in self.places)
            raise ValueError(f'no message with exactly {fields}')
        return self.stamps(data), np.stack(columns[len(STAMP_FIELDS) :], axis=1)

    def stamps(self, rows: bytes) -> npt.NDArray[np.int64]:
        """Returns the stamps in filled templates, ns."""
        fields = [self.fields[field.name] for field in STAMP_FIELDS]
        seconds, nanoseconds = (self.column(rows, field) for field in fields)
        stamps: npt.NDArray[np.int64] = seconds.astype(np.int64) * NS_PER_S + nanoseconds
        return stamps

    def column(self, rows: Any, place: Field) -> npt.NDArray[Any]:
        """Returns a view of one field in the bytes of any number of filled templates."""
        values: npt.NDArray[Any] = np.ndarray(
            len(rows) // self.size, f'<{place.code}', rows, place.offset, (self.size,)
        )
        return values
