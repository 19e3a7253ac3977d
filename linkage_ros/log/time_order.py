# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads the messages of a log in the order of log times, not of the file."""

from __future__ import annotations

import heapq
from collections.abc import Iterator

from mcap.opcode import Opcode
from mcap.records import Message

from linkage_ros.errors import LogError
from linkage_ros.log.mcap_file import McapFile, Summary

# Bytes of messages that wait for their turn at a time, where chunks overlap; each takes as many
# more in Python. A simulator that was reset a hundred times needs a third of it.
_MOST_WAITING, _OVERHEAD = 1 << 29, 500


def in_order(
    file: McapFile, summary: Summary, channels: set[int], first: int, last: int
) -> Iterator[Message]:
    """Reads the messages of some channels and times in the order of their log times.

    A chunk is unpacked when its first time is due. Messages of equal time keep the order of the
    file.

    Args:
        file: The file.
        summary: Summary of the file.
        channels: Numbers of the channels.
        first: Log time, ns.
        last: Log time before which to stop, ns.

    Yields:
        The messages.

    Raises:
        LogError: The file unpacks to too much, or too many chunks overlap in time.
    """
    # Time, place of the chunk, place within it; without a message, the chunk itself.
    queue: list[tuple[int, int, int, Message | None]] = [
        (chunk.message_start_time, chunk.chunk_start_offset, -1, None)
        for chunk in summary.chunks
        if chunk.message_start_time < last
        and chunk.message_end_time >= first
        and not channels.isdisjoint(chunk.message_index_offsets or channels)
    ]
    heapq.heapify(queue)
    if not summary.chunks:  # another tool has unpacked the file: all of it is one chunk
        queue.append((0, 0, -1, None))
    waiting = 0
    while queue:
        _, at, _, item = heapq.heappop(queue)
        if item is not None:
            waiting -= len(item.data) + _OVERHEAD
            yield item
            continue
        for number, message in enumerate(_messages(file, at)):
            if message.channel_id in channels and first <= message.log_time < last:
                heapq.heappush(queue, (message.log_time, at, number, message))
                waiting += len(message.data) + _OVERHEAD
                if waiting > _MOST_WAITING:
                    raise LogError('too much of it is of the same times: it cannot be sorted')


def _messages(file: McapFile, at: int) -> Iterator[Message]:
    """The messages of the chunk at a place; place 0: of the whole file.

    Raises:
        ValueError: There is no chunk.
    """
    for part in [file.part(at)] if at else file.parts():
        if at and part.opcode != Opcode.CHUNK:
            raise ValueError('its index tells of a chunk where there is none')
        place = 0
        while place < len(part.data):
            record, place = file.next_record(part.data, place)
            if isinstance(record, Message):
                yield record
