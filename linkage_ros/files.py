# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Files that a user names: opened, and asked about, whatever is there under the name."""

from __future__ import annotations

import errno
import fcntl
import os
import stat
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO, Literal


def open_file(path: Path | str, mode: Literal['rb', 'wb', 'xb'] = 'rb') -> BinaryIO:
    """Opens a file, and waits for nobody.

    A pipe into which nobody writes is empty; one from which nobody reads cannot be opened. A file
    that somebody writes who opened it here is not opened for writing: it would be emptied. It can
    be read meanwhile.

    Args:
        path: The file.
        mode: As of open.

    Returns:
        The file, to be closed.

    Raises:
        BlockingIOError: Somebody writes it.
        OSError: It cannot be opened; also where no file can have such a name.
    """
    opener = _open_at_once if mode == 'rb' else _open_locked
    try:
        stream = open(path, mode, opener=opener)  # noqa: SIM115, the caller's to close
    except ValueError as error:  # a NUL, or half a character
        raise OSError(errno.EINVAL, str(error)) from error
    os.set_blocking(stream.fileno(), True)
    return stream


def _open_at_once(path: str, flags: int) -> int:
    return os.open(path, flags | os.O_NONBLOCK, 0o666)  # less the umask, as open does


def _open_locked(path: str, flags: int) -> int:
    """Opens a file for writing; it is emptied only where nobody else writes it.

    Raises:
        OSError: It cannot be opened; a BlockingIOError where somebody does.
    """
    number = _open_at_once(path, flags & ~os.O_TRUNC)
    try:
        if stat.S_ISREG(os.fstat(number).st_mode):  # /dev/null is everybody's
            _lock(number)
            os.ftruncate(number, 0)
    except OSError:
        os.close(number)
        raise
    return number


def _lock(number: int) -> None:
    """Locks a file until it is closed, or its process ends in whatever way.

    Raises:
        BlockingIOError: Somebody else has locked it.
    """
    try:
        fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise
    except OSError:  # some file systems of networks have no locks
        return


def is_written(path: Path | str) -> bool:
    """Whether somebody writes a file who opened it here."""
    with suppress(OSError), open_file(path) as stream:
        try:
            fcntl.flock(stream.fileno(), fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
    return False


def is_one_file(path: str, other: str) -> bool:
    """Whether two names are of one file, or will be where none is there yet."""
    with suppress(OSError, ValueError):
        if os.path.realpath(path) == os.path.realpath(other):
            return True
        return Path(path).samefile(other)
    return False


def is_replaceable(path: Path | str) -> bool:
    """Whether `open_file` could write a file anew: no folder, no pipe, no loop of links."""
    try:
        mode = Path(path).stat().st_mode
    except FileNotFoundError:  # nothing, or a link to what is not there yet
        return True
    except (OSError, ValueError):
        return False
    return stat.S_ISREG(mode) or stat.S_ISCHR(mode)  # as /dev/null is


def is_there(path: Path | str) -> bool:
    """Whether there is something under a name; Path.exists raises where none can have it."""
    with suppress(OSError, ValueError):
        return Path(path).exists()
    return False
