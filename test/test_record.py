# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_record: contents and length of records, and errors for invalid input.

test_configuration.py and test_refusals.py test which values and linkages are refused.
"""

import json
import math
import re
import signal
import subprocess
from fractions import Fraction

import numpy as np
import pytest
from mechanisms import FOLLOWED, load_values
from one_linkage import run_alone, templates_of
from ros_harness import PATIENCE, assert_refused, command, decoded, logged, wait_for
from state_messages import messages_at

from linkage_ros import ConfigurationError, LinkageError
from linkage_ros.log.rows import RowLayout, message_record
from linkage_ros.motion.steps import live_steps, record_steps
from linkage_ros.programs import record as record_module
from linkage_ros.programs.record import count_states, record
from linkage_ros.run.batches import LinkageStates
from linkage_ros.run.states import Simulator
from linkage_ros.settings.configuration import configure, load, read_values

STATES = '/joint_states'


def preset(**changes):
    """Returns the quadrilateral with other values."""
    return configure({**load('quadrilateral').parameters(), **changes})


@pytest.fixture
def out(tmp_path):
    return tmp_path / 'run.mcap'


def states_of(path):
    """Returns (stamp, numbers) of every joint state."""
    return decoded(message.data for message in logged(path)[1][STATES])


# ---------------------------------------------------------------- contents


def test_all_states_before_an_impossible_one_are_recorded(out):
    """At 90 deg, a slider-crank of equal links has infinite joint forces, and so friction."""
    configuration = configure({
        'mechanism': 'slider_crank', 'rpm': 60.0, 'rate_hz': 200.0, 'crank.length': 0.1,
        'coupler.length': 0.1, 'slider.mass': 1.0, **load_values('friction', guide=0.1),
    })  # fmt: skip
    with pytest.raises(LinkageError, match='keeps the 50 states'):
        record(configuration, out, duration=1.0)
    assert len(logged(out)[1][STATES]) == 50


RUNS = {
    'quadrilateral': {},
    # Described by other coordinates at every dead centre.
    'limited crank': {
        'drive': 'torque',
        'motor.torque': 2.0,
        'crank.length': 0.3,
        'crank_angle': 2.0,
        'start_rpm': 60.0,
    },
    'compressor': {
        **load('compressor').parameters(),
        'start_rpm': -90.0,
        'crank_acceleration': 30.0,
        **load_values('friction', pin=0.1, pin_radius=0.01, guide=0.1),
    },
    'slider_crank': {**load('slider_crank').parameters(), 'rpm': -1e5, 'crank_angle': -7.0},
    'coupler_point': {**load('coupler_point').parameters(), 'rpm': 0.0},
    'wind_pump': load('wind_pump').parameters(),
}


@pytest.mark.parametrize('name', RUNS)
@pytest.mark.parametrize(('start', 'integrate'), [(0, record_steps), (10**12, live_steps)])
def test_many_states_at_once_have_the_bits_of_each_alone(name, start, integrate):
    values = {**RUNS[name], 'rate_hz': 333.3}
    if values.get('drive') != 'torque':
        base = {} if 'mechanism' in values else read_values('quadrilateral')
        values = {**base, **values, 'effort_command_topic': 'torque', 'lead_time': 0.01}
    simulator = Simulator(configure(values).only)
    stamps = [start + simulator.ticks.elapsed(tick) for tick in range(900)]
    together, alone = (simulator.begin(start, integrate) for _ in range(2))
    layout = RowLayout(templates_of(simulator), enumerate(templates_of(simulator).topics))
    single = b''.join(
        message_record(channel, (stamp, stamp), message)
        for stamp in stamps
        for channel, message in enumerate(messages_at(simulator, alone, stamp).messages)
    )
    many, pieces = bytearray(), 0
    while stamps:  # one description at a time
        found = together.at_all(stamps)
        now, stamps = stamps[: len(found.unwrapped)], stamps[len(found.unwrapped) :]
        part = simulator.part(found, simulator.ahead(together, now))
        many += layout.rows(now, now, run_alone(simulator).row({'': part}))
        pieces += 1
    assert many == single
    assert (pieces > 4) == (name == 'limited crank')


# ---------------------------------------------------------------- length


def states_below(simulator, duration, revolutions=None):
    return count_states([LinkageStates(simulator, simulator.begin(0))], duration, revolutions)


def brute_count(rate, seconds):
    """Counts the stamps below a time one by one; floats stand for the decimals typed."""
    exact = [Fraction(repr(x)) if isinstance(x, float) else x for x in (rate, seconds)]
    tick = 0
    while math.floor(tick * 10**9 / exact[0]) < exact[1] * 10**9:
        tick += 1
    return tick


@pytest.mark.parametrize('rate', [0.01, 0.3, 3.0, 7.7, 59.94, 200.0, 333.3, 1e5])
@pytest.mark.parametrize('duration', [1e-9, 1e-5, 0.005, 1 / 3, 1.1, 4.35])
def test_duration_contains_the_stamps_below_it(rate, duration):
    simulator = Simulator(preset(rate_hz=rate).only)
    if rate * duration < 5_000:
        assert states_below(simulator, duration) == brute_count(rate, duration)


@pytest.mark.parametrize('rate', [200.0, 1000.0])
def test_duration_of_whole_ticks_contains_that_many_states(rate):
    """At 1 kHz, 0.067 s contain 67 states: the state at 0.067 s is not in [0, 0.067)."""
    simulator = Simulator(preset(rate_hz=rate).only)
    durations = {ticks: float(Fraction(ticks) / Fraction(rate)) for ticks in range(1, 1_001)}
    found = {ticks: states_below(simulator, duration) for ticks, duration in durations.items()}
    assert {ticks: count for ticks, count in found.items() if count != ticks} == {}


@pytest.mark.parametrize('duration', [1, 1.0, np.float64(1.0), np.float32(1.0), None], ids=repr)
def test_record_writes_the_number_of_states_that_it_reports(out, duration):
    seconds = 10.0 if duration is None else 1.0
    count = record(preset(rate_hz=7.7), out, duration=duration)
    assert count == len(states_of(out)) == brute_count(7.7, seconds)


@pytest.mark.parametrize(
    ('changes', 'revolutions', 'seconds'),
    [
        ({'rpm': 150.0}, 1, Fraction(2, 5)),
        ({'rpm': -150.0, 'rate_hz': 7.7}, 5, Fraction(2)),
        ({'rpm': 60.0, 'crank_angle': 3.0, 'rate_hz': 10.0}, 3, Fraction(3)),
        ({'rpm': 7.0, 'rate_hz': 30.0}, 1, Fraction(60, 7)),
        ({'rpm': 60.0, 'start_rpm': -5.0, 'rate_hz': 7.7}, 2, Fraction(2)),
    ],
)
def test_revolutions_hold_the_stamps_before_the_last_turn_ends(changes, revolutions, seconds):
    simulator = Simulator(preset(**changes).only)
    rate = simulator.linkage.session.rate_hz
    assert states_below(simulator, None, revolutions) == brute_count(rate, seconds)


@pytest.mark.parametrize(
    ('changes', 'revolutions'),
    [
        ({'rpm': 0.1}, 10**9),  # 19 000 years, beyond 64 bits of nanoseconds
        ({'rpm': 1e-9, 'rate_hz': 0.01}, 1),  # 1900 years, beyond ROS's 32 bits of seconds
        ({'rpm': 1e-9, 'start_rpm': 0.0, 'crank_acceleration': 1e-40}, 1),
        ({'rpm': 0.0}, 1),
    ],
)
def test_revolutions_beyond_the_range_of_stamps_are_refused(out, changes, revolutions):
    with pytest.raises(ConfigurationError, match=r'revolutions|rest'):
        record(preset(**changes), out, revolutions=revolutions)
    assert not out.exists()


# ---------------------------------------------------------------- the command

GOOD = {
    'mechanism': 'four_bar',
    'rpm': '150.0',
    'frame': '{length: 0.425, angle: 5.5}',
    'crank': '{length: 0.1, inertia: 0.0245}',
    'coupler': '{length: 0.315, mass: 2.0, center: [0.1575, 0.0]}',
    'rocker': '{length: 0.5, mass: 3.5}',
}


def layout(**changes):
    """Returns a parameter file in which some values differ from the defaults."""
    lines = [f'    {name}: {text}' for name, text in {**GOOD, **changes}.items()]
    return '\n'.join(['/**:', '  ros__parameters:', *lines, ''])


def lengths(crank, coupler, rocker, frame):
    links = {'crank': crank, 'coupler': coupler, 'rocker': rocker, 'frame': frame}
    return layout(**{name: f'{{length: {length}}}' for name, length in links.items()})


@pytest.fixture
def params(tmp_path):
    return tmp_path / 'params.yaml'


def test_command_prints_what_it_wrote(called, out):
    words = 'quadrilateral', out, '--revolutions', 2, '--rate', 50
    said = f'{out}: 40 states, 0.8 s; linkage_replay {out} --viewer web --no-ros shows it\n'
    assert called(record_module, *words) == (0, said, '')
    assert len(states_of(out)) == 40
    assert logged(out)[0].configuration == preset(rate_hz=50.0)
    words = 'quadrilateral', '/dev/null', '--overwrite', '--duration', 0.005
    assert called(record_module, *words) == (0, '/dev/null: 1 state, 0.005 s\n', '')


def test_a_parameter_file_is_recorded_with_its_own_values(called, out, params):
    """Without a mechanism, the values change the preset, which the command reports."""
    alone = '/**:\n  ros__parameters: {rpm: 60, rate_hz: 20, log_overwrite: true}\n'
    for text in (layout(rpm='60', rate_hz='20', log_overwrite='true'), alone):
        params.write_text(text)
        out.write_bytes(b'')  # replaced, because the file sets log_overwrite
        code, said, errors = called(record_module, params, out, '--duration', 1)
        assert (code, errors, 'no mechanism given' in said) == (0, '', text == alone)
        configuration = logged(out)[0].configuration
        assert (configuration.drive.rpm, len(states_of(out))) == (60.0, 20)
    assert configuration.mechanism == load('quadrilateral').mechanism


def test_existing_file_is_kept_unless_overwrite_is_set(called, out):
    out.write_bytes(b'precious')
    refusal = called(record_module, 'quadrilateral', out)
    assert_refused(*refusal, r'already exists.* or give --overwrite')
    refusal = called(record_module, 'quadrilateral', out, '--overwrite')
    assert_refused(*refusal, f'{out} is not a log and was not replaced: choose another name')
    assert out.read_bytes() == b'precious'
    out.write_bytes(b'')
    assert called(record_module, 'quadrilateral', out, '--overwrite', '--duration', 0.1)[0] == 0
    assert len(states_of(out)) == 20


BAD_FILES = {
    'crank stopped': (
        lengths(2.0, 2.0, 2.1, 2.3),
        # 360 -+ cos^-1((2^2 + 2.3^2 - 4.1^2) / (2 2 2.3))
        r'triple-rocker .* = -0.2 m is negative; .* at most 1.8 m .* 215.176 to 504.824 deg;',
    ),
    'binary': (bytes(range(256)) * 16, 'is not a text file'),
    'measured crank': (
        json.dumps({'/**': {'ros__parameters': FOLLOWED}}),
        'run linkage_node, or give linkage_record --measured BAG',
    ),
    # Otherwise a typing error in the node's name would record another linkage.
    'another node': (
        layout().replace('/**', 'linkage_mode'),
        r'has no parameters of /linkage_node, only of linkage_mode: write /\*\* or',
    ),
}


@pytest.mark.parametrize(('text', 'words'), BAD_FILES.values(), ids=BAD_FILES)
def test_a_bad_file_is_refused_in_one_line_and_leaves_no_log(called, out, params, text, words):
    params.write_bytes(text if isinstance(text, bytes) else text.encode())
    assert_refused(*called(record_module, params, out, '--duration', 0.1), words)
    assert not out.exists()


# These valid files must not be refused.
GOOD_FILES = {
    'whole numbers': layout(rpm='150', crank='{length: 1}', coupler='{length: 3}',
                            rocker='{length: 3}', frame='{length: 2}', gravity='[0, -10]'),
    'standing still': layout(rpm='0.0'),
    'rhombus': lengths(1.0, 1.0, 1.0, 1.0),
    'change point in decimals': lengths(0.1, 0.4, 0.3, 0.2),
    'shortest links': lengths('1.0e-9', '3.0e-9', '2.5e-9', '2.0e-9'),
    'longest links': lengths('1.0e8', '3.0e8', '2.5e8', '2.0e8'),
    'exponents as rcl takes them': layout(rpm='1e2', rate_hz='2e2'),
}  # fmt: skip


@pytest.mark.parametrize('text', GOOD_FILES.values(), ids=GOOD_FILES)
def test_a_degenerate_but_possible_file_is_recorded(called, out, params, text):
    params.write_text(text)
    code, _, noted = called(record_module, params, out, '--duration', 0.5)
    assert (code, [*filter(None, re.split('note: .*\n', noted))]) == (0, [])
    states = states_of(out)
    assert len(states) == 100
    assert all(math.isfinite(number) for _, numbers in states for number in numbers)


@pytest.mark.parametrize(
    ('words', 'reason'),
    [
        ([], 'required: PARAMS, OUT.mcap; see linkage_record --help'),
        (['', 'run.mcap'], "no preset '': choose one of .*, wiper"),
        *(
            ([name, 'run.mcap'], f"no preset '{re.escape(name)}': choose one of .*quadrilateral")
            for name in ('pentagon', 'quadrilatera', '*')
        ),
        (['.', 'run.mcap'], 'Is a directory'),
        (['quadrilateral', '/proc/missing/run.mcap'], 'cannot be written'),
        (['quadrilateral', '.', '--overwrite'], '. is a folder: add a file name'),
        (['quadrilateral', 'run.csv'], 'run.csv is not a name for a log, .*: write NAME.mcap'),
        (['quadrilateral', 'no/way/run.mcap'], 'cannot be written: there is no folder no$'),
        (['quadrilateral', '/dev/full', '--overwrite'], 'is not a log and was not replaced'),
        (['quadrilateral', 'run.mcap', '--speed', '1'], 'unrecognized arguments: --speed'),
        (['quadrilateral', 'run.mcap', '--rate', '1e6'], "--rate: '1e6': must be a number fr"),
        (['quadrilateral', 'run.mcap', '--duration', 'nan'], r"'nan': .* from 1e-09 to 1e\+09 s"),
        (['quadrilateral', 'run.mcap', '--revolutions', '1.5'], "'1.5': must be a whole number"),
        (['quadrilateral', 'run.mcap', '--duration', '1', '--revolutions', '1'], 'not allowed w'),
        (['quadrilateral', 'run.mcap', '--revolutions', '1' * 5000], "'111.*111': must be a who"),
        (['quadrilateral', 'run.mcap', '--duration', '1e18'], "'1e18': must be a number from"),
    ],
)
def test_a_wrong_command_line_is_one_line(called, tmp_path, monkeypatch, words, reason):
    monkeypatch.chdir(tmp_path)
    assert_refused(*called(record_module, *words), reason)
    assert list(tmp_path.iterdir()) == []


# ---------------------------------------------------------------- as a process


def test_ctrl_c_leaves_a_complete_log(out):
    words = command('record', 'quadrilateral', out, '--duration', 1e6, '--rate', 1000)
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as run:
        try:
            # The configuration takes less than 4000 bytes, every chunk more than 80 000.
            wait_for(lambda: out.exists() and out.stat().st_size > 80_000)
            run.send_signal(signal.SIGINT)
            said, errors = run.communicate(timeout=PATIENCE)
        finally:
            run.kill()
    assert (run.returncode, errors.strip()) == (130, '')
    states = states_of(out)
    assert said == f'{out}: stopped; {len(states)} states kept\n'
    assert [stamp for stamp, _ in states] == [tick * 10**6 for tick in range(len(states))]
    assert len(states) > 1_500


@pytest.mark.parametrize(('lead', 'duration', 'leaves'), [(0.2, 0.1, 0), (0.2, 0.2, 1)])
def test_note_on_a_load_curve_counts_recorded_states_alone(out, lead, duration, leaves):
    """The feed-forward torque is computed for later states, which may be beyond the curve."""
    configuration = configure({
        **dict(read_values('slider_crank')), 'rpm': 60.0, 'start_rpm': 60.0, 'crank_angle': 0.0,
        **load_values('curve', link='slider', over='position', at=[2.1, 2.5], value=[-1.0, -1.0]),
        'effort_command_topic': 'torque', 'lead_time': lead,
    })  # fmt: skip
    lines = []
    record(configuration, out, duration=duration, note=lines.append)
    assert len(lines) == leaves
