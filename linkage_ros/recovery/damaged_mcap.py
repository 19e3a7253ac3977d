# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads the intact records of a truncated or damaged MCAP file.

Chunks hold all messages and have checksums. After damage, reading continues at the next chunk or
record of this package.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass

from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from linkage_ros.log.mcap_file import HEAD, KINDS, LARGEST, McapFile, Part, parsed

# What a data section holds, and the lengths of what ends it; another opcode is damage.
_HELD = {Opcode.HEADER, *range(Opcode.SCHEMA, Opcode.MESSAGE_INDEX + 1), Opcode.ATTACHMENT,
         Opcode.METADATA}  # fmt: skip
_ENDS = {Opcode.DATA_END: 4, Opcode.FOOTER: 20}
# The beginning of a chunk or of a metadata record of linkage_ros, wherever it is.
_LANDMARK = re.compile(rb'\x06.{36}\x04\0\0\0zstd|\x0c.{8}[\x0b-\x20]\0\0\0linkage_ros', re.DOTALL)
_LANDMARK_SIZE = 45


@dataclass
class Losses:
    """The part of a log that could not be recovered.

    Attributes:
        places: Number of damaged stretches between intact records.
        damaged: Number of bytes in them.
        messages: Number of messages known to be lost.
        records: Number of motion records among them.
        tail: Number of incomplete or damaged bytes at the end.
    """

    places: int = 0
    damaged: int = 0
    messages: int = 0
    records: int = 0
    tail: int = 0


def walk(file: McapFile, losses: Losses) -> Iterator[Part]:
    """Reads the records that can be read, up to the end of the data section.

    Args:
        file: The file; its beginning is that of an MCAP file.
        losses: Counts what cannot be read.

    Yields:
        Records, in order.

    Raises:
        LogError: It unpacks to too much, or is damaged in too many places.
    """
    at, hurt, chunked = len(MCAP0_MAGIC), False, False
    while at < file.size:
        opcode = file.read(at, 1)[0]
        # One wrong bit makes a header or an index a message: none comes first, or beside chunks.
        is_forged = opcode == Opcode.MESSAGE and (chunked or at == len(MCAP0_MAGIC))
        chunked |= opcode == Opcode.CHUNK
        part = None if is_forged else _whole(file, at)
        file.allowance.check()
        if part and part.opcode in _ENDS:
            return
        if part:
            if opcode == Opcode.MESSAGE_INDEX and hurt:
                losses.messages += (part.end - at - HEAD.size - 6) // 16
            hurt &= opcode != Opcode.CHUNK
            yield part
            at = part.end
            continue
        hurt = opcode == Opcode.CHUNK
        after = _next_place(file, at)
        if after is None:
            losses.tail = file.size - at
            break
        losses.places += 1
        losses.damaged += after - at
        at = after
    file.allowance.check()


def _whole(file: McapFile, at: int) -> Part | None:
    """Reads the record at a place; None if it is damaged or too large."""
    with suppress(Exception):  # nothing bounds what damage makes a parser raise
        if _is_possible(file, at):
            part = file.part(at)
            if part.opcode in KINDS and part.opcode != Opcode.CHUNK:
                _, body, _ = file.record(at)
                return part._replace(record=parsed(part.opcode, body))
            return part
    return None


def _is_possible(file: McapFile, at: int) -> bool:
    """Returns whether a place may hold a record: its opcode and end are valid.

    Raises:
        Exception: There is none.
    """
    opcode, end = file.frame(at)
    return opcode in _HELD or end - at - HEAD.size == _ENDS.get(Opcode(opcode))


def _next_place(file: McapFile, at: int) -> int | None:
    """Finds the next place to read after a damaged record; None at the end.

    If the length of a chunk is right, the next record follows it; otherwise the record may lie
    within the claimed length.

    Raises:
        LogError: Too many places were tried.
    """
    # To try this one may have taken as much: thousands that look like chunks are not tried.
    file.allowance.take(0, LARGEST)
    with suppress(Exception):
        opcode, end = file.frame(at)
        if opcode == Opcode.CHUNK and _is_possible(file, end):
            return end
    at += 1
    while len(data := file.read(at, LARGEST)) >= _LANDMARK_SIZE:
        for found in _LANDMARK.finditer(data):
            with suppress(Exception):
                if _is_possible(file, at + found.start()):
                    return at + found.start()
        at += len(data) - _LANDMARK_SIZE + 1
    return None
