# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads an MCAP file of which nothing is believed: no length, no size, no place.

The mcap library reads what a length claims and unpacks whatever a chunk gives. Here each record is
taken by its own length, which is bounded, and parsed within that.
"""

from __future__ import annotations

import heapq
import operator
import os
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import BinaryIO

from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Message,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
)
from mcap.writer import MCAP0_MAGIC

from linkage_ros.errors import LogError
from linkage_ros.log.untrusted_chunks import (
    HEAD,
    IN_CHUNKS,
    LARGEST,
    Allowance,
    stream,
    unpack,
    unpacked_records,
)
from linkage_ros.units import TIME_END

# Bytes of messages that wait for their turn at a time, where chunks overlap; each takes as many
# more in Python. A simulator that was reset a hundred times needs a third of it.
_MOST_WAITING, _OVERHEAD = 1 << 29, 500

_FOOTER_SIZE = HEAD.size + 20


@dataclass
class Summary:
    """What stands at the end of a complete file.

    Attributes:
        statistics: Counts and times.
        schemas: By number.
        channels: By number.
        chunks: Where they are, in the order of the file.
        metadata: Where the records are.
    """

    statistics: Statistics
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    chunks: list[ChunkIndex] = field(default_factory=list)
    metadata: list[MetadataIndex] = field(default_factory=list)


def read_summary(file: BinaryIO) -> Summary | None:
    """Reads the summary of a file.

    Args:
        file: The file; its position is moved.

    Returns:
        The summary; None if there is none, or none with statistics.

    Raises:
        LogError: It is damaged.
    """
    end = file.seek(-(_FOOTER_SIZE + len(MCAP0_MAGIC)), os.SEEK_END)
    opcode, body = _record(file)
    if opcode != Opcode.FOOTER:
        raise LogError('it is damaged: it does not end with a footer')
    footer = Footer.read(stream(body))
    if not footer.summary_start:
        return None
    file.seek(footer.summary_start)
    statistics, summary = None, Summary(Statistics(0, 0, {}, 0, 0, 0, 0, 0, 0))
    while file.tell() < end:
        opcode, body = _record(file)
        if opcode == Opcode.STATISTICS:
            statistics = summary.statistics = Statistics.read(stream(body))
        elif opcode == Opcode.SCHEMA:
            schema = Schema.read(stream(body))
            summary.schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(stream(body))
            summary.channels[channel.id] = channel
        elif opcode == Opcode.CHUNK_INDEX:
            summary.chunks.append(ChunkIndex.read(stream(body)))
        elif opcode == Opcode.METADATA_INDEX:
            summary.metadata.append(MetadataIndex.read(stream(body)))
    _compare_checksum(file, footer, end)
    return summary if statistics else None


def _compare_checksum(file: BinaryIO, footer: Footer, end: int) -> None:
    """Compares the summary's checksum.

    Raises:
        LogError: It is wrong.
    """
    # It covers the summary and the footer up to the checksum itself.
    left = end + _FOOTER_SIZE - 4 - file.seek(footer.summary_start)
    found = _passed(file, left, 0)
    if footer.summary_crc and found != footer.summary_crc:
        raise LogError('it is damaged: the checksum of its summary is wrong')


def read_metadata(file: BinaryIO, at: int) -> Metadata:
    """Reads the metadata record at a place.

    Raises:
        LogError: There is none.
    """
    file.seek(at)
    opcode, body = _record(file)
    if opcode != Opcode.METADATA:
        raise LogError('it is damaged: its index tells of metadata where there is none')
    metadata: Metadata = Metadata.read(stream(body))
    return metadata


def in_order(
    file: BinaryIO, summary: Summary, channels: set[int], first: int, last: int
) -> Iterator[Message]:
    """Reads the messages of some channels and times in the order of their log times.

    Chunks are unpacked when the first of their times comes. Of one time, messages keep the order
    of the file.

    Args:
        file: The file; its position is moved.
        summary: Its summary.
        channels: Their numbers.
        first: Log time, ns.
        last: Log time before which to stop, ns.

    Yields:
        The messages.

    Raises:
        LogError: The file is damaged, unpacks to too much, or too much of it is of the same times.
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
    waiting, allowance = 0, allowance_of(file)
    while queue:
        _, at, _, item = heapq.heappop(queue)
        if item is not None:
            waiting -= len(item.data) + _OVERHEAD
            yield item
            continue
        file.seek(at)
        data = (_read_chunk(file),) if at else read_data(file)
        records = (record for part in data for record in unpacked_records(part, allowance))
        found: list[tuple[int, int, int, Message]] = []
        for number, record in enumerate(records):
            if (
                isinstance(record, Message)
                and record.channel_id in channels
                and first <= record.log_time < last
            ):
                found.append((record.log_time, at, number, record))
                waiting += len(record.data) + _OVERHEAD
                if waiting > _MOST_WAITING:
                    raise LogError('too much of it is of the same times: it cannot be sorted')
        found.sort(key=operator.itemgetter(0))
        following = queue[0][0] if queue else TIME_END
        for entry in found:
            if entry[0] < following:  # as most are: no other chunk has some of these times
                waiting -= len(entry[3].data) + _OVERHEAD
                yield entry[3]
            else:
                heapq.heappush(queue, entry)


def allowance_of(file: BinaryIO) -> Allowance:
    """For a pass through a file; its position is moved."""
    return Allowance(file.seek(0, os.SEEK_END))


def _read_chunk(file: BinaryIO) -> bytes:
    """What is in the chunk at the file's position.

    Raises:
        LogError: There is no chunk, or a damaged one.
    """
    opcode, body = _record(file)
    if opcode != Opcode.CHUNK:
        raise LogError('it is damaged: its index tells of a chunk where there is none')
    return unpack(Chunk.read(stream(body)))


def read_data(file: BinaryIO) -> Iterator[bytes]:
    """Reads the data section from its beginning, chunks unpacked, and compares its checksum.

    Args:
        file: The file; its position is moved.

    Yields:
        Whole records of schemas, channels and messages, in the order of writing.

    Raises:
        LogError: It is damaged.
    """
    file.seek(0)
    if (magic := file.read(len(MCAP0_MAGIC))) != MCAP0_MAGIC:
        raise LogError('it does not begin as MCAP files do')
    checksum = zlib.crc32(magic)
    while True:
        opcode, length = _head(file)
        if opcode == Opcode.ATTACHMENT:  # of any size; none is ours
            checksum = _passed(file, length, zlib.crc32(HEAD.pack(opcode, length), checksum))
            continue
        body = _body(file, length)
        if opcode == Opcode.DATA_END:
            if DataEnd.read(stream(body)).data_section_crc not in {0, checksum}:
                raise LogError('it is damaged: the checksum of its data is wrong')
            return
        head = HEAD.pack(opcode, length)
        if opcode == Opcode.CHUNK:
            yield unpack(Chunk.read(stream(body)))
        elif opcode in IN_CHUNKS:
            yield head + body
        checksum = zlib.crc32(body, zlib.crc32(head, checksum))


def _record(file: BinaryIO) -> tuple[int, bytes]:
    """Opcode and body of the record at the file's position."""
    opcode, length = _head(file)
    return opcode, _body(file, length)


def _head(file: BinaryIO) -> tuple[int, int]:
    """Opcode and length of the record at the file's position.

    Raises:
        LogError: There is none.
    """
    head = file.read(HEAD.size)
    if len(head) < HEAD.size:
        raise LogError('it is damaged or not complete: a record is missing')
    opcode, length = HEAD.unpack(head)
    return opcode, length


def _body(file: BinaryIO, length: int) -> bytes:
    """What follows the head of a record.

    Raises:
        LogError: It is too large, or the file ends before it does.
    """
    if length > LARGEST:
        raise LogError(f'it has a record of {length} bytes: at most {LARGEST} are read')
    body = file.read(length)
    if len(body) < length:
        raise LogError('it is damaged or not complete: a record is longer than the file')
    return body


def _passed(file: BinaryIO, length: int, checksum: int) -> int:
    """Reads over a part of the file, however long; returns the checksum behind it."""
    while length > 0 and (part := file.read(min(length, 1 << 20))):
        checksum = zlib.crc32(part, checksum)
        length -= len(part)
    return checksum
