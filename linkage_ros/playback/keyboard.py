# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Single keys from a terminal, without echo; the terminal is restored however the program ends."""

from __future__ import annotations

import os
import re
import select
import signal
import termios
import tty
from contextlib import AbstractContextManager, suppress
from types import FrameType
from typing import Any

SPACE, RIGHT, UP, DOWN = b' ', b'\x1b[C', b'\x1b[A', b'\x1b[B'

# Terminals send the cursor keys with [ or O.
_KEY = re.compile(rb' |\x1b[\[O][ABC]')
_PARTIAL_KEY = re.compile(rb'(\x1b[\[O]?)?\Z')  # the rest of a cursor key is still to come
# These signals would end or stop the process with the terminal as it is. Those with a handler of
# the caller, for an orderly end, keep it. SIGKILL cannot be handled.
_ENDING_SIGNALS = signal.SIGTSTP, signal.SIGQUIT, signal.SIGHUP


class Keyboard(AbstractContextManager['Keyboard']):
    """The keys of a terminal; none in the background, or if the descriptor is something else.

    To be used in the main thread, since it handles signals.
    """

    def __init__(self, descriptor: int = 0) -> None:
        """Takes the terminal.

        Args:
            descriptor: File descriptor of the terminal; by default standard input.
        """
        self._descriptor = descriptor
        self._pending = b''
        self._is_cbreak = False
        self._saved: list[Any] | None = None  # settings of the terminal; None: there is none
        self._signals: list[signal.Signals] = []
        with suppress(termios.error):
            self._saved = termios.tcgetattr(descriptor)
            # A signal that nohup or a shell script has set to be ignored stays ignored.
            leaving = [n for n in _ENDING_SIGNALS if signal.getsignal(n) == signal.SIG_DFL]
            for number in leaving:
                signal.signal(number, self._restore_and_signal)
            signal.signal(signal.SIGCONT, self._set_cbreak)
            self._signals = [*leaving, signal.SIGCONT]
            self._set_cbreak()

    def read(self, timeout: float) -> bytes | None:
        """Waits for a key.

        Args:
            timeout: Longest time, s; without a terminal it always takes that long.

        Returns:
            SPACE, RIGHT, UP or DOWN; None: no key, or another one.
        """
        self._set_cbreak()  # a shell's `fg` sends no signal to a job that ran in the background
        key = self._next_key()
        watched = [self._descriptor] if self._is_cbreak else []
        if key is None and select.select(watched, [], [], timeout)[0] and self._is_cbreak:
            self._receive()
            key = self._next_key()
        return key

    def __exit__(self, *error: object) -> None:
        for number in self._signals:
            signal.signal(number, signal.SIG_DFL)
        self._restore()

    def _receive(self) -> None:
        data = b''
        with suppress(OSError):
            data = os.read(self._descriptor, 64)
        self._pending += data
        if not data:  # the terminal has gone: it would always be ready, with nothing
            self._is_cbreak, self._saved = False, None

    def _next_key(self) -> bytes | None:
        if found := _KEY.search(self._pending):
            self._pending = self._pending[found.end() :]
            return found[0].replace(b'O', b'[')
        partial = _PARTIAL_KEY.search(self._pending)
        self._pending = partial[0] if partial else b''
        return None

    def _is_in_foreground(self) -> bool:
        with suppress(OSError):
            return os.tcgetpgrp(self._descriptor) == os.getpgrp()
        return True  # a terminal without job control

    def _set_cbreak(self, *_: object) -> None:
        # A process in the background would be stopped (SIGTTOU) for touching the terminal.
        if not self._is_cbreak and self._saved is not None and self._is_in_foreground():
            with suppress(termios.error):
                tty.setcbreak(self._descriptor, termios.TCSANOW)
                self._is_cbreak = True

    def _restore(self) -> None:
        if self._is_cbreak and self._saved is not None and self._is_in_foreground():
            with suppress(termios.error):
                termios.tcsetattr(self._descriptor, termios.TCSANOW, self._saved)
        self._is_cbreak = False

    def _restore_and_signal(self, number: int, _: FrameType | None) -> None:
        """Restores the terminal before a signal has its default effect."""
        self._restore()
        signal.signal(number, signal.SIG_DFL)
        os.kill(os.getpid(), number)
        signal.signal(
            number, self._restore_and_signal
        )  # continued; SIGCONT has taken the terminal again
