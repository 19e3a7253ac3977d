# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is waited for is said on a terminal alone, and leaves nothing behind."""

import fcntl
import os
import struct
import sys
import termios
from contextlib import contextmanager
from pathlib import Path

from linkage_ros.progress import waiting


@contextmanager
def terminal():
    """While stderr is a terminal: what is written on it."""
    master, slave = os.openpty()

    def said():
        os.write(slave, b'\0')  # what is written comes through a while later, in order
        text = b''
        while not text.endswith(b'\0'):
            text += os.read(master, 10_000)
        return text[:-1].decode()

    fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack('4H', 24, 80, 0, 0))
    before = sys.stderr
    try:
        with Path(f'/dev/fd/{slave}').open('w', buffering=1) as sys.stderr:
            yield said
    finally:
        sys.stderr = before
        os.close(master)
        os.close(slave)


def lines(text):
    """As a terminal shows them in the end."""
    shown = []
    for line in text.split('\n'):
        row = ''
        for part in line.split('\r'):
            row = part + row[len(part) :]
        shown.append(row.rstrip())
    return shown


def test_what_is_waited_for_is_said_and_wiped_out():
    with terminal() as said:
        with waiting('looks for listeners'):
            during = said()
        assert lines(during) == ['looks for listeners']
        assert lines(during + said()) == ['']


def test_what_others_say_meanwhile_stands_alone():
    with terminal() as said:
        with waiting('looks'):
            print('nobody listens so far', file=sys.stderr)
        assert lines(said()) == ['nobody listens so far', '']


def test_without_a_terminal_nothing_is_said(capsys):
    with waiting('looks for listeners'):
        pass
    assert capsys.readouterr().err == ''
