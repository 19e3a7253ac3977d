# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads MCAP files that may be incomplete, damaged or forged.

The mcap package trusts the lengths in a file and decompresses any chunk. This module limits the
size of a record, and passes only the bytes of that record to the mcap package. Damaged data may
raise any exception.
"""

import os
import re
import struct
import zlib
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

import lz4.frame
import zstandard
from mcap import records as mcap_records
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from linkage_ros.errors import LinkageError, LogError
from linkage_ros.files import open_file

# Largest size of a record and of an uncompressed chunk, bytes. Chunks of this package have 1 MiB,
# those of other tools a few MiB.
LARGEST = 1 << 24
HEAD = struct.Struct('<BQ')  # opcode and length of a record
_MESSAGE = struct.Struct('<BQH')  # and the channel of a message
# Opcode and length of the footer, offsets of the summary and summary offset section, checksum, and
# magic.
_FOOTER = struct.Struct('<BQQQI8s')
_DATA_END = struct.Struct('<BQI')  # opcode, length and checksum
MAGIC_SIZE = len(MCAP0_MAGIC)
_KINDS: dict[int, Any] = {
    Opcode.HEADER: mcap_records.Header,
    Opcode.DATA_END: mcap_records.DataEnd,
    Opcode.SCHEMA: mcap_records.Schema,
    Opcode.CHANNEL: mcap_records.Channel,
    Opcode.CHUNK: mcap_records.Chunk,
    Opcode.ATTACHMENT: mcap_records.Attachment,
    Opcode.METADATA: mcap_records.Metadata,
    Opcode.STATISTICS: mcap_records.Statistics,
    Opcode.CHUNK_INDEX: mcap_records.ChunkIndex,
    Opcode.METADATA_INDEX: mcap_records.MetadataIndex,
    Opcode.ATTACHMENT_INDEX: mcap_records.AttachmentIndex,
    Opcode.SUMMARY_OFFSET: mcap_records.SummaryOffset,
}
# Kinds of records between chunks, except message indexes.
_IN_DATA = {
    Opcode.HEADER, Opcode.DATA_END, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.ATTACHMENT,
    Opcode.METADATA,
}  # fmt: skip
# Kinds of records in a chunk, and their smallest lengths, bytes; no record has the other length.
IN_CHUNKS, _NEVER = {Opcode.MESSAGE: 22, Opcode.SCHEMA: 2, Opcode.CHANNEL: 2}, 1 << 64
# Largest size of the decompressed records of a pass, bytes, and per byte of the file.
_FREE, _RATIO = 1 << 30, 1000
# Matches the start of a chunk or of a metadata record of linkage_ros.
_LANDMARK = re.compile(rb'\x06.{36}\x04\0\0\0zstd|\x0c.{8}[\x0b-\x20]\0\0\0linkage_ros', re.DOTALL)
_LANDMARK_SIZE = 45
_OWN_LOG = 'give a log of linkage_ros, such as one written by linkage_record'


@contextmanager
def mcap_file(
    path: Path,
    remedy: Callable[['McapFile'], str],
    *,
    cure: str = _OWN_LOG,
    largest: int = LARGEST,
) -> Iterator['McapFile']:
    """Opens an MCAP file for one pass; converts parser errors to one line with the file name.

    Args:
        path: Path of the file.
        remedy: Returns what to do about a damaged or incomplete file.
        cure: End of the error message if it is another file.
        largest: Largest size of a record and of an uncompressed chunk, bytes.

    Yields:
        The file.

    Raises:
        LogError: The file cannot be read, is damaged, or is not an MCAP file.
    """
    with open_mcap(path, cure) as stream:
        file = McapFile(stream, largest)
        try:
            yield file
        except LinkageError as error:
            raise LogError(f'{path} cannot be used: {error}') from error
        except Exception as error:  # on damaged data the parser may raise any exception
            raise LogError(
                f'{path} is damaged or incomplete: {remedy(file)} '
                f'({type(error).__name__}: {error})'
            ) from error


def open_mcap(path: Path, cure: str = _OWN_LOG) -> BinaryIO:
    """Opens an MCAP file, which the caller must close; `cure` ends the error of another file.

    Raises:
        LogError: The file cannot be read, or is not an MCAP file.
    """
    try:
        stream = open_file(path)
        # Do not read from a pipe, which may never provide data.
        begin = stream.read(MAGIC_SIZE) if stream.seekable() else b''
    except IsADirectoryError as error:
        raise LogError(f'{path} is a folder: give an .mcap file in it') from error
    except OSError as error:
        raise LogError(f'{path} cannot be read: {error.strerror or error}') from error
    if begin != MCAP0_MAGIC:
        stream.close()
        raise LogError(
            f'{path} is not an MCAP file on a disk: it '
            f'{f"starts with {begin!r}" if begin else "is empty or a pipe"}; {cure}'
        )
    return stream


def records(data: bytes, at: int = 0) -> Iterator[tuple[int, int, int, int]]:
    """Finds the records in the uncompressed data of a chunk, from an offset on.

    Yields:
        The opcode, the channel of a message, the start offset and the end offset of each record.

    Raises:
        ValueError: A length is wrong, or a chunk must not contain records of this kind.
    """
    # Local names save a third of the time.
    unpack, head, size, kinds = _MESSAGE.unpack_from, HEAD.size, len(data), IN_CHUNKS
    while at < size:
        opcode, length, channel = unpack(data, at)
        start = at
        at += head + length
        if at > size or length < kinds.get(opcode, _NEVER):
            raise ValueError('a chunk contains an invalid record')
        yield opcode, channel, start, at


class McapFile:
    """One pass through an MCAP file.

    Attributes:
        size: Size of the file, bytes.
        at: Offset of the record that `records` found last, or finds next.
        left: Number of bytes that may still be decompressed; negative once this is exceeded.
    """

    def __init__(self, stream: BinaryIO, largest: int = LARGEST) -> None:
        """Starts a pass.

        Args:
            stream: The file, whose position changes.
            largest: Largest size of a record and of an uncompressed chunk, bytes.
        """
        self._stream, self.size = stream, stream.seek(0, os.SEEK_END)
        self.at, self._largest = MAGIC_SIZE, largest
        self.left = _FREE + _RATIO * self.size

    def read(self, at: int, size: int) -> bytes:
        """Reads up to `size` bytes at an offset; fewer at the end of the file."""
        self._stream.seek(at)
        return self._stream.read(max(0, min(size, self.size - at)))

    def records(self) -> Iterator[tuple[int, int, int]]:
        """Finds the records of the data section from `at` on; then moves `at` past each of them.

        Yields:
            The opcode, the start offset and the end offset of each record. The last one is the end
            of the data section, or the last one of an incomplete file.

        Raises:
            ValueError: A record is longer than the file. Damaged data may raise other exceptions.
        """
        opcode = 0
        while self.at < self.size and opcode != Opcode.DATA_END:
            opcode, length = HEAD.unpack(self.read(self.at, HEAD.size))
            end = self.at + HEAD.size + length
            if end > self.size:
                raise ValueError('a record is longer than the file')
            yield opcode, self.at, end
            self.at = end

    def content(self, at: int) -> Any:
        """Reads the record of the data section at an offset.

        Returns:
            The uncompressed records of a chunk, None for a message index, or the parsed record of
            any other kind.

        Raises:
            LogError: The record is too large, or the file decompresses to too many bytes.
            ValueError: There is no valid record at the offset. Damaged data may raise other
                exceptions.
        """
        opcode, body, _ = self._record(at)
        if opcode == Opcode.MESSAGE_INDEX:
            # Only its length is checked: its entries would take long to parse.
            if len(body) != 6 + int.from_bytes(body[2:6], 'little'):
                raise ValueError('the kind or length of a record is wrong')
            return None
        if opcode == Opcode.CHUNK:
            return self._decompressed(parsed(opcode, body))
        if opcode not in _IN_DATA:
            raise ValueError('the kind or length of a record is wrong')
        return parsed(opcode, body)

    def _decompressed(self, chunk: mcap_records.Chunk) -> bytes:
        """Decompresses a chunk, and limits what the whole file decompresses to.

        Raises:
            LogError: The chunk is too large, or the file decompresses to too many bytes.
            ValueError: The chunk is damaged.
        """
        data = _unpacked(chunk, self._largest)
        self.left -= len(data)
        if self.left < 0:
            raise LogError(
                f'its {self.size} bytes decompress to more than {_FREE + _RATIO * self.size}; '
                'if this is intended, run "mcap decompress" first'
            )
        return data

    def _record(self, at: int) -> tuple[int, bytes, int]:
        """Reads the opcode, the body and the end offset of the record at an offset.

        Raises:
            LogError: The record is too large.
            ValueError: The record extends beyond the end of the file.
        """
        opcode, length = HEAD.unpack(self.read(at, HEAD.size))
        _check_size(length, self._largest)
        body = self.read(at + HEAD.size, length)
        if len(body) != length:
            raise ValueError('a record is longer than the file')
        return opcode, body, at + HEAD.size + length

    def next_place(self, at: int) -> int:
        """Finds the offset of the next chunk or metadata record of linkage_ros from `at` on.

        It is the size of the file if there is none.
        """
        # The next record is often close, so that large reads would make the time quadratic.
        size = 1 << 10
        while len(data := self.read(at, size)) >= _LANDMARK_SIZE:
            if landmark := _LANDMARK.search(data):
                return at + landmark.start()
            at += len(data) - _LANDMARK_SIZE + 1
            size = min(2 * size, LARGEST)
        return self.size

    def summary(self) -> dict[type, list[Any]] | None:
        """Reads the records of the summary section, by type; None if there is none.

        Raises:
            ValueError: The section is damaged. Damaged data may raise other exceptions.
        """
        end = self.size - _FOOTER.size
        opcode, _, at, _, checksum, magic = _FOOTER.unpack(self.read(end, _FOOTER.size))
        if magic != MCAP0_MAGIC or not at:
            return None
        checked = self.read(at, self.size - at)[:-12]  # up to the checksum
        if opcode != Opcode.FOOTER or checksum not in {0, zlib.crc32(checked)}:
            raise ValueError('its footer is damaged')
        parsed_records = defaultdict[type, list[Any]](list)
        while at < end:
            opcode, body, at = self._record(at)
            parsed_records[_KINDS[opcode]].append(parsed(opcode, body))
        return parsed_records

    def check_data(self) -> None:
        """Verifies the checksum of the data section, if it has one.

        It also covers what `content` does not check, such as the message indexes. The file must
        have a summary section, which follows the data section.

        Raises:
            ValueError: The checksum is wrong.
        """
        _, _, summary_start, *_ = _FOOTER.unpack(self.read(self.size - _FOOTER.size, _FOOTER.size))
        end, computed = summary_start - _DATA_END.size, 0
        for at in range(0, end, LARGEST):
            computed = zlib.crc32(self.read(at, min(LARGEST, end - at)), computed)
        opcode, length, checksum = _DATA_END.unpack(self.read(end, _DATA_END.size))
        if (opcode, length) != (Opcode.DATA_END, 4) or checksum not in {0, computed}:
            raise ValueError('the checksum of its data is wrong')


def parsed(opcode: int, body: bytes) -> Any:
    """Parses the body of a record with the mcap package.

    Raises:
        ValueError: The length of the body is wrong. Damaged data may raise other exceptions.
    """
    stream = ReadDataStream(BytesIO(body))
    record: mcap_records.McapRecord = _KINDS[opcode].read(stream)
    if stream.count != len(body):
        raise ValueError('the length of a record is wrong')
    return record


def _unpacked(chunk: mcap_records.Chunk, largest: int) -> bytes:
    """Returns the uncompressed records of a chunk, of at most `largest` bytes.

    The size is checked first, because a few bytes may decompress to gigabytes.

    Raises:
        LogError: The records are too large, or are compressed with an unknown method.
        ValueError: The size or the checksum of the records is wrong.
    """
    size, data = chunk.uncompressed_size, chunk.data
    _check_size(size, largest)
    if chunk.compression == 'zstd':
        # zstandard allocates the size in the frame header, even if it exceeds the limit.
        if zstandard.frame_content_size(data) not in {-1, size}:
            raise ValueError('the size of a chunk is wrong')
        data = zstandard.decompress(data, size)
    elif chunk.compression == 'lz4':
        data = lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size + 1)
    elif chunk.compression:
        raise LogError(
            f'it is compressed with {chunk.compression!r:.40}: only zstd and lz4 are supported; '
            'rewrite it with "mcap compress"'
        )
    if len(data) != size or chunk.uncompressed_crc not in {0, zlib.crc32(data)}:
        raise ValueError('the size or checksum of a chunk is wrong')
    return data


def _check_size(size: int, largest: int) -> None:
    if size > largest:
        raise LogError(
            f'it has a record of {size} bytes, compressed or not: must be at most {largest}; '
            'write it with smaller chunks'
        )
