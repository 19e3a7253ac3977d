# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Protects a program from a stderr that blocks, and hides output of rcl."""

import os
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress

_PIPE_SIZE = 65536  # bytes, the size of a pipe
_STDERR = 2  # its file descriptor
_FLUSH_SECONDS = 1.0  # time limit for writing the program's last lines


@contextmanager
def nonblocking_stderr() -> Iterator[None]:
    """Makes stderr non-blocking, so that Ctrl-S in the terminal cannot stop the crank.

    Log lines pass through a pipe of this process. Lines beyond the pipe's 64 KiB are lost, as are
    the last lines if they are not read within a second after the end.
    """
    _occupy_standard_streams()
    original = os.dup(_STDERR)
    if os.isatty(original):  # rcutils would check the pipe instead
        os.environ.setdefault('RCUTILS_COLORIZED_OUTPUT', '1')
    outlet, inlet = os.pipe()
    os.set_blocking(inlet, False)
    _redirect(inlet)
    thread = threading.Thread(target=_copy, args=(outlet, original), name='stderr', daemon=True)
    thread.start()
    try:
        yield
    finally:
        _redirect(os.open(os.devnull, os.O_WRONLY))  # closes the pipe
        thread.join(_FLUSH_SECONDS)
        if not thread.is_alive():
            _redirect(original)


@contextmanager
def muted_stderr() -> Iterator[None]:
    """Drops rcl's output about errors that it also raises, so that the user sees one line.

    If no error is raised, the output is printed afterwards.
    """
    with tempfile.TemporaryFile() as held:
        original = os.dup(_STDERR)
        _redirect(os.dup(held.fileno()))
        try:
            yield
        finally:
            _redirect(original)
        held.seek(0)
        os.write(_STDERR, held.read())


def _occupy_standard_streams() -> None:
    """Opens the null device for each standard stream that is closed, as by `2>&-`.

    Otherwise, a file opened later would get its descriptor.
    """
    while (opened := os.open(os.devnull, os.O_RDWR)) <= _STDERR:
        pass
    os.close(opened)


def _redirect(number: int) -> None:
    """Redirects stderr to an open file, and closes the file's original descriptor."""
    with suppress(OSError, AttributeError):  # the disk is full, or stderr is closed
        sys.stderr.flush()
    os.dup2(number, _STDERR)
    os.close(number)


def _copy(outlet: int, original: int) -> None:
    """Copies a pipe to a file that may block."""
    while data := os.read(outlet, _PIPE_SIZE):
        with suppress(OSError):  # the terminal is closed, or the disk is full
            while data:
                data = data[os.write(original, data) :]
    os.close(outlet)
