# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The real linkage_replay as a process; a subscriber in this process compares bytes and times."""

import os
import re
import shlex
import signal
import struct
import time
from bisect import bisect
from itertools import pairwise
from threading import Event

import pytest
from joint_codec import JointStateCodec
from ros_harness import (
    PATIENCE,
    Listener,
    assert_refused,
    command,
    environment,
    fresh_domain,
    unbroken,
    wait_for,
    watched,
)
from shell_harness import Shell, held
from state_messages import messages_at
from test_hostile import little_memory

from linkage_ros import ViewerError
from linkage_ros.log.reader import LogReader
from linkage_ros.log.writer import LogWriter
from linkage_ros.messages.topics import DRIVING_TORQUE, JOINT_COMMANDS, JOINT_STATES, qualified
from linkage_ros.node import republish
from linkage_ros.programs import replay
from linkage_ros.programs.player import excerpt_of, feed
from linkage_ros.programs.record import record
from linkage_ros.programs.replay import showing
from linkage_ros.run.states import Simulator
from linkage_ros.settings.configuration import configure, load, read_values
from linkage_ros.view import rerun_connection
from linkage_ros.view.viewer_process import free_address

STATES, TORQUE, DESCRIPTION = '/joint_states', '/driving_torque', '/robot_description'
COMMANDS = '/effort_controller/commands'
MS = 10**6
TYPES = {
    STATES: 'sensor_msgs/msg/JointState',
    TORQUE: 'std_msgs/msg/Float64',
    DESCRIPTION: 'std_msgs/msg/String',
    COMMANDS: 'std_msgs/msg/Float64MultiArray',
    '/clock': 'rosgraph_msgs/msg/Clock',
}


@pytest.fixture(scope='module')
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp('log') / 'run.mcap'
    given = {**read_values('quadrilateral'), 'rpm': 60.0, 'effort_command_topic': COMMANDS}
    record(configure(given), path, duration=2.0)
    return path


def stored(path, topic, start=0, end=None):
    log = LogReader(path)
    return [message.data for message in log.messages([topic], start, end)]


def played(log, *options):
    """Plays to a listener, again if a busy machine did not discover it in time."""
    for delay in (0.2, 2.0, 8.0):
        with watched(TYPES, log, '--delay', delay, *options, program='replay') as (
            listener,
            process,
        ):
            out, err = process.communicate(timeout=PATIENCE)
            quiet(listener)  # to hear what was sent too much
        assert process.returncode == 0, err
        assert 'messages replayed' in out
        if 'no subscribers yet' not in err:
            break
    assert err == ''
    return listener


def await_all(received, due):
    """Asserts that exactly the messages that are due arrive."""
    wait_for(lambda: len(received) >= len(due))
    assert received == due


def assert_pace(times, period):
    """Asserts that messages were sent a period, s, apart, except where the replay was late."""
    # It catches up with at most 0.1 s.
    assert times[-1] - times[0] > (len(times) - 1) * period - 0.1
    assert min(late - early for early, late in zip(times, times[5:], strict=False)) < 9 * period


def clock_times(listener):
    """Returns the received clock times, ns."""
    stamps = [struct.unpack('<4xiI', data) for data in listener.received['/clock']]
    return [seconds * 10**9 + nanoseconds for seconds, nanoseconds in stamps]


# ---------------------------------------------------------------- bytes and times


def test_messages_are_replayed_byte_for_byte_at_their_times_with_a_clock(log):
    listener = played(log, '--rate', 0.5, '--playback-duration', 0.6, '--clock', 50)
    for topic in (STATES, TORQUE, DESCRIPTION, COMMANDS):
        await_all(listener.received[topic], stored(log, topic, end=600 * MS))
    wait_for(lambda: clock_times(listener)[-1] == 595 * MS)  # the end of the log
    times = listener.sent[STATES]
    assert_pace(times, 0.005 / 0.5)
    clock = clock_times(listener)
    assert clock == sorted(clock)
    assert clock[0] == 0  # published before the start
    assert_pace(listener.sent['/clock'], 1 / 50)
    # The time is read between two messages of the clock: it is not before the last state sent
    # until then, and not after the next one.
    counts = [bisect(times, moment) for moment in listener.sent['/clock']]
    for (before, after), stamp in zip(pairwise(counts), clock[1:], strict=True):
        assert 5 * MS * (before - 1) <= stamp <= 5 * MS * after


def test_loop_repeats_the_bytes_and_its_clock_never_goes_back(log):
    options = '--loop', '--start-offset', 1, '--playback-duration', 0.25, '--clock', 100
    with watched(TYPES, log, *options, program='replay') as (listener, process):
        listener.await_more(160)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0
    assert not err or 'no subscribers yet' in err  # if discovery is slow
    heard = listener.received[STATES]
    assert unbroken(heard, 400 * stored(log, STATES, 10**9, 1_250_000_000))
    assert len(listener.received[DESCRIPTION]) == 1
    count = int(re.search(r'(\d+) messages replayed', out)[1])
    assert count >= len(heard) + len(listener.received[TORQUE])
    wait_for(lambda: clock_times(listener)[-1] >= 10**9 + 5 * MS * (len(heard) - 1))
    clock = clock_times(listener)
    assert clock == sorted(clock)
    assert clock[0] >= 10**9


# ---------------------------------------------------------------- keys


@pytest.fixture
def player(log):
    """Starts replays in a terminal; returns terminal and listener."""
    domain = fresh_domain()

    def start(*options):
        words = shlex.join(command('replay', log, *options))
        settings = environment(domain)
        names = ('ROS_DOMAIN_ID', 'ROS_AUTOMATIC_DISCOVERY_RANGE')
        values = ' '.join(f'{name}={settings[name]}' for name in names)
        return Shell('-c', f'trap : INT TERM; {values} {words}; echo ended $?; sleep 60')

    with Listener(domain, TYPES) as listener:
        yield start, listener


def quiet(listener, seconds=0.3):
    """Waits until no states have arrived for some time; returns their number."""
    before = -1
    while before != (before := len(listener.received[STATES])):
        time.sleep(seconds)
    return before


def test_a_replay_that_waits_for_a_key_says_so_without_its_status_line(log, tmp_path):
    words = shlex.join(command('replay', log, '--start-paused', '--no-ros', '--viewer', 'x.rrd'))
    with Shell('-c', f'cd {tmp_path}; exec {words} 2>errors') as shell:
        shell.sees(rb'press the space bar')
        shell.send(b' ')
        shell.sees(rb'messages replayed')


def test_keys_pause_step_change_the_rate_and_resume(log, player):
    start, listener = player
    options = '--start-paused', '--delay', 0.1, '--clock', '--loop', '--rate', 0.5
    with start(*options) as shell:
        shell.sees(
            rb'waiting for subscribers.*begins in 0\.1 s.*0\.000/1\.995 s, rate 0\.5, paused'
        )
        assert not held(shell.terminal)
        wait_for(lambda: len(clock_times(listener)) > 10)
        assert not listener.received[STATES]
        assert set(clock_times(listener)) == {0}  # published while paused
        for count in (1, 2, 3):
            shell.send(b'\x1b[C')
            wait_for(lambda count=count: len(listener.received[STATES]) == count)
        assert quiet(listener) == 3
        assert len(listener.received[TORQUE]) == 3  # a step plays all messages of one log time
        wait_for(lambda: clock_times(listener)[-1] == 10_000_000)
        shell.sees(rb'0\.010/1\.995 s, rate 0\.5, paused')
        shell.send(3 * b'\x1b[B' + b'\x1b[A')
        shell.sees(rb'rate 0\.2, paused.*rate 0\.3, paused')
        shell.send(b' ')
        shell.sees(rb'rate 0\.3\s')
        wait_for(lambda: len(listener.received[STATES]) > 60)
        shell.send(b'\x1b[C')  # no effect while not paused
        shell.send(b' ')
        shell.sees(rb'rate 0\.3, paused')
        assert_pace(listener.sent[STATES][3:60], 0.005 / 0.3)
        # The clock stands.
        wait_for(lambda: len(set(clock_times(listener)[-20:])) == 1)
        stood = quiet(listener)
        shell.send(9 * b'\x1b[A' + b' ')
        shell.sees(rb'rate 1\.2\s')
        wait_for(lambda: len(listener.received[STATES]) > stood)
        shell.send(b'\x03')
        shell.sees(rb'messages replayed.*ended 0')
        assert held(shell.terminal)
    for topic in (STATES, TORQUE):
        assert unbroken(listener.received[topic], 400 * stored(log, topic)), topic
        assert listener.received[topic][0] == stored(log, topic)[0]
    assert listener.received[DESCRIPTION] == stored(log, DESCRIPTION)
    assert clock_times(listener) == sorted(clock_times(listener))


# ---------------------------------------------------------------- view


class View:
    """Replaces the view: stores its input, or fails."""

    dropped, period, trouble, page = 0, 0.03, '', ''

    def __init__(self):
        self.shown, self.fails = [], False

    def consume(self, samples):
        if samples and self.fails:
            raise ViewerError('no window could be opened')
        self.shown.extend(samples)

    def close(self):
        pass


@pytest.fixture
def view(monkeypatch):
    view = View()
    monkeypatch.setattr(rerun_connection, 'View', lambda *_, read, **__: view)
    return view


def shown(log, until):
    """Shows a loop over 0.1 s of a log until a condition holds."""
    reader = LogReader(log)
    with (
        showing(reader, 'spawn', Event()) as sink,
        feed(reader, excerpt_of(reader, 0, 0.1, None), loop=True) as items,
    ):
        for count, item in enumerate(items):
            if until(count):
                break
            sink(item)
            time.sleep(0.001)


def test_view_of_a_loop_has_rising_stamps_and_what_it_missed_is_reported(log, view, capfd):
    view.dropped = 7
    shown(log, lambda _: len(view.shown) > 50)
    codec = JointStateCodec(('crank', 'coupler', 'rocker'))
    stamps = [shift + codec.decode(data)[0] for shift, data in view.shown]
    assert stamps == [n * 5_000_000 for n in range(len(stamps))]
    words = 'linkage_replay: 7 states not shown: the viewer lagged or ended\n'
    assert capfd.readouterr().err == words


@pytest.mark.parametrize(
    ('screen', 'browser', 'pages'), [(':0', True, ['http://x']), ('', True, []), (':0', False, [])]
)
def test_page_is_opened_in_a_browser_if_there_is_a_screen(
    log, view, monkeypatch, screen, browser, pages
):
    opened, view.page = [], 'http://x'
    monkeypatch.setattr('webbrowser.open', opened.append)
    for name in ('WAYLAND_DISPLAY', 'WAYLAND_SOCKET'):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv('DISPLAY', screen)
    with showing(LogReader(log), 'web', Event(), browser=browser):
        pass
    assert opened == pages


def test_replay_of_a_page_starts_when_one_connects_or_ends_with_ctrl_c(log, view):
    view.page, answers = 'http://x', iter([False, False, True])
    view.is_watched = lambda: next(answers)
    with showing(LogReader(log), 'web', Event(), loop=True):
        assert list(answers) == []
    view.is_watched, stop = lambda: False, Event()
    stop.set()
    with showing(LogReader(log), 'web', stop, loop=True):
        pass


def test_failed_view_ends_the_replay(log, view):
    view.fails = True
    with pytest.raises(ViewerError, match='the view ended: no window could be opened'):
        shown(log, lambda count: count > 300)


def test_commands_in_a_log_are_not_shown(called, tmp_path):
    configuration, path = load('quadrilateral'), tmp_path / 'run.mcap'
    simulator = Simulator(configuration.only)
    motion = simulator.begin(0)
    command_ = JointStateCodec(('crank',)).encode(0, (0.0,), (0.0,), (1.0,))
    with LogWriter(path, configuration, overwrite=False) as log:
        states, commands = (
            log.add_topic(topic, qualified(topic)) for topic in (JOINT_STATES, JOINT_COMMANDS)
        )
        log.write_motion(motion.segment)
        for stamp in range(0, 50_000_000, 5_000_000):
            log.write(commands, stamp, command_)
            log.write(states, stamp, messages_at(simulator, motion, stamp).messages[0])
    code, out, err = called(replay, path, '--no-ros', '--viewer', tmp_path / 'run.rrd')
    assert (code, err) == (0, '')
    assert '20 messages replayed' in out


def test_memory_does_not_grow_with_the_log(tmp_path):
    path = tmp_path / 'long.mcap'
    record(configure({'rate_hz': 1000.0}), path, duration=20.0)  # in Python more than 7 MB
    # A chunk of 1 MB, and its decoded messages.
    with little_memory(5.5e6):
        log = LogReader(path)
        excerpt = excerpt_of(log, 0, None, [qualified(JOINT_STATES)])
        with feed(log, excerpt, loop=False) as items:
            assert sum(1 for _ in items) == 20_000


# ---------------------------------------------------------------- refusals


@pytest.mark.parametrize(
    ('options', 'words'),
    [
        (['--rate', '0'], "--rate: '0': must be a number from 0.001 to 1e\\+06; see linkage_re"),
        (['--start-offset', '3'], r'--start-offset = 3\.0: must be a number from 0 to 1\.995 s'),
        (['--playback-duration', '0'], "--playback-duration: '0': must be a number from 1e-09 to"),
        (['--clock', '1e4'], "--clock: '1e4': must be a number from 0.01 to 1000 Hz; see"),
        (['--topics', '/nope'], '--topics /nope: the log has /joint_states, /driving_torque'),
        (['--no-ros'], '--no-ros leaves nothing to do'),
        (['--no-ros', '--viewer', 'spawn', '--clock'], '--clock publishes a topic, so it'),
        (['--no-ros', '--viewer', 'nonsense'], 'nonsense'),
        (['--no-open'], '--no-open is for a page in a browser: give --viewer web'),
        (['--start-paused'], '--start-paused needs a terminal'),
        (['another.mcap'], 'unrecognized arguments: another'),
        (
            ['\x1b[31m\u202e', 'a\nb', '\udcff' * 3000],
            r'unrecognized arguments: .x1b\[31m.u202e a',
        ),
        (['--ros-args', '-p', 'x'], 'override rule'),
        (['--ros-args', '-p', 'rate:=2.0'], "'rate' is not a parameter of linkage_replay"),
    ],
)
def test_bad_options_are_one_line_and_code_2(log, called, monkeypatch, options, words):
    monkeypatch.setattr(os, 'isatty', lambda _: False)
    assert_refused(*called(replay, log, *options), words)


def test_absent_viewer_is_one_line_before_the_replay(log, called, monkeypatch):
    monkeypatch.setattr(rerun_connection, '_ANSWER_SECONDS', 0.1)
    url = f'rerun+http://127.0.0.1:{free_address("127.0.0.1")[1]}/proxy'
    words = f'no viewer answers at {re.escape(url)}: start one there first with `rerun`'
    assert_refused(*called(replay, log, '--no-ros', '--viewer', url), words)


def test_message_that_cannot_be_published_is_one_line(called, monkeypatch, tmp_path):
    monkeypatch.setattr(republish, '_DISCOVERY_SECONDS', 0.0)
    configuration, path = load('quadrilateral'), tmp_path / 'run.mcap'
    with LogWriter(path, configuration, overwrite=False) as log:
        channel = log.add_topic(DRIVING_TORQUE, '/driving_torque')
        log.write_motion(Simulator(configuration.only).begin(0).segment)
        log.write(channel, 0, b'none' * 20)
    code, _, err = called(replay, path)
    assert code == 2
    assert 'a message on /driving_torque does not match the type of the topic' in err
    assert 'Traceback' not in err
