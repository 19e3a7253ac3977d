# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Opens files that a user names, whatever is there under the name."""

from __future__ import annotations

import errno
import os
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO, Literal


def open_file(path: Path | str, mode: Literal['rb', 'wb', 'xb'] = 'rb') -> BinaryIO:
    """Opens a file, and waits for nobody.

    A pipe into which nobody writes is empty; one from which nobody reads cannot be opened.

    Args:
        path: The file.
        mode: As of open.

    Returns:
        The file, to be closed.

    Raises:
        OSError: It cannot be opened; also where no file can have such a name.
    """
    try:
        stream = open(path, mode, opener=_open_at_once)  # noqa: SIM115, the caller's to close
    except ValueError as error:  # a NUL, or half a character
        raise OSError(errno.EINVAL, str(error)) from error
    os.set_blocking(stream.fileno(), True)
    return stream


def _open_at_once(path: str, flags: int) -> int:
    return os.open(path, flags | os.O_NONBLOCK, 0o666)  # less the umask, as open does


def is_there(path: Path | str) -> bool:
    """Whether there is something under a name; Path.exists raises where none can have it."""
    with suppress(OSError, ValueError):
        return Path(path).exists()
    return False
