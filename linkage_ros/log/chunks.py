# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Appends messages as bytes to the chunks of mcap's writer, which packs field by field."""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
import numpy.typing as npt
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Statistics
from mcap.writer import Writer

from linkage_ros.wire.rows import RowLayout, message_record

_INDEX_HEAD = struct.Struct('<BQHI')  # opcode and length of the record, channel, bytes of entries


class _Index:
    """Index of one channel in a chunk; the library calls its `write`."""

    def __init__(self, channel: int) -> None:
        self._channel, self._entries = channel, list[bytes]()

    def add(self, times: npt.NDArray[Any], offsets: npt.NDArray[Any]) -> None:
        """Adds messages: their log times, ns, and their places in the chunk."""
        entries = np.empty((len(times), 2), '<u8')
        entries[:, 0], entries[:, 1] = times, offsets
        self._entries.append(entries.tobytes())

    def write(self, builder: RecordBuilder) -> None:
        """Writes the record."""
        entries = b''.join(self._entries)
        size = len(entries)
        builder.write(_INDEX_HEAD.pack(Opcode.MESSAGE_INDEX, 6 + size, self._channel, size))
        builder.write(entries)


class Chunks:
    """The chunks of a file written by the library.

    The library has no public function to add a packed message.

    Attributes:
        statistics: The library's counts and times so far.
    """

    def __init__(self, writer: Writer, size: int) -> None:
        """Replaces the writer's `add_message`.

        Args:
            writer: The writer.
            size: Size at which a chunk ends, bytes.
        """
        self._writer, self._size = writer, size
        private = vars(writer)
        self._builder = private['_Writer__chunk_builder']
        self.statistics: Statistics = private['_Writer__statistics']

    def add(self, channel: int, time: int, data: bytes) -> None:
        """Appends a message, published and logged at a time, ns."""
        record = message_record(channel, (time, time), data)
        self.add_records(record, {channel: (np.array([time]), np.array([0]))})

    def add_rows(self, layout: RowLayout, rows: bytearray) -> None:
        """Appends rows; a row may continue in the next chunk.

        Args:
            layout: Layout of the rows.
            rows: Bytes of the rows.
        """
        size = layout.size
        while rows:
            room = (self._size - self._builder.count) // size * size
            whole, rows = rows[:room], rows[room:]
            times, places = layout.column(whole, layout.times), np.arange(0, len(whole), size)
            heads = zip(layout.channels, layout.starts, strict=True)
            self.add_records(whole, {n: (times, places + start) for n, start in heads})
            crossing, rows = bytes(rows[:size]), rows[size:]
            for time in map(int, layout.column(crossing, layout.times)):
                messages = layout.messages(crossing)
                for channel, message in zip(layout.channels, messages, strict=True):
                    self.add(channel, time, message)

    def add_records(
        self, data: bytes | bytearray, index: dict[int, tuple[npt.NDArray[Any], npt.NDArray[Any]]]
    ) -> None:
        """Appends the records of messages.

        Args:
            data: The records.
            index: For each channel the log times, ns, and the places of its messages.
        """
        builder, statistics = self._builder, self.statistics
        place = builder.count
        builder.record_writer.write(data)
        for channel, (times, offsets) in index.items():
            if not (count := len(times)):
                continue
            first, last = int(times.min()), int(times.max())
            for span, known in (
                (builder, builder.num_messages), (statistics, statistics.message_count)
            ):  # fmt: skip
                start = min(span.message_start_time, first) if known else first
                span.message_start_time = start
                span.message_end_time = max(span.message_end_time, last)
            if channel not in builder.message_indices:
                builder.message_indices[channel] = _Index(channel)
            builder.message_indices[channel].add(times, place + offsets)
            builder.num_messages += count
            statistics.message_count += count
            statistics.channel_message_counts[channel] += count
        if builder.count > self._size:
            self._writer.flush()
