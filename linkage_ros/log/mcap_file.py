# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads MCAP files that may be incomplete, damaged or forged.

The mcap package trusts the lengths in a file and unpacks any chunk. This module limits the size of
a record, and lets the mcap package parse only these bytes. Damage may raise any exception.
"""

import os
import re
import struct
import zlib
from collections import defaultdict
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

import zstandard
from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from linkage_ros.errors import LogError
from linkage_ros.files import open_file

# Limit of a record and of an unpacked chunk, bytes. Chunks of this package have 1 MiB, those of
# other tools a few MiB.
LARGEST = 1 << 24
HEAD = struct.Struct('<BQ')  # opcode and length of a record
# Opcode and length of the footer, starts of the summary and of its offsets, checksum, magic.
_FOOTER = struct.Struct('<BQQQI8s')
MAGIC_SIZE = len(MCAP0_MAGIC)
_KINDS: dict[int, Any] = {
    Opcode.HEADER: records.Header,
    Opcode.DATA_END: records.DataEnd,
    Opcode.SCHEMA: records.Schema,
    Opcode.CHANNEL: records.Channel,
    Opcode.CHUNK: records.Chunk,
    Opcode.ATTACHMENT: records.Attachment,
    Opcode.METADATA: records.Metadata,
    Opcode.STATISTICS: records.Statistics,
    Opcode.CHUNK_INDEX: records.ChunkIndex,
    Opcode.METADATA_INDEX: records.MetadataIndex,
    Opcode.ATTACHMENT_INDEX: records.AttachmentIndex,
    Opcode.SUMMARY_OFFSET: records.SummaryOffset,
}
# The records in a chunk, and their smallest lengths.
_IN_CHUNKS = {Opcode.MESSAGE: 22, Opcode.SCHEMA: 0, Opcode.CHANNEL: 0}
# Costs, in bytes to unpack: reading a message takes as long as unpacking 5000 bytes. Parsing a
# byte takes as long as unpacking 250, but counts as 1000: a file whose index refers to one large
# record many times is refused early.
_MESSAGE_COST, _PARSING_COST = 5000, 1000
_FREE, _COST_PER_BYTE = 1 << 30, 1000
# Start of a chunk or of a metadata record of linkage_ros.
_LANDMARK = re.compile(rb'\x06.{36}\x04\0\0\0zstd|\x0c.{8}[\x0b-\x20]\0\0\0linkage_ros', re.DOTALL)
_LANDMARK_SIZE = 45


def open_mcap(path: Path) -> BinaryIO:
    """Opens an MCAP file.

    Args:
        path: Path of the file.

    Returns:
        The file, to be closed by the caller.

    Raises:
        LogError: The file cannot be read, or is not an MCAP file.
    """
    try:
        stream = open_file(path)
        # A pipe may never have data.
        begin = stream.read(MAGIC_SIZE) if stream.seekable() else b''
    except OSError as error:
        raise LogError(f'{path} cannot be read: {error.strerror or error}') from error
    if begin != MCAP0_MAGIC:
        stream.close()
        raise LogError(
            f'{path} is no MCAP file on a disk: it begins with {begin!r}; name a log of '
            'linkage_ros, as linkage_record writes them'
        )
    return stream


class McapFile:
    """One pass through a file, of limited cost.

    Attributes:
        size: Size of the file, bytes.
        left: Remaining cost allowed for the pass; negative: the limit is exceeded.
    """

    def __init__(self, stream: BinaryIO) -> None:
        """Starts a pass.

        Args:
            stream: The file; its position is moved.
        """
        self._stream, self.size = stream, stream.seek(0, os.SEEK_END)
        self.left = _FREE + _COST_PER_BYTE * self.size

    def spend(self, size: int, count: int = 0) -> None:
        """Adds to the cost of the pass.

        Args:
            size: Number of unpacked bytes.
            count: Number of messages read from these bytes.

        Raises:
            LogError: The cost exceeds the limit for the size of the file.
        """
        self.left -= size + count * _MESSAGE_COST
        if self.left < 0:
            raise LogError(
                f'its {self.size} bytes unpack to more than is read, {_COST_PER_BYTE} times as '
                'many or a message for every five; if that is right, unpack it with "mcap '
                'decompress" first'
            )

    def _read(self, at: int, size: int) -> bytes:
        """Reads bytes at an offset; fewer at the end of the file."""
        self._stream.seek(at)
        return self._stream.read(max(0, min(size, self.size - at)))

    def part(self, at: int) -> tuple[int, Any, int]:
        """Reads a record of the data section.

        Args:
            at: First byte of the record.

        Returns:
            The opcode; the content; and the end of the record. The content is the unpacked records
            of a chunk, None for a message index, or any other record parsed by the mcap package.

        Raises:
            LogError: The record is too large.
            ValueError: No record begins there. Damaged data may raise other exceptions.
        """
        (opcode, body, end), content = self._record(at), None
        if opcode == Opcode.CHUNK:
            content = unpack(parsed(opcode, body))
            self.spend(len(content))
        elif opcode != Opcode.MESSAGE_INDEX:  # parsing its entries takes long
            self.spend(len(body) * _PARSING_COST)
            content = parsed(opcode, body)
        elif len(body) != 6 + int.from_bytes(body[2:6], 'little'):
            raise ValueError('the length of a record is wrong')
        return opcode, content, end

    def _record(self, at: int) -> tuple[int, bytes, int]:
        """Reads the opcode, the body and the end of the record at an offset.

        Raises:
            LogError: The record is too large.
            ValueError: The record extends beyond the end of the file.
        """
        opcode, length = HEAD.unpack(self._read(at, HEAD.size))
        _check_size(length)
        body = self._read(at + HEAD.size, length)
        if len(body) != length:
            raise ValueError('a record is longer than the file')
        return opcode, body, at + HEAD.size + length

    def next_place(self, at: int) -> int:
        """Finds the next chunk or metadata record of this package after damage.

        Args:
            at: Offset at which the search starts.

        Returns:
            Its first byte; the end of the file if there is none.

        Raises:
            LogError: The file has too many damaged places.
        """
        self.spend(LARGEST)  # parsing may cost this much, and many places may look like chunks
        while len(data := self._read(at, LARGEST)) >= _LANDMARK_SIZE:
            if found := _LANDMARK.search(data):
                return at + found.start()
            at += len(data) - _LANDMARK_SIZE + 1
        return self.size

    def records(self, data: bytes, at: int = 0) -> Iterator[tuple[int, int]]:
        """Finds the records in a chunk.

        Args:
            data: The records of an unpacked chunk.
            at: First byte of the first record.

        Yields:
            The first byte of each record, and the first byte after it.

        Raises:
            ValueError: A length is wrong, or the chunk contains a kind of record that it must not.
            LogError: There are more records than the file may contain.
        """
        while at < len(data):
            opcode, length = HEAD.unpack_from(data, at)
            start, at = at, at + HEAD.size + length
            if at > len(data) or length < _IN_CHUNKS.get(opcode, LARGEST):
                raise ValueError('a chunk has something other than messages')
            self.spend(0 if opcode == Opcode.MESSAGE else length * _PARSING_COST, 1)
            yield start, at

    def summary(self) -> dict[type, list[Any]] | None:
        """Reads the records of the summary section, by type; None if there is none.

        Raises:
            ValueError: The section is damaged. Damage may raise other exceptions, too.
        """
        end = self.size - _FOOTER.size
        opcode, _, at, _, checksum, magic = _FOOTER.unpack(self._read(end, _FOOTER.size))
        if magic != MCAP0_MAGIC or not at:
            return None
        checked = self._read(at, self.size - at)[:-12]  # up to the checksum
        if opcode != Opcode.FOOTER or checksum not in {0, zlib.crc32(checked)}:
            raise ValueError('its footer is damaged')
        found = defaultdict[type, list[Any]](list)
        while at < end:
            opcode, body, at = self._record(at)
            found[_KINDS[opcode]].append(parsed(opcode, body))
        return found


def parsed(opcode: int, body: bytes) -> Any:
    """Parses a record with the mcap package, within the bounds of its body.

    Raises:
        ValueError: The record extends beyond its body. Damage may raise other exceptions, too.
    """
    stream = ReadDataStream(BytesIO(body))
    record: records.McapRecord = _KINDS[opcode].read(stream)
    if stream.count != len(body):
        raise ValueError('the length of a record is wrong')
    return record


def unpack(chunk: records.Chunk) -> bytes:
    """Unpacks the records of a chunk.

    A few bytes may unpack to gigabytes, or declare any size.

    Args:
        chunk: A chunk with compressed or plain records.

    Returns:
        The records.

    Raises:
        LogError: The records are too large, or not compressed by zstd.
        ValueError: The size or the checksum of the records is wrong.
    """
    size, data = chunk.uncompressed_size, chunk.data
    _check_size(size)
    if chunk.compression == 'zstd':
        # The size in the frame header is allocated, regardless of the limit.
        if zstandard.frame_content_size(data) not in {-1, size}:
            raise ValueError('the size of a chunk is wrong')
        data = zstandard.decompress(data, size)
    elif chunk.compression:
        raise LogError(
            f'it is compressed by {chunk.compression!r:.40}: only zstd is read; "mcap compress" '
            'writes it anew'
        )
    if len(data) != size or chunk.uncompressed_crc not in {0, zlib.crc32(data)}:
        raise ValueError('the size or checksum of a chunk is wrong')
    return data


def _check_size(size: int) -> None:
    if size > LARGEST:
        raise LogError(
            f'it has a record of {size} bytes, packed or unpacked: at most {LARGEST} are read; '
            'write it with smaller chunks'
        )
