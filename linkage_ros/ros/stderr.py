# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""stderr as C code writes to it: never waited for, and muted where rcl repeats itself."""

from __future__ import annotations

import os
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress

_AT_MOST = 65536  # bytes, the size of a pipe
_PATIENCE = 1.0  # s, for the reader of our last lines


@contextmanager
def nonblocking_stderr() -> Iterator[None]:
    """Keeps a terminal that was stopped with Ctrl-S from stopping the crank with it.

    Log lines go through a pipe of ours. Lines beyond the 64 KiB that it holds are lost, and so
    are the last ones if nobody reads them within a second of the end.
    """
    if sys.stderr is None:  # closed by `2>&-`: the log must not get its number, and its lines
        os.open(os.devnull, os.O_WRONLY)
    theirs = os.dup(2)
    if os.isatty(theirs):  # rcutils would look at our pipe
        os.environ.setdefault('RCUTILS_COLORIZED_OUTPUT', '1')
    outlet, inlet = os.pipe()
    os.set_blocking(inlet, False)
    _redirect(inlet)
    thread = threading.Thread(target=_carry, args=(outlet, theirs), name='stderr', daemon=True)
    thread.start()
    try:
        yield
    finally:
        _redirect(os.open(os.devnull, os.O_WRONLY))  # which ends our pipe
        thread.join(_PATIENCE)
        if not thread.is_alive():
            _redirect(theirs)


@contextmanager
def muted_stderr() -> Iterator[None]:
    """Drops what rcl prints about an error that it raises too: a user gets one line of ours.

    If nothing is raised, all that was written follows.
    """
    with tempfile.TemporaryFile() as held:
        theirs = os.dup(2)
        _redirect(os.dup(held.fileno()))
        try:
            yield
        finally:
            _redirect(theirs)
        held.seek(0)
        os.write(2, held.read())


def _redirect(number: int) -> None:
    """Lets an open file take the place of stderr."""
    with suppress(OSError, AttributeError):  # the disk is full; there is no stderr
        sys.stderr.flush()
    os.dup2(number, 2)
    os.close(number)


def _carry(outlet: int, theirs: int) -> None:
    """Copies a pipe to a file that may have to wait."""
    while data := os.read(outlet, _AT_MOST):
        with suppress(OSError):  # the terminal has gone, or the disk is full
            while data:
                data = data[os.write(theirs, data) :]
    os.close(outlet)
