# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What every executable does alike with rclpy."""

import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress

import pytest
from ros_harness import Listener, command, environment, fresh_domain, node_arguments, wait_for
from test_node import TYPES, logged

STUCK = """
import rclpy
from rclpy.node import Node
from linkage_ros.ros import process

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
def test_a_node_that_never_ends_is_ended(turns, code):
    done = subprocess.run(
        [sys.executable, '-c', STUCK.format(turns=turns)], env=environment(fresh_domain()),
        capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert done.returncode == code, done.stderr
    assert done.stdout == 'all is logged\n'
    assert done.stderr == ''


@pytest.mark.parametrize(('module', 'code', 'words'), [('rclpy', 3, ''), ('json', 4, 'the end\n')])
def test_a_process_of_ros_leaves_before_python_takes_it_apart(module, code, words):
    program = f"""
import atexit, sys, {module}
from linkage_ros import cli
atexit.register(print, 'the end')
sys.exit(cli.leave({code}))
"""
    done = subprocess.run(
        [sys.executable, '-c', program], capture_output=True, text=True, timeout=60, check=False
    )
    assert (done.returncode, done.stdout) == (code, words)


def filled_pipe():
    """A pipe that takes no byte more."""
    outlet, inlet = os.pipe()
    os.set_blocking(inlet, False)
    with suppress(BlockingIOError):
        while True:
            os.write(inlet, b'.')
    os.set_blocking(inlet, True)
    return outlet, inlet


def read_from_now_on(outlet):
    """Reads a pipe to its end in a thread; what was found after what filled it."""

    def read():
        with os.fdopen(outlet, 'rb') as file:
            return file.read().lstrip(b'.').decode()

    return ThreadPoolExecutor(1).submit(read)


@pytest.mark.parametrize('read', [False, True], ids=['by nobody', 'late'])
def test_stderr_that_is_not_read_holds_nothing_up(tmp_path, read):
    path, domain = tmp_path / 'run.mcap', fresh_domain()
    outlet, inlet = filled_pipe()
    with Listener(domain, {'/joint_states': TYPES['/joint_states']}) as listener:
        node = subprocess.Popen(
            command('node', *node_arguments(log=path)), env=environment(domain), stderr=inlet
        )
        os.close(inlet)
        try:
            wait_for(lambda: len(listener.received['/joint_states']) > 50)
            said = read_from_now_on(outlet) if read else None
            node.send_signal(signal.SIGINT)
            assert node.wait(30) == 0
        finally:
            node.kill()
            node.wait()
    _, messages = logged(path)
    assert len(messages['/joint_states']) >= len(listener.received['/joint_states'])
    if said is not None:
        first, last = said.result(30).splitlines()
        assert 'no mechanism given' in first
        assert ' states published, ' in last
    else:
        os.close(outlet)


def test_who_asks_for_the_end_many_times_gets_it_in_order(tmp_path):
    path, domain = tmp_path / 'run.mcap', fresh_domain()
    node = subprocess.Popen(
        command('node', *node_arguments(log=path)),
        env=environment(domain), stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        assert 'no mechanism given' in node.stderr.readline()
        while node.poll() is None:
            node.send_signal(signal.SIGINT)
            time.sleep(0.001)
        assert ' states published, ' in node.stderr.read()
        assert node.returncode == 0
    finally:
        node.kill()
        node.communicate()


def test_an_error_that_nobody_reads_ends_the_program_as_well():
    outlet, inlet = filled_pipe()
    done = subprocess.run(
        command('node', *node_arguments(rate_hz=-1.0)), env=environment(fresh_domain()),
        stderr=inlet, timeout=60, check=False,
    )  # fmt: skip
    os.close(inlet)
    os.close(outlet)
    assert done.returncode == 2


@pytest.mark.parametrize('closed', ['2>&-', '>&-'])
def test_a_program_without_stderr_or_stdout_does_its_work(tmp_path, closed):
    path, domain = tmp_path / 'run.mcap', fresh_domain()
    words = ' '.join(command('node', *node_arguments(log=path)))
    with Listener(domain, {'/joint_states': TYPES['/joint_states']}) as listener:
        node = subprocess.Popen(['sh', '-c', f'exec {words} {closed}'], env=environment(domain))
        try:
            wait_for(lambda: len(listener.received['/joint_states']) > 20)
            node.send_signal(signal.SIGINT)
            assert node.wait(30) == 0
        finally:
            node.kill()
            node.wait()
    _, messages = logged(path)
    assert len(messages['/joint_states']) >= len(listener.received['/joint_states'])
