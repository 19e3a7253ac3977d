# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Torque-driven runs: configuration, commands, records, logs and their verification."""

import math
import time
from dataclasses import replace

import numpy as np
import pytest
from joint_codec import JointStateCodec
from live_logs import START, live, ticks
from mechanisms import load_values
from one_linkage import inputs_of, templates_of, with_linkage
from ros_harness import decoded, logged, report_of, verified
from state_messages import messages_at, messages_of
from test_playback import Clock

from linkage_ros import ConfigurationError, LogError, MotionError, Solver
from linkage_ros.log.torque_states import DrivenStates
from linkage_ros.log.writer import LogWriter
from linkage_ros.mechanism import program
from linkage_ros.mechanism.conditions import OWN_CONDITIONS
from linkage_ros.mechanism.tracer import Tape
from linkage_ros.messages.templates import trajectory
from linkage_ros.motion.drives import torque as commands_module
from linkage_ros.motion.drives.torque import TorqueDrive
from linkage_ros.motion.segments import Coordinates
from linkage_ros.motion.steps import AdaptiveSteps
from linkage_ros.motion.under_torque import Motor
from linkage_ros.numeric import within_two_turns
from linkage_ros.programs.record import record
from linkage_ros.run.states import Simulator
from linkage_ros.settings.configuration import configure, load
from linkage_ros.settings.summary import summary
from linkage_ros.units import NS_PER_MS, NS_PER_S

PUMP = load('wind_pump')
QUADRILATERAL = configure({'drive': 'torque', 'motor.torque': 2.0, 'motor.damping': 0.05})
# 150 rpm from rest, with time constants of 5 ns and 6 ms.
STEEP = configure({'drive': 'torque', 'motor.torque': 5e7 * math.pi, 'motor.damping': 1e7})
STUCK = configure({**PUMP.parameters(), 'loads.water.damping': 1e9, 'slider.velocity': 1.0})
HELD = configure({
    **QUADRILATERAL.parameters(), 'start_rpm': 150.0,
    **load_values('link', link='rocker', damping=1e12),
})  # fmt: skip


def sprung(stiffness):
    """Returns parameters of a spring on the rocker."""
    return load_values('link', link='rocker', stiffness=stiffness)


def changed(configuration=PUMP, **parts):
    """Returns a configuration with other fields, grouped by the part that contains them."""
    only = configuration.only
    new = {name: replace(getattr(only, name), **f) for name, f in parts.items()}
    return with_linkage(configuration, **new)


def cranks(path):
    """Returns the crank angles of the states in the log of a four-bar, rad."""
    states = decoded(message.data for message in logged(path)[1]['/joint_states'])
    return np.array([numbers[0] for _, numbers in states])


# ---------------------------------------------------------------- configuration


def test_wind_pump_always_has_drive_torque():
    values = PUMP.parameters()
    unsaid = {name: value for name, value in values.items() if name != 'drive'}
    assert configure(unsaid) == configure(values) == PUMP
    assert isinstance(PUMP.drive, TorqueDrive)
    with pytest.raises(ConfigurationError, match=r'frame\.angle.* is not a parameter'):
        configure({**values, 'frame.angle': 0.0})


def test_a_limited_crank_may_be_driven_by_a_torque_but_not_at_a_speed():
    values = {
        'mechanism': 'four_bar', 'frame.length': 1.0, 'crank.length': 0.9, 'crank.inertia': 1.0,
        'coupler.length': 0.5, 'rocker.length': 0.5,
    }  # fmt: skip
    with pytest.raises(ConfigurationError, match='cannot turn fully'):
        configure({**values, 'rpm': 1.0})
    driven = {**values, 'drive': 'torque'}
    swings = configure({**driven, 'crank_angle': 0.5})
    assert 'transmission' not in summary(swings.only, Solver(swings.mechanism))
    with pytest.raises(
        ConfigurationError,
        match=r'^crank_angle = 3\.14\d* rad: .* at .* = 180 deg: [^;]*; it reaches .* deg$',
    ):
        configure({**driven, 'crank_angle': math.pi})
    with pytest.raises(ConfigurationError, match='links without mass have no finite acceleration'):
        configure({**driven, 'crank_angle': 0.5, 'crank.inertia': 0.0})


# ---------------------------------------------------------------- commands


@pytest.fixture
def clock(monkeypatch):
    clock = Clock(100.0)
    monkeypatch.setattr(time, 'monotonic', clock)
    return clock


@pytest.fixture
def commands(clock):
    return commands_module.TorqueCommands(5.0, 0.5, 'crank')


def test_a_command_acts_from_the_tick_that_reads_it_until_it_expires(commands):
    assert commands.held.at(0, []) == 0.0
    # Time since the last tick, ms, commands read by this tick, and the torque that acts.
    now = 0
    for wait, efforts, torque in (
        *((200, [2.0], 2.0), (499, [], 2.0), (1, [], 0.0), (200, [], 0.0)),
        *((200, [1.0, 5.1], 5.0), (200, [-1e300], -5.0), (200, [-5.0], -5.0)),
        *((499, [], -5.0), (500, [1.5], 1.5), (10_000, [0.5], 0.5), (501, [], 0.0)),
    ):
        now += wait * NS_PER_MS
        read = [commands.commanded(['rocker', 'crank'], [9.0, effort]) for effort in efforts]
        assert commands.held.at(now, read) == torque
        assert float(commands.diagnostics()['command, N m']) == torque
    figures = [*commands.diagnostics().values()]
    assert figures[1:] == ['7', '2', '0', '2']


def test_a_gap_between_commands_is_warned_of_until_its_end_and_three_for_ten_seconds(
    commands, clock
):
    commands.held.at(0, [])
    assert not commands.troubles('')  # no command was ever sent
    commands.held.at(0, [1.5])
    for n, is_reported in ((0, False), (1, False), (2, True)):
        commands.held.at((n + 1) * NS_PER_S - 1, [])
        assert commands.troubles('')
        clock.time += 1.0
        commands.held.at((n + 1) * NS_PER_S, [1.5])
        assert bool(commands.troubles('')) == is_reported
    for wait, is_reported in ((6.5, True), (1.0, False)):
        clock.time += wait
        assert bool(commands.troubles('')) == is_reported


@pytest.mark.parametrize('configuration', [PUMP, QUADRILATERAL])
def test_commands_without_a_limit_are_noted(configuration):
    limited = changed(configuration, drive={'torque_limit': 9.0})
    for given, count in ((configuration, 1), (limited, 0)):
        (source,) = inputs_of(Simulator(given.only)).values()
        found = source.notes('/commands')
        assert len(found) == count
        assert all('torque_limit' in line and '/commands' in line for line in found)


@pytest.mark.parametrize(
    ('names', 'efforts', 'words'),
    [
        (['crank'], [math.nan], 'effort nan'),
        (['crank'], [math.inf], 'effort inf'),
        (['crank'], [], '1 names and 0 efforts'),
        ([], [], 'must name crank'),
        (['Crank'], [1.0], 'it names Crank: must name crank once'),
        (['crank', 'crank'], [1.0, 1.0], 'must name crank once'),
        (['left_crank'], [1.0], 'it names left_crank: must name crank once'),
        (['x' * 500], [1.0], f'it names {"x" * 80}: must'),
    ],
)
def test_a_bad_command_is_refused_and_the_good_one_before_goes_on(commands, names, efforts, words):
    commands.held.at(0, [commands.commanded(['crank'], [1.5])])
    with pytest.raises(ValueError, match=words):
        commands.commanded(names, efforts)
    assert (commands.held.at(1, []), commands.counts[commands_module.TAKEN]) == (1.5, 1)


# ---------------------------------------------------------------- record


# A massless crank at its dead centre, where no coordinates determine the acceleration.
MASSLESS = """/**:
  ros__parameters:
    mechanism: slider_crank
    drive: torque
    crank: {length: 1.0}
    coupler: {length: 1.5}
    slider: {mass: 1.5}
    motor: {torque: 5.0}
    crank_angle: 0.5
"""


def test_record_that_ends_with_an_error_keeps_its_states(tmp_path):
    path = tmp_path / 'run.mcap'
    (tmp_path / 'massless.yaml').write_text(MASSLESS)
    start = load(str(tmp_path / 'massless.yaml'))
    with pytest.raises(MotionError, match=r'too fast.*run\.mcap keeps the \d+ states') as raised:
        record(start, path, duration=5)
    verified(path)
    last = logged(path)[0].end / 1e9
    assert last < raised.value.time <= last + 0.0051
    assert math.degrees(raised.value.coordinates[0]) == pytest.approx(180.0, abs=0.1)


def test_revolutions_are_counted_from_the_start_either_way(tmp_path):
    for sign in (1, -1):
        motor = replace(QUADRILATERAL.drive.motor, torque=sign * 2.0)
        driven = changed(QUADRILATERAL, drive={'motor': motor, 'crank_angle': 1.0})
        count = record(driven, tmp_path / f'{sign}.mcap', revolutions=3)
        turned = abs(cranks(tmp_path / f'{sign}.mcap') - 1.0) / (2 * math.pi)
        assert len(turned) == count
        assert turned[-1] < 3 < turned[-1] + 0.2
    resting = changed(
        QUADRILATERAL, drive={'motor': Motor()}, mechanism={'gravity': (0.0, 0.0)},
        session={'rate_hz': 0.05},
    )  # fmt: skip
    with pytest.raises(ConfigurationError, match=r'0 of 1 .* 3600 s'):
        record(resting, tmp_path / 'rest.mcap', revolutions=1)


@pytest.mark.parametrize(
    'configuration', [STEEP, STUCK, HELD], ids=['steep motor line', 'stiff guide', 'stiff rocker']
)
def test_record_with_strong_damping_is_reproduced_to_the_bit(tmp_path, configuration):
    paths = [tmp_path / f'{i}.mcap' for i in range(2)]
    assert [record(configuration, path, duration=0.5) for path in paths] == [100, 100]
    assert paths[0].read_bytes() == paths[1].read_bytes()
    verified(paths[0])


def test_a_live_run_refuses_a_motion_that_takes_too_many_steps():
    words = r'oscillation takes 0\.\d+ ms and a tick 5 ms: .*(\d\d+ steps per ms|too fast)'
    for values in (sprung(1e9), sprung(1e6), {'start_rpm': 1e5}):
        with pytest.raises(ConfigurationError, match=words):
            Simulator(configure({'drive': 'torque', **values}).only).prepare_live()
    Simulator(configure({'drive': 'torque', **sprung(1e4)}).only).prepare_live()


@pytest.mark.parametrize(('rate', 'timeout'), [(5.0, 0.2), (3.0, 0.333333333), (62.5, 0.016)])
def test_a_live_run_refuses_commands_that_expire_within_a_tick(rate, timeout):
    values = {'drive': 'torque', 'rate_hz': rate}
    Simulator(configure({**values, 'command_timeout': timeout}).only).prepare_live()
    short = Simulator(configure({**values, 'command_timeout': 0.999 * timeout}).only)
    with pytest.raises(ConfigurationError, match=f'must be at least a tick, {timeout} s'):
        short.prepare_live()


def test_the_first_tick_of_a_live_run_compiles_nothing(monkeypatch):
    program._tapes_of.cache_clear()  # as in a new process
    simulator = Simulator(STEEP.only)
    simulator.prepare_live()
    monkeypatch.delattr(Tape, '_compiled')
    assert simulator.begin(START).at(START + NS_PER_MS).u[0] == pytest.approx(5 * math.pi)


# ---------------------------------------------------------------- live runs and verification


PLAN = [
    *ticks(60), ('command', 3.0), *ticks(40), ('skip', 7), *ticks(20), ('motor', -1.5), *ticks(50),
    ('step', -1_234_567_890), ('command', -2.0), *ticks(30), ('step', 98_765_432), *ticks(10),
    ('motor', 4.0), ('skip', 3), *ticks(30), ('skip', 12_000), *ticks(20), ('skip', 1_200),
    *ticks(9),
]  # fmt: skip


@pytest.mark.parametrize(
    'configuration', [PUMP, QUADRILATERAL, STEEP, STUCK],
    ids=['pump', 'quadrilateral', 'steep motor line', 'stiff guide'],
)  # fmt: skip
def test_a_live_run_verifies_through_commands_and_clock_steps(tmp_path, configuration):
    fast = changed(configuration, session={'rate_hz': 1000.0})
    path = live(tmp_path / 'run.mcap', fast, PLAN)
    report = verified(path)
    assert report.states == sum(kind in {'tick', 'step'} for kind, _ in PLAN)
    assert report.missed == 7 + 3 + 12_000 + 1_200
    torques = [segment.torque for segment in logged(path)[0].motions['']]
    assert torques == [fast.drive.motor.torque, -1.5, -1.5, -1.5, 4.0, 4.0, 4.0]


@pytest.mark.parametrize(('rpm', 'torques'), [(19_000.0, [-2e3]), (9_000.0, [-3e3, 3e3])])
def test_long_gaps_at_extreme_speeds_verify(tmp_path, rpm, torques):
    """A tick 74 ms late keeps a large command in force; errors grow with the distance covered."""
    plan = ticks(5)
    for torque in torques:
        plan += [('command', torque), *ticks(2), ('skip', 74), *ticks(2)]
    configuration = changed(QUADRILATERAL, session={'rate_hz': 1000.0}, drive={'start_rpm': rpm})
    report = verified(live(tmp_path / 'run.mcap', configuration, plan))
    assert report.states == 5 + 4 * len(torques)


@pytest.mark.parametrize('rate_hz', [1000.0, 0.5])
def test_plant_is_paused_only_while_a_tick_is_over_a_quarter_second_late(rate_hz):
    simulator, drive = Simulator(changed(session={'rate_hz': rate_hz}).only), PUMP.drive
    motion, latest = simulator.begin(START), simulator.ticks.elapsed(1) + 250_000_000
    before, first = motion.at(START), motion.segment
    assert motion.under(START + latest, OWN_CONDITIONS, drive).segment is first
    moved = motion.at(START + latest)
    assert moved.unwrapped > before.unwrapped
    late = START + 2 * latest + 1
    assert motion.under(late, OWN_CONDITIONS, drive).segment is not first
    assert motion.at(late) == moved


def test_change_of_motor_torque_keeps_the_command_in_force():
    simulator = Simulator(QUADRILATERAL.only)
    motion = simulator.begin(START)
    motion.command(START, 3.0)
    motor = replace(QUADRILATERAL.drive.motor, torque=5.0)
    motion.under(START, OWN_CONDITIONS, replace(QUADRILATERAL.drive, motor=motor))
    assert simulator.state(motion.at(START)).torque == pytest.approx(8.0)


def forge(path, claimed, real):
    """Records one run with the configuration of another."""
    simulator, motion = Simulator(real.only), Simulator(real.only).begin(0, AdaptiveSteps)
    with LogWriter(path, claimed, overwrite=False) as log:
        channels = [
            log.add_topic(topic, f'/{topic.name}') for topic in templates_of(simulator).topics
        ]
        log.write_motion(Simulator(claimed.only).begin(0).segment)
        for tick in range(20):
            stamp = simulator.ticks.elapsed(tick)
            made = messages_at(simulator, motion, stamp)
            for channel, message in zip(channels, made.messages, strict=True):
                log.write(channel, stamp, message)


@pytest.mark.parametrize(
    'part',
    [
        {'drive': {'start_rpm': 57.3}},
        {'mechanism': {'slider': replace(PUMP.mechanism.slider, velocity=1e-4)}},
    ],
)  # fmt: skip
def test_log_with_another_start_than_configured_is_detected(tmp_path, part):
    forge(tmp_path / 'run.mcap', changed(**part), PUMP)
    words = 'state 1, stamp 0 ns: it does not follow from the previous state'
    assert words in report_of(tmp_path / 'run.mcap').difference


@pytest.mark.parametrize('turned', [-9.0, 654_321.0])
def test_state_after_many_turns_belongs_to_the_published_angle(tmp_path, turned):
    drive = {'crank_angle': turned, 'start_rpm': -150.0}
    record(changed(QUADRILATERAL, drive=drive), tmp_path / 'run.mcap', duration=1)
    found = cranks(tmp_path / 'run.mcap')
    assert found[0] == turned
    assert found.min() < turned - 1
    verified(tmp_path / 'run.mcap')


def moved(joint, row, by):
    """Changes a number in joint_states and mechanism_state."""

    def alter(simulator, made):
        codec = JointStateCodec(simulator.joints, parts=trajectory)
        stamp, numbers = codec.decode(made.messages[2])
        rows = np.array(numbers).reshape(4, -1)
        rows[row, joint] += by
        return (
            JointStateCodec(simulator.joints).encode(stamp, rows[0], rows[1], rows[3]),
            made.messages[1],
            codec.encode(stamp, *rows),
            *made.messages[3:],
        )

    return alter


def elsewhere(shift, simulator, made, slide=0.0):
    """Returns a consistent state at another position."""
    q, u, a = ((row[0], row[3]) for row in made.state[:3])  # of crank and slider
    moved_to = made.numbers[0] + shift
    state = Coordinates((within_two_turns(moved_to)[0], q[1] + slide), u, a, moved_to)
    return messages_of(simulator, made.stamp, state).messages


@pytest.mark.parametrize(
    ('alter', 'words'),
    [
        (moved(0, 0, 1e-9), 'mechanism_state|joint_states'),
        (moved(1, 0, 1e-12), 'coupler'),
        (moved(2, 1, 1e-12), 'rod'),
        (moved(3, 2, 1e-12), ''),
        (moved(0, 3, 1e-12), 'effort'),
        (
            lambda m, s: elsewhere(1e-5, m, s),
            'does not follow from the previous state: crank position',
        ),
        (lambda m, s: elsewhere(1e-3, m, s), 'does not follow from the previous state'),
        (lambda m, s: elsewhere(0.0, m, s, 5e-8), 'slider position'),  # the crank is 0.12 m long
        (moved(0, 2, np.inf), 'mechanism_state is not finite'),
    ],
)
def test_changed_state_is_detected(tmp_path, alter, words):
    simulator = Simulator(PUMP.only)

    def change(number, made):
        return alter(simulator, made) if number == 30 else made.messages

    report = report_of(live(tmp_path / 'run.mcap', PUMP, ticks(60), alter=change))
    assert report.difference
    assert report.states in {28, 29, 30}
    assert any(word in report.difference for word in words.split('|'))


def test_states_of_a_good_log_are_checked_together(tmp_path, monkeypatch):
    """Checking a state alone takes many times as long."""
    monkeypatch.setattr(DrivenStates, '_difference', lambda *_: 'checked alone')
    verified(live(tmp_path / 'run.mcap', PUMP, ticks(60)))


def test_record_with_a_torque_that_the_motor_cannot_give_is_detected(tmp_path):
    """Commands occur only in live runs, so a record has none."""
    verified(live(tmp_path / 'a.mcap', PUMP, [*ticks(9), ('command', 1.0), *ticks(9)]))
    other = changed(drive={'motor': replace(PUMP.drive.motor, torque=8.5)})
    forge(tmp_path / 'b.mcap', PUMP, other)
    words = 'effort[crank] = 6.1 logged, 6.0 recomputed'
    assert words in report_of(tmp_path / 'b.mcap').difference


def test_a_log_without_accelerations_cannot_be_verified(tmp_path):
    live(tmp_path / 'run.mcap', PUMP, ticks(1), topics=('joint_states',))
    with pytest.raises(LogError, match='mechanism_state'):
        report_of(tmp_path / 'run.mcap')
