# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is written to stderr, by C code too: never waited for, and held back where it repeats."""

from __future__ import annotations

import os
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

_AT_MOST = 65536  # bytes, what a pipe holds
_PATIENCE = 1.0  # s, for whoever reads our last lines


@contextmanager
def never_waited_for() -> Iterator[None]:
    """Lets a reader who stands still, behind a full pipe or Ctrl-S, hold up nobody who writes.

    All lines go through a pipe of ours; those that it cannot hold any more, beyond 64 KiB, are
    lost, and so are the last ones if nobody reads them within a second of the end.
    """
    if sys.stderr is None:  # it was closed: lines go nowhere, instead of into the next file
        _go_nowhere()
        yield
        return
    sys.stderr.flush()
    theirs = os.dup(2)
    if os.isatty(theirs):  # rcutils would look at our pipe
        os.environ.setdefault('RCUTILS_COLORIZED_OUTPUT', '1')
    outlet, inlet = os.pipe()
    os.set_blocking(inlet, False)
    os.dup2(inlet, 2)
    os.close(inlet)
    thread = threading.Thread(target=_carry, args=(outlet, theirs), name='stderr', daemon=True)
    thread.start()
    try:
        yield
    finally:
        with suppress(OSError):
            sys.stderr.flush()
        _go_nowhere()  # our pipe ends with that
        thread.join(_PATIENCE)
        if not thread.is_alive():
            os.dup2(theirs, 2)
            os.close(theirs)


def _go_nowhere() -> None:
    nowhere = os.open(os.devnull, os.O_WRONLY)
    if nowhere != 2:
        os.dup2(nowhere, 2)
        os.close(nowhere)


def _carry(outlet: int, theirs: int) -> None:
    """Carries all that comes out of a pipe to where it may have to wait."""
    while data := os.read(outlet, _AT_MOST):
        with suppress(OSError):  # the terminal has gone, or the disk of the file is full
            while data:
                data = data[os.write(theirs, data) :]
    os.close(outlet)


@contextmanager
def held_back() -> Iterator[Callable[[], None]]:
    """Holds back what C code writes: rcl announces in a line of its own what it raises.

    Yields:
        Call it to let the words out after all.
    """
    if sys.stderr is not None:
        sys.stderr.flush()
    saved = os.dup(2)
    with tempfile.TemporaryFile() as held:

        def release() -> None:
            held.seek(0)
            os.write(saved, held.read())

        os.dup2(held.fileno(), 2)
        try:
            yield release
        finally:
            os.dup2(saved, 2)
            os.close(saved)
