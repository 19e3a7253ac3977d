# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The real linkage_replay as a process; a subscriber in this one compares bytes and times."""

from __future__ import annotations

import re
import signal
import statistics
import subprocess
from itertools import pairwise

import pytest
from ros_harness import Listener, command, environment, fresh_domain, running, wait_for

from linkage_ros.configuration import configure
from linkage_ros.log_reader import LogReader
from linkage_ros.record import record

TYPES = {
    '/joint_states': 'sensor_msgs/msg/JointState',
    '/driving_torque': 'std_msgs/msg/Float64',
    '/robot_description': 'std_msgs/msg/String',
}


@pytest.fixture(scope='module')
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp('log') / 'run.mcap'
    record(configure({'rpm': 60.0}), path, duration=2.0)
    return path


def stored(path, topic, start=0):
    with LogReader(path) as log:
        return [message.data for message in log.messages([topic], start)]


def played(log, *options):
    domain = fresh_domain()
    with (
        Listener(domain, TYPES) as listener,
        running('replay', log, '--delay', 2.0, *options, domain=domain) as process,
    ):
        out, err = process.communicate(timeout=60)
        assert process.returncode == 0, err
        assert 'messages replayed' in out
        assert err == ''
    return listener


def test_every_message_comes_again_byte_for_byte_and_in_its_rhythm(log):
    listener = played(log)
    for topic in TYPES:
        assert listener.received[topic] == stored(log, topic), topic
    times = listener.arrived['/joint_states']
    assert times[-1] - times[0] == pytest.approx(1.995, abs=0.05)
    gaps = [later - earlier for earlier, later in pairwise(times)]
    assert statistics.median(gaps) == pytest.approx(0.005, abs=0.001)


def test_a_subscriber_that_was_there_first_misses_nothing(log):
    domain = fresh_domain()
    with Listener(domain, TYPES) as listener, running('replay', log, domain=domain) as process:
        _, err = process.communicate(timeout=60)
    assert process.returncode == 0, err
    for topic in TYPES:
        assert listener.received[topic] == stored(log, topic), topic


def test_rate_stretches_time(log):
    times = played(log, '--rate', 4).arrived['/joint_states']
    assert times[-1] - times[0] == pytest.approx(1.995 / 4, abs=0.05)


def test_an_offset_leaves_out_the_beginning_but_not_the_description(log):
    listener = played(log, '--start-offset', 1.5)
    late = stored(log, '/joint_states', 1_500_000_000)
    assert listener.received['/joint_states'] == late
    assert len(late) == 100
    assert listener.received['/robot_description'] == stored(log, '/robot_description')


def test_only_the_topics_asked_for_are_played(log):
    listener = played(log, '--topics', '/driving_torque', '--rate', 10)
    assert listener.received['/driving_torque'] == stored(log, '/driving_torque')
    assert not listener.received['/joint_states']
    assert not listener.received['/robot_description']


def test_ctrl_c_ends_it_at_once_without_a_traceback(log):
    domain = fresh_domain()
    with (
        Listener(domain, TYPES) as listener,
        running('replay', log, '--rate', 0.01, domain=domain) as process,
    ):
        wait_for(lambda: listener.received['/robot_description'])
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=10)
    assert 'Traceback' not in err
    assert process.returncode == 0


def run(*arguments):
    return subprocess.run(
        command('replay', *arguments),
        env=environment(fresh_domain()),
        capture_output=True,
        text=True,
        timeout=60,
    )


@pytest.mark.parametrize(
    ('options', 'words'),
    [
        (['--rate', '0'], r'--rate 0: must be a number from 0\.001'),
        (['--rate', 'nan'], '--rate nan: must be'),
        (['--start-offset', '3'], r'--start-offset 3: must be from 0 to the log.s 1\.995 s'),
        (['--start-offset', '-1'], '--start-offset -1'),
        (['--topics', '/nope'], '--topics /nope: the log has /joint_states, /driving_torque'),
        (['--no-ros'], '--no-ros leaves nothing to do'),
        (['--viewer', 'nonsense', '--no-ros'], 'nonsense'),
        (['--delay', '-1'], '--delay -1'),
        (['--ros-args', '-p', 'x'], 'override rule'),
    ],
)
def test_bad_options_are_one_line_and_code_2(log, options, words):
    result = run(log, *options)
    assert result.returncode == 2
    assert re.fullmatch(rf'linkage_replay: [^\n]*{words}[^\n]*\n', result.stderr), result.stderr


def test_what_is_no_log_is_refused_with_one_line(log, tmp_path):
    text = tmp_path / 'text.mcap'
    text.write_text('no log')
    cut = tmp_path / 'cut.mcap'
    cut.write_bytes(log.read_bytes()[:5000])
    words = 'no readable MCAP', 'not complete: its run was killed', 'No such file', 'directory'
    for path, reason in zip((text, cut, tmp_path / 'missing.mcap', tmp_path), words, strict=True):
        result = run(path, '--no-ros', '--viewer', tmp_path / 'x.rrd')
        assert result.returncode == 2
        assert re.fullmatch(rf'linkage_replay: {path}[^\n]+\n', result.stderr), result.stderr
        assert reason in result.stderr
