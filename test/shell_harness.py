# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Runs a shell on a pseudo-terminal: types, reads output, and inspects terminal settings."""

import fcntl
import os
import pty
import re
import select
import signal
import struct
import termios
from contextlib import suppress

from ros_harness import wait_for

HELD = termios.ICANON | termios.ECHO


def held(terminal):
    """Returns whether line mode and echo are on, as a shell leaves a terminal."""
    return termios.tcgetattr(terminal)[3] & HELD == HELD


class Shell:
    """A shell on its own terminal, which outlives the programs that it runs."""

    def __init__(self, *arguments):
        self.said = b''
        self._pid, self.terminal = pty.fork()
        if self._pid == 0:
            os.execv('/bin/sh', ('sh', *arguments))
        size = struct.pack('4H', 24, 120, 0, 0)
        fcntl.ioctl(self.terminal, termios.TIOCSWINSZ, size)

    def __enter__(self):
        return self

    def __exit__(self, *error):
        os.kill(self._pid, signal.SIGKILL)
        os.waitpid(self._pid, 0)
        os.close(self.terminal)

    def says(self, words):
        with suppress(OSError):  # EIO: the last program has ended, and all it said has been read
            while select.select([self.terminal], [], [], 0)[0]:
                self.said += os.read(self.terminal, 1000)
        return re.search(words, self.said, re.DOTALL)

    def sees(self, words):
        # Words that have been seen are dropped, so that they are not seen again.
        try:
            wait_for(lambda: self.says(words))
        except AssertionError:
            raise AssertionError(f'{words} is not in {self.said}') from None
        found = self.says(words)
        self.said = self.said[found.end() :]
        return found

    def send(self, data):
        os.write(self.terminal, data)
