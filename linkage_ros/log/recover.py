# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Recovers the readable data of a truncated or damaged log."""

from collections.abc import Callable
from contextlib import suppress
from itertools import compress, pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Metadata, Schema

from linkage_ros.errors import LogError
from linkage_ros.files import is_same_file, replacement
from linkage_ros.log.disk import keep_other_files, require_name
from linkage_ros.log.reader import NO_CONFIGURATION
from linkage_ros.log.records import (
    CHECKSUM,
    CONFIGURATION_RECORD,
    END_RECORD,
    EVENT_RECORDS,
    MOTION_RECORD,
    Gap,
    unseal,
)
from linkage_ros.log.rows import message_heads
from linkage_ros.log.scan import HEAD, McapFile, open_mcap, parsed, records
from linkage_ros.log.writer import LogWriter
from linkage_ros.units import NS_PER_S, TIME_END

# Names of the metadata records that are copied as they are.
_COPIED = CONFIGURATION_RECORD, MOTION_RECORD, *EVENT_RECORDS.values()


class Recovered(NamedTuple):
    """The outcome of a recovery.

    Attributes:
        messages: Number of recovered messages.
        duration: Time from the first to the last recovered message, s.
        places: Number of damaged regions, including an incomplete end.
        damaged: Number of bytes in the damaged regions.
        unknown: Number of messages lost because their topics are unknown.
    """

    messages: int
    duration: float
    places: int
    damaged: int
    unknown: int


def recover(
    source: Path | str,
    target: Path | str,
    *,
    overwrite: bool = False,
    progress: Callable[[int], object] = lambda _: None,
) -> Recovered:
    """Copies the readable messages, topics, configuration and motions of a log to a new one.

    Args:
        source: Path of the damaged log, which is not changed.
        target: Path of the new log, which is created or replaced only when it is complete.
        overwrite: Whether to replace an existing log.
        progress: Called with the number of bytes read since the last call.

    Returns:
        Counts of the recovered and lost data.

    Raises:
        LogError: The source is not a log of this package, or would be too large when
            decompressed; or the target is the source or cannot be written.
    """
    with open_mcap(Path(source)) as stream:
        if is_same_file(str(source), str(target)):
            raise LogError(f'{target} is the damaged log itself: choose another name')
        if overwrite:
            keep_other_files(target)
        require_name(target)
        with (
            replacement(target, LogError, overwrite=overwrite, cure='give --overwrite') as path,
            LogWriter(path, None, overwrite=True) as new,
        ):
            new.file.path = target
            try:
                return _Copy(McapFile(stream), new).run(progress)
            except LogError as error:
                raise LogError(f'{source} cannot be recovered: {error}') from error


class _Copy:
    """Copies the intact records of a log into a new one, with the same division into chunks."""

    def __init__(self, file: McapFile, new: LogWriter) -> None:
        """Prepares the copy of a damaged log."""
        self._file, self._new = file, new
        self._unknown, self._is_configured = 0, False
        self._logged = -1  # number of messages in the end record; -1 if there is none
        # Schemas and channels of the summary, in case the chunk that declares them is lost.
        self._spare: list[Schema | Channel] = []
        with suppress(Exception):  # the file is incomplete, or its summary is damaged
            summary = file.summary() or {}
            self._spare = [*summary[Schema], *summary[Channel]]

    def run(self, progress: Callable[[int], object]) -> Recovered:
        """Copies all intact records; returns the outcome.

        Raises:
            LogError: The decompressed log would be too large, the log has no configuration, or the
                new log cannot be written.
        """
        file, damaged_places, damaged_bytes = self._file, 0, 0
        while not self._copy_records(progress):
            start, file.at = file.at, file.next_place(file.at + 1)
            self._new.write_event(Gap(0))
            damaged_places += 1
            damaged_bytes += file.at - start
            progress(file.at - start)
        if not self._is_configured:
            raise LogError(NO_CONFIGURATION)
        statistics = self._new.mcap.statistics
        # Without an end record, verification says that states may be missing.
        self._new.has_end = statistics.message_count == self._logged
        duration = (statistics.message_end_time - statistics.message_start_time) / NS_PER_S
        return Recovered(
            statistics.message_count, duration, damaged_places, damaged_bytes, self._unknown
        )

    def _copy_records(self, progress: Callable[[int], object]) -> bool:
        """Copies records up to a damaged one; returns whether there is none.

        Raises:
            LogError: As for `run`.
        """
        try:
            for _, start, end in self._file.records():
                self._take(self._file.content(start))
                progress(end - start)
        except Exception:  # on damaged data the parser may raise any exception
            if self._file.left < 0 or self._new.file.stream.closed:
                raise
            return False
        return True

    def _take(self, content: object) -> None:
        """Copies the content of a record, as returned by `McapFile.content`.

        Raises:
            LogError: The record is damaged. Damaged data may raise other exceptions.
            ValueError: The name of a metadata record is damaged, or it is a second configuration.
        """
        mcap = self._new.mcap
        if isinstance(content, bytes):
            self._take_chunk(content)
        elif isinstance(content, Attachment):
            mcap.add_attachment(content)
        elif isinstance(content, Metadata):
            if content.name == END_RECORD:
                self._logged = int(unseal(content.metadata)['messages'])
                return
            self._check_metadata(content)
            self._is_configured |= content.name == CONFIGURATION_RECORD
            mcap.add_metadata(content)

    def _check_metadata(self, record: Metadata) -> None:
        """Checks a record that a run of this package may have written; accepts others.

        Raises:
            LogError: The record is damaged.
            ValueError: Its name is damaged, or it is a second configuration.
        """
        is_known = record.name in _COPIED
        if not is_known and CHECKSUM not in record.metadata:
            return  # the record of another program
        unseal(record.metadata)
        is_second = self._is_configured and record.name == CONFIGURATION_RECORD
        if is_second or not is_known:
            raise ValueError('the name of a record is damaged')

    def _take_chunk(self, data: bytes) -> None:
        """Copies the channels of a chunk and its messages, unless their channels are unknown.

        Raises:
            LogError: The new log cannot be written.
            ValueError: A record is damaged. Damaged data may raise other exceptions.
        """
        if not data:
            return
        new, starts = self._new.mcap, [0, *(end for *_, end in records(data))]
        heads = message_heads(data, starts[:-1])
        is_message = heads['opcode'] == Opcode.MESSAGE
        if (heads['time'][is_message] >= TIME_END).any():  # readers would refuse the log
            raise ValueError('a time is too large')
        for i in np.flatnonzero(~is_message):
            new.declare(parsed(data[starts[i]], data[starts[i] + HEAD.size : starts[i + 1]]))
        numbers = list(dict.fromkeys(heads['channel'][is_message].tolist()))  # in order of use
        for number in numbers:  # up to the record of the summary that declares it
            while self._spare and number not in new.channels:
                new.declare(self._spare.pop(0))
        is_kept = is_message & np.isin(heads['channel'], [*new.channels])
        self._unknown += int(is_message.sum() - is_kept.sum())
        if not is_kept.all():
            spans = compress(pairwise(starts), is_kept.tolist())
            data = b''.join(data[start:end] for start, end in spans)
        times, channels = heads['time'][is_kept], heads['channel'][is_kept]
        sizes = np.diff(starts)[is_kept]
        offsets = new.position + np.cumsum(sizes) - sizes  # in the new chunk
        entries = np.column_stack([times, offsets.astype(np.uint64)])
        index = {n: entries[channels == n] for n in numbers if n in new.channels}
        new.add_records(data, times, index)
        new.flush()
