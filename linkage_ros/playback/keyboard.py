# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Keys pressed in a terminal, one by one and unseen; it is given back on every way out."""

from __future__ import annotations

import os
import select
import signal
import termios
from contextlib import AbstractContextManager, suppress
from types import FrameType
from typing import Any

SPACE, RIGHT, UP, DOWN = b' ', b'\x1b[C', b'\x1b[A', b'\x1b[B'

# As terminals send them, in either cursor key mode.
_KEYS = {
    SPACE: SPACE,
    **{key[:1] + o + key[2:]: key for key in (RIGHT, UP, DOWN) for o in (b'[', b'O')},
}
# These would end or stop the process with the terminal as it is. Those that the caller handles,
# for an orderly end, stay the caller's; nothing can be done about SIGKILL.
_LEAVING = (signal.SIGTSTP, signal.SIGQUIT, signal.SIGHUP)


class Keyboard(AbstractContextManager['Keyboard']):
    """The keys of a terminal; of anything else, and in the background, none.

    To be used in the main thread, since signals are handled there.
    """

    def __init__(self, descriptor: int = 0) -> None:
        """Takes the terminal.

        Args:
            descriptor: Of the terminal; by default standard input.
        """
        self._descriptor = descriptor
        self._pending = b''
        self._taken = self._gone = False
        self._saved: list[Any] | None = None
        with suppress(termios.error):  # no terminal, or closed
            self._saved = termios.tcgetattr(descriptor)
        if self._saved is None:
            return
        for number in _LEAVING:
            # What nohup or a shell script set to be ignored stays so.
            if signal.getsignal(number) == signal.SIG_DFL:
                signal.signal(number, self._leave)
        signal.signal(signal.SIGCONT, self._return)
        self._take()

    def read(self, timeout: float) -> bytes | None:
        """Waits for a key.

        Args:
            timeout: Longest time, s; waits as long where there is no terminal.

        Returns:
            SPACE, RIGHT, UP or DOWN; None: no key, or another one.
        """
        if not self._taken:
            self._take()  # a shell's fg says nothing to a job that it had let run
        key = self._next_key()
        if key is None and self._is_ready(timeout):
            self._pending += self._receive()
            key = self._next_key()
        return key

    def close(self) -> None:
        """Gives the terminal back."""
        if self._saved is None:
            return
        for number in (*_LEAVING, signal.SIGCONT):
            if signal.getsignal(number) in (self._leave, self._return):
                signal.signal(number, signal.SIG_DFL)
        self._give_back()

    def __exit__(self, *error: object) -> None:
        self.close()

    def _is_ready(self, timeout: float) -> bool:
        watched = [self._descriptor] if self._taken else []
        ready = select.select(watched, [], [], timeout)[0]
        return bool(ready) and self._taken  # it may have been put into the background meanwhile

    def _receive(self) -> bytes:
        data = b''
        with suppress(OSError):
            data = os.read(self._descriptor, 64)
        if not data:  # the terminal has gone: it would be ready, with nothing, for ever
            self._taken, self._gone = False, True
        return data

    def _next_key(self) -> bytes | None:
        while self._pending:
            for sent, key in _KEYS.items():
                if self._pending.startswith(sent):
                    self._pending = self._pending[len(sent) :]
                    return key
                if sent.startswith(self._pending):
                    return None  # the rest is on its way
            self._pending = self._pending[1:]
        return None

    def _is_in_foreground(self) -> bool:
        try:
            return os.tcgetpgrp(self._descriptor) == os.getpgrp()
        except OSError:
            return True  # a terminal without job control

    def _take(self) -> None:
        # In the background, touching the terminal would stop the process (SIGTTOU).
        if self._saved is None or self._gone or not self._is_in_foreground():
            return
        with suppress(termios.error):
            raw = termios.tcgetattr(self._descriptor)
            raw[3] &= ~(termios.ICANON | termios.ECHO)
            raw[6][termios.VMIN], raw[6][termios.VTIME] = 1, 0
            termios.tcsetattr(self._descriptor, termios.TCSANOW, raw)
            self._taken = True

    def _give_back(self) -> None:
        if self._taken and self._saved is not None and self._is_in_foreground():
            with suppress(termios.error):
                termios.tcsetattr(self._descriptor, termios.TCSANOW, self._saved)
        self._taken = False

    def _return(self, *_: object) -> None:
        """Takes the terminal again where the process goes on."""
        self._take()

    def _leave(self, number: int, _: FrameType | None) -> None:
        """Gives the terminal back before a signal does what it does by default."""
        self._give_back()
        signal.signal(number, signal.SIG_DFL)
        os.kill(os.getpid(), number)
        signal.signal(number, self._leave)  # continued; SIGCONT takes the terminal again
