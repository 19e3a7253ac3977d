# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Writes MCAP files from encoded message records.

`writer` decides which channels, messages and metadata a log contains; `rows` makes the records of
the messages of a state; `disk` writes the bytes.

The writer of the mcap package takes one message at a time, which is many times slower. This one
uses only the records of that package, and lays out the file in the same way.
"""

import struct
import zlib
from collections import defaultdict
from collections.abc import Iterable, Iterator

import numpy as np
import numpy.typing as npt
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.writer import MCAP0_MAGIC

from linkage_ros.log.disk import LogFile

CHUNK_SIZE = 1 << 20
_BLOCK_SIZE = 1 << 16  # of records of the summary
_INDEX_HEAD = struct.Struct('<BQHI')  # opcode and length of the record, channel, size of entries


def _encoded(*records: McapRecord) -> bytes:
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    return bytes(builder.end())


class _Packed:
    """Records of the summary, encoded and compressed, because a run of days makes millions."""

    def __init__(self) -> None:
        self._blocks, self._last = list[bytes](), bytearray()

    def add(self, record: McapRecord) -> None:
        """Adds a record."""
        self._last += _encoded(record)
        if len(self._last) > _BLOCK_SIZE:
            self._blocks.append(zlib.compress(self._last))
            self._last.clear()

    def __iter__(self) -> Iterator[bytes]:
        """Yields the encoded records in parts."""
        yield from map(zlib.decompress, self._blocks)
        yield bytes(self._last)


class McapWriter:
    """Writes an MCAP file; not thread-safe.

    Attributes:
        statistics: Counts and times of the records so far.
        schemas: Schemas declared so far, by number.
        channels: Channels declared so far, by number.
        position: Offset of the next record in the current chunk.
    """

    def __init__(self, file: LogFile, profile: str, library: str) -> None:
        """Writes the header, with the profile of the contents and the name of this program."""
        self._file, self._offset, self._checksum = file, 0, 0
        self.schemas, self.channels = dict[int, Schema](), dict[int, Channel]()
        self.statistics = Statistics(
            attachment_count=0, channel_count=0, channel_message_counts=defaultdict(int),
            chunk_count=0, message_count=0, message_end_time=0, message_start_time=0,
            metadata_count=0, schema_count=0,
        )  # fmt: skip
        self._chunks, self._metadata, self._attachments = (_Packed() for _ in range(3))
        self._begin_chunk()
        self._write(MCAP0_MAGIC + _encoded(Header(profile, library)))

    def _begin_chunk(self) -> None:
        self.position, self._parts = 0, list[bytes | bytearray]()
        self._index = defaultdict[int, list[bytes]](list)
        self._times = list[int]()  # log times that include the first and the last, ns

    def _write(self, data: bytes) -> None:
        """Writes bytes outside of chunks."""
        self._checksum = zlib.crc32(data, self._checksum)
        self._offset += len(data)
        self._file.write(data)

    def _append(self, data: bytes | bytearray) -> None:
        """Appends encoded records to the current chunk."""
        self._parts.append(data)
        self.position += len(data)

    def declare(self, record: Schema | Channel) -> None:
        """Appends a schema or channel, unless its number is in use or its schema is unknown."""
        if isinstance(record, Schema):
            is_new = record.id not in self.schemas
            self.schemas.setdefault(record.id, record)
        else:
            is_known = record.schema_id in {0, *self.schemas}  # 0: no schema
            is_new = is_known and record.id not in self.channels
            if is_new:
                self.channels[record.id] = record
        if is_new:
            self._append(_encoded(record))

    def add_records(
        self,
        data: bytes | bytearray,
        times: npt.NDArray[np.uint64],
        index: dict[int, npt.NDArray[np.uint64]],
    ) -> None:
        """Appends message records to the current chunk.

        Args:
            data: Concatenated message records, which must not be changed later.
            times: Log times that include the first and the last, ns.
            index: Log time, ns, and offset in the chunk of each message, shape (messages, 2), by
                channel number.

        Raises:
            LogError: The file cannot be written.
        """
        self._append(data)
        if len(times):
            self._times += int(times.min()), int(times.max())
        for channel, entries in index.items():
            self._index[channel].append(entries.tobytes())
            self.statistics.message_count += len(entries)
            self.statistics.channel_message_counts[channel] += len(entries)
        if self.position > CHUNK_SIZE:
            self.flush()

    def add_metadata(self, record: Metadata) -> None:
        """Writes a metadata record before the current chunk."""
        data = _encoded(record)
        self._metadata.add(MetadataIndex(self._offset, len(data), record.name))
        self.statistics.metadata_count += 1
        self._write(data)

    def add_attachment(self, record: Attachment) -> None:
        """Writes an attachment before the current chunk."""
        data, about = _encoded(record), {**vars(record), 'data_size': len(record.data)}
        del about['data']
        self._attachments.add(AttachmentIndex(offset=self._offset, length=len(data), **about))
        self.statistics.attachment_count += 1
        self._write(data)

    def flush(self) -> None:
        """Completes the current chunk, and passes all bytes to the operating system.

        Raises:
            LogError: The file cannot be written, or was removed or truncated.
        """
        if self._index:
            self._end_chunk()
        self._file.flush()

    def _end_chunk(self) -> None:
        """Writes the current chunk and its message indexes, and begins a new one."""
        data, statistics = b''.join(self._parts), self.statistics
        start, end = min(self._times), max(self._times)
        if statistics.chunk_count:
            statistics.message_start_time = min(start, statistics.message_start_time)
            statistics.message_end_time = max(end, statistics.message_end_time)
        else:
            statistics.message_start_time, statistics.message_end_time = start, end
        statistics.chunk_count += 1
        chunk = Chunk(
            compression='zstd', data=zstandard.compress(data), message_start_time=start,
            message_end_time=end, uncompressed_crc=zlib.crc32(data), uncompressed_size=len(data),
        )  # fmt: skip
        chunk_start = self._offset
        self._write(_encoded(chunk))
        chunk_end = self._offset
        index_starts = dict[int, int]()
        for channel, entries in self._index.items():
            index_starts[channel] = self._offset
            size = sum(map(len, entries))
            head = _INDEX_HEAD.pack(Opcode.MESSAGE_INDEX, 6 + size, channel, size)
            self._write(b''.join((head, *entries)))
        self._chunks.add(
            ChunkIndex(
                chunk_length=chunk_end - chunk_start, chunk_start_offset=chunk_start,
                compression='zstd', compressed_size=len(chunk.data), message_end_time=end,
                message_start_time=start, message_index_length=self._offset - chunk_end,
                message_index_offsets=index_starts, uncompressed_size=len(data),
            )
        )  # fmt: skip
        self._begin_chunk()

    def finish(self) -> None:
        """Completes the file.

        Raises:
            LogError: The file cannot be written, or was removed or truncated.
        """
        self.flush()
        self._write(_encoded(DataEnd(self._checksum)))
        summary_start, statistics, checksum = self._offset, self.statistics, 0
        statistics.schema_count, statistics.channel_count = len(self.schemas), len(self.channels)
        groups: dict[int, Iterable[bytes]] = {
            Opcode.SCHEMA: map(_encoded, self.schemas.values()),
            Opcode.CHANNEL: map(_encoded, self.channels.values()),
            Opcode.STATISTICS: [_encoded(statistics)], Opcode.CHUNK_INDEX: self._chunks,
            Opcode.ATTACHMENT_INDEX: self._attachments, Opcode.METADATA_INDEX: self._metadata,
        }  # fmt: skip
        group_offsets = list[SummaryOffset]()
        for opcode, parts in groups.items():
            start = self._offset
            for part in parts:
                self._write(part)
                self._file.flush()
                checksum = zlib.crc32(part, checksum)
            group_offsets.append(SummaryOffset(opcode, start, self._offset - start))
        footer, offsets = Footer(summary_start, self._offset, 0), _encoded(*group_offsets)
        # The checksum covers the summary and the footer up to the checksum.
        footer.summary_crc = zlib.crc32(offsets + _encoded(footer)[:-4], checksum)
        self._write(offsets + _encoded(footer) + MCAP0_MAGIC)
        self._file.flush()
