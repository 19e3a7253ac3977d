# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The log's file: a full or hanging disk, a power cut, a removed file, and other writers.

When the file cannot be written, `LogFile` raises a `LogError` and keeps what is written, which
`linkage_log recover` reads. linkage_record ends with this error; a node goes on without a log, and
its diagnostics say so (`Worker` and `Outputs` in `node/`). Rerun writes an .rrd file itself.
"""

import os
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from mcap.writer import MCAP0_MAGIC

from linkage_ros.errors import LogError
from linkage_ros.files import create_file, open_file, path_exists


def keep_other_files(path: Path | str) -> None:
    """Checks that an existing file may be replaced with a log.

    Raises:
        LogError: The file is neither empty nor an MCAP file, or is a pipe.
    """
    with suppress(OSError):
        if Path(path).is_fifo():
            raise LogError(f'{path} is a pipe: write the log to a regular file')
    with suppress(OSError), open_file(path) as old:
        if old.read(len(MCAP0_MAGIC)) not in {b'', MCAP0_MAGIC}:
            raise LogError(f'{path} is not a log and was not replaced: choose another name')


def require_name(path: Path | str) -> None:
    """Checks that the name of a new log ends with .mcap; a device may have any name.

    Raises:
        LogError: The name has another ending.
    """
    if Path(path).suffix != '.mcap' and (os.path.isfile(path) or not path_exists(path)):  # noqa: PTH113, accepts invalid names
        raise LogError(f'{path} is not a name for a log, which is an MCAP file: write NAME.mcap')


class LogFile:
    """A new log file; not thread-safe.

    Attributes:
        path: Path of the file, for error messages.
        advice: End of the error message if the file cannot be written; empty at first.
        stream: The open file.
    """

    def __init__(self, path: Path | str, *, overwrite: bool) -> None:
        """Creates the file; `overwrite` replaces an existing log.

        Raises:
            LogError: The name does not end with .mcap, or the file exists and must not be
                replaced, is not an MCAP file, is a pipe, is being written by another run, or
                cannot be created.
        """
        self.path, self.advice = path, ''
        if overwrite:
            keep_other_files(path)
        require_name(path)
        self.stream: Any = create_file(
            path, LogError, overwrite=overwrite, cure='give --overwrite (a node: log_overwrite)'
        )
        if not self.stream.seekable():
            self.stream.close()
            raise LogError(f'{path} is a pipe or a terminal: write the log to a regular file')
        self._waiting: list[bytes] = []

    def write(self, data: bytes) -> None:
        """Buffers bytes until the next `flush`."""
        self._waiting.append(data)

    def flush(self) -> None:
        """Passes all bytes to the operating system, so that they survive if the run is killed.

        Raises:
            LogError: The file cannot be written, or was removed or truncated.
        """
        self._check()  # writing now would hide that the file was truncated
        try:
            self.stream.write(b''.join(self._waiting))
            self.stream.flush()
        except OSError as error:
            self.close()
            raise LogError(
                f'{self.path} cannot be written: {error.strerror or error}{self.advice}'
            ) from error
        self._waiting.clear()

    def _check(self) -> None:
        """Closes the file with an error unless it still exists and has the written length.

        Raises:
            LogError: The file was removed, or another program truncated it or wrote to it.
        """
        number, problem = self.stream.fileno(), ''
        status, written = os.fstat(number), os.lseek(number, 0, os.SEEK_CUR)
        if not status.st_nlink:  # a removed file still exists while it is open
            problem = (
                'was removed while it was written; until this process ends, it can be saved with '
                f'linkage_log recover /proc/{os.getpid()}/fd/{os.dup(number)} OUT.mcap'
            )
        elif status.st_size != written:
            problem = (
                f'has {status.st_size} bytes instead of {written}: another program '
                'truncates it or writes to it; give each run its own log'
            )
        if problem:
            self.stream.raw.close()  # without flushing, which would write after a gap
            raise LogError(f'{self.path} {problem}')

    def close(self) -> None:
        """Closes the file."""
        with suppress(OSError):  # closing tries once more to flush unwritten data
            self.stream.close()

    def remove(self) -> None:
        """Closes and removes the file, unless it is a device."""
        self.close()
        with suppress(OSError):
            if Path(self.path).is_file():
                Path(self.path).unlink()


class DiskSync:
    """Consumer of a `Worker` that syncs a file to the disk, so that it survives a power cut.

    It needs its own worker, because a sync may take seconds, during which the log must still be
    flushed.
    """

    def __init__(self, path: Path | str, number: int) -> None:
        """Duplicates a file descriptor, so that syncs work even after the file is closed.

        Args:
            path: Path of the file, for error messages.
            number: Descriptor of the file.
        """
        self._path, self._number = path, os.dup(number)

    def consume(self, _: Sequence[object]) -> None:
        """Syncs all data flushed so far.

        Raises:
            LogError: The sync failed.
        """
        try:
            os.fdatasync(self._number)
        except OSError as error:
            raise LogError(f'{self._path} cannot be synced: {error.strerror}') from error

    def close(self) -> None:
        """Closes the duplicated descriptor."""
        os.close(self._number)
