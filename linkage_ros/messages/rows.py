# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Rows: the MCAP records of all messages of one state.

The messages of a topic differ only in numbers at fixed offsets. Filling a template, once or
thousands of times, is several times faster than serialising each message. Padding bytes are zero.
Fast DDS leaves them uninitialised, which would make files of equal states differ.

The messages of a state are adjacent in a log, so that a state is written, found and compared as
one block of bytes.
"""

import operator
import re
import struct
from collections.abc import Sequence
from itertools import accumulate
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from linkage_ros.numeric import Array, Real
from linkage_ros.units import NS_PER_S

# Opcode and length of the record, channel, sequence number, log time and publish time.
MESSAGE_HEAD = struct.Struct('<BQHIQQ')
_HEAD_FIELDS = np.dtype({
    'names': ['opcode', 'channel', 'time'], 'formats': ['u1', '<u2', '<u8'],
    'offsets': [0, 9, 15], 'itemsize': MESSAGE_HEAD.size,
})  # fmt: skip
_OPCODE = 5
_CONSTANT = 15  # number of bytes in the head before the times


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
TIME_FIELDS = Field('log time', 'Q'), Field('publish time', 'Q')
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
        known: list[str | bytes] = [*names, *(part for part in parts if isinstance(part, bytes))]
        order = [known.index(part.name if isinstance(part, Field) else part) for part in parts]
        forms = [part.code if isinstance(part, Field) else f'{len(part)}s' for part in parts]
        self._struct, self._constants = struct.Struct('<' + ''.join(forms)), known[len(names) :]
        self._arrange, self.size = operator.itemgetter(*order), self._struct.size
        starts = accumulate((struct.calcsize('<' + form) for form in forms), initial=0)
        pairs = zip(parts, starts, strict=False)
        self.places = [part._replace(offset=at) for part, at in pairs if isinstance(part, Field)]
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

        Returns:
            The bytes of all copies.
        """
        rows = bytearray(self._blank * count)
        for place, number in zip(self.places, self._numbers, strict=True):
            self.column(rows, place)[:] = numbers[number]
        return rows

    def read(self, data: bytes) -> tuple[npt.NDArray[np.int64], Array]:
        """Reads messages that match the template, which has a stamp.

        Args:
            data: Concatenated CDR bytes of one or more messages.

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
        whole, rest = (self.column(rows, self.fields[field.name]) for field in STAMP_FIELDS)
        stamps: npt.NDArray[np.int64] = whole.astype(np.int64) * NS_PER_S + rest
        return stamps

    def column(self, rows: Any, place: Field) -> npt.NDArray[Any]:
        """Returns a view of one field.

        Args:
            rows: Bytes of any number of filled templates.
            place: Field to view.

        Returns:
            The values of the field, one per template.
        """
        values: npt.NDArray[Any] = np.ndarray(
            len(rows) // self.size, f'<{place.code}', rows, place.offset, (self.size,)
        )
        return values


def message_record(channel: int, times: tuple[int, int], data: bytes) -> bytes:
    """Encodes a message as an MCAP record.

    Args:
        channel: Number of the message's channel.
        times: Log and publish time, ns.
        data: CDR bytes of the message.

    Returns:
        The bytes of the record.
    """
    size = MESSAGE_HEAD.size - 9 + len(data)  # without opcode and length
    return MESSAGE_HEAD.pack(_OPCODE, size, channel, 0, *times) + data


def message_heads(data: bytes, starts: Sequence[int]) -> npt.NDArray[Any]:
    """Reads the heads of message records.

    Args:
        data: Bytes with the records.
        starts: Offset of each record.

    Returns:
        A structured array with the fields opcode, channel and time (log time, ns). If a record is
        not a message, only its opcode is meaningful.
    """
    padded = np.frombuffer(data + bytes(MESSAGE_HEAD.size), np.uint8)
    windows = np.lib.stride_tricks.sliding_window_view(padded, MESSAGE_HEAD.size)
    heads: npt.NDArray[Any] = windows[np.array(starts, np.int64)].view(_HEAD_FIELDS)[:, 0]
    return heads


class RowLayout(Template):
    """The layout of a row, which contains the records of one state's messages.

    Attributes:
        channels: Channel number of each message.
        starts: Offset of each message's record.
        bodies: Slice of each message's CDR bytes.
        times: Field with the log time of the first message.
    """

    def __init__(
        self, messages: Sequence[tuple[int, Sequence[Part]]], names: Sequence[str]
    ) -> None:
        """Computes the offsets of the messages and their fields.

        Args:
            messages: Channel number and template parts of each message.
            names: Names of the numbers that fill the messages.
        """
        parts, patterns = list[Part](), list[bytes]()
        self.channels, self._ends = [channel for channel, _ in messages], [0]
        for channel, message in messages:
            size = Template(message).size
            self._ends.append(self._ends[-1] + MESSAGE_HEAD.size + size)
            head = message_record(channel, (0, 0), bytes(size))[:_CONSTANT]
            parts += [head, *TIME_FIELDS, *message]
            patterns.append(re.escape(head) + b'.{%d}' % (MESSAGE_HEAD.size - _CONSTANT + size))
        super().__init__(parts, names)
        self.starts, self.times = self._ends[:-1], self.places[0]
        ends = zip(self.starts, self._ends[1:], strict=True)
        self.bodies = [slice(start + MESSAGE_HEAD.size, end) for start, end in ends]
        self._whole = re.compile(b'(?:%b)*' % b''.join(patterns), re.DOTALL)

    def fitting(self, records: bytes | bytearray) -> int:
        """Returns the length of the leading messages that match the start of a row, in bytes."""
        rows = ((end, records[:end] + self._blank[end:]) for end in self._ends)
        return max(end for end, row in rows if self.count(row, 0))

    def count(self, data: bytes | bytearray, at: int) -> int:
        """Counts complete adjacent rows.

        Args:
            data: MCAP records.
            at: Offset of the first row.

        Returns:
            The number of complete rows from that offset on.
        """
        found = self._whole.match(data, at)
        return (found.end() - at) // self.size if found else 0
