# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The real linkage_replay as a process; a subscriber in this one compares bytes and times."""

from __future__ import annotations

import itertools
import os
import re
import shlex
import signal
import statistics
import struct
import subprocess
import time
from itertools import pairwise

import pytest
from mcap.writer import Writer
from ros_harness import Listener, command, environment, fresh_domain, running, wait_for
from shell_harness import Shell, held
from test_rerun_view import free_port
from test_rerun_view import running as viewing

from linkage_ros import ViewerError, replay
from linkage_ros.log.reader import LogReader
from linkage_ros.log.writer import LogWriter
from linkage_ros.parameters.configuration import configure, load
from linkage_ros.playback import replay_view
from linkage_ros.playback.excerpt import excerpt_of
from linkage_ros.playback.feed import feed
from linkage_ros.playback.replay_view import ReplayView
from linkage_ros.record import record
from linkage_ros.run.machine import Machine
from linkage_ros.wire.codecs import JointStateCodec, encode_float64
from linkage_ros.wire.topics import DRIVING_TORQUE, JOINT_COMMANDS, JOINT_STATES, qualified

STATES, TORQUE, DESCRIPTION = '/joint_states', '/driving_torque', '/robot_description'
TYPES = {
    STATES: 'sensor_msgs/msg/JointState',
    TORQUE: 'std_msgs/msg/Float64',
    DESCRIPTION: 'std_msgs/msg/String',
}
CLOCK = {'/clock': 'rosgraph_msgs/msg/Clock'}


@pytest.fixture(scope='module')
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp('log') / 'run.mcap'
    record(configure({'rpm': 60.0}), path, duration=2.0)
    return path


def stored(path, topic, start=0, end=None):
    with LogReader(path) as log:
        return [message.data for message in log.messages([topic], start, end)]


def played(log, *options):
    """Plays to a listener; again, where a busy machine did not let it be found in time."""
    for delay in (0.5, 2.0, 8.0):
        domain = fresh_domain()
        with (
            Listener(domain, TYPES) as listener,
            running('replay', log, '--delay', delay, *options, domain=domain) as process,
        ):
            out, err = process.communicate(timeout=60)
            assert process.returncode == 0, err
            assert 'messages replayed' in out
        if 'nobody listens so far' not in err:
            break
    assert err == ''
    return listener


def period(times, together=20):
    """Median time between messages, s; a busy machine lets some come together."""
    spans = [late - early for early, late in zip(times, times[together:], strict=False)]
    return statistics.median(spans) / together


def clock_times(listener):
    """ns"""
    stamps = [struct.unpack('<4xiI', data) for data in listener.received['/clock']]
    return [seconds * 10**9 + nanoseconds for seconds, nanoseconds in stamps]


# ---------------------------------------------------------------- bytes and times


@pytest.mark.parametrize('rate', [0.5, 1, 4])
def test_every_message_comes_again_byte_for_byte_and_in_its_rhythm(log, rate):
    length = min(2.0, rate)
    listener = played(log, '--rate', rate, '--playback-duration', length)
    for topic in TYPES:
        assert listener.received[topic] == stored(log, topic, end=round(length * 1e9)), topic
    times = listener.arrived[STATES]
    assert times[-1] - times[0] >= (length - 0.005) / rate - 0.1
    assert period(times) == pytest.approx(0.005 / rate, rel=0.3)
    # Deadlines are absolute: the second half is not later than the first.
    late = [at - times[0] - n * 0.005 / rate for n, at in enumerate(times)]
    half = len(late) // 2
    drift = statistics.median(late[half:]) - statistics.median(late[:half])
    assert abs(drift) < 0.05


def test_a_piece_of_the_log_is_played(log):
    listener = played(log, '--start-offset', 1.5, '--playback-duration', 0.25)
    piece = stored(log, STATES, 1_500_000_000, 1_750_000_000)
    assert listener.received[STATES] == piece
    assert len(piece) == 50
    assert listener.received[DESCRIPTION] == stored(log, DESCRIPTION)


def test_only_the_topics_asked_for_are_played(log):
    listener = played(log, '--topics', TORQUE, '--rate', 10)
    assert listener.received[TORQUE] == stored(log, TORQUE)
    assert not listener.received[STATES]
    assert not listener.received[DESCRIPTION]


def test_a_loop_goes_on_with_the_same_bytes_and_its_clock_never_goes_back(log):
    domain = fresh_domain()
    options = '--loop', '--start-offset', 1, '--playback-duration', 0.5, '--clock', 100
    with (
        Listener(domain, {**TYPES, **CLOCK}) as listener,
        running('replay', log, *options, domain=domain) as process,
    ):
        wait_for(lambda: len(listener.received[STATES]) > 250)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=10)
        assert process.returncode == 0
        assert not err or 'nobody listens so far' in err  # where discovery takes its time
    heard = listener.received[STATES]
    assert heard == (20 * stored(log, STATES, 10**9, 1_500_000_000))[: len(heard)]
    assert len(listener.received[DESCRIPTION]) == 1
    count = int(re.search(r'(\d+) messages replayed', out)[1])
    assert count >= len(heard) + len(listener.received[TORQUE])
    # No round waits for the one before to end, nor begins before.
    times = listener.arrived[STATES]
    assert times[-1] - times[0] >= 0.005 * (len(times) - 1) - 0.1
    clock = clock_times(listener)
    assert clock == sorted(clock)
    assert clock[0] >= 10**9
    last_state = 10**9 + 5_000_000 * (len(heard) - 1)
    assert abs(clock[-1] - last_state) <= 200_000_000


# ---------------------------------------------------------------- clock


def test_the_clock_tells_the_log_time_at_its_frequency(log):
    domain = fresh_domain()
    options = '--rate', 2, '--clock', 50, '--delay', 1
    with (
        Listener(domain, {**TYPES, **CLOCK}) as listener,
        running('replay', log, *options, domain=domain) as process,
    ):
        assert process.wait(60) == 0
    clock, arrived = clock_times(listener), listener.arrived['/clock']
    assert clock == sorted(clock)
    assert clock[0] == 0  # it stands before the start
    assert clock[-1] == 1_995_000_000  # and where the log ends
    assert period(arrived, 5) == pytest.approx(0.02, rel=0.5)
    steps = [later - earlier for earlier, later in pairwise(clock) if earlier > 0]
    assert statistics.median(steps) == pytest.approx(40_000_000, rel=0.5)
    # It tells the time of the messages: those that came last before it are as old.
    starts = listener.arrived[STATES]
    late = [
        moment - (starts[0] + stamp / 2e9)
        for stamp, moment in zip(clock, arrived, strict=True)
        if stamp
    ]
    assert abs(statistics.median(late)) < 0.1


def test_there_is_no_clock_unless_it_is_asked_for(log):
    domain = fresh_domain()
    with (
        Listener(domain, {**TYPES, **CLOCK}) as listener,
        running('replay', log, '--rate', 10, domain=domain) as process,
    ):
        assert process.wait(60) == 0
    assert listener.received[STATES]
    assert not listener.received['/clock']


# ---------------------------------------------------------------- keys


@pytest.fixture
def player(log):
    """Starts a replay in a terminal: (terminal, listener)."""
    domain = fresh_domain()

    def start(*options):
        words = shlex.join(command('replay', log, *options))
        settings = environment(domain)
        names = ('ROS_DOMAIN_ID', 'ROS_AUTOMATIC_DISCOVERY_RANGE')
        values = ' '.join(f'{name}={settings[name]}' for name in names)
        return Shell('-c', f'trap : INT TERM; {values} {words}; echo ended $?; sleep 60')

    with Listener(domain, {**TYPES, **CLOCK}) as listener:
        yield start, listener


def quiet(listener, seconds=0.3):
    """The number of states, once no more have come for a while."""
    before = -1
    while before != (before := len(listener.received[STATES])):
        time.sleep(seconds)
    return before


def test_keys_pause_step_and_go_on(log, player):
    start, listener = player
    with start('--start-paused', '--clock') as shell:
        shell.sees(rb'0\.000/1\.995 s, rate 1, paused')
        wait_for(lambda: len(clock_times(listener)) > 20)
        assert not listener.received[STATES]
        assert set(clock_times(listener)) == {0}  # published, and standing
        for count in (1, 2, 3):
            shell.send(b'\x1b[C')
            wait_for(lambda count=count: len(listener.received[STATES]) == count)
        assert quiet(listener) == 3
        assert len(listener.received[TORQUE]) == 3  # all of one log time at a step
        wait_for(lambda: clock_times(listener)[-1] == 10_000_000)
        shell.sees(rb'0\.010/1\.995 s, rate 1, paused')
        shell.send(b' ')
        wait_for(lambda: len(listener.received[STATES]) > 30)
        shell.send(b'\x1b[C')  # while it runs, that key does nothing
        shell.send(b' ')
        shell.sees(rb'0\.\d+/1\.995 s, rate 1, paused')
        paused = quiet(listener)
        assert 30 < paused < 400
        stood = clock_times(listener)[-1]
        assert stood < 2 * 10**9
        time.sleep(0.2)
        assert clock_times(listener)[-1] == stood
        shell.send(b' ')
        shell.sees(rb'messages replayed.*ended 0')
        assert held(shell.terminal)
    for topic in TYPES:
        assert listener.received[topic] == stored(log, topic), topic
    assert clock_times(listener) == sorted(clock_times(listener))


def test_keys_change_the_rate_and_ctrl_c_gives_the_terminal_back(player):
    start, listener = player
    with start('--rate', 0.5, '--loop', '--delay', 0.1) as shell:
        shell.sees(rb'looks for listeners.*begins in 0\.1 s.*rate 0\.5')
        assert not held(shell.terminal)
        shell.send(3 * b'\x1b[A')
        shell.sees(rb'rate 0\.8')
        shell.send(b'\x1b[B')
        shell.sees(rb'rate 0\.7')
        begin = len(listener.arrived[STATES])
        wait_for(lambda: len(listener.arrived[STATES]) > begin + 100)
        times = listener.arrived[STATES][begin + 20 :]
        assert period(times) == pytest.approx(0.005 / 0.7, rel=0.15)
        shell.send(b'\x03')
        shell.sees(rb'messages replayed.*ended 0')
        assert held(shell.terminal)


# ---------------------------------------------------------------- ends


def test_ctrl_c_ends_it_at_once_without_a_traceback(log):
    domain = fresh_domain()
    with (
        Listener(domain, TYPES) as listener,
        running('replay', log, '--rate', 0.01, domain=domain) as process,
    ):
        wait_for(lambda: listener.received[DESCRIPTION])
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=10)
    assert 'Traceback' not in err
    assert process.returncode == 0


def test_what_was_suspended_goes_on_where_it_was(log):
    domain = fresh_domain()
    with (
        Listener(domain, TYPES) as listener,
        running('replay', log, domain=domain) as process,
    ):
        wait_for(lambda: len(listener.received[STATES]) > 50)
        process.send_signal(signal.SIGSTOP)
        before = quiet(listener, 0.5)
        process.send_signal(signal.SIGCONT)
        assert process.wait(60) == 0
    assert listener.received[STATES] == stored(log, STATES)
    # Without that, the messages of the time of standing would come all at once.
    assert period(listener.arrived[STATES][before + 25 : before + 125]) == pytest.approx(
        0.005, rel=0.3
    )


# ---------------------------------------------------------------- view


def test_a_view_of_a_loop_goes_on_too(log, monkeypatch):
    shown = []

    class View:
        page, trouble, dropped = None, '', 0

        def __init__(self, *_):
            pass

        def consume(self, samples):
            shown.extend(samples)

        def close(self):
            pass

    monkeypatch.setattr(replay_view, 'View', View)
    with LogReader(log) as reader:
        piece = excerpt_of(reader, 0, 0.1, None)
        with (
            ReplayView('replay', reader, 'spawn', alone=True) as sink,
            feed(reader, piece, loop=True) as items,
        ):
            while len(shown) < 50:
                sink(next(items))
    stamps = [sample.stamp for sample in shown]
    assert stamps == [n * 5_000_000 for n in range(len(stamps))]


def test_what_no_middleware_publishes_is_one_line(tmp_path):
    configuration, path = load('quadrilateral'), tmp_path / 'run.mcap'
    with LogWriter(path, configuration, overwrite=False) as log:
        channel = log.add_topic(DRIVING_TORQUE, '/driving_torque')
        log.write_motion(Machine(configuration).begin(0))
        log.write(channel, 0, b'none' * 20)
    done = run(path)
    assert done.returncode == 2
    assert re.search('a message on /driving_torque is none of its type', done.stderr)
    assert 'Traceback' not in done.stderr


def test_commands_in_a_log_are_no_states_to_show(tmp_path):
    configuration = load('quadrilateral')
    machine = Machine(configuration)
    motion = machine.begin(0)
    path = tmp_path / 'run.mcap'
    command = JointStateCodec(('crank',)).encode(0, (0.0,), (0.0,), (1.0,))
    with LogWriter(path, configuration, overwrite=False) as log:
        states, commands = (
            log.add_topic(topic, qualified(topic)) for topic in (JOINT_STATES, JOINT_COMMANDS)
        )
        log.write_motion(motion)
        for stamp in range(0, 50_000_000, 5_000_000):
            log.write(commands, stamp, command)
            log.write(states, stamp, machine.snapshot_at(motion, stamp).messages[0])
    done = run(path, '--no-ros', '--viewer', tmp_path / 'run.rrd', '--rate', 10)
    assert (done.returncode, done.stderr) == (0, '')
    assert '20 messages replayed' in done.stdout


def test_a_viewer_that_does_not_answer_is_one_line_before_anything_is_played(log):
    url = f'rerun+http://127.0.0.1:{free_port()}/proxy'
    result = subprocess.run(
        command('replay', log, '--no-ros', '--viewer', url), capture_output=True, text=True
    )
    assert (result.returncode, result.stdout) == (2, '')
    words = f'no viewer answers at {url}: start one there first, with `rerun`'
    assert result.stderr == f'linkage_replay: {words}\n'


@pytest.mark.parametrize('alone', [True, False])
def test_a_view_that_fails_ends_the_replay_where_it_is_all_there_is(
    log, monkeypatch, capsys, alone
):
    class View:
        page, trouble, dropped = None, '', 0

        def __init__(self, *_):
            pass

        def consume(self, samples):
            if samples:
                raise ViewerError('no window could be opened')

        def close(self):
            pass

    monkeypatch.setattr(replay_view, 'View', View)
    with (
        LogReader(log) as reader,
        feed(reader, excerpt_of(reader, 0, 0.5, None), loop=True) as items,
    ):

        def play():
            with ReplayView('linkage_replay', reader, 'spawn', alone=alone) as sink:
                for item in itertools.islice(items, 300):
                    sink(item)
                    time.sleep(0.001)

        if alone:
            with pytest.raises(ViewerError, match='the view ended: no window could be opened'):
                play()
        else:
            play()
    words = 'linkage_replay: the view ends here, the topics go on: no window could be opened\n'
    assert capsys.readouterr().err == ('' if alone else words)


def test_what_a_viewer_that_ended_was_not_shown_is_said(log, capsys):
    with (
        viewing('--serve-grpc') as (viewer, url),
        LogReader(log) as reader,
        feed(reader, excerpt_of(reader, 0, 0.5, None), loop=True) as items,
        ReplayView('linkage_replay', reader, url, alone=True) as sink,
    ):
        sink(next(items))
        viewer.kill()
        viewer.wait()
        shown = 1
        for item in itertools.islice(items, 300):
            sink(item)
            shown += item.message.topic == STATES
            time.sleep(0.001)
    (line,) = capsys.readouterr().err.splitlines()
    lost = re.fullmatch(r'linkage_replay: (\d+) states were not shown: the viewer .*ended', line)
    assert 0 < int(lost[1]) <= shown


# ---------------------------------------------------------------- memory


def write_long(path, states):
    configuration = configure({'rpm': 60.0})
    machine = Machine(configuration)
    data = machine.snapshot_at(machine.begin(0), 0).messages[0]
    with LogWriter(path, configuration, overwrite=True) as log:
        first, second = (log.add_topic(t, f'/{t.name}') for t in (JOINT_STATES, DRIVING_TORQUE))
        log.write_motion(machine.begin(0))
        for tick in range(states):
            log.write(first, tick * 5_000_000, data)
            log.write(second, tick * 5_000_000, encode_float64(tick))
    return 2 * states * (len(data) + len(encode_float64(0))) / 2


def most_memory(path):
    """MiB that a replay as fast as it can held at most."""
    process = subprocess.Popen(
        command('replay', path, '--rate', 1e6),
        env=environment(fresh_domain()),
        stdout=subprocess.PIPE,
    )
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    assert process.returncode == 0
    assert b' messages replayed' in process.stdout.read()
    process.stdout.close()
    return usage.ru_maxrss / 1024


def test_a_long_log_takes_no_more_memory_than_a_short_one(tmp_path):
    short, long = tmp_path / 'short.mcap', tmp_path / 'long.mcap'
    write_long(short, 10_000)
    size = write_long(long, 200_000) / 2**20
    assert size > 30  # which would be seen
    assert most_memory(long) - most_memory(short) < 6


# ---------------------------------------------------------------- refusals


def run(*arguments):
    return subprocess.run(
        command('replay', *arguments),
        env=environment(fresh_domain()),
        capture_output=True,
        text=True,
        timeout=60,
        stdin=subprocess.DEVNULL,
    )


@pytest.fixture
def called(monkeypatch, capfd):
    """Calls the command in this process, on no terminal: (exit code, stderr)."""
    numbers = signal.SIGINT, signal.SIGTERM, signal.SIGHUP
    before = [signal.getsignal(number) for number in numbers]
    monkeypatch.setattr(os, 'isatty', lambda _: False)

    def call(*arguments):
        monkeypatch.setattr('sys.argv', ['linkage_replay', *map(str, arguments)])
        try:
            code = replay.main()
        except SystemExit as error:
            code = error.code
        return code, capfd.readouterr().err

    yield call
    for number, handler in zip(numbers, before, strict=True):
        signal.signal(number, handler)


@pytest.mark.parametrize(
    ('options', 'words'),
    [
        (
            ['--rate', '0'],
            "--rate: '0': must be a number from 0.001 to 1e\\+06; see linkage_replay",
        ),
        (['--rate', '-1'], "--rate: '-1': must be"),
        (['--rate', 'nan'], "--rate: 'nan': must be"),
        (['--rate', 'inf'], "--rate: 'inf': must be"),
        (['--rate', 'fast'], "--rate: 'fast': must be a number from 0.001"),
        (
            ['--start-offset', '3'],
            r'--start-offset = 3\.0: must be a number from 0 to 1\.995 s of the log',
        ),
        (['--start-offset', '-1'], "--start-offset: '-1': must be a number from 0 to"),
        (['--start-offset', 'nan'], "--start-offset: 'nan': must be"),
        (['--playback-duration', '0'], "--playback-duration: '0': must be a number from 1e-09 to"),
        (['--playback-duration', '-1'], "--playback-duration: '-1'"),
        (['--playback-duration', 'inf'], "--playback-duration: 'inf'"),
        (['--playback-duration', 'nan'], "--playback-duration: 'nan'"),
        (['--clock', 'abc'], "--clock: 'abc': must be a number from 0.01 to 1000 Hz; see"),
        (['--clock', '0'], "--clock: '0': must be a number from 0.01 to 1000 Hz; see"),
        (['--clock', '-40'], "--clock: '-40': must be"),
        (['--clock', 'nan'], "--clock: 'nan': must be"),
        (['--clock', '1e4'], "--clock: '1e4': must be"),
        (['--topics', '/nope'], '--topics /nope: the log has /joint_states, /driving_torque'),
        (['--topics'], '--topics: expected at least one argument'),
        (['--delay', '-1'], "--delay: '-1': must be a number from 0 to"),
        (['--delay', 'inf'], "--delay: 'inf': must be"),
        (['--no-ros'], '--no-ros leaves nothing to do'),
        (['--no-ros', '--viewer', 'spawn', '--clock'], '--clock publishes a topic, which --no'),
        (['--start-paused'], '--start-paused needs a terminal'),
        (['--until', '3'], 'unrecognized arguments: --until'),
        (['another.mcap'], 'unrecognized arguments: another'),
    ],
)
def test_bad_options_are_one_line_and_code_2(log, called, options, words):
    code, err = called(log, *options)
    assert re.fullmatch(rf'linkage_replay: [^\n]*{words}[^\n]*\n', err), err
    assert code == 2


def test_an_empty_name_is_no_folder(called):
    code, err = called('')
    assert (code, err[:64]) == (
        2,
        "linkage_replay: argument LOG.mcap: '' is no path: name one; see ",
    )


@pytest.mark.parametrize('step', [-1_000_000_000, 1_000_000_000])
def test_a_clock_that_was_set_back_is_said(called, tmp_path, step):
    path, configuration = tmp_path / 'run.mcap', configure({})
    motion = Machine(configuration).begin(10**10)
    with LogWriter(path, configuration, overwrite=False) as writer:
        writer.write_motion(motion)
        writer.write_motion(motion.change(10**10, motion.rpm, restamp=10**10 + step))
    code, err = called(path, '--viewer', tmp_path / 'view.rrd', '--no-ros')
    assert code == 0
    assert ('the clock was set back during this run' in err) == (step < 0)


@pytest.mark.parametrize(
    ('options', 'words'),
    [
        (['--ros-args', '-p', 'x'], 'override rule'),
        (
            ['--ros-args', '-p', 'qos_overrides./joint_states.publisher.depth:=1'],
            "'qos_overrides./joint_states.publisher.depth' is not a parameter of linkage_replay",
        ),
        (['--ros-args', '-p', 'rate:=2.0'], "'rate' is not a parameter of linkage_replay"),
        (['--clock', '0'], "--clock: '0': must be"),
        (['--viewer', 'nonsense', '--no-ros'], 'nonsense'),
    ],
)
def test_bad_options_of_the_process_are_one_line_and_code_2(log, options, words):
    result = run(log, *options)
    assert result.returncode == 2
    assert re.fullmatch(rf'linkage_replay: [^\n]*{words}[^\n]*\n', result.stderr), result.stderr


def foreign(path):
    """A sound MCAP file of somebody else."""
    with path.open('wb') as stream:
        writer = Writer(stream)
        writer.start(profile='ros2', library='other')
        schema = writer.register_schema('std_msgs/msg/Float64', 'ros2msg', b'float64 data\n')
        channel = writer.register_channel('/driving_torque', 'cdr', schema)
        writer.add_message(channel, 0, encode_float64(1.0), 0)
        writer.finish()


def test_what_is_no_log_is_refused_with_one_line(log, called, tmp_path):
    text, empty, cut_off, other, missing = (
        tmp_path / f'{name}.mcap' for name in ('text', 'empty', 'cut', 'foreign', 'missing')
    )
    text.write_text('no log')
    empty.touch()
    cut_off.write_bytes(log.read_bytes()[:5000])
    foreign(other)
    for path, reason in (
        (text, "it begins with 'no log'; name a log"),
        (empty, 'it is empty; name a log'),
        (cut_off, 'not complete: its run was killed.*linkage_log recover'),
        (other, 'no log of linkage_ros'),
        (missing, 'No such file'),
        (tmp_path, 'directory'),
    ):
        code, err = called(path)
        assert re.fullmatch(rf'linkage_replay: {path}[^\n]*{reason}[^\n]*\n', err), err
        assert code == 2


def test_the_help_lists_every_option_and_the_keys():
    text = run('--help').stdout
    for word in (
        *('--rate', '--loop', '--start-offset', '--playback-duration', '--start-paused'),
        *('--delay', '--clock', '--topics', '--viewer', '--no-ros'),
        *('space', 'right arrow', 'up, down'),
    ):
        assert word in text, word
    words = ' '.join(text.split())
    for span in (
        'log time over real time, 0.001 to 1e+06 (default 1)',
        'skip the beginning, 0 to 1e+09 s of the log',
        'wait before the start, 0 to 1e+06 s',
        'publish the log time on /clock, 0.01 to 1000 Hz (default 40)',
    ):
        assert span in words
