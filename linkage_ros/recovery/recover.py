# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Saves what a killed run or a damaged disk left of a log into a complete one."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from mmap import ACCESS_READ, mmap
from pathlib import Path
from typing import BinaryIO, NamedTuple

from mcap.records import Metadata
from mcap.writer import MCAP0_MAGIC, CompressionType, Writer

from linkage_ros.errors import LogError
from linkage_ros.files import is_written, open_file, path_exists
from linkage_ros.log.metadata import CONFIGURATION_RECORD
from linkage_ros.log.untrusted_mcap import Summary, read_summary
from linkage_ros.recovery.damaged_mcap import Losses, Stretch, walk
from linkage_ros.recovery.record_copy import CHUNK_SIZE, RecordCopy, is_undamaged
from linkage_ros.units import NS_PER_S


class Recovered(NamedTuple):
    """What came of a recovery.

    Attributes:
        messages: Saved.
        duration: From the first to the last of them, s.
        losses: What was not.
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
        source: The log; it is left as it is.
        target: The new log.
        overwrite: Whether to replace an existing file.
        progress: Called with the number of bytes that were read since the last call.

    Returns:
        What was saved and what was lost.

    Raises:
        LogError: The source is no log of this package or unpacks to too much, or the target
            cannot be written or is the source.
    """
    source, target = Path(source), Path(target)
    with _opened(source) as log:
        if not _has_configuration(log):
            raise LogError(f'{source} has no configuration record: it cannot be recovered')
        if path_exists(target) and target.samefile(source):
            raise LogError(f'{target} is the broken log itself: choose another name')
        with _replaced(target, overwrite=overwrite) as part:
            return _copy(log, part, progress)


class _Source(NamedTuple):
    """The broken log: its name, the open file, and its bytes."""

    path: Path
    stream: BinaryIO
    data: mmap


@contextmanager
def _opened(path: Path) -> Iterator[_Source]:
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
            with mmap(stream.fileno(), 0, access=ACCESS_READ) as data:
                yield _Source(path, stream, data)
    except OSError as error:
        raise LogError(f'{path} cannot be read: {error.strerror or error}') from error


@contextmanager
def _replaced(target: Path, *, overwrite: bool) -> Iterator[Path]:
    """A path beside the target for the new file, which takes the target's place at the end.

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


def _stretches(source: _Source, losses: Losses) -> Iterator[Stretch]:
    """What can be read of a log.

    Raises:
        LogError: It unpacks to too much.
    """
    try:
        yield from walk(source.data, losses)
    except LogError as error:
        raise LogError(f'{source.path} cannot be recovered: {error}') from error


def _has_configuration(source: _Source) -> bool:
    """Whether the log explains itself; looked for up to the first such record."""
    return any(
        isinstance(record, Metadata)
        and record.name == CONFIGURATION_RECORD
        and is_undamaged(record)
        for stretch in _stretches(source, Losses())
        for record in stretch.records
    )


def _spare(source: _Source) -> Summary | None:
    """The schemas and channels that a complete file repeats at its end, if it is complete."""
    try:
        return read_summary(source.stream)
    except Exception:  # noqa: BLE001, nothing bounds what damage makes a parser raise
        return None


def _copy(source: _Source, path: Path, progress: Callable[[int], object]) -> Recovered:
    losses, before = Losses(), 0
    with path.open('wb') as stream:
        writer = Writer(stream, chunk_size=CHUNK_SIZE, compression=CompressionType.ZSTD)
        copy = RecordCopy(writer, losses, _spare(source))
        for end, records, is_chunk in _stretches(source, losses):
            for record in records:
                copy.add(record)
            if is_chunk:
                copy.write_messages()
                writer.flush()
            progress(end - before)
            before = end
        copy.write_messages()
        writer.finish()
    found = copy.chunks.statistics
    duration = (found.message_end_time - found.message_start_time) / NS_PER_S
    return Recovered(found.message_count, duration, losses)
