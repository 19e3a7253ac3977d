# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Walks through an MCAP file that is cut off or damaged, and passes over what is not whole.

Chunks hold all messages and have checksums. Behind a damaged place the walk goes on at the next
chunk or record of ours; of a chunk that the file's end cuts off, zstd unpacks whole blocks.
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from mmap import mmap
from typing import NamedTuple

import zstandard
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Header, McapRecord, Metadata, Schema
from mcap.writer import MCAP0_MAGIC

from linkage_ros.log.untrusted_chunks import (
    HEAD,
    LARGEST,
    Allowance,
    parsed,
    stream,
    unpack,
    unpacked_records,
)

_KEPT: dict[int, type[Header | Schema | Channel | Metadata | Attachment]] = {
    Opcode.HEADER: Header,
    Opcode.SCHEMA: Schema,
    Opcode.CHANNEL: Channel,
    Opcode.METADATA: Metadata,
    Opcode.ATTACHMENT: Attachment,
}
# What else a data section holds; another opcode is damage. The lengths of what ends it.
_OTHERS = (Opcode.MESSAGE, Opcode.CHUNK, Opcode.MESSAGE_INDEX)
_ENDS: dict[int, int] = {Opcode.DATA_END: 4, Opcode.FOOTER: 20}
# Bytes, beside a multiple of the file size, that damaged records may cost before it gives up:
# thousands of places that look like the beginning of a long record would else be tried in turn.
_PATIENCE = 1 << 30
# The beginning of a chunk or of a metadata record of linkage_ros, wherever it is.
_LANDMARK = re.compile(rb'\x06.{36}\x04\0\0\0zstd|\x0c.{8}[\x0b-\x20]\0\0\0linkage_ros', re.DOTALL)


@dataclass
class Losses:
    """What could not be saved.

    Attributes:
        places: Damaged stretches between whole records.
        damaged: Their bytes.
        messages: Messages known to have been there.
        records: Motion records among them.
        tail: Bytes at the end that the run was writing when it was killed, or that are damaged.
    """

    places: int = 0
    damaged: int = 0
    messages: int = 0
    records: int = 0
    tail: int = 0


class Stretch(NamedTuple):
    """A part of the file: its end, the records in it, and whether they made up a chunk."""

    end: int
    records: list[McapRecord]
    is_chunk: bool


def walk(data: mmap, losses: Losses) -> Iterator[Stretch]:
    """Reads the records that can be read, up to the end of the data section.

    Args:
        data: The file, which begins as MCAP files do.
        losses: Is told what cannot be read.

    Yields:
        Stretches of the file, in order.

    Raises:
        LogError: It unpacks to too much.
    """
    at, hurt, patience = len(MCAP0_MAGIC), False, _PATIENCE + 16 * len(data)
    chunked = False
    allowance = Allowance(len(data))
    while at < len(data):
        opcode, end = _frame(data, at)
        if _is_the_end(data, at):
            return
        # One wrong bit makes a header or an index a message: none comes first, or beside chunks.
        is_forged = opcode == Opcode.MESSAGE and (chunked or at == len(MCAP0_MAGIC))
        is_credible = _is_whole(data, at) and not is_forged
        records = _read(data, at, opcode, end, allowance) if is_credible else None
        chunked = chunked or opcode == Opcode.CHUNK
        allowance.check()
        if records is not None:
            if opcode == Opcode.MESSAGE_INDEX and hurt:
                losses.messages += (end - at - HEAD.size - 6) // 16
            hurt = hurt and opcode != Opcode.CHUNK
            yield Stretch(end, records, opcode == Opcode.CHUNK)
            at = end
            continue
        hurt = opcode == Opcode.CHUNK
        # Where the length of a chunk is right, the next record is known; elsewhere it may lie
        # within what the damaged length claims.
        is_framed = hurt and _is_whole(data, at) and _is_whole(data, end)
        after = end if is_framed else _next_landmark(data, at + 1)
        patience -= _effort(data, at)
        if after is None or patience < 0:
            losses.tail = len(data) - at
            yield Stretch(len(data), _begun(data, at, allowance), is_chunk=True)
            return
        losses.places += 1
        losses.damaged += after - at
        at = after


def _frame(data: mmap, at: int) -> tuple[int, int]:
    """Opcode and end of the record at a place; (0, the file's end) where there is none."""
    if at + HEAD.size > len(data):
        return 0, len(data)
    opcode, length = HEAD.unpack_from(data, at)
    return opcode, at + HEAD.size + length


def _is_the_end(data: mmap, at: int) -> bool:
    """Whether the data section ends at a place: one wrong bit makes a chunk look so."""
    opcode, end = _frame(data, at)
    return end <= len(data) and end - at - HEAD.size == _ENDS.get(opcode)


def _is_whole(data: mmap, at: int) -> bool:
    """Whether a record at a place lies within the file, and its length fits its parts."""
    opcode, end = _frame(data, at)
    if _is_the_end(data, at):
        return True
    if (opcode not in _KEPT and opcode not in _OTHERS) or end > len(data):
        return False
    body = at + HEAD.size
    if opcode == Opcode.MESSAGE_INDEX:
        return end == body + 6 + _number(data, body + 2, 4)
    if opcode == Opcode.CHUNK:
        start = body + 32 + _number(data, body + 28, 4)
        return end == start + 8 + _number(data, start, 8)
    return True


def _effort(data: mmap, at: int) -> int:
    """Bytes that were copied and unpacked to find out that a record is damaged."""
    if not _is_whole(data, at):
        return 0
    opcode, end = _frame(data, at)
    unpacked = _number(data, at + HEAD.size + 16, 8) if opcode == Opcode.CHUNK else 0
    return end - at + min(unpacked, LARGEST)


def _number(data: mmap, at: int, size: int) -> int:
    return int.from_bytes(data[at : at + size], 'little')


def _next_landmark(data: mmap, at: int) -> int | None:
    places = (found.start() for found in _LANDMARK.finditer(data, at))
    return next((place for place in places if _is_whole(data, place)), None)


def _read(
    data: mmap, at: int, opcode: int, end: int, allowance: Allowance
) -> list[McapRecord] | None:
    """The records in a stretch of the file; None if it is damaged, or too large to be read."""
    if end - at > HEAD.size + LARGEST and opcode != Opcode.ATTACHMENT:
        return None
    body = data[at + HEAD.size : end]
    source = stream(body)
    try:
        if opcode == Opcode.CHUNK:
            return _unpacked(unpack(Chunk.read(source)), allowance)
        if opcode == Opcode.MESSAGE:
            return [parsed(opcode, body)]
        kind = _KEPT.get(opcode)
        found: list[McapRecord] = [kind.read(source)] if kind else []
        # A damaged length would swallow what lies behind the record.
        return None if kind and source.count != len(body) else found
    except Exception:  # noqa: BLE001, nothing bounds what damage makes a parser raise
        return None


def _unpacked(data: bytes, allowance: Allowance) -> list[McapRecord]:
    """The whole records at the beginning of a chunk's data."""
    records: list[McapRecord] = []
    with suppress(Exception):  # as above
        records.extend(unpacked_records(data, allowance))
    return records


def _begun(data: mmap, at: int, allowance: Allowance) -> list[McapRecord]:
    """What can be unpacked of a chunk that the end of the file cuts off."""
    opcode, end = _frame(data, at)
    if opcode != Opcode.CHUNK or end <= len(data):
        return []
    body = at + HEAD.size
    try:
        chunk = Chunk.read(stream(data[body : body + LARGEST]))
        unpacking = zstandard.ZstdDecompressor(max_window_size=LARGEST)
        unpacked = unpacking.stream_reader(chunk.data).read(LARGEST)
    except Exception:  # noqa: BLE001, as above
        return []
    # All of it is there where only the length is damaged, and then it has to be right.
    size, expected = chunk.uncompressed_size, chunk.uncompressed_crc
    if len(unpacked) >= size and zlib.crc32(unpacked) != expected:
        return []
    return _unpacked(unpacked, allowance)
