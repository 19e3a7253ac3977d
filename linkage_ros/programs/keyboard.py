# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads single keys from a terminal without echo, and restores the terminal at the end."""

import os
import re
import select
import signal
import termios
import tty
from contextlib import AbstractContextManager, suppress
from typing import Any

SPACE, RIGHT, UP, DOWN = b' ', b'\x1b[C', b'\x1b[A', b'\x1b[B'

# Terminals send the cursor keys with [ or O.
_KEY = re.compile(rb' |\x1b[\[O][ABC]')


class Keyboard(AbstractContextManager['Keyboard']):
    """Reads keys from a terminal; returns none in the background or without a terminal.

    It must be used in the main thread, because it handles Ctrl-Z: the terminal is restored while
    the program is stopped, and the next `read` prepares it again.
    """

    def __init__(self, descriptor: int = 0) -> None:
        """Prepares the terminal.

        Args:
            descriptor: File descriptor of the terminal; by default standard input.
        """
        self._descriptor = descriptor
        self._pending = b''
        self._saved: list[Any] | None = None  # settings of the terminal; None: there is none
        with suppress(termios.error):
            self._saved = termios.tcgetattr(descriptor)
            signal.signal(signal.SIGTSTP, self._stop)
        self._take_terminal()

    def read(self, timeout: float) -> bytes | None:
        """Waits for a key.

        Args:
            timeout: Time limit, s; without a terminal, `read` always waits this long.

        Returns:
            SPACE, RIGHT, UP or DOWN; None if no key, or another key, was pressed.
        """
        watched = [self._descriptor] if self._take_terminal() else []
        key = self._next_key()
        if key is not None:
            return key
        readable, _, _ = select.select(watched, [], [], timeout)
        if not readable or not self._take_terminal():
            return None
        # The wake-up may be due to a line that the shell has read, such as fg.
        still_readable, _, _ = select.select(watched, [], [], 0)
        if still_readable:
            self._pending += os.read(self._descriptor, 64)
        return self._next_key()

    def __exit__(self, *error: object) -> None:
        signal.signal(signal.SIGTSTP, signal.SIG_DFL)
        self._restore()

    def _stop(self, *_: object) -> None:
        self._restore()
        os.kill(os.getpid(), signal.SIGSTOP)

    def _restore(self) -> None:
        if self._take_terminal():
            with suppress(termios.error):
                termios.tcsetattr(self._descriptor, termios.TCSANOW, self._saved or [])

    def _next_key(self) -> bytes | None:
        key = _KEY.search(self._pending)
        # If no key is complete, the last bytes may be the start of one.
        self._pending = self._pending[key.end() :] if key else self._pending[-2:]
        return key[0].replace(b'O', b'[') if key else None

    def _take_terminal(self) -> bool:
        """Switches the terminal to single keys without echo; returns whether keys can be read."""
        if self._saved is None:
            return False
        with suppress(OSError):  # a terminal without job control
            # A process in the background would be stopped (SIGTTOU) for touching the terminal.
            if os.tcgetpgrp(self._descriptor) != os.getpgrp():
                return False
        with suppress(termios.error):
            tty.setcbreak(self._descriptor, termios.TCSANOW)
        return True
