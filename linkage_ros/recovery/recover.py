# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Recovers a log after a killed run or damage to the disk."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC, CompressionType, Writer

from linkage_ros.errors import LogError
from linkage_ros.files import is_written, open_file, path_exists
from linkage_ros.log.mcap_file import McapFile, Summary
from linkage_ros.recovery.damaged_mcap import Losses, walk
from linkage_ros.recovery.record_copy import CHUNK_SIZE, RecordCopy
from linkage_ros.units import NS_PER_S


class Recovered(NamedTuple):
    """The outcome of a recovery.

    Attributes:
        messages: Number of messages recovered.
        duration: Time from the first to the last of them, s.
        losses: What could not be recovered.
    """

    messages: int
    duration: float
    losses: Losses


def recover(
    source: Path | str,
    target: Path | str,
    *,
    overwrite: bool = False,
    progress: Callable[[int], object] = lambda _: None,
) -> Recovered:
    """Copies all that can be read of a log: messages, topics, configuration and motions.

    Args:
        source: The log; it is not changed.
        target: The new log.
        overwrite: Whether to replace an existing file.
        progress: Called with the number of bytes that were read since the last call.

    Returns:
        What was recovered and what was lost.

    Raises:
        LogError: The source is not a log of this package or unpacks to too much, or the target
            cannot be written or is the source.
    """
    source, target = Path(source), Path(target)
    with _opened(source) as file:
        if path_exists(target) and target.samefile(source):
            raise LogError(f'{target} is the broken log itself: choose another name')
        with _replaced(target, overwrite=overwrite) as path:
            try:
                return _copy(file, path, progress)
            except LogError as error:
                raise LogError(f'{source} cannot be recovered: {error}') from error


@contextmanager
def _opened(path: Path) -> Iterator[McapFile]:
    """Opens a log.

    Raises:
        LogError: It cannot be read, or is no MCAP file.
    """
    try:
        with open_file(path) as stream:
            # A pipe has no size, and may have nothing to read for ever.
            size = os.fstat(stream.fileno()).st_size
            if not size or stream.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
                raise LogError(f'{path} is no MCAP file: nothing in it can be recovered')
            yield McapFile(stream)
    except OSError as error:
        raise LogError(f'{path} cannot be read: {error.strerror or error}') from error


@contextmanager
def _replaced(target: Path, *, overwrite: bool) -> Iterator[Path]:
    """Context with a temporary path beside the target, which replaces the target at the end.

    Raises:
        LogError: The target exists and is not to be replaced, or cannot be written.
    """
    if os.path.lexists(target):
        if target.is_symlink() or not target.is_file():
            raise LogError(f'{target} is no file that could be replaced: choose another name')
        if not overwrite:
            raise LogError(
                f'{target} exists already and is kept: choose another name, or give --overwrite'
            )
        if is_written(target):
            raise LogError(f'{target} is being written by a run and is kept: choose another name')
    # A name of its own: what an earlier run left beside the target may be the source.
    part = target.with_name(f'{target.name}.{os.getpid()}.part')
    try:
        part.open('xb').close()
    except (OSError, ValueError) as error:
        reason = getattr(error, 'strerror', None) or error
        raise LogError(f'{target} cannot be written: {reason}') from error
    try:
        yield part
        part.replace(target)
    except OSError as error:
        raise LogError(f'{target} cannot be written: {error.strerror or error}') from error
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)


def _copy(file: McapFile, path: Path, progress: Callable[[int], object]) -> Recovered:
    """Copies a log.

    Raises:
        LogError: It unpacks to too much, or has no configuration.
    """
    losses, before, spare = Losses(), 0, Summary()
    with suppress(Exception):  # of a file that is not complete, or damaged there
        spare = file.summary() or spare
    with path.open('wb') as stream:
        writer = Writer(stream, chunk_size=CHUNK_SIZE, compression=CompressionType.ZSTD)
        writer.start(profile='ros2', library='linkage_ros')
        copy = RecordCopy(writer, file, losses, spare)
        for part in walk(file, losses):
            copy.add(part)
            if part.opcode == Opcode.CHUNK:
                writer.flush()
            progress(part.end - before)
            before = part.end
        if not copy.is_configured:
            raise LogError('it has no configuration record')
        writer.finish()
    found = copy.chunks.statistics
    duration = (found.message_end_time - found.message_start_time) / NS_PER_S
    return Recovered(found.message_count, duration, losses)
