# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Rows: all messages of one state as bytes of an MCAP file, record headers included.

The messages of a state are adjacent in a log and have fixed sizes, so that a state is written,
found and compared as one run of bytes.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence

import numpy as np

from linkage_ros.wire.template import Field, Part, Template

MESSAGE_OPCODE = 5
# Opcode and length of the record, channel, sequence, log and publish time.
MESSAGE_HEAD = struct.Struct('<BQHIQQ')
_CONSTANT = 15  # bytes of the head before its times


def message_record(channel: int, times: tuple[int, int], data: bytes, sequence: int = 0) -> bytes:
    """The record of a message in an MCAP file.

    Args:
        channel: Number of its channel.
        times: Log and publish time, ns.
        data: CDR bytes.
        sequence: Sequence number of the publisher.

    Returns:
        The bytes.
    """
    size = MESSAGE_HEAD.size - 9 + len(data)  # without opcode and length
    return MESSAGE_HEAD.pack(MESSAGE_OPCODE, size, channel, sequence, *times) + data


_TIMES = Field('log time', 'Q', 'time'), Field('publish time', 'Q', 'time')


class RowLayout(Template):
    """The bytes of one state's messages.

    Attributes:
        channels: Channels of the messages.
        starts: First byte of each message's record.
        times: Place of the first message's log time.
    """

    def __init__(
        self, messages: Sequence[tuple[int, Sequence[Part]]], sources: Sequence[str]
    ) -> None:
        """Lays out the messages.

        Args:
            messages: Channel and parts of each.
            sources: Names of the numbers that fill them: the time, ns, first.
        """
        parts, ends = list[Part](), [0]
        self.channels = [channel for channel, _ in messages]
        for channel, message in messages:
            size = Template(message, sources).size
            ends.append(ends[-1] + MESSAGE_HEAD.size + size)
            head = message_record(channel, (0, 0), bytes(size))[:_CONSTANT]
            parts += [head, *_TIMES, *message]
        super().__init__(parts, sources)
        self.starts, self._ends = ends[:-1], ends[1:]
        self._heads = np.array([start + i for start in self.starts for i in range(_CONSTANT)])
        self.times = self.places[0]

    def messages(self, row: bytes) -> tuple[bytes, ...]:
        """The CDR bytes of the messages in a row."""
        return tuple(
            row[start + MESSAGE_HEAD.size : end]
            for start, end in zip(self.starts, self._ends, strict=True)
        )

    def first(self, rows: bytes) -> bytes:
        """Records of the first message in each row, without opcode and length."""
        return rows[9 : self._ends[0]]

    def begins(self, row: bytes) -> bool:
        """Returns whether records are those at the beginning of a row."""
        at = next((i for i, end in enumerate(self._ends) if end == len(row)), None)
        heads = self._heads[: _CONSTANT * (0 if at is None else at + 1)]
        return bool(len(heads)) and all(row[i] == self.blank[i] for i in heads)

    def message_of(self, offset: int) -> int:
        """Index of the message that contains a byte of the row."""
        return next(i for i, end in enumerate(self._ends) if offset < end)

    def count(self, data: bytes, at: int) -> int:
        """Counts adjacent whole rows.

        Args:
            data: Records.
            at: Place of the first row.

        Returns:
            The number of rows.
        """
        heads = np.frombuffer(self.blank, np.uint8)[self._heads]
        found, window = 0, 1
        while size := min(window, (len(data) - at) // self.size - found):
            place = at + found * self.size
            rows = np.frombuffer(data, np.uint8, size * self.size, place)
            fits = (rows.reshape(size, -1)[:, self._heads] == heads).all(axis=1)
            if not fits.all():
                return found + int(fits.argmin())
            found, window = found + size, 8 * window
        return found
