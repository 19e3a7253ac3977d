# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Unpacks the chunks of an MCAP file, to no more than is read of anything at a time.

A few bytes may unpack to gigabytes, claim to be of any size, or be millions of true messages.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from io import BytesIO

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Message, Schema

from linkage_ros.errors import LogError

# Bytes of a record, and of what a chunk unpacks to. Our chunks have 1 MiB, other tools' a few.
LARGEST = 1 << 24
HEAD = struct.Struct('<BQ')  # opcode and length of a record
IN_CHUNKS = (Opcode.MESSAGE, Opcode.SCHEMA, Opcode.CHANNEL)
_MESSAGE = struct.Struct('<HIQQ')  # channel, sequence, log and publish time
# What a file unpacks to costs time: a message as much as 5000 bytes, a byte of a channel as 250,
# because 8 may be a field. A file may cost 1 GiB and 1000 for each of its bytes: five bytes for a
# message. Our logs and rosbag2's have an index of 16 bytes per message; ours have 22 in all, even
# of a linkage that stands still.
_MESSAGE_COST, _CHANNEL_COST = 5000, 250
_FREE, _COST_PER_BYTE = 1 << 30, 1000


class Allowance:
    """What the chunks of a file may unpack to in one pass through it."""

    def __init__(self, size: int) -> None:
        """Begins a pass.

        Args:
            size: Size of the file, bytes.
        """
        self._size, self._left = size, _FREE + _COST_PER_BYTE * size

    def take(self, opcode: int, length: int) -> None:
        """Counts a record, before it is parsed.

        Args:
            opcode: Its kind.
            length: Its bytes.

        Raises:
            LogError: It is more than the file may unpack to.
        """
        self.take_messages(1, (_CHANNEL_COST if opcode == Opcode.CHANNEL else 1) * length)

    def take_messages(self, count: int, length: int) -> None:
        """Counts messages of some bytes in all.

        Raises:
            LogError: They are more than the file may unpack to.
        """
        self._left -= count * _MESSAGE_COST + length
        if self._left < 0:
            self.check()

    def check(self) -> None:
        """Passes if nothing so far was too much.

        Raises:
            LogError: A record was.
        """
        if self._left < 0:
            raise LogError(
                f'its {self._size} bytes unpack to more than is read, {_COST_PER_BYTE} times as '
                'many or a message for every five; if that is right, unpack it with "mcap '
                'decompress" first'
            )


def unpack(chunk: Chunk) -> bytes:
    """The records of a chunk, as bytes.

    Raises:
        LogError: They are more than is read, or not what their size or checksum tells.
    """
    size = chunk.uncompressed_size
    if size > LARGEST:
        raise LogError(
            f'it has a chunk of {size} bytes: at most {LARGEST} are unpacked; write it with '
            'smaller chunks'
        )
    data = chunk.data
    if chunk.compression == 'zstd':
        # What the frame itself tells is allocated, whatever the limit.
        if zstandard.frame_content_size(data) not in {-1, size}:
            raise LogError('it is damaged: a chunk has not the size that it tells')
        data = zstandard.decompress(data, size)
    elif chunk.compression == 'lz4':
        data = lz4.frame.LZ4FrameDecompressor().decompress(data, size + 1)
    elif chunk.compression:
        raise LogError(
            f'it has chunks packed by {chunk.compression!r:.40}: nothing here unpacks them'
        )
    if len(data) != size:
        raise LogError('it is damaged: a chunk has not the size that it tells')
    if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
        raise LogError('it is damaged: the checksum of a chunk is wrong')
    return data


def next_record(
    data: bytes, at: int, allowance: Allowance
) -> tuple[Schema | Channel | Message, int]:
    """The record at a place in an unpacked chunk, and its end: nothing else may be in one.

    Raises:
        LogError: There is something else, or more than the file may unpack to.
    """
    opcode, length = HEAD.unpack_from(data, at)
    body = at + HEAD.size
    end = body + length
    if end > len(data):
        raise LogError('it is damaged: a record is longer than its chunk')
    allowance.take(opcode, length)
    if opcode not in IN_CHUNKS:
        raise LogError('it is damaged: a chunk has something other than messages')
    return parsed(opcode, data[body:end]), end


def unpacked_records(data: bytes, allowance: Allowance) -> Iterator[Schema | Channel | Message]:
    """The records of an unpacked chunk.

    Raises:
        LogError: As `next_record` does.
    """
    at = 0
    while at < len(data):
        record, at = next_record(data, at, allowance)
        yield record


def parsed(opcode: int, body: bytes) -> Schema | Channel | Message:
    """A record that a chunk may hold."""
    if opcode == Opcode.MESSAGE:
        return message_of(body)
    record: Schema | Channel = (Schema if opcode == Opcode.SCHEMA else Channel).read(stream(body))
    return record


def message_of(body: bytes) -> Message:
    """A message record."""
    number, sequence, log_time, publish_time = _MESSAGE.unpack_from(body)
    return Message(number, log_time, body[_MESSAGE.size :], publish_time, sequence)


def stream(body: bytes) -> ReadDataStream:
    """A record's bytes as its parser takes them: nothing in it reaches beyond them."""
    return ReadDataStream(BytesIO(body))
