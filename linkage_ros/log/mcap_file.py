# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads an untrusted MCAP file: lengths, sizes and places in it may be wrong.

The mcap library trusts the lengths in a file and unpacks any chunk. Here the length of each record
is limited, and the library parses a record within these bounds. Damage may raise any exception.
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from typing import Any, BinaryIO, NamedTuple

import lz4.frame
import zstandard
from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from linkage_ros.errors import LogError

# Bytes of a record, and of what a chunk unpacks to. Our chunks have 1 MiB, other tools' a few.
LARGEST = 1 << 24
HEAD = struct.Struct('<BQ')  # opcode and length of a record
_MESSAGE = struct.Struct('<HIQQ')  # channel, sequence, log and publish time
_FOOTER_SIZE = HEAD.size + 20
KINDS: dict[int, Any] = {
    Opcode.HEADER: records.Header,
    Opcode.FOOTER: records.Footer,
    Opcode.SCHEMA: records.Schema,
    Opcode.CHANNEL: records.Channel,
    Opcode.CHUNK: records.Chunk,
    Opcode.CHUNK_INDEX: records.ChunkIndex,
    Opcode.ATTACHMENT: records.Attachment,
    Opcode.STATISTICS: records.Statistics,
    Opcode.METADATA: records.Metadata,
    Opcode.METADATA_INDEX: records.MetadataIndex,
}
_IN_CHUNKS = (Opcode.MESSAGE, Opcode.SCHEMA, Opcode.CHANNEL)
# What a file unpacks to costs time: a message as much as 5000 bytes, a byte of a channel as 250,
# because 8 may be a field. A file may cost 1 GiB and 1000 for each of its bytes: five bytes for a
# message. Our logs and rosbag2's have an index of 16 bytes per message; ours have 22 in all, even
# of a linkage that stands still.
_MESSAGE_COST, _CHANNEL_COST = 5000, 250
_FREE, _COST_PER_BYTE = 1 << 30, 1000


class Allowance:
    """Limits the unpacked size of a file in one pass."""

    def __init__(self, size: int) -> None:
        """Begins a pass.

        Args:
            size: Size of the file, bytes.
        """
        self._size, self._left = size, _FREE + _COST_PER_BYTE * size

    def take(self, count: int, cost: int) -> None:
        """Counts messages.

        Args:
            count: Their number.
            cost: Their cost besides the count; a byte costs 1.

        Raises:
            LogError: The limits are exceeded.
        """
        self._left -= count * _MESSAGE_COST + cost
        if self._left < 0:
            self.check()

    def check(self) -> None:
        """Checks that the limits have not been exceeded.

        Raises:
            LogError: They have been exceeded.
        """
        if self._left < 0:
            raise LogError(
                f'its {self._size} bytes unpack to more than is read, {_COST_PER_BYTE} times as '
                'many or a message for every five; if that is right, unpack it with "mcap '
                'decompress" first'
            )


class Part(NamedTuple):
    """A record of the data section.

    Attributes:
        opcode: Its kind.
        data: The contents of a chunk, the whole record if a chunk could contain it, else the body;
            empty for attachments and indexes.
        end: Place after the record.
        record: The record itself, if a recovery read it.
    """

    opcode: int
    data: bytes
    end: int
    record: records.McapRecord | None = None


@dataclass
class Summary:
    """The summary section at the end of a complete file.

    Attributes:
        statistics: Counts and times.
        schemas: Schemas by number.
        channels: Channels by number.
        chunks: Places of the chunks, in the order of the file.
        metadata: Places of the metadata records.
    """

    statistics: records.Statistics = field(
        default_factory=lambda: records.Statistics(0, 0, {}, 0, 0, 0, 0, 0, 0)
    )
    schemas: dict[int, records.Schema] = field(default_factory=dict)
    channels: dict[int, records.Channel] = field(default_factory=dict)
    chunks: list[records.ChunkIndex] = field(default_factory=list)
    metadata: list[records.MetadataIndex] = field(default_factory=list)
    _tables: dict[tuple[int, ...], dict[int, int]] = field(default_factory=dict)

    def add(self, record: object) -> None:
        """Takes a record of the summary section."""
        if isinstance(record, records.Statistics):
            self.statistics = record
        elif isinstance(record, records.Schema | records.Channel):
            kept: Any = self.schemas if isinstance(record, records.Schema) else self.channels
            kept[record.id] = record
        elif isinstance(record, records.MetadataIndex):
            self.metadata.append(record)
        elif isinstance(record, records.ChunkIndex):
            # Chunks with the same channels share one table of them: half of what an index holds.
            # The reader looks at the keys alone; a log of a day has hundreds of thousands.
            offsets = record.message_index_offsets
            record.message_index_offsets = self._tables.setdefault(tuple(offsets), offsets)
            self.chunks.append(record)


class McapFile:
    """The records of a file, by place.

    Attributes:
        size: Size of the file, bytes.
        allowance: Limits of a pass through it.
    """

    def __init__(self, stream: BinaryIO) -> None:
        """Begins a pass.

        Args:
            stream: The file; its position is moved.
        """
        self._stream, self.size = stream, stream.seek(0, os.SEEK_END)
        self.allowance = Allowance(self.size)

    def read(self, at: int, size: int) -> bytes:
        """Reads bytes at a place; fewer at the end of the file."""
        self._stream.seek(at)
        return self._stream.read(max(0, min(size, self.size - at)))

    def frame(self, at: int) -> tuple[int, int]:
        """Opcode and end of the record at a place.

        Raises:
            struct.error: The file ends within the header.
            EOFError: The file ends within the record.
        """
        opcode, length = HEAD.unpack(self.read(at, HEAD.size))
        if (end := at + HEAD.size + length) > self.size:
            raise EOFError('a record is longer than the file')
        return opcode, end

    def record(self, at: int) -> tuple[int, bytes, int]:
        """Opcode, body and end of the record at a place.

        Raises:
            LogError: It is too large.
        """
        opcode, end = self.frame(at)
        if (length := end - at - HEAD.size) > LARGEST:
            raise LogError(f'it has a record of {length} bytes: at most {LARGEST} are read')
        return opcode, self.read(at + HEAD.size, length), end

    def part(self, at: int) -> Part:
        """The record at a place of the data section.

        Raises:
            LogError: It is too large.
        """
        opcode, end = self.frame(at)
        if opcode in {Opcode.ATTACHMENT, Opcode.MESSAGE_INDEX}:
            return Part(opcode, b'', end)
        _, body, _ = self.record(at)
        if opcode == Opcode.CHUNK:
            return Part(opcode, unpack(parsed(opcode, body)), end)
        return Part(opcode, HEAD.pack(opcode, len(body)) * (opcode in _IN_CHUNKS) + body, end)

    def parts(self) -> Iterator[Part]:
        """The records of the data section that hold messages, schemas and channels.

        Raises:
            LogError: One is too large.
        """
        at = len(MCAP0_MAGIC)
        while (part := self.part(at)).opcode != Opcode.DATA_END:
            if part.opcode in {Opcode.CHUNK, *_IN_CHUNKS}:
                yield part
            at = part.end

    def next_record(self, data: bytes, at: int) -> tuple[records.McapRecord, int]:
        """Reads the record at a place in a part; returns it and its end.

        Raises:
            ValueError: It is longer than the part, or of a kind that no chunk contains.
            LogError: It is more than the file may unpack to.
        """
        opcode, length = HEAD.unpack_from(data, at)
        end = (body := at + HEAD.size) + length
        if end > len(data) or opcode not in _IN_CHUNKS:
            raise ValueError('a chunk has something other than messages')
        self.allowance.take(1, length * (_CHANNEL_COST if opcode == Opcode.CHANNEL else 1))
        return parsed(opcode, data[body:end]), end

    def summary(self) -> Summary | None:
        """Reads the summary section; None if there is none.

        Raises:
            ValueError: It is damaged.
        """
        end = self.size - len(MCAP0_MAGIC) - _FOOTER_SIZE
        opcode, body, _ = self.record(end)
        if opcode != Opcode.FOOTER:
            raise ValueError('it does not end with a footer')
        footer, summary, checksum = parsed(opcode, body), Summary(), 0
        at = footer.summary_start
        while 0 < at < end:
            opcode, body, after = self.record(at)
            summary.add(parsed(opcode, body) if opcode in KINDS else None)
            checksum = zlib.crc32(body, zlib.crc32(self.read(at, HEAD.size), checksum))
            at = after
        # It covers the footer up to the checksum itself.
        checksum = zlib.crc32(self.read(end, _FOOTER_SIZE - 4), checksum)
        if footer.summary_crc not in {0, checksum}:
            raise ValueError('the checksum of its summary is wrong')
        return summary if footer.summary_start else None


def parsed(opcode: int, body: bytes) -> Any:
    """Parses a record with the mcap library, within the bounds of its body.

    Raises:
        ValueError: The record reaches beyond its body.
    """
    if opcode == Opcode.MESSAGE:
        number, sequence, log_time, publish_time = _MESSAGE.unpack_from(body)
        return records.Message(number, log_time, body[_MESSAGE.size :], publish_time, sequence)
    stream = ReadDataStream(BytesIO(body))
    record: records.McapRecord = KINDS[opcode].read(stream)
    if stream.count != len(body):
        raise ValueError('a record is longer than what is in it')
    return record


def unpack(chunk: records.Chunk) -> bytes:
    """Unpacks the records of a chunk, as bytes.

    A few bytes may unpack to gigabytes, or claim to be of any size.

    Raises:
        LogError: They exceed the limits, or their compression is unknown.
        ValueError: Their size or checksum is wrong.
    """
    size, data = chunk.uncompressed_size, chunk.data
    if size > LARGEST:
        raise LogError(
            f'it has a chunk of {size} bytes: at most {LARGEST} are unpacked; write it with '
            'smaller chunks'
        )
    if chunk.compression == 'zstd':
        # What the frame itself tells is allocated, whatever the limit.
        if zstandard.frame_content_size(data) not in {-1, size}:
            raise ValueError('a chunk has not the size that it tells')
        data = zstandard.decompress(data, size)
    elif chunk.compression == 'lz4':
        data = lz4.frame.LZ4FrameDecompressor().decompress(data, size + 1)
    elif chunk.compression:
        raise LogError(
            f'it has chunks packed by {chunk.compression!r:.40}: nothing here unpacks them'
        )
    if len(data) != size:
        raise ValueError('a chunk has not the size that it tells')
    if chunk.uncompressed_crc not in {0, zlib.crc32(data)}:
        raise ValueError('the checksum of a chunk is wrong')
    return data
