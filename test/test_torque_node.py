# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The torque-driven node on real DDS: commands in, motion out, and how it ends."""

from __future__ import annotations

import math
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message, serialize_message
from ros_harness import (
    Listener,
    command,
    environment,
    fresh_domain,
    node_arguments,
    running,
    unbroken,
    wait_for,
)
from sensor_msgs.msg import JointState
from test_node import logged, set_parameter, stop

from linkage_ros.log.reader import LogReader
from linkage_ros.parameters.configuration import configure, load
from linkage_ros.parameters.presets import preset_path
from linkage_ros.record import record
from linkage_ros.run.machine import Machine
from linkage_ros.verification.verify import verify
from linkage_ros.wire.codecs import JointStateCodec

STATES = {'/joint_states': 'sensor_msgs/msg/JointState'}
PUMP = JointStateCodec(('crank', 'coupler', 'rod', 'slider'))
FOUR_BAR = JointStateCodec(('crank', 'coupler', 'rocker'))


def pump(path, **parameters):
    words = [w for name, value in parameters.items() for w in ('-p', f'{name}:={value}')]
    return ['--ros-args', '--params-file', preset_path('wind_pump'), '-p', f'log:={path}', *words]


def check(path):
    with LogReader(path) as log:
        report = verify(log)
    assert report.difference == ''
    return report


def test_the_pump_runs_live_and_its_log_verifies(tmp_path):
    path, domain = tmp_path / 'run.mcap', fresh_domain()
    arguments = pump(path, rate_hz=1000.0, viewer=tmp_path / 'run.rrd')
    with Listener(domain, STATES) as listener, running('node', *arguments, domain=domain) as node:
        wait_for(lambda: len(listener.received['/joint_states']) > 1500)
        # Type 3 is a double.
        assert set_parameter(listener, 'motor.torque', type=3, double_value=20.0).successful
        count = len(listener.received['/joint_states'])
        wait_for(lambda: len(listener.received['/joint_states']) > count + 500)
        bad = set_parameter(listener, 'motor.torque', type=3, double_value=math.inf)
        assert not bad.successful
        assert not set_parameter(listener, 'motor.damping', type=3, double_value=0.0).successful
        code, output = stop(node)
    assert code == 0, output
    assert 'wind_pump, crossed, motor 8.4 N m - 1.2 N m s x speed' in output
    log, messages = logged(path)
    assert [motion.target for motion in log.motions] == [8.4, 20.0]
    assert check(path).states == len(messages['/joint_states'])
    states = [message.data for message in messages['/joint_states']]
    assert unbroken(listener.received['/joint_states'], states)
    rows = np.array([PUMP.decode(data)[1] for data in states]).reshape(-1, 3, 4)
    assert rows[0, 1, 0] == pytest.approx(2.0, abs=1e-3)
    # What acts is the motor line at the speed of that very state.
    assert rows[0, 2, 0] == pytest.approx(8.4 - 1.2 * rows[0, 1, 0], abs=1e-12)
    assert rows[-1, 2, 0] == pytest.approx(20 - 1.2 * rows[-1, 1, 0], abs=1e-11)
    assert (tmp_path / 'run.rrd').stat().st_size > 50_000


def test_commands_move_the_plant_within_a_tick_and_time_out(tmp_path):
    path, domain = tmp_path / 'run.mcap', fresh_domain()
    arguments = [
        '--ros-args', '-p', 'drive:=torque', '-p', 'motor.damping:=0.1', '-p', f'log:={path}',
        '-p', 'rate_hz:=500.0', '-p', 'torque_limit:=4.0', '-p', 'command_timeout:=0.3',
        '-p', 'gravity:=[0.0, 0.0]',
    ]  # fmt: skip
    with Listener(domain, STATES) as listener, running('node', *arguments, domain=domain) as node:
        publisher = listener.node.create_publisher(JointState, 'joint_commands', 10)
        wait_for(lambda: publisher.get_subscription_count() and listener.received['/joint_states'])

        def crank():
            """Speed and effort in the last state."""
            *_, last = listener.received['/joint_states']
            _, _, _, speed, *_, effort, _, _ = FOUR_BAR.decode(last)[1]
            return speed, effort

        def send(names, values):
            publisher.publish(JointState(name=names, effort=values))

        def acts(torque):
            speed, effort = crank()
            return effort == pytest.approx(torque - 0.1 * speed, abs=1e-12)

        def held(command, torque):
            send(['crank'], [command])
            return acts(torque)

        wait_for(lambda: held(1.5, 1.5))
        wait_for(lambda: held(-99.0, -4.0))
        send(['crank'], [math.nan])
        send(['rocker'], [1.0])
        send(['crank'], [1.0, 2.0])
        wait_for(lambda: acts(0.0))
        states = len(listener.received['/joint_states'])
        wait_for(lambda: len(listener.received['/joint_states']) > states + 500)
        code, output = stop(node)
    assert code == 0, output
    # Refused one by one, and said at most once a second.
    assert output.count('a command on joint_commands is refused: effort nan') == 1
    assert output.count('is refused') <= 2
    assert 'no command within command_timeout: the motor drove alone' in output
    report = check(path)
    assert report.states > 500
    assert '/joint_commands' in report.others
    _, messages = logged(path)
    heard = [deserialize_message(m.data, JointState).effort for m in messages['/joint_commands']]
    assert heard[0].tolist() == [1.5]
    assert heard[-1].tolist() == [1.0, 2.0]  # bad ones too


@pytest.mark.parametrize('reliability', ['RELIABLE', 'BEST_EFFORT'])
def test_commands_are_heard_however_reliably_they_are_sent(reliability):
    domain = fresh_domain()
    arguments = node_arguments(drive='torque')
    with Listener(domain, STATES) as listener, running('node', *arguments, domain=domain) as node:
        qos = QoSProfile(depth=1, reliability=ReliabilityPolicy[reliability])
        publisher = listener.node.create_publisher(JointState, 'joint_commands', qos)

        def acts():
            publisher.publish(JointState(name=['crank'], effort=[0.75]))
            last = listener.received['/joint_states'][-1:]
            return [FOUR_BAR.decode(data)[1][6] for data in last] == [0.75]

        wait_for(acts)
        code, output = stop(node)
    assert code == 0, output


@pytest.mark.parametrize('effort', [1.0, math.nan])
def test_a_flood_of_commands_costs_neither_memory_nor_ticks(tmp_path, effort):
    path, domain = tmp_path / 'run.mcap', fresh_domain()
    arguments = [
        '--ros-args', '-p', 'drive:=torque', '-p', 'rate_hz:=1000.0', '-p', f'log:={path}',
        '-p', 'motor.damping:=0.5',
    ]  # fmt: skip
    message = serialize_message(JointState(name=['crank'], effort=[effort]))
    with Listener(domain, STATES) as listener, running('node', *arguments, domain=domain) as node:
        publisher = listener.node.create_publisher(JointState, 'joint_commands', 10)
        wait_for(lambda: publisher.get_subscription_count() and listener.received['/joint_states'])

        def memory():
            return int(Path(f'/proc/{node.pid}/statm').read_text().split()[1]) * 4096 / 2**20

        def flood(seconds):
            begin, sent = time.monotonic(), 0
            while (passed := time.monotonic() - begin) < seconds:
                for _ in range(sent, int(passed * 10_000)):
                    publisher.publish(message)
                    sent += 1
                time.sleep(2e-5)
            return sent

        sent = flood(1.0)
        before = memory()
        sent += flood(3.0)
        grown = memory() - before
        publisher.publish(b'\0\1\0\0' + b'\xff' * 40)  # no message at all
        states = len(listener.received['/joint_states'])
        wait_for(lambda: len(listener.received['/joint_states']) > states + 1500)
        code, output = stop(node)
    assert code == 0, output
    assert grown < 8.0
    words = 'its bytes are no JointState' if effort == 1.0 else 'effort nan: must be'
    assert f'is refused: {words}' in output
    assert 'sequence size' not in output  # Fast CDR's line for each
    log, messages = logged(path)
    assert 0.5 * sent < len(messages['/joint_commands']) <= sent + 1
    machine, states = Machine(log.configuration), messages['/joint_states']
    first, last = (FOUR_BAR.decode(states[i].data)[0] for i in (0, -1))
    assert 0 < output.count('is refused') <= 2 + (last - first) / 1e9  # once a second
    # When each command woke a thread of the node, five of six ticks were missed.
    assert len(states) > 0.5 * machine.tick_at(last - first)


def test_a_stretched_dyad_ends_the_node_with_a_complete_log(tmp_path):
    path, domain = tmp_path / 'run.mcap', fresh_domain()
    arguments = pump(path, **{'slider.velocity': 5.0, 'rate_hz': 1000.0})
    with running('node', *arguments, domain=domain) as node:
        output, errors = node.communicate(timeout=30)
    assert node.returncode == 1
    said = [line for line in (output + errors).splitlines() if 'the motion ends' in line]
    assert len(said) == 1, output + errors
    assert 'at t = 0.39946' in said[0]
    assert 'coupler and rod are stretched' in said[0]
    assert 'Traceback' not in output + errors
    assert check(path).states > 300


@pytest.mark.parametrize(
    ('parameter', 'words'),
    [
        ('drive:=speed', "drive = 'speed': must be torque"),
        ('rpm:=60.0', "'rpm' is not a parameter of a torque-driven wind_pump"),
        ('slider.position:=0.1', 'no motion starts there: coupler and rod do not fit in'),
    ],
)
def test_a_pump_that_cannot_run_is_one_line_and_exit_code_2(tmp_path, parameter, words):
    done = subprocess.run(
        command('node', *pump(tmp_path / 'run.mcap'), '-p', parameter),
        env=environment(fresh_domain()), capture_output=True, text=True, timeout=30, check=False,
    )  # fmt: skip
    assert done.returncode == 2
    assert words in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert not (tmp_path / 'run.mcap').exists()


def test_a_log_of_the_pump_replays_to_the_bit(tmp_path):
    path, domain = tmp_path / 'run.mcap', fresh_domain()
    record(load('wind_pump'), path, duration=1.0)
    with (
        Listener(domain, STATES) as listener,
        running('replay', path, '--rate', '4', domain=domain) as replay,
    ):
        assert replay.wait(timeout=30) == 0
        wait_for(lambda: len(listener.received['/joint_states']) == 200)
    log, messages = logged(path)
    assert listener.received['/joint_states'] == [m.data for m in messages['/joint_states']]
    assert Machine(log.configuration).joints == PUMP.names


def test_a_log_with_a_controller_s_topic_replays(tmp_path):
    path, domain = tmp_path / 'run.mcap', fresh_domain()
    configuration = configure({'rpm': 60.0, 'effort_command_topic': '/effort_controller/commands'})
    record(configuration, path, duration=0.5)
    topics = {'/effort_controller/commands': 'std_msgs/msg/Float64MultiArray'}
    with Listener(domain, topics) as listener, running('replay', path, domain=domain) as replay:
        assert replay.wait(timeout=30) == 0
        received = listener.received['/effort_controller/commands']
        wait_for(lambda: len(received) == 100)
    assert received == [m.data for m in logged(path)[1]['/effort_controller/commands']]


@pytest.mark.parametrize('topic', ['joint_states', '/driving_torque'])
def test_a_topic_of_two_types_is_one_line_and_exit_code_2(topic):
    done = subprocess.run(
        command('node', '--ros-args', '-p', f'effort_command_topic:={topic}'),
        env=environment(fresh_domain()), capture_output=True, text=True, timeout=30, check=False,
    )  # fmt: skip
    assert done.returncode == 2, done.stderr
    assert 'Traceback' not in done.stderr
    assert len(done.stderr.splitlines()) == 1, done.stderr


def test_too_many_ticks_of_a_torque_are_said_to_grow_with_the_speed():
    topic, domain = '/diagnostics', fresh_domain()
    arguments = node_arguments(drive='torque', rate_hz=1e5)
    with (
        Listener(domain, {topic: 'diagnostic_msgs/msg/DiagnosticArray'}) as heard,
        running('node', *arguments, domain=domain) as node,
    ):
        wait_for(lambda: any(b'a fast crank costs more' in one for one in heard.received[topic]))
        code, output = stop(node)
    assert code == 0
    assert 'add motor.damping or lower rate_hz' in output
