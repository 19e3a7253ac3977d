# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_record: what it writes, how much of it, and what it says to everything it cannot use."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from fractions import Fraction
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from linkage_ros import ConfigurationError, LogError, Solver
from linkage_ros import record as record_module
from linkage_ros.log.reader import LogReader
from linkage_ros.log.writer import LogWriter
from linkage_ros.motion.speed_driven import SpeedMotion
from linkage_ros.parameters.configuration import configure, load
from linkage_ros.parameters.presets import preset_names
from linkage_ros.record import record
from linkage_ros.record_end import End
from linkage_ros.run.machine import Machine
from linkage_ros.wire.codecs import JointStateCodec, encode_float64, encode_string
from linkage_ros.wire.urdf import make_urdf

ROOT = Path(__file__).resolve().parents[1]
JOINTS = ('crank', 'coupler', 'rocker')
PATIENCE = 60.0  # s, until a process that must answer counts as hanging

BLOCK = """
import sys

class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.partition('.')[0] in {'rclpy', 'rerun', 'rerun_bindings', 'matplotlib'}:
            raise ModuleNotFoundError(f'{name} is blocked here', name=name)

sys.meta_path.insert(0, Blocked())
"""


def preset(**changes):
    """The quadrilateral with other values; dots are written as two underscores."""
    values = {name.replace('__', '.'): value for name, value in changes.items()}
    return configure({**load('quadrilateral').parameters(), **values})


def command(*arguments):
    return [sys.executable, '-m', 'linkage_ros.record', *map(str, arguments)]


@pytest.fixture
def without_ros(tmp_path):
    """The variables of a process to which rclpy, rerun and matplotlib do not exist."""
    folder = tmp_path / 'site'
    folder.mkdir()
    (folder / 'sitecustomize.py').write_text(BLOCK)
    path = os.pathsep.join((str(folder), str(ROOT), os.environ.get('PYTHONPATH', '')))
    return {**os.environ, 'PYTHONPATH': path}


@pytest.fixture
def main(monkeypatch, capsys):
    """The entry point in this process: exit code, lines on stdout, lines on stderr."""

    def call(*arguments):
        monkeypatch.setattr(sys, 'argv', ['linkage_record', *map(str, arguments)])
        capsys.readouterr()
        try:
            code = record_module.main()
        except SystemExit as ended:  # argparse
            code = ended.code
        out, err = capsys.readouterr()
        return code, out.splitlines(), err.splitlines()

    return call


def content(path):
    """(stamp, numbers) of every joint state, and the torques."""
    codec = JointStateCodec(JOINTS)
    with LogReader(path) as log:
        messages = list(log.messages())
        states = [codec.decode(m.data) for m in messages if m.topic == '/joint_states']
        torques = [m for m in messages if m.topic == '/driving_torque']
        return log.configuration, log.motions, messages, states, torques


# ---------------------------------------------------------------- what it writes

DRIVES = {
    'constant': {},
    'clockwise': {'rpm': -33.3, 'crank_angle': 2.0},
    'ramp through a reversal': {
        'rpm': 90.0,
        'start_rpm': -60.0,
        'crank_acceleration': 9.0,
        'crank_angle': -1.0,
        'assembly': 'crossed',
        'rate_hz': 130.7,
    },
}


@pytest.mark.parametrize('changes', DRIVES.values(), ids=DRIVES.keys())
def test_the_states_are_the_solvers_to_the_bit(tmp_path, changes):
    configuration = preset(**changes)
    assert record(configuration, tmp_path / 'run.mcap', duration=4.0) > 500
    logged, [segment], messages, states, torques = content(tmp_path / 'run.mcap')
    assert logged == configuration
    assert messages[0].topic == '/robot_description'
    assert messages[0].data == encode_string(make_urdf(configuration.mechanism))
    solver, rate = Solver(configuration.mechanism), Fraction(configuration.session.rate_hz)
    expected_motion = SpeedMotion.begin(configuration.drive, 0)
    for tick, ((stamp, numbers), torque) in enumerate(zip(states, torques, strict=True)):
        assert stamp == math.floor(tick * 10**9 / rate) == torque.time
        crank = expected_motion.at(stamp)
        assert SpeedMotion(segment).at(stamp) == crank
        (q,), (u,), (a,), _ = crank
        angle, spin, _, drive = solver.state(q, u, a)
        alpha, beta, gamma, *rates = numbers[:6]
        assert (alpha, gamma) == (crank.unwrapped, angle[2])
        assert -math.pi < beta <= math.pi
        relative = math.remainder(angle[1] - angle[0] - beta, 2 * math.pi)
        assert abs(relative) <= 4 * math.ulp(4 * math.pi)
        assert tuple(rates) == (spin[0], spin[1] - spin[0], spin[2])
        assert numbers[6:] == (drive, 0.0, 0.0)
        assert torque.data == encode_float64(drive)


@pytest.mark.parametrize('name', [n for n in preset_names() if load(n).kind.drive == 'speed'])
def test_after_a_thousand_million_turns_the_state_is_the_first_turns(name):
    """At 60 rpm turns are whole seconds: the same bits, but for the unwrapped crank angle."""
    configuration = load(name)
    drive = replace(configuration.drive, rpm=60.0, start_rpm=None, crank_angle=0.0)
    machine = Machine(replace(configuration, drive=drive))
    motion = machine.begin(0)
    for stamp in range(0, 10**9, 37_037_037):
        first, later = (
            np.reshape(machine.mechanism_state.decode(snapshot.messages[2])[1], (4, -1)).tolist()
            for snapshot in (
                machine.snapshot_at(motion, stamp),
                machine.snapshot_at(motion, stamp + 10**9 * 10**9),
            )
        )
        assert later[0][2] == first[0][2]
        assert later[1:] == first[1:]
        turned = Fraction(stamp, 10**9) + 10**9
        assert later[0][0] == pytest.approx(float(2 * turned) * math.pi, rel=3e-16)


def test_log_times_are_stamps_and_start_at_zero(tmp_path):
    record(preset(rate_hz=70.0), tmp_path / 'run.mcap', duration=0.5)
    _, _, messages, states, _ = content(tmp_path / 'run.mcap')
    times = [m.time for m in messages if m.topic == '/joint_states']
    assert times == [stamp for stamp, _ in states] == [i * 10**9 // 70 for i in range(35)]
    assert messages[0].time == 0


def test_topics_are_the_nodes(tmp_path):
    record(preset(), tmp_path / 'run.mcap', duration=0.01)
    with LogReader(tmp_path / 'run.mcap') as log:
        assert [(topic.name, topic.messages) for topic in log.topics] == [
            ('/joint_states', 2),
            ('/driving_torque', 2),
            ('/mechanism_state', 2),
            ('/coupler_point', 2),
            ('/robot_description', 1),
        ]


# ---------------------------------------------------------------- how much


def states_below(machine, duration, revolutions=None):
    return len(End(machine, machine.begin(0), duration, revolutions).ticks)


def brute_count(rate, duration):
    """Stamps below the duration, one by one; the duration is the decimal that was typed."""
    end, tick = Fraction(repr(duration)) * 10**9, 0
    while math.floor(tick * 10**9 / Fraction(repr(rate))) < end:
        tick += 1
    return tick


@pytest.mark.parametrize('rate', [0.01, 0.1, 0.3, 1.0, 3.0, 7.7, 59.94, 200.0, 333.3, 1e3, 1e5])
@pytest.mark.parametrize('duration', [1e-9, 1e-5, 0.001, 0.005, 0.3, 1.0, 1 / 3, 1.1, 4.35])
def test_a_duration_holds_the_stamps_below_it(rate, duration):
    machine = Machine(preset(rate_hz=rate))
    if rate * duration < 5_000:
        assert states_below(machine, duration) == brute_count(rate, duration)


@pytest.mark.parametrize('rate', [200.0, 1000.0, 1e5])
def test_a_duration_typed_as_whole_ticks_holds_so_many_states(rate):
    """At 1 kHz, 0.067 s are 67 states: the one at 0.067 s is not in [0, 0.067)."""
    machine = Machine(preset(rate_hz=rate))
    wrong = {}
    for ticks in range(1, 3_001):
        duration = float(Fraction(ticks) / Fraction(repr(rate)))
        count = states_below(machine, duration)
        if count != ticks:
            wrong[duration] = (count, ticks)
    assert dict(islice(wrong.items(), 5)) == {}


@pytest.mark.parametrize('rate', [0.01, 0.1, 1 / 3, 7.7, 59.94, 200.0, 333.3, 1e3, 99_999.9])
def test_ticks_and_stamps_are_exact_however_late(rate):
    machine = Machine(preset(rate_hz=rate))
    for tick in (0, 1, 2, 3, 10, 999, 10**6 + 1, 10**9 + 7, 123_456_789_012, 10**15 + 1):
        elapsed = machine.elapsed(tick)
        assert elapsed == math.floor(tick * 10**9 / Fraction(repr(rate)))
        assert machine.tick_at(elapsed) == tick
        assert machine.tick_at(elapsed - 1) == tick - 1
        assert machine.tick_at(machine.elapsed(tick + 1) - 1) == tick


def test_record_writes_as_many_states_as_it_says(tmp_path):
    for number, (rate, duration) in enumerate([(200.0, 0.5), (7.7, 1.0), (3.0, 1.0), (0.3, 0.1)]):
        path = tmp_path / f'{number}.mcap'
        count = record(preset(rate_hz=rate), path, duration=duration)
        *_, states, torques = content(path)
        assert count == len(states) == len(torques) == brute_count(rate, duration)


@pytest.mark.parametrize(
    ('changes', 'revolutions', 'seconds'),
    [
        ({'rpm': 150.0}, 1, Fraction(2, 5)),
        ({'rpm': -150.0}, 5, Fraction(2)),
        ({'rpm': 60.0, 'crank_angle': 3.0}, 3, Fraction(3)),
        ({'rpm': 7.0}, 1, Fraction(60, 7)),
        ({'rpm': 60.0, 'start_rpm': -5.0}, 2, Fraction(2)),
    ],
)
@pytest.mark.parametrize('rate', [10.0, 7.7, 30.0])
def test_revolutions_hold_the_stamps_before_the_last_turn_ends(
    changes, revolutions, seconds, rate
):
    machine = Machine(preset(**changes, rate_hz=rate))
    tick = 0
    while math.floor(tick * 10**9 / Fraction(repr(rate))) < seconds * 10**9:
        tick += 1
    assert states_below(machine, None, revolutions) == tick


def test_revolutions_through_a_reversal_end_where_the_crank_is_a_turn_away(tmp_path):
    configuration = preset(rpm=60.0, start_rpm=-60.0, crank_acceleration=4.0, rate_hz=1000.0)
    record(configuration, tmp_path / 'run.mcap', revolutions=1)
    *_, states, _ = content(tmp_path / 'run.mcap')
    angles = [numbers[0] for _, numbers in states]
    assert max(abs(angle) for angle in angles) < 2 * math.pi
    assert min(angles) < -math.pi
    step = angles[-1] - angles[-2]
    assert angles[-1] + 1.1 * step > 2 * math.pi


@pytest.mark.parametrize('duration', [1, 1.0, np.float64(1.0), np.float32(1.0)], ids=repr)
def test_a_duration_may_be_any_kind_of_number(tmp_path, duration):
    assert record(preset(rate_hz=20.0), tmp_path / 'run.mcap', duration=duration) == 20


def test_ten_seconds_are_the_default(tmp_path):
    assert record(preset(rate_hz=10.0), tmp_path / 'run.mcap') == 100


@pytest.mark.parametrize(
    ('changes', 'revolutions'),
    [
        ({'rpm': 0.1}, 10**9),  # 19 000 years: beyond what 64 bits of nanoseconds hold
        ({'rpm': 1e-9, 'rate_hz': 0.01}, 1),  # 1900 years: beyond ROS's 32 bits of seconds
        ({'rpm': 1e-300, 'rate_hz': 0.01}, 1),
        ({'rpm': 1e-9, 'start_rpm': 0.0, 'crank_acceleration': 1e-40}, 1),
    ],
)
def test_revolutions_that_take_longer_than_stamps_go_are_refused(
    tmp_path, monkeypatch, changes, revolutions
):
    monkeypatch.setattr(record_module, 'LogWriter', lambda *_, **__: pytest.fail('it began'))
    with pytest.raises(ConfigurationError, match=r'revolutions|rest'):
        record(preset(**changes), tmp_path / 'run.mcap', revolutions=revolutions)


def test_an_acceleration_of_next_to_nothing_is_recorded(tmp_path):
    configuration = preset(rpm=60.0, start_rpm=30.0, crank_acceleration=1e-40, rate_hz=10.0)
    assert record(configuration, tmp_path / 'run.mcap', duration=1.0) == 10
    *_, states, _ = content(tmp_path / 'run.mcap')
    assert states[-1][1][3] == pytest.approx(math.pi, rel=1e-15)


# ---------------------------------------------------------------- the command


def test_the_command_says_what_it_wrote(main, tmp_path):
    out = tmp_path / 'run.mcap'
    code, lines, errors = main('quadrilateral', out, '--revolutions', 2, '--rate', 50)
    assert (code, errors) == (0, [])
    assert lines == [f'{out}: 40 states, 0.8 s; linkage_replay {out} shows it']
    configuration, *_, states, _ = content(out)
    assert len(states) == 40
    assert configuration == preset(rate_hz=50.0)


def test_what_keeps_nothing_is_not_offered_for_replay(main):
    code, lines, errors = main('quadrilateral', '/dev/null', '--overwrite', '--duration', 0.1)
    assert (code, lines, errors) == (0, ['/dev/null: 20 states, 0.1 s'], [])


def test_an_empty_name_is_no_folder(main, tmp_path):
    code, lines, [error] = main('quadrilateral', '')
    assert (code, lines) == (2, [])
    assert error.startswith("linkage_record: argument OUT.mcap: '' is no path: name one; see")
    code, lines, [error] = main('', tmp_path / 'run.mcap')
    assert (code, lines) == (2, [])
    assert error.startswith("linkage_record: no preset '': choose one of ")


def test_a_parameter_file_is_recorded_with_its_own_values(main, tmp_path):
    (tmp_path / 'params.yaml').write_text(layout(rpm='60', rate_hz='20', log_overwrite='true'))
    (tmp_path / 'run.mcap').touch()  # to be replaced, as the file says
    code, _, errors = main(tmp_path / 'params.yaml', tmp_path / 'run.mcap', '--duration', 1)
    assert (code, errors) == (0, [])
    configuration, *_, states, _ = content(tmp_path / 'run.mcap')
    assert (configuration.drive.rpm, len(states)) == (60.0, 20)


def test_an_existing_file_is_kept_unless_asked(main, tmp_path):
    out = tmp_path / 'run.mcap'
    out.write_bytes(b'precious')
    code, lines, [error] = main('quadrilateral', out)
    assert (code, lines) == (2, [])
    assert error.startswith(f'linkage_record: {out} exists already and is kept')
    assert error.endswith(
        ': choose another name, or set log_overwrite (linkage_record: --overwrite)'
    )
    assert out.read_bytes() == b'precious'
    code, _, [error] = main('quadrilateral', out, '--overwrite')
    assert (code, error) == (
        2,
        f'linkage_record: {out} is no log and is kept: choose another name',
    )
    out.write_bytes(b'')
    assert main('quadrilateral', out, '--overwrite', '--duration', 0.1)[0] == 0
    assert len(content(out)[3]) == 20


@pytest.mark.parametrize('where', ['missing/run.mcap', 'file/run.mcap', '.', 'x' * 300])
def test_an_unwritable_output_is_one_line(main, tmp_path, where):
    (tmp_path / 'file').touch()
    code, lines, [error] = main('quadrilateral', tmp_path / where, '--duration', 0.1)
    assert (code, lines) == (2, [])
    assert error.startswith('linkage_record: ')
    assert 'cannot be written' in error or 'is no file that could be replaced' in error
    assert [item.name for item in tmp_path.iterdir()] == ['file']


@pytest.mark.skipif(not Path('/dev/full').exists(), reason='needs /dev/full')
def test_a_full_disk_is_one_line(main):
    code, lines, errors = main('quadrilateral', '/dev/full', '--overwrite', '--duration', 0.1)
    assert (code, lines, len(errors)) == (2, [], 1)
    assert 'No space left' in errors[0]


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        ([], 'required: PARAMS, OUT.mcap'),
        (['--rate', 'fast'], "--rate: 'fast': must be a number from 0.01 to 100000 Hz"),
        (['--duration', '1s'], "--duration: '1s': must be a number from 1e-09 to 1e+09 s"),
        (['--revolutions', '1.5'], "'1.5': must be a whole number from 1 to 1e+09 turns"),
        (['--revolutions', 'two'], "'two': must be a whole number from 1 to 1e+09 turns"),
        (['--duration', '1', '--revolutions', '1'], 'not allowed with argument'),
        (['--speed', '1'], 'unrecognized arguments: --speed'),
    ],
)
def test_a_wrong_command_line_is_one_line(main, tmp_path, arguments, words):
    params = ['quadrilateral', tmp_path / 'run.mcap'] if arguments else []
    code, lines, errors = main(*params, *arguments)
    assert (code, lines) == (2, [])
    (error,) = errors
    assert error.startswith('linkage_record: ')
    assert error.endswith('; see linkage_record --help')
    assert words in error
    assert not (tmp_path / 'run.mcap').exists()


# ---------------------------------------------------------------- what it refuses

GOOD = {
    'mechanism': 'four_bar',
    'rpm': '150.0',
    'frame': '{length: 0.425, angle: 5.5}',
    'crank': '{length: 0.1, inertia: 0.0245}',
    'coupler': '{length: 0.315, mass: 2.0, center: [0.1575, 0.0]}',
    'rocker': '{length: 0.5, mass: 3.5}',
}


def layout(**changes):
    """A parameter file in which some values are others; None leaves one out."""
    values = {**GOOD, **changes}
    lines = [f'    {name}: {text}' for name, text in values.items() if text is not None]
    return '\n'.join(['/**:', '  ros__parameters:', *lines, ''])


def lengths(crank, coupler, rocker, frame):
    links = {'crank': crank, 'coupler': coupler, 'rocker': rocker, 'frame': frame}
    return layout(**{name: f'{{length: {length}}}' for name, length in links.items()})


NUMBER = 'must be a number from'
TURNS = r'linkage cannot turn fully: .*; it reaches .* deg'
# name: (file, words on stderr)
BAD_FILES = {
    # Linkages whose crank cannot turn: far too short, near too different, both, nothing closes.
    'crank stopped outside': (
        lengths(2.0, 1.0, 2.2, 2.5),
        r'crank of this double-rocker ' + TURNS + '$',
    ),
    'crank stopped outside alone': (
        lengths(2.0, 2.0, 2.1, 2.3),
        # 360 -+ cos^-1((2^2 + 2.3^2 - 4.1^2) / (2 2 2.3))
        r'triple-rocker .* rocker are 0.2 m shorter .* at most 1.8 m .* 215.176 to 504.824 deg$',
    ),
    'crank stopped inside': (
        lengths(2.0, 1.0, 3.0, 1.9),
        # cos^-1((2^2 + 1.9^2 - 2^2) / (2 2 1.9))
        r'differ by 1.9 m more .* at least 2.9 m; it reaches 61.6406 to 298.359 deg$',
    ),
    'crank stopped on both sides': (
        lengths(2.0, 0.5, 1.6, 1.9),
        r'are 1.8 m shorter than .* and rocker differ by .*deg and .* deg$',
    ),
    'crank of a rocker-crank': (lengths(2.5, 2.2, 1.0, 2.0), 'this rocker-crank ' + TURNS),
    'crank of a double-rocker': (lengths(2.5, 1.0, 2.2, 2.0), 'this double-rocker ' + TURNS),
    'crank of a triple-rocker': (lengths(2.0, 1.9, 2.0, 2.5), 'this triple-rocker ' + TURNS),
    'crank a hair too long': (lengths(1.0000001, 2.5, 3.0, 1.5), TURNS),
    'crank too long': (lengths(9.0, 1.0, 1.0, 1.0), r'longest link, 9 m, .* the loop cannot clo'),
    'frame too long': (lengths(1.0, 1.0, 1.0, 4.0), 'longest link, 4 m, is longer than the other'),
    # Lengths that are none.
    'zero length': (layout(crank='{length: 0.0}'), rf'crank.length = 0.0: {NUMBER}'),
    'zero length, whole': (layout(rocker='{length: 0}'), rf'rocker.length = 0: {NUMBER}'),
    'negative length': (layout(coupler='{length: -0.3}'), rf'coupler.length = -0.3: {NUMBER}'),
    'length below the limit': (
        layout(crank='{length: 1.0e-10}'),
        rf'crank.length = 1e-10: {NUMBER}',
    ),
    'length above the limit': (layout(frame='{length: 1.0e10}'), rf'frame.length = .*: {NUMBER}'),
    'length nan': (layout(crank='{length: .nan}'), rf'crank.length = nan: {NUMBER}'),
    'length inf': (layout(frame='{length: .inf}'), rf'frame.length = inf: {NUMBER}'),
    'length minus inf': (layout(frame='{length: -.inf}'), rf'frame.length = -inf: {NUMBER}'),
    'length overflows': (layout(crank='{length: 1e400}'), rf"crank.length = '1e400': {NUMBER}"),
    'length text': (layout(crank='{length: long}'), rf"crank.length = 'long': {NUMBER}"),
    'length in quotes': (layout(crank='{length: "0.1"}'), rf"crank.length = '0.1': {NUMBER}"),
    'length with its unit': (
        layout(crank='{length: 0.1 m}'),
        rf"crank.length = '0.1 m': {NUMBER}",
    ),
    'length bool': (layout(crank='{length: true}'), rf'crank.length = True: {NUMBER}'),
    'length yes': (layout(crank='{length: yes}'), rf'crank.length = True: {NUMBER}'),
    'length list': (layout(crank='{length: [0.1]}'), rf'crank.length = \[0.1\]: {NUMBER}'),
    'length group': (layout(crank='{length: {m: 0.1}}'), "'crank.length.m' is not a parameter"),
    'length null': (layout(crank='{length: null}'), rf"crank.length = 'null': {NUMBER}"),
    'length empty': (layout(crank='{length: }'), "'crank.length' has no value"),
    'length missing': (layout(crank='{mass: 1.0}'), rf'crank.length is missing: {NUMBER}'),
    'link missing': (layout(rocker=None), rf'rocker.length is missing: {NUMBER}'),
    'link a number': (layout(crank='0.1'), "'crank' is not a parameter of a four_bar"),
    # Other values.
    'mass negative': (layout(crank='{length: 0.1, mass: -1.0}'), rf'crank.mass = -1.0: {NUMBER}'),
    'inertia nan': (
        layout(crank='{length: 0.1, inertia: .nan}'),
        rf'crank.inertia = nan: {NUMBER}',
    ),
    'speed missing': (layout(rpm=None), rf'rpm is missing: {NUMBER}'),
    'speed too high': (layout(rpm='1.0e7'), rf'rpm = 10000000.0: {NUMBER}'),
    'speed text': (layout(rpm='fast'), rf"rpm = 'fast': {NUMBER}"),
    'start speed inf': (layout(start_rpm='.inf'), rf'start_rpm = inf: {NUMBER}'),
    'acceleration negative': (
        layout(crank_acceleration='-1.0'),
        rf'crank_acceleration = -1.0: {NUMBER}',
    ),
    'angle huge': (layout(crank_angle='1.0e300'), rf'crank_angle = 1e\+300: {NUMBER}'),
    'frame angle text': (layout(frame='{length: 0.425, angle: 315deg}'), "frame.angle = '315deg'"),
    'rate zero': (layout(rate_hz='0.0'), rf'rate_hz = 0.0: {NUMBER} 0.01 to 100000 Hz'),
    'rate negative': (layout(rate_hz='-200.0'), rf'rate_hz = -200.0: {NUMBER}'),
    'rate too high': (layout(rate_hz='1.0e6'), rf'rate_hz = 1000000.0: {NUMBER}'),
    'gravity of one': (layout(gravity='[-9.81]'), r'gravity = \[-9.81\]: must be two numbers'),
    'gravity of three': (layout(gravity='[0.0, 0.0, -9.81]'), 'gravity = .*: must be two numbers'),
    'gravity a number': (layout(gravity='-9.81'), 'gravity = -9.81: must be two numbers'),
    'gravity mixed': (layout(gravity='[0, -9.81]'), "'gravity' mixes .*0 and .*-9.81"),
    'gravity mixed with text': (layout(gravity='[0.0, down]'), "'gravity' mixes .* and .*'down'"),
    'gravity nan': (layout(gravity='[0.0, .nan]'), r'gravity = \[0.0, nan\]: must be two numbers'),
    'gravity nested': (layout(gravity='[[0.0, -9.81]]'), "'gravity' holds a list"),
    'gravity of text': (layout(gravity="['0', '0']"), r"gravity = \['0', '0'\]: must be two num"),
    'gravity of bools': (
        layout(gravity='[true, false]'),
        r'gravity = \[True, False\]: must be two',
    ),
    'centre empty': (layout(crank='{length: 0.1, center: []}'), "'crank.center' is an empty list"),
    'point of one': (
        layout(coupler='{length: 0.315, point: [0.1]}'),
        r'coupler.point = \[0.1\]: m',
    ),
    'assembly unknown': (
        layout(assembly='closed'),
        "assembly = 'closed': must be one of open, cr",
    ),
    'mechanism unknown': (layout(mechanism='pentagon'), "mechanism = 'pentagon': must be one of"),
    'drive unknown': (layout(drive='force'), "drive = 'force': must be one of speed, torque"),
    'switch text': (layout(log_overwrite='maybe'), "log_overwrite = 'maybe': must be true or fal"),
    'log a number': (layout(log='5'), 'log = 5: must be text'),
    # Names.
    'name misspelt': (
        layout(crank='{lenght: 0.1}'),
        r"'crank.lenght' is not a parameter of a four_bar; did you mean crank.length\?",
    ),
    'name unknown': (layout(colour='red'), "'colour' is not a parameter of a four_bar"),
    'name in capitals': (layout(RPM='150.0'), "'RPM' is not a parameter of a four_bar"),
    'slider on a four-bar': (
        layout(slider='{mass: 1.0}'),
        "'slider.mass' is not a parameter of a f",
    ),
    # Files.
    'text': ('a four-bar linkage\n', r'line 1: .*mapping'),
    'list': ('- rpm\n- 150.0\n', r'line 1: .*mapping'),
    'tab': ('/**:\n\tros__parameters:\n', r'line 2: no YAML'),
    'open bracket': ('/**:\n  ros__parameters:\n    gravity: [0.0,\n', r'line \d: no YAML'),
    'no ros__parameters': ('/**:\n  rpm: 150.0\n', 'ros__parameters'),
    'alias': ('/**:\n  ros__parameters:\n    rpm: &a 1.0\n    rate_hz: *a\n', 'takes no alias'),
    'not UTF-8': (b'/**:\n  ros__parameters:\n    log: "\xff\xfe"\n', 'no YAML in UTF-8'),
    'binary': (bytes(range(256)) * 16, 'no YAML'),
    'zeros': (bytes(4_096), r'linkage_record: .'),
    'endless': (b'#' + b'x' * (1 << 20), r'over 1048576 bytes'),
}
# A degenerate linkage or setting that works all the same: the guards do not refuse too much.
GOOD_FILES = {
    'as it stands': layout(),
    'whole numbers': layout(rpm='150', crank='{length: 1}', coupler='{length: 3}',
                            rocker='{length: 3}', frame='{length: 2}', gravity='[0, -10]'),
    'standing still': layout(rpm='0.0'),
    'clockwise': layout(rpm='-150.0'),
    'parallelogram': lengths(1.0, 2.0, 1.0, 2.0),
    'rhombus': lengths(1.0, 1.0, 1.0, 1.0),
    'kite': lengths(1.0, 2.0, 2.0, 1.0),
    'change point in decimals': lengths(0.1, 0.4, 0.3, 0.2),
    'shortest links': lengths('1.0e-9', '3.0e-9', '2.5e-9', '2.0e-9'),
    'longest links': lengths('1.0e8', '3.0e8', '2.5e8', '2.0e8'),
    'no weight': layout(gravity='[0.0, 0.0]'),
    'exponents as rcl takes them': layout(rpm='1e2', rate_hz='2e2'),
}  # fmt: skip


@pytest.mark.parametrize(('text', 'words'), BAD_FILES.values(), ids=BAD_FILES.keys())
def test_a_bad_file_is_refused_in_one_line_and_leaves_no_log(main, tmp_path, text, words):
    params, out = tmp_path / 'params.yaml', tmp_path / 'run.mcap'
    params.write_bytes(text if isinstance(text, bytes) else text.encode())
    code, lines, errors = main(params, out, '--duration', 0.1)
    assert (code, lines) == (2, [])
    assert len(errors) == 1
    assert errors[0].startswith('linkage_record: ')
    assert_matches(words, errors[0])
    assert errors[0].isprintable()
    assert not out.exists()


def assert_matches(words, line):
    with pytest.raises(LookupError, match=words):
        raise LookupError(line)


@pytest.mark.parametrize('text', GOOD_FILES.values(), ids=GOOD_FILES.keys())
def test_a_degenerate_but_possible_file_is_recorded(main, tmp_path, text):
    (tmp_path / 'params.yaml').write_text(text)
    code, _, errors = main(tmp_path / 'params.yaml', tmp_path / 'run.mcap', '--duration', 0.5)
    assert (code, errors) == (0, [])
    *_, states, _ = content(tmp_path / 'run.mcap')
    assert len(states) == 100
    assert all(math.isfinite(number) for _, numbers in states for number in numbers)


@pytest.mark.parametrize(
    'text',
    ['', '# nothing\n', layout().replace('/**', 'linkage_mode')],
    ids=['empty', 'comment', 'section of another node'],
)
def test_a_file_that_sets_nothing_is_refused(main, tmp_path, text):
    """Or a slip in the node's name would record another linkage."""
    (tmp_path / 'params.yaml').write_text(text)
    code, _, errors = main(tmp_path / 'params.yaml', tmp_path / 'run.mcap')
    assert (code, len(errors)) == (2, 1)
    assert 'has no parameters of linkage_node: above ros__parameters write /**' in errors[0]
    assert not (tmp_path / 'run.mcap').exists()


def test_a_file_without_a_mechanism_runs_the_preset_and_says_so(main, tmp_path):
    (tmp_path / 'params.yaml').write_text('/**:\n  ros__parameters:\n    rpm: 60.0\n')
    code, lines, errors = main(tmp_path / 'params.yaml', tmp_path / 'run.mcap', '--duration', 0.1)
    assert code == 0
    assert content(tmp_path / 'run.mcap')[0].mechanism == load('quadrilateral').mechanism
    assert 'quadrilateral' in ' '.join(lines + errors)


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        (
            ['--duration', '0'],
            "argument --duration: '0': must be a number from 1e-09 to 1e\\+09 s",
        ),
        (['--duration', '1e-10'], "argument --duration: '1e-10': must be a number from 1e-09 to"),
        (['--duration', '-1'], "argument --duration: '-1': must be a number from 1e-09 to"),
        (['--duration', 'nan'], "argument --duration: 'nan': must be a number from 1e-09 to"),
        (['--duration', 'inf'], "argument --duration: 'inf': must be a number from 1e-09 to"),
        (['--duration', '1e10'], "argument --duration: '1e10': must be a number from 1e-09 to"),
        (['--revolutions', '0'], "argument --revolutions: '0': must be a whole number from 1 to"),
        (
            ['--revolutions', '-3'],
            "argument --revolutions: '-3': must be a whole number from 1 to",
        ),
        (
            ['--revolutions', '9' * 30],
            "argument --revolutions: '9+': must be a whole number from 1 to",
        ),
        (['--rate', '0'], "argument --rate: '0': must be a number from 0.01"),
        (['--rate', '-5'], "argument --rate: '-5': must be a number from 0.01"),
        (['--rate', 'nan'], "argument --rate: 'nan': must be a number from 0.01"),
        (['--rate', 'inf'], "argument --rate: 'inf': must be a number from 0.01"),
        (['--rate', '1e6'], "argument --rate: '1e6': must be a number from 0.01"),
    ],
)
def test_a_bad_option_is_refused_in_one_line_and_leaves_no_log(main, tmp_path, arguments, words):
    code, lines, errors = main('quadrilateral', tmp_path / 'run.mcap', *arguments)
    assert (code, lines, len(errors)) == (2, [], 1)
    assert_matches(f'^linkage_record: {words}', errors[0])
    assert not (tmp_path / 'run.mcap').exists()


def test_revolutions_of_a_crank_at_rest_are_refused(main, tmp_path):
    (tmp_path / 'params.yaml').write_text(layout(rpm='0.0'))
    arguments = (tmp_path / 'params.yaml', tmp_path / 'run.mcap', '--revolutions', 1)
    code, lines, [error] = main(*arguments)
    assert (code, lines) == (2, [])
    assert_matches('comes to rest before 1 revolutions: give a --duration', error)
    assert not (tmp_path / 'run.mcap').exists()


@pytest.mark.parametrize(
    ('params', 'words'),
    [
        ('pentagon', "no preset 'pentagon': choose one of .*quadrilateral"),
        ('missing.yaml', 'missing.yaml: No such file or directory'),
        ('.', 'Is a directory'),
        ('file/x.yaml', 'Not a directory'),
        ('', 'linkage_record: .'),
        ('x' * 300 + '.yaml', 'File name too long'),
        ('new\nline.yaml', r'new\\nline.yaml'),
    ],
)
def test_a_file_that_cannot_be_read_is_refused_in_one_line(
    main, tmp_path, monkeypatch, params, words
):
    monkeypatch.chdir(tmp_path)
    Path('file').touch()
    code, lines, errors = main(params, 'run.mcap', '--duration', 0.1)
    assert (code, lines, len(errors)) == (2, [], 1)
    assert_matches(words, errors[0])
    assert not Path('run.mcap').exists()


def test_enough_bad_files_are_tried():
    assert len(BAD_FILES) >= 40


# ---------------------------------------------------------------- as a process


def test_it_needs_no_ros_no_viewer_and_no_charts(tmp_path, without_ros):
    out = tmp_path / 'run.mcap'
    done = subprocess.run(
        command('quadrilateral', out, '--duration', 1), env=without_ros, timeout=PATIENCE,
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, '')
    assert done.stdout.startswith(f'{out}: 200 states, 1 s;')
    record(load('quadrilateral'), tmp_path / 'here.mcap', duration=1.0)
    assert out.read_bytes() == (tmp_path / 'here.mcap').read_bytes()


@pytest.mark.parametrize('module', ['rclpy', 'rclpy.node', 'rerun', 'matplotlib.pyplot'])
def test_the_block_does_block(without_ros, module):
    done = subprocess.run(
        [sys.executable, '-c', f'import {module}'], env=without_ros, timeout=PATIENCE,
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 1
    assert 'is blocked here' in done.stderr.splitlines()[-1]


def test_the_process_refuses_with_exit_code_2_and_one_line(tmp_path, without_ros):
    (tmp_path / 'params.yaml').write_text(BAD_FILES['crank too long'][0])
    done = subprocess.run(
        command(tmp_path / 'params.yaml', tmp_path / 'run.mcap'), env=without_ros,
        timeout=PATIENCE, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (2, '')
    assert done.stderr.count('\n') == 1
    assert_matches('^linkage_record: the longest link, 9 m', done.stderr)
    assert not (tmp_path / 'run.mcap').exists()


def test_a_reader_that_has_enough_of_the_output_is_no_error(tmp_path, without_ros):
    reading, writing = os.pipe()
    os.close(reading)
    done = subprocess.run(
        command('quadrilateral', tmp_path / 'run.mcap', '--duration', 0.1), env=without_ros,
        timeout=PATIENCE, stdout=writing, stderr=subprocess.PIPE, check=False,
    )  # fmt: skip
    os.close(writing)
    assert (done.returncode, done.stderr) == (0, b'')


@pytest.mark.parametrize('chunks', [0, 1, 2])
def test_ctrl_c_leaves_a_complete_log(tmp_path, chunks):
    """Interrupted before the first chunk, and after some."""
    out = tmp_path / 'run.mcap'
    with subprocess.Popen(
        command('quadrilateral', out, '--duration', 1e6, '--rate', 1000),
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    ) as process:  # fmt: skip
        try:
            ends = time.monotonic() + PATIENCE
            # The configuration makes less than 4000 bytes, every chunk more than 80 000.
            while not out.exists() or out.stat().st_size < (500, 80_000, 200_000)[chunks]:
                assert time.monotonic() < ends
                assert process.poll() is None
                time.sleep(0.005)
            process.send_signal(signal.SIGINT)
            printed, errors = process.communicate(timeout=PATIENCE)
        finally:
            process.kill()
    assert (process.returncode, errors.strip()) == (130, '')
    configuration, [motion], _, states, torques = content(out)
    assert printed == f'{out}: stopped; the first {len(states)} states are kept\n'
    assert configuration == preset(rate_hz=1000.0)
    assert [stamp for stamp, _ in states] == [tick * 10**6 for tick in range(len(states))]
    assert len(torques) == len(states)
    assert motion.phase == 0
    if chunks:
        assert len(states) > 1_500


def interrupted(main, monkeypatch, method, call, place, out):
    """Records, with a Ctrl-C at the given line of Python within one call of LogWriter's.

    Returns:
        The exit code; None where the call has fewer lines.
    """
    original, calls, lines = getattr(LogWriter, method), 0, 0

    def trace(frame, event, argument):
        nonlocal lines
        if event == 'line':
            lines += 1
            if lines == place:
                sys.settrace(None)
                signal.raise_signal(signal.SIGINT)
        return trace

    def traced(*arguments):
        nonlocal calls
        calls += 1
        before = sys.gettrace()
        if calls == call:
            sys.settrace(trace)
        try:
            return original(*arguments)
        finally:
            sys.settrace(before)

    with monkeypatch.context() as patch:
        patch.setattr(LogWriter, method, traced)
        code, _, _ = main('quadrilateral', out, '--overwrite', '--duration', 0.05)
    return code if lines >= place else None


@pytest.mark.parametrize(
    ('method', 'call', 'every'),
    [('write', 1, 1), ('write', 8, 1), ('write', 9, 1), ('close', 1, 41)],
)
def test_ctrl_c_at_any_line_leaves_a_complete_log(
    main, tmp_path, monkeypatch, method, call, every
):
    """Most of a record's time is spent within `write`, so that is where most Ctrl-C come."""
    record(preset(), tmp_path / 'whole.mcap', duration=0.05)
    expected, out = content(tmp_path / 'whole.mcap')[2], tmp_path / 'run.mcap'
    faults, place = {}, 1
    while (code := interrupted(main, monkeypatch, method, call, place, out)) is not None:
        try:
            messages = content(out)[2]
        except LogError as error:
            faults[place] = str(error)[-90:]
        else:
            at_end = method == 'close' and messages == expected
            if messages != expected[: len(messages)] or not (
                code == 130 or (at_end and code == 0)
            ):
                faults[place] = f'exit code {code}, {len(messages)} messages'
        place += every
    assert place > 10
    assert dict(islice(faults.items(), 3)) == {}, f'{len(faults)} of {place // every} places'


@pytest.fixture(autouse=True)
def handlers():
    """Puts the signals' handlers back, which a command may set."""
    numbers = signal.SIGINT, signal.SIGTERM, signal.SIGHUP
    before = [(number, signal.getsignal(number)) for number in numbers]
    yield
    for number, handler in before:
        signal.signal(number, handler)
