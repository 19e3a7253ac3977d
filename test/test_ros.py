# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Behaviour that all executables with rclpy share."""

import os
import shlex
import signal
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress

import pytest
import rclpy
from rclpy.context import Context
from rclpy.node import Node
from ros_harness import (
    PATIENCE,
    Listener,
    command,
    finished,
    fresh_domain,
    logged,
    node_arguments,
    running,
    verified,
    wait_for,
)

from linkage_ros.log.recover import recover
from linkage_ros.node.process import full_name

STATES = '/joint_states'

STUCK = """
import rclpy
from rclpy.node import Node
from linkage_ros.node import process

process._DESTROY_SECONDS = 0.5
rclpy.init()

class Stuck(Node):
    def destroy_node(self):
        ''.join('' for _ in range({turns}))  # holds the interpreter for ever, or not at all
        super().destroy_node()

with process.spinning(Stuck('stuck')):
    print('all is logged', flush=True)
rclpy.try_shutdown()
"""


@pytest.mark.parametrize(('turns', 'code'), [('10**15', 1), ('10', 0)])
def test_node_that_hangs_at_its_end_exits_with_code_1(turns, code):
    done = finished(STUCK.format(turns=turns))
    assert done.returncode == code, done.stderr
    assert done.stdout == 'all is logged\n'
    assert done.stderr == ''


@pytest.mark.parametrize(('module', 'code', 'words'), [('rclpy', 3, ''), ('json', 4, 'the end\n')])
def test_ros_process_exits_without_python_clean_up(module, code, words):
    program = f"""
import atexit, sys, {module}
from linkage_ros import cli
atexit.register(print, 'the end')
sys.exit(cli.leave({code}))
"""
    done = finished([sys.executable, '-c', program])
    assert (done.returncode, done.stdout) == (code, words)


@contextmanager
def running_node(path, redirection='', **options):
    """Starts a node with a log; ends it after 20 of its states have been received."""
    domain = fresh_domain()
    node = f'exec {shlex.join(command("node", *node_arguments(log=path)))} {redirection}'
    with (
        Listener(domain, {STATES: 'sensor_msgs/msg/JointState'}) as listener,
        running(['sh', '-c', node], domain=domain, **options) as process,
    ):
        wait_for(lambda: len(listener.received[STATES]) > 20)
        yield process
        process.send_signal(signal.SIGINT)
        assert process.wait(PATIENCE) == 0
    _, messages = logged(path)
    assert len(messages[STATES]) >= len(listener.received[STATES])


def filled_pipe():
    """Returns both ends of a full pipe."""
    outlet, inlet = os.pipe()
    os.set_blocking(inlet, False)
    with suppress(BlockingIOError):
        while True:
            os.write(inlet, b'.')
    os.set_blocking(inlet, True)
    return outlet, inlet


def read_from_now_on(outlet):
    """Reads a pipe to its end; returns the data without the leading filler bytes."""
    with os.fdopen(outlet, 'rb') as file:
        return file.read().lstrip(b'.').decode()


@pytest.mark.parametrize('is_read', [False, True], ids=['by nobody', 'late'])
def test_unread_stderr_does_not_block_the_node(tmp_path, is_read):
    outlet, inlet = filled_pipe()
    with ThreadPoolExecutor(1) as pool:
        with running_node(tmp_path / 'run.mcap', stderr=inlet):
            os.close(inlet)
            said = pool.submit(read_from_now_on, outlet) if is_read else None
        if said:
            first, *_, last = said.result(PATIENCE).splitlines()
            assert 'no mechanism given' in first
            assert ' states, ' in last


def test_repeated_signals_end_the_node_in_order(tmp_path):
    with running_node(tmp_path / 'run.mcap') as node:
        while node.poll() is None:
            node.send_signal(signal.SIGINT)
            time.sleep(0.001)
        assert ' states, ' in node.stderr.read()


HANGING = """
import sys, threading
from linkage_ros import cli
from linkage_ros.node import linkage_node as node
from linkage_ros.node import outputs
from {module} import {kind} as Hanging

outputs._LOG_CLOSE_SECONDS = 1e6  # so that only the second signal ends it

act, calls = Hanging.{method}, iter(range({calls}))

def hang(self, *arguments):
    if next(calls, None) is None:
        print('hangs', flush=True)
        threading.Event().wait()
    return act(self, *arguments)

Hanging.{method} = hang
sys.exit(cli.leave(cli.run('linkage_node', node.main)))
"""


@pytest.mark.parametrize(
    ('module', 'kind', 'method', 'calls', 'words'),
    [
        ('linkage_ros.run.states', 'Simulator', 'state', 100, 'a tick hangs'),
        ('linkage_ros.log.disk', 'LogFile', 'flush', 20, 'the disk hangs'),
    ],
)
def test_a_second_signal_ends_a_node_that_hangs_and_keeps_its_log(
    tmp_path, module, kind, method, calls, words
):
    path, saved = tmp_path / 'run.mcap', tmp_path / 'saved.mcap'
    code = HANGING.format(module=module, kind=kind, method=method, calls=calls)
    with running(code, *node_arguments(log=path), domain=fresh_domain()) as node:
        assert node.stdout.readline() == 'hangs\n'
        size, signals = path.stat().st_size, []
        # A second signal that comes before the first is handled has no effect.
        wait_for(
            lambda: node.poll() is not None or signals.append(node.send_signal(signal.SIGINT)),
            pause=1.5,
        )
        assert len(signals) >= 2
        assert node.returncode == 1
        assert words in node.stderr.read()
    assert path.stat().st_size >= size
    if kind == 'Simulator':
        assert verified(path).states == 100
    else:
        assert recover(path, saved).messages > 0


NAMES = [
    '-r __ns:=/a -r __ns:=/b',
    '-r linkage_node:__ns:=/a -r __node:=x -r linkage_node:__node:=y',
    '-r other:__node:=x -r __name:=y --remap y:__ns:=/a/b',
    '-r __node:=x -r linkage_node:__ns:=/a',
]


@pytest.mark.parametrize('rules', NAMES)
def test_a_node_is_renamed_as_by_rcl(rules):
    context, arguments = Context(), ['--ros-args', *rules.split()]
    rclpy.init(args=arguments, context=context, domain_id=fresh_domain())
    node = Node('linkage_node', context=context)
    assert full_name(arguments, 'linkage_node') == node.get_fully_qualified_name()
    node.destroy_node()
    context.shutdown()


ELSEWHERE = """
import signal, threading, time
from linkage_ros.cli import Stop
stop = Stop()

def raise_here():
    time.sleep(0.3)
    signal.pthread_kill(threading.get_ident(), signal.SIGINT)
    time.sleep(600)

threading.Thread(target=raise_here, daemon=True).start()
print(stop.wait())
"""


def test_a_signal_that_another_thread_receives_ends_the_wait():
    """Linux may deliver the signal in this way while a process is being stopped."""
    done = finished(ELSEWHERE)
    assert done.stdout == 'True\n', done.stderr


@pytest.mark.parametrize('closed', ['2>&-', '>&-', '>&- 2>&-'])
def test_a_program_without_stderr_or_stdout_does_its_work(tmp_path, closed):
    with running_node(tmp_path / 'run.mcap', closed):
        pass
