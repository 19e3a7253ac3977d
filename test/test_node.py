# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The real node as a process on real DDS, observed from this process, speed- or torque-driven."""

import math
import re
import signal
import time
from dataclasses import replace
from itertools import groupby, pairwise
from pathlib import Path

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from joint_codec import JointStateCodec
from mechanisms import FOLLOWED
from one_linkage import with_linkage
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message, serialize_message
from ros_harness import (
    CODEC,
    assert_refused,
    command,
    decoded,
    finished,
    logged,
    node_arguments,
    set_parameter,
    stop,
    unbroken,
    verified,
    wait_for,
    watched,
)
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from test_torque_drive import MASSLESS

from linkage_ros.messages.cdr import stamp_of
from linkage_ros.node import linkage_node as node
from linkage_ros.programs import controller
from linkage_ros.settings.configuration import load
from linkage_ros.settings.presets import preset_path
from linkage_ros.units import NS_PER_S

STATES = '/joint_states'
OUTPUTS = (STATES, '/driving_torque', '/mechanism_state', '/points/coupler_point')


def times_of(reports):
    """Returns the stamps of diagnostics, s."""
    return [stamp_of(data) / NS_PER_S for data in reports]


@pytest.fixture(scope='module')
def run(tmp_path_factory):
    """Runs at 200 Hz for three reports; returns received and logged messages, output, memory."""
    path = tmp_path_factory.mktemp('run') / 'run.mcap'
    topics = (*OUTPUTS, '/robot_description', '/diagnostics')
    arguments = node_arguments(log=path)
    with watched(topics, *arguments, program=command('node')) as (listener, process):
        told = listener.received['/diagnostics']
        # After a late report, the next one is on time again.
        listener.await_more(300)
        wait_for(lambda: len(told) >= 3 and any(b - a < 1.5 for a, b in pairwise(times_of(told))))
        status = Path(f'/proc/{process.pid}/status').read_text()
        output = stop(process)
        log, messages = logged(path)
        heard = listener.received
        wait_for(lambda: all(heard[t][-1] == messages[t][-1].data for t in topics[:-1]))
    return log, messages, heard, output, status


def test_every_message_arrives_in_order_with_stamps_one_period_apart(run):
    log, messages, received, output, _ = run
    for topic, heard in received.items():
        sent = [message.data for message in messages[topic]]
        if topic == '/diagnostics':  # the last message comes at the end
            sent = sent[: sent.index(heard[-1]) + 1]
        assert sent[-len(heard) :] == heard, topic
    stamps = [stamp for stamp, _ in decoded(received[STATES])]
    gaps = {later - earlier for earlier, later in pairwise(stamps)}
    missed = int(re.search(r'(\d+) ticks? missed,', output)[1])
    assert {gap % 5_000_000 for gap in gaps} == {0}
    assert gaps == {5_000_000} or missed
    # Every tick is kept or missed.
    states = [stamp for stamp, _ in decoded(message.data for message in messages[STATES])]
    due = (states[-1] - states[0]) // 5_000_000 + 1
    assert 300 <= due <= len(states) + missed
    assert verified(log.path).compared == (*OUTPUTS, '/robot_description')
    session = replace(load('quadrilateral').session, log=str(log.path))
    assert log.configuration == with_linkage(load('quadrilateral'), session=session)


def test_diagnostics_come_once_a_second_with_figures(run):
    log, messages, received, *_ = run
    times = times_of(received['/diagnostics'])
    assert all(later - earlier > 1.0 for earlier, later in zip(times, times[2:], strict=False))
    told = deserialize_message(received['/diagnostics'][2], DiagnosticArray)
    motion, log_part, viewer = told.status
    names = ['linkage_node: motion', 'linkage_node: log', 'linkage_node: viewer']
    assert [motion.name, log_part.name, viewer.name] == names
    values = {pair.key: pair.value for pair in motion.values}
    assert float(values['rate kept, Hz']) > 0
    assert 0 < int(values['states']) <= len(messages[STATES])
    assert float(values['loop residual, m']) < 1e-15
    assert float(values['crank speed, rad/s']) == pytest.approx(15.708)
    assert (log_part.level, log_part.message, viewer.message) == (b'\0', 'ok', 'off')
    assert {status.hardware_id for status in told.status} == {'four_bar'}
    values = {pair.key: pair.value for pair in log_part.values}
    assert values == {'target': str(log.path), 'lost': '0'}


def test_memory_stays_below_130_mb_and_the_start_line_names_the_preset(run):
    *_, output, status = run
    assert int(re.search(r'VmHWM:\s+(\d+) kB', status)[1]) < 130_000
    assert 'no mechanism given, so the quadrilateral: four_bar, open, crank-rocker' in output


def test_rpm_is_set_live_in_a_namespace_and_a_signal_ends_with_a_complete_log(tmp_path):
    path, states = tmp_path / 'run.mcap', '/left/joint_states'
    arguments = node_arguments(log=path, crank_acceleration='40.0', rate_hz='1000.0')
    arguments += ['-r', '__ns:=/left', '-r', 'driving_torque:=torque']
    with watched([states, '/diagnostics'], *arguments) as (listener, process):
        listener.await_more(100, states)
        for value in ({'type': 2, 'integer_value': -60}, {'type': 3, 'double_value': 0.5}):
            assert set_parameter(listener, 'rpm', '/left', **value).successful
            if 'integer_value' in value:
                wait_for(lambda: decoded(listener.received[states][-1:])[0][1][3] < -6.28)
        listener.await_more(100, states)
        stop(process, signal.SIGHUP)
    told = deserialize_message(listener.received['/diagnostics'][0], DiagnosticArray)
    assert told.status[0].name == 'left/linkage_node: motion'
    log, messages = logged(path)
    assert len(messages[states]) >= len(listener.received[states])
    assert [segment.rpm for segment in log.motions['']] == [150.0, -60.0, 0.5]
    moved = (
        'joint_states',
        'torque',
        'mechanism_state',
        'points/coupler_point',
        'robot_description',
    )
    assert set(messages) == {'/diagnostics', *(f'/left/{name}' for name in moved)}
    verified(path)


# ---------------------------------------------------------------- refusals and help

PUMP = ['--params-file', preset_path('wind_pump')]
QUADRILATERAL = ['--params-file', preset_path('quadrilateral')]
BAD = [
    (['-p', 'rpm:=fast'], r"rpm = 'fast': must be a number from -1e\+06 to 1e\+06 rpm"),
    (['-p', 'crank.length:=0.3'], 'cannot turn fully: .* it reaches'),
    (['-p', 'gravity:=[0, -9.81]'], 'same type'),
    (['-p', 'log:='], 'override rule'),
    (['-p', 'log:=/nowhere/at/all/run.mcap'], 'cannot be written: there is no folder /nowhere$'),
    (['-p', 'viewer:=nonsense'], 'nonsense'),
    (['-p', 'use_sim_time:=3'], 'use_sim_time'),
    ([*QUADRILATERAL, '-p', 'effort_command_topic:=joint_states'], 'joint_states'),
    (
        [*QUADRILATERAL, '-p', 'trajectory_command_topic:=mechanism_state'],
        ' mechanism_state and trajectory_.* = mechanism_state .*: change the parameter$',
    ),
    (
        [
            *node_arguments(effort_command_topic='/cmd', trajectory_command_topic='cmd')[1:],
            *QUADRILATERAL,
        ],
        'effort_command_topic = /cmd and trajectory_command_topic = cmd .*: change the parameter',
    ),
    # of another type
    ([*QUADRILATERAL, '-p', 'effort_command_topic:=/rosout'], '/rosout: change the parameter'),
    (
        ['-r', 'driving_torque:=joint_states'],
        'joint_states and driving_torque .*, -r driving_torque:=linkage/driving_torque',
    ),
    *(
        (
            [*node_arguments(**FOLLOWED | {'drive': drive})[1:], '-r', f'{heard}:={own}'],
            f'{heard} and {own} are the same topic, /{own}: .* -r {own}:=linkage/{own}$',
        )
        for drive, heard, own in (
            ('follow', 'measured_joint_states', 'joint_states'),
            ('follow', 'measured_joint_states', 'driving_torque'),  # of another type
            ('torque', 'joint_commands', 'joint_states'),
        )
    ),
    (  # a remapping would affect both
        node_arguments(**FOLLOWED, effort_command_topic='/measured_joint_states')[1:],
        'effort_command_topic = .*: change the parameter$',
    ),
    (['-r', '__ns:=9x'], 'remap rule'),
    # Without a mechanism of its own, a machine must not get the quadrilateral's torque.
    *(
        (['-p', f'{name}:={value}'], f'{name} = .{value}.: a mechanism must be given')
        for name, value in (
            ('effort_command_topic', '/arm/commands'),
            ('trajectory_command_topic', 'arm/joint_trajectory'),
        )
    ),
    (['-p', 'drive:=follow'], 'drive = follow: a mechanism must be given'),
    (['--params-file', '/nowhere.yaml'], '/nowhere.yaml: No such file .*; give the path of a p'),
    (['--params-file', 'quadrilateral'], r'is a preset, and --params-file takes a path: .*\.yaml'),
    ([*PUMP, '-p', 'drive:=speed'], "drive = 'speed': must be torque"),
    ([*PUMP, '-p', 'slider.position:=0.1'], 'the motion cannot start: coupler and rod do not'),
]


@pytest.mark.parametrize(('arguments', 'words'), BAD, ids=[words for _, words in BAD])
def test_a_bad_start_is_one_line_and_code_2(called, arguments, words):
    assert_refused(*called(node, '--ros-args', *arguments), words)


@pytest.mark.parametrize('module', [node, controller], ids=['node', 'controller'])
def test_a_file_for_other_nodes_is_refused_with_their_names(called, tmp_path, module):
    """rcl ignores such a file, and the quadrilateral's torque would reach somebody's motor."""
    path = tmp_path / 'left.yaml'
    own = '{ros__parameters: {mechanism: slider_crank}}'
    path.write_text(f'/left/*: {own}\nrobot: {{ros__parameters: {{a: 1}}}}\n')
    words = r'left\.yaml has no parameters of /right/linkage_\w+, only of /left/\*, robot: write /'
    options = '-r', '__ns:=/right', '--params-file', path, '-p', 'effort_command_topic:=/motor'
    assert_refused(*called(module, '--ros-args', *options), words)
    # With this namespace, the section applies.
    options = '-r', '__ns:=/left', '--params-file', path
    assert 'has no parameters' not in called(module, '--ros-args', *options)[2]


@pytest.mark.parametrize('module', [node, controller], ids=['node', 'controller'])
def test_parameters_before_ros_args_are_refused_with_their_right_place(called, module):
    words = 'unknown: -p rpm:=30; parameters follow --ros-args'
    assert_refused(*called(module, '-p', 'rpm:=30'), words)


def test_a_bad_viewer_or_log_leaves_nothing_behind(called, tmp_path):
    log, view = tmp_path / 'run.mcap', tmp_path / 'run.rrd'
    log.write_text('an earlier log')
    given = node_arguments(log=log, log_overwrite='true', viewer='nonsense')
    assert_refused(*called(node, *given), 'nonsense')
    assert log.read_text() == 'an earlier log'
    given = node_arguments(log=log, viewer=view)
    assert_refused(*called(node, *given), 'already exists')
    assert not view.exists()
    given = *node_arguments(log=view, drive='torque'), '-r', 'joint_commands:=joint_states'
    assert_refused(*called(node, *given), 'are the same topic')
    assert not view.exists()


# ---------------------------------------------------------------- simulated time

DESCRIPTION = '/robot_description'
MS = 10**6
START = 50 * 10**9


def stamps(listener):
    return [stamp for stamp, _ in decoded(listener.received[STATES])]


@pytest.fixture(scope='module')
def simulated(tmp_path_factory):
    """Runs a node on a clock that starts late, is slow, stops, jumps back and is invalid."""
    path = tmp_path_factory.mktemp('simulated') / 'run.mcap'
    arguments = node_arguments(use_sim_time='true', log=path)
    with watched([STATES, DESCRIPTION], *arguments) as (listener, process):
        publisher = listener.node.create_publisher(Clock, '/clock', 10)

        def tell(now):
            message = Clock()
            message.clock.sec, message.clock.nanosec = divmod(now, 10**9)
            publisher.publish(message)
            return stamps(listener)[-1:] == [now]

        def run(begin, steps, pause):
            """Publishes clock times 10 ms apart, each until its state has arrived."""
            for now in range(begin, begin + (steps + 1) * 10 * MS, 10 * MS):
                wait_for(lambda now=now: tell(now))
                time.sleep(pause)

        wait_for(lambda: listener.received[DESCRIPTION])  # does not wait for the clock
        assert stamps(listener) == []  # no states without a clock
        run(START, 50, 0.02)
        for _ in range(20):
            tell(START + 500 * MS)
            time.sleep(0.01)
        assert len(stamps(listener)) == 101  # the clock stopped
        run(START - 10**9, 20, 0.01)
        for seconds, rest in ((2**31 - 1, 2**32 - 1), (-1, 0)):
            message = Clock()
            message.clock.sec, message.clock.nanosec = seconds, rest
            publisher.publish(message)
        run(START - 10**9 + 210 * MS, 4, 0.01)
        output = stop(process)
    return stamps(listener), path, output


def test_states_follow_a_clock_that_runs_at_half_rate_stops_and_goes_back(simulated):
    got, path, output = simulated
    assert 'the clock was stepped by -1.505 s' in output
    assert got[:101] == [START + 5 * MS * i for i in range(101)]
    assert got[101:] == [START - 10**9 + 5 * MS * i for i in range(51)]
    # The crank continues from its position. The log is in the order of publishing.
    log, messages = logged(path)
    numbers = [values for _, values in decoded(m.data for m in messages[STATES])]
    turned = [b[0] - a[0] for a, b in pairwise(numbers)]
    assert turned == pytest.approx([numbers[0][3] * 0.005] * 151, rel=1e-9)
    assert [motion.stamp for motion in log.motions['']] == [START, START - 10**9]


def test_invalid_clock_messages_do_not_end_the_node(simulated):
    got, path, output = simulated
    assert 'messages on /clock are rejected: 2147483651.29497 s: must be from 0 to' in output
    assert 'a callback failed' not in output
    assert verified(path).states == len(got)


# ---------------------------------------------------------------- torque-driven runs

PUMP_CODEC = JointStateCodec(('crank', 'coupler', 'rod', 'slider'))


def pump(**parameters):
    file = preset_path('wind_pump')  # later values override the file's
    return ['--ros-args', '--params-file', file, *node_arguments(**parameters)[1:]]


def test_the_pump_runs_live_and_its_log_verifies(tmp_path):
    path, view = tmp_path / 'run.mcap', tmp_path / 'run.rrd'
    arguments = [*node_arguments(log=path, viewer=view), *PUMP]
    with watched([STATES], *arguments) as (listener, node):
        listener.await_more(100)
        for name, value, is_taken in (
            *(('motor.torque', 20.0, True), ('motor.torque', math.inf, False)),
            ('motor.damping', 0.0, False),
        ):
            result = set_parameter(listener, name, type=3, double_value=value)  # a double
            assert result.successful == is_taken
        listener.await_more(100)
        output = stop(node, signal.SIGTERM)
    assert 'wind_pump, crossed, motor 8.4 N m - 1.2 N m s x speed' in output
    log, messages = logged(path)
    # A delay of more than 0.25 s starts a segment with the same torque.
    assert [torque for torque, _ in groupby(s.torque for s in log.motions[''])] == [8.4, 20.0]
    states = [message.data for message in messages[STATES]]
    assert verified(path).states == len(states)
    assert unbroken(listener.received[STATES], states)
    rows = np.array([PUMP_CODEC.decode(data)[1] for data in states]).reshape(-1, 3, 4)
    assert rows[0, 1, 0] == pytest.approx(2.0, abs=1e-3)
    # The effort is the motor line at the speed of the same state.
    torques = [motor - 1.2 * rows[i, 1, 0] for i, motor in ((0, 8.4), (-1, 20.0))]
    assert rows[[0, -1], 2, 0] == pytest.approx(torques, abs=1e-11)
    assert view.stat().st_size > 50_000


def test_commands_move_the_plant_within_a_tick_and_time_out(tmp_path):
    path, states, commands = tmp_path / 'run.mcap', '/plant/joint_states', '/ctrl/joint_states'
    renamed = '-r', f'joint_states:={states}', '-r', f'joint_commands:={commands}'
    arguments = node_arguments(
        drive='torque', log=path, rate_hz=500.0, torque_limit=4.0, command_timeout=0.3,
        gravity='[0.0, 0.0]', **{'motor.damping': 0.1},
    )  # fmt: skip
    with watched([states], *arguments, *renamed) as (listener, node):
        reliable, best_effort = (
            listener.node.create_publisher(
                JointState, commands, QoSProfile(depth=10, reliability=reliability)
            )
            for reliability in (ReliabilityPolicy.RELIABLE, ReliabilityPolicy.BEST_EFFORT)
        )
        wait_for(reliable.get_subscription_count)
        listener.await_more(1, states)

        def acts(torque):
            """Returns whether the last state has the effort that belongs to its speed."""
            _, numbers = CODEC.decode(listener.received[states][-1])
            return numbers[6] == pytest.approx(torque - 0.1 * numbers[3], abs=1e-12)

        def held(command, torque, publisher):
            publisher.publish(JointState(name=['crank'], effort=[command]))
            return acts(torque)

        for held_now in ((1.5, 1.5, reliable), (0.75, 0.75, best_effort), (-99.0, -4.0, reliable)):
            wait_for(lambda held_now=held_now: held(*held_now))
        for name, efforts in (('crank', [math.nan]), ('rocker', [1.0]), ('crank', [1.0, 2.0])):
            reliable.publish(JointState(name=[name], effort=efforts))
        wait_for(lambda: acts(0.0))
        listener.await_more(100, states)
        output = stop(node)
    # Refused one by one.
    assert output.count(f'messages on {commands} are rejected: effort nan') == 1
    assert f'no command on {commands} within command_timeout: the motor alone' in output
    report = verified(path)
    assert (states in report.compared, commands in report.others) == (True, True)
    _, messages = logged(path)
    heard = [deserialize_message(m.data, JointState).effort for m in messages[commands]]
    assert [heard[0].tolist(), heard[-1].tolist()] == [[1.5], [1.0, 2.0]]  # invalid ones too


def test_commands_expire_in_simulated_time(tmp_path):
    """At 1 Hz, the last command acts for two ticks, however little real time passes."""
    path = tmp_path / 'run.mcap'
    arguments = node_arguments(
        drive='torque', use_sim_time='true', log=path, rate_hz=1.0, command_timeout=2.0,
        gravity='[0.0, 0.0]',
    )  # fmt: skip
    with watched([STATES, DESCRIPTION], *arguments) as (listener, node):
        # The node hears of the subscriptions in order, so that it will not lose the first state.
        wait_for(lambda: listener.received[DESCRIPTION])
        times, commands = (
            listener.node.create_publisher(kind, topic, 10)
            for kind, topic in ((Clock, '/clock'), (JointState, 'joint_commands'))
        )

        def efforts():
            return [round(numbers[6], 9) for _, numbers in decoded(listener.received[STATES])]

        def tick():
            """Publishes the time of the next tick until its state has arrived."""
            message, states = Clock(), len(efforts())
            message.clock.sec = 100 + states
            wait_for(lambda: times.publish(message) or len(efforts()) > states)

        while not any(efforts()):
            commands.publish(JointState(name=['crank'], effort=[1e-3 + 1e-3 * len(efforts())]))
            tick()
        while efforts()[-1]:
            tick()
        stop(node)
    assert verified(path).states == len(efforts())
    assert efforts().count(efforts()[-2]) == 2


def switches(process, name):
    """Returns how often a thread of a process was woken."""
    (thread,) = (
        task for task in Path(f'/proc/{process}/task').iterdir()
        if (task / 'comm').read_text() == f'{name}\n'
    )  # fmt: skip
    status = (thread / 'status').read_text()
    return int(re.search(r'\nvoluntary_ctxt_switches:\s+(\d+)', status)[1])


def test_a_flood_of_commands_costs_neither_memory_nor_ticks(tmp_path):
    path = tmp_path / 'run.mcap'
    arguments = node_arguments(
        **{'drive': 'torque', 'rate_hz': 1000.0, 'log': path, 'motor.damping': 0.5}
    )
    topics = {STATES: 'sensor_msgs/msg/JointState', '/rosout': 'rcl_interfaces/msg/Log',
              '/diagnostics': 'diagnostic_msgs/msg/DiagnosticArray'}  # fmt: skip
    with watched(topics, *arguments) as (listener, node):
        publisher = listener.node.create_publisher(JointState, 'joint_commands', 10)
        wait_for(publisher.get_subscription_count)
        listener.await_more(1, '/diagnostics')  # the first report takes memory once
        states, said, sent, used, woken = listener.received[STATES], '/rosout', 0, [], []

        def send(effort):
            nonlocal sent
            sent += 1
            publisher.publish(serialize_message(JointState(name=['crank'], effort=[effort])))

        def acts(effort):
            _, numbers = CODEC.decode(states[-1])
            return numbers[6] + 0.5 * numbers[3] == pytest.approx(effort, abs=1e-9)

        while sent < 21_000:
            if len(used) < 1 + sent // 6_000:
                used.append(int(Path(f'/proc/{node.pid}/statm').read_text().split()[1]))
                woken.append(switches(node.pid, 'executor'))
            for number in range(50):  # the node keeps the last 100 that it has not read
                send(1.0 if number % 7 else math.nan)
            effort = 1.0 + sent % 1_000 / 1_000
            wait_for(lambda effort=effort: send(effort) or acts(effort), pause=0.001)
        publisher.publish(b'\0\1\0\0' + b'\xff' * 40)  # no message at all
        wait_for(lambda: any(b'not a JointState' in one for one in listener.received[said]))
        output = stop(node)
    # In pages of 4096 bytes: 300 bytes of each command would be seen.
    assert used[-1] - used[1] < 3 * 2**20 / 4096
    # A command that woke a thread of the node would cost a tick: five of six were missed.
    assert woken[-1] - woken[0] < sent / 10
    assert 'are rejected: effort nan: must be' in output
    assert 'its bytes are not a JointState' in output
    assert 'sequence size' not in output  # printed by Fast CDR for each
    _, messages = logged(path)
    assert sent / 4 < len(messages['/joint_commands']) <= sent + 1
    first, last = (CODEC.decode(messages[STATES][i].data)[0] for i in (0, -1))
    assert output.count('are rejected') <= 2 + (last - first) / 1e9  # once a second


def test_a_motion_that_ends_ends_the_node_with_a_complete_log(tmp_path):
    path, file = tmp_path / 'run.mcap', tmp_path / 'massless.yaml'
    file.write_text(MASSLESS)
    done = finished('node', '--ros-args', '--params-file', file, '-p', f'log:={path}')
    assert done.returncode == 1
    output = done.stdout + done.stderr
    (said,) = [line for line in output.splitlines() if 'the motion ends' in line]
    assert 'the motion is too fast for the shortest step' in said
    assert 'Traceback' not in output
    assert verified(path).states > 0
