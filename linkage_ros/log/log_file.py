# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The file of a log: reports a full disk, a removed file, and another program's changes."""

import os
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from mcap.writer import MCAP0_MAGIC

from linkage_ros.errors import LogError
from linkage_ros.files import create_file, open_file


def keep_other_files(path: Path | str) -> None:
    """Checks that a file, if there is one, may be replaced by a log.

    Raises:
        LogError: The file is neither empty nor a log.
    """
    with suppress(OSError), open_file(path) as old:
        if old.read(len(MCAP0_MAGIC)) not in {b'', MCAP0_MAGIC}:
            raise LogError(f'{path} is not a log and is kept: choose another name')


class LogFile:
    """A new log file, written by one thread.

    The writer of the mcap package calls `write`, `tell` and `flush`.

    Attributes:
        path: Path of the file.
        stream: The open file.
    """

    def __init__(self, path: Path | str, *, overwrite: bool) -> None:
        """Creates the file.

        Args:
            path: Path of the file.
            overwrite: Whether to replace an existing log.

        Raises:
            LogError: The file exists and must not be replaced, is not a log, is being written
                by another run, or cannot be created.
        """
        self.path = path
        if overwrite:
            keep_other_files(path)
        self.stream: Any = create_file(
            path, LogError, overwrite=overwrite, cure='give --overwrite (a node: log_overwrite)'
        )

    def write(self, data: bytes) -> None:
        """Writes bytes.

        Raises:
            LogError: The file cannot be written, or was removed or truncated.
        """
        self._attempt(self.stream.write, data)

    def flush(self) -> None:
        """Passes all bytes to the operating system, which keeps them if the run is killed.

        Raises:
            LogError: The file cannot be written, or was removed or truncated.
        """
        self._attempt(self.stream.flush)
        self._check()

    def tell(self) -> int:
        """Returns the number of bytes written so far."""
        return int(self.stream.tell())

    def _attempt(self, work: Callable[..., object], *arguments: object) -> None:
        self._check()  # writing now would hide that the file was truncated
        try:
            work(*arguments)
        except OSError as error:
            self.close()
            raise LogError(
                f'{self.path} cannot be written: {error.strerror or error}; linkage_log recover '
                'saves what it holds'
            ) from error

    def _check(self) -> None:
        """Checks that the file exists and has the written length; otherwise ends the writing.

        Raises:
            LogError: The file was removed, or another program truncated it or wrote to it.
        """
        number, problem = self.stream.fileno(), ''
        status, written = os.fstat(number), os.lseek(number, 0, os.SEEK_CUR)
        if not status.st_nlink:  # an open file exists even after its removal
            problem = (
                'was removed while it was written; before this process ends, save it with '
                f'linkage_log recover /proc/{os.getpid()}/fd/{os.dup(number)} OUT.mcap'
            )
        elif status.st_size != written:
            problem = (
                f'has {status.st_size} bytes instead of {written}: another program '
                'truncates it or writes to it; give each run a log of its own'
            )
        if problem:
            self.stream.raw.close()  # buffered data would be written after a hole
            raise LogError(f'{self.path} {problem}')

    def close(self) -> None:
        """Closes the file."""
        with suppress(OSError):  # closing flushes unwritten data once more
            self.stream.close()


class DiskSync:
    """Syncs a log to the disk, so that it survives a power cut; used as a worker's consumer.

    A sync may take seconds, during which the log must still be flushed, so the sync has its own
    worker.
    """

    def __init__(self, log: LogFile) -> None:
        """Prepares the sync; it works even after the log has closed its file."""
        self._path, self._number = log.path, os.dup(log.stream.fileno())

    def consume(self, _: Sequence[object]) -> None:
        """Syncs everything flushed so far.

        Raises:
            LogError: The sync failed.
        """
        try:
            os.fdatasync(self._number)
        except OSError as error:
            raise LogError(f'{self._path} does not reach the disk: {error.strerror}') from error

    def close(self) -> None:
        """Closes this object's descriptor of the file."""
        os.close(self._number)
