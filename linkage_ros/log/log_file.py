# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The file of a log, which may run out of space, or be removed, renamed or truncated."""

from __future__ import annotations

import io
import os
import shutil
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NoReturn, cast

from linkage_ros.errors import LogError
from linkage_ros.files import create_file, open_file


class LogFile:
    """A new file, written by one thread.

    Attributes:
        path: Path of the file.
        stream: The stream to write to.
        begun: Whether it holds enough for a recovery; set by the caller.
    """

    def __init__(self, path: Path | str, magic: bytes, *, overwrite: bool) -> None:
        """Creates the file.

        Args:
            path: Path of the file.
            magic: First bytes of a log.
            overwrite: Whether to replace an existing log.

        Raises:
            LogError: The file exists and is not to be replaced, or is no log; it is being written
                by another run, or cannot be created.
        """
        self.path, self.begun = Path(path), False
        if overwrite and _is_something_else(self.path, magic):
            raise LogError(f'{path} is no log and is kept: choose another name')
        opened = create_file(
            path, LogError, overwrite=overwrite,
            cure='set log_overwrite (linkage_record: --overwrite)',
        )  # fmt: skip
        self.stream = cast('io.BufferedWriter', opened)

    @contextmanager
    def reported(self) -> Iterator[None]:
        """Says where the system fails within that the file cannot be written.

        Raises:
            LogError: The file cannot be written.
        """
        try:
            yield
        except OSError as error:
            words = f'{self.path} cannot be written: {error.strerror or error}'
            rescue = '; linkage_log recover saves what it holds' if self.begun else ''
            raise LogError(words + rescue) from error

    def check_size(self) -> None:
        """Checks that the file has the written length; otherwise writing ends.

        Raises:
            LogError: Another program truncated it, or wrote to it.
        """
        status = os.fstat(number := self.stream.fileno())
        written = os.lseek(number, 0, os.SEEK_CUR) if stat.S_ISREG(status.st_mode) else None
        if written not in {None, status.st_size}:
            self.stream.raw.close()  # what waits would be written behind a hole
            raise LogError(
                f'{self.path} has {status.st_size} bytes instead of {written}: '
                'somebody else cuts it off or writes to it; give each run a log of its own'
            )

    def is_removed(self) -> bool:
        """Returns whether the file has been removed; a renamed log continues."""
        return os.fstat(self.stream.fileno()).st_nlink == 0

    def put_back(self) -> NoReturn:
        """Copies a removed file back to its path; Linux cannot restore its name.

        Raises:
            LogError: Always, because the log ends here.
        """
        source, words = self.stream.fileno(), f'{self.path} was removed while it was written'
        try:
            _copy(source, self.path)
        except OSError as error:
            # It is there as long as somebody has it open.
            place = f'/proc/{os.getpid()}/fd/{os.dup(source)}'
            raise LogError(
                f'{words} and cannot be put back ({error.strerror or error}): copy it from '
                f'{place} before this process ends'
            ) from error
        raise LogError(f'{words}; it is put back with what was logged until then')

    def close(self) -> None:
        """Ends the writing."""
        with suppress(OSError):  # closing flushes once more what could not be written before
            self.stream.close()

    def discard(self) -> None:
        """Removes the empty file."""
        with suppress(OSError):
            if stat.S_ISREG(os.fstat(self.stream.fileno()).st_mode):  # and no device
                self.path.unlink()
        self.close()


def _is_something_else(path: Path, magic: bytes) -> bool:
    """Returns whether the path is a file that is not a log, such as the run's parameters."""
    with suppress(OSError), open_file(path) as stream:
        if stat.S_ISREG(os.fstat(stream.fileno()).st_mode):
            return stream.read(len(magic)) not in {b'', magic}
    return False


def _copy(source: int, path: Path) -> None:
    """Copies an open file to a new one; removes an incomplete copy.

    Raises:
        OSError: The file cannot be copied.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open('xb') as target:
        try:
            with Path(f'/proc/self/fd/{source}').open('rb') as whole:
                shutil.copyfileobj(whole, target, 1 << 20)
        except OSError:
            path.unlink()
            raise
