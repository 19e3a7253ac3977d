# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Opens and inspects files at user-supplied paths, which may be missing or special files."""

import errno
import fcntl
import os
import stat
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO, Literal, TextIO

from linkage_ros.errors import LinkageError

STANDARD_OUTPUT = '-'
_EXISTS = 'already exists: choose another name, or'
# Largest size of a file that is read as a whole, bytes.
LARGEST = 1 << 24
_FOLDER = 'is a folder: add a file name'
_WRITTEN = 'is being written by another run: choose another name'


def open_file(path: Path | str, mode: Literal['rb', 'wb', 'xb'] = 'rb') -> BinaryIO:
    """Opens a file without blocking; the caller must close it.

    A pipe without a writer reads as empty, and a pipe without a reader cannot be opened for
    writing. A file opened for writing is locked, so that this function cannot open it for writing
    again in any process.

    Raises:
        BlockingIOError: The file is locked.
        OSError: The file cannot be opened, or its name is invalid.
    """
    opener = _open_nonblocking if mode == 'rb' else _open_locked
    try:
        stream = open(path, mode, opener=opener)  # noqa: SIM115, the caller closes it
    except ValueError as error:  # the name contains a NUL or a lone surrogate
        raise OSError(errno.EINVAL, str(error)) from error
    os.set_blocking(stream.fileno(), True)
    return stream


def read_file(path: Path | str, largest: int = LARGEST) -> bytes:
    """Reads a whole file of at most `largest` bytes, as all files but logs and bags are read.

    Raises:
        OSError: The file cannot be read, is not a regular file, or is too large.
    """
    with open_file(path) as stream:
        if not stat.S_ISREG(os.fstat(stream.fileno()).st_mode):
            raise OSError(errno.EINVAL, 'is not a regular file')
        # Some files, as in /proc, say that their size is 0.
        data = stream.read(largest + 1)
        size = max(os.fstat(stream.fileno()).st_size, len(data))
    if len(data) > largest:
        raise OSError(errno.EFBIG, f'has {size} bytes, and at most {largest} are read')
    return data


def create_file(
    path: Path | str, kind: type[LinkageError], *, overwrite: bool, cure: str
) -> BinaryIO:
    """Creates a file with `open_file`, or replaces it; for files that are read while they grow.

    Args:
        path: Path of the file. Its folder is created if that folder's parent exists.
        kind: Class of the exception to raise.
        overwrite: Whether to replace an existing file.
        cure: Instruction for replacing an existing file, for the error message.

    Raises:
        LinkageError: The file exists and must not be replaced, or cannot be created. The exception
            is of type `kind`.
    """
    try:
        with suppress(OSError, ValueError):  # opening the file then gives the reason
            Path(path).parent.mkdir(exist_ok=True)
        return open_file(path, 'wb' if overwrite else 'xb')
    except (FileExistsError, IsADirectoryError):
        problem = _FOLDER if Path(path).is_dir() else f'{_EXISTS} {cure}'
    except BlockingIOError:
        problem = _WRITTEN
    except OSError as error:
        problem = f'cannot be written: {reason(error, path)}'
    raise kind(f'{path} {problem}')


def require_new(path: Path | str, kind: type[LinkageError], *, overwrite: bool, cure: str) -> None:
    """Rejects a path at which no file may be written, before the work for the file begins.

    The arguments are those of `create_file`; the path may be '-'.

    Raises:
        LinkageError: The file exists and must not be replaced, or its folder cannot be created.
            The exception is of type `kind`.
    """
    if str(path) == STANDARD_OUTPUT:
        return
    problem = ''
    if os.path.isdir(path):  # noqa: PTH112, accepts invalid names
        problem = _FOLDER
    elif os.path.lexists(path) and not os.path.isfile(path):  # noqa: PTH113
        problem = 'is not a regular file: choose another name'
    elif os.path.lexists(path) and not overwrite:
        problem = f'{_EXISTS} {cure}'
    elif is_written(path):
        problem = _WRITTEN
    if problem:
        raise kind(f'{path} {problem}')
    if not path_exists(Path(path).parent.parent):
        raise kind(f'{path} cannot be written: {reason(FileNotFoundError(), path)}')


@contextmanager
def replacement(
    path: Path | str, kind: type[LinkageError], *, overwrite: bool, cure: str
) -> Iterator[Path]:
    """Provides a temporary file that becomes the file once it is complete.

    At the end of the block, the temporary file, in the same folder, is renamed to `path`. If the
    block raises an exception, the temporary file is removed. The arguments are those of
    `create_file`.

    Raises:
        LinkageError: As for `require_new`, or the file cannot be written.
    """
    require_new(path, kind, overwrite=overwrite, cure=cure)
    try:
        target = Path(os.path.realpath(path))
        target.parent.mkdir(exist_ok=True)
        temporary = target.with_name(f'.{os.getpid()}.part{target.suffix}')
        temporary.touch()
    except (OSError, ValueError) as error:  # ValueError for a NUL or a lone surrogate in the name
        raise kind(f'{path} cannot be written: {reason(error, path)}') from error
    try:
        yield temporary
        temporary.replace(target)
    except OSError as error:
        raise kind(f'{path} cannot be written: {reason(error, path)}') from error
    finally:
        temporary.unlink(missing_ok=True)


@contextmanager
def text_output(
    path: Path | str, kind: type[LinkageError], *, overwrite: bool, cure: str
) -> Iterator[TextIO]:
    """Opens a text file in UTF-8 as `replacement` does; '-' is standard output."""
    if str(path) == STANDARD_OUTPUT:
        yield sys.stdout
        return
    with (
        replacement(path, kind, overwrite=overwrite, cure=cure) as part,
        part.open('w', newline='', encoding='utf-8') as stream,
    ):
        yield stream


def reason(error: Exception, path: Path | str) -> str:
    """Returns why a file cannot be written: the missing folder, or the message of the error."""
    if isinstance(error, FileNotFoundError):
        for folder in reversed(Path(path).parents):
            if not path_exists(folder):
                return f'there is no folder {folder}'
    return getattr(error, 'strerror', None) or str(error)


def _open_nonblocking(path: str, flags: int) -> int:
    return os.open(path, flags | os.O_NONBLOCK, 0o666)  # the umask applies, as with open()


def _open_locked(path: str, flags: int) -> int:
    """Opens a file for writing, locks it until it is closed, and truncates it.

    Raises:
        BlockingIOError: The file is locked.
        OSError: The file cannot be opened.
    """
    number = _open_nonblocking(path, flags & ~os.O_TRUNC)
    if stat.S_ISREG(os.fstat(number).st_mode):  # do not lock devices such as /dev/null
        try:
            fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(number)
            raise
        except OSError:  # some network file systems do not support locks
            pass
        os.ftruncate(number, 0)
    return number


def is_written(path: Path | str) -> bool:
    """Returns whether this package has a file open for writing, in any process."""
    with suppress(OSError), open_file(path) as stream:
        try:
            fcntl.flock(stream.fileno(), fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
    return False


def is_same_file(path: str, other: str) -> bool:
    """Returns whether two paths refer to the same file, existing or not."""
    with suppress(OSError, ValueError):
        if os.path.realpath(path) == os.path.realpath(other):
            return True
        return Path(path).samefile(other)
    return False


def path_exists(path: Path | str) -> bool:
    """Returns whether a path exists; unlike Path.exists, does not raise for invalid names."""
    return os.path.exists(path)  # noqa: PTH110
