# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Keys from a pseudo-terminal, and the state of the terminal after every kind of exit."""

import os
import select
import signal
import sys
import time
from pathlib import Path

import pytest
from ros_harness import wait_for
from shell_harness import Shell, held

from linkage_ros.programs.keyboard import DOWN, RIGHT, SPACE, UP, Keyboard

PROGRAM = """
import os
from linkage_ros.programs.keyboard import Keyboard
with Keyboard() as keyboard:
    print('ready', os.getpid(), flush=True)
    while True:
        key = keyboard.read(0.2)
        if key:
            print('got', key, flush=True)
        if key == b' ':
            1 / 0
"""


@pytest.fixture
def terminal():
    """Opens a pseudo-terminal; returns (master, slave)."""
    ends = os.openpty()
    yield ends
    for end in ends:
        os.close(end)


def pressed(keyboard):
    """Waits for a key, which the terminal may pass on late and in pieces."""
    keys = []
    wait_for(lambda: keys.append(keyboard.read(1.0)) or keys[-1])
    return keys[-1]


def test_keys_are_read_singly_and_not_echoed(terminal):
    master, slave = terminal
    with Keyboard(slave) as keyboard:
        assert not held(slave)
        os.write(master, b' x\x1b[A\x1bOB\x1b[C\x1b[D\n ')
        keys = [pressed(keyboard) for _ in range(5)]
        assert keys == [SPACE, UP, DOWN, RIGHT, SPACE]
        assert keyboard.read(0.01) is None
        assert not select.select([master], [], [], 0.01)[0]  # no echo
    assert held(slave)


def test_cursor_key_may_arrive_in_pieces(terminal):
    master, slave = terminal
    with Keyboard(slave) as keyboard:
        for piece in (b'\x1b', b'['):
            os.write(master, piece)
            assert keyboard.read(0.05) is None
        os.write(master, b'C')
        assert pressed(keyboard) == RIGHT
        os.write(master, b'\x1b')  # the escape key alone does not hide the next key
        assert keyboard.read(0.05) is None
        os.write(master, b' ')
        assert pressed(keyboard) == SPACE


def test_without_a_terminal_it_waits_and_reads_nothing(tmp_path):
    path = tmp_path / 'file'
    path.write_text(' ')
    with path.open() as file, Keyboard(file.fileno()) as keyboard:
        begin = time.monotonic()
        assert keyboard.read(0.05) is None
        assert time.monotonic() - begin > 0.04
        assert file.read() == ' '


@pytest.fixture
def program(tmp_path):
    """Returns the command line of PROGRAM."""
    path = tmp_path / 'program.py'
    path.write_text(PROGRAM)
    return f'PYTHONPATH={Path(__file__).resolve().parents[1]} {sys.executable} {path}'


@pytest.mark.parametrize(
    ('key', 'code', 'back'),
    [
        (b' ', 1, True), (b'\x03', 130, True), (signal.SIGKILL, 137, False),
    ],
    ids=['exception', 'interrupt', 'kill'],
)  # fmt: skip
def test_every_end_but_a_kill_restores_the_terminal(program, key, code, back):
    run = f'trap : INT QUIT HUP; {program}; echo ended $?; sleep 600'
    with Shell('-c', run) as shell:
        number = int(shell.sees(rb'ready (\d+)\s')[1])
        assert not held(shell.terminal)
        shell.send(key) if isinstance(key, bytes) else os.kill(number, key)
        assert int(shell.sees(rb'ended (\d+)')[1]) == code
        assert held(shell.terminal) == back


def test_restored_terminal_is_prepared_again_without_a_signal(terminal, monkeypatch):
    """As after `fg` of a background job in a shell, once the shell has read that line."""
    master, slave = terminal
    with Keyboard(slave) as keyboard:
        keyboard._restore()
        assert held(slave)
        os.set_blocking(slave, False)  # an empty read would block
        answers, wait = iter([([slave], [], [])]), select.select
        monkeypatch.setattr(select, 'select', lambda *a: next(answers, None) or wait(*a))
        assert keyboard.read(1.0) is None
        assert not held(slave)
        os.write(master, b' ')
        assert pressed(keyboard) == SPACE
        assert not held(slave)
    assert held(slave)


def test_stopped_program_restores_the_terminal_and_takes_it_again(program):
    with Shell('-i') as shell:
        shell.send(f'{program}\n'.encode())
        shell.sees(rb'ready')
        wait_for(lambda: not held(shell.terminal))
        shell.send(b'\x1a')
        shell.sees(rb'Stopped')
        assert held(shell.terminal)
        shell.send(b'bg\n')  # in the background it must not touch the terminal
        shell.send(b'sleep 0.3; jobs; echo li"st"ed\n')
        shell.sees(rb'Running.*listed')
        assert held(shell.terminal)
        shell.send(b'fg\n')
        wait_for(lambda: not held(shell.terminal))
        shell.send(b'\x1b[A')
        shell.sees(rb'got')
        shell.send(b'\x03')
        wait_for(lambda: held(shell.terminal))
