# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The torque-driven node on real DDS: commands in, motion out, and how it ends."""

import math
import time
from pathlib import Path

import numpy as np
import pytest
from joint_codec import JointStateCodec
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message, serialize_message
from ros_harness import (
    CODEC,
    finished,
    logged,
    node_arguments,
    stop,
    unbroken,
    verified,
    wait_for,
    watched,
)
from sensor_msgs.msg import JointState
from test_node_parameters import set_parameter
from test_torque_drive import MASSLESS

from linkage_ros.parameters.presets import preset_path
from linkage_ros.run.simulator import Simulator

STATES = '/joint_states'
PUMP = JointStateCodec(('crank', 'coupler', 'rod', 'slider'))


def pump(**parameters):
    file = preset_path('wind_pump')  # what comes after it, replaces its values
    return ['--ros-args', '--params-file', file, *node_arguments(**parameters)[1:]]


def test_the_pump_runs_live_and_its_log_verifies(tmp_path):
    path, view = tmp_path / 'run.mcap', tmp_path / 'run.rrd'
    with watched([STATES], *pump(log=path, viewer=view)) as (listener, node):
        listener.await_more(100)
        for name, value, is_taken in (
            *(('motor.torque', 20.0, True), ('motor.torque', math.inf, False)),
            ('motor.damping', 0.0, False),
        ):
            result = set_parameter(listener, name, type=3, double_value=value)  # a double
            assert result.successful == is_taken
        listener.await_more(100)
        output = stop(node)
    assert 'wind_pump, crossed, motor 8.4 N m - 1.2 N m s x speed' in output
    log, messages = logged(path)
    assert [segment.torque for segment in log.motions] == [8.4, 20.0]
    states = [message.data for message in messages[STATES]]
    assert verified(path).states == len(states)
    assert unbroken(listener.received[STATES], states)
    rows = np.array([PUMP.decode(data)[1] for data in states]).reshape(-1, 3, 4)
    assert rows[0, 1, 0] == pytest.approx(2.0, abs=1e-3)
    # What acts is the motor line at the speed of that very state.
    torques = [motor - 1.2 * rows[i, 1, 0] for i, motor in ((0, 8.4), (-1, 20.0))]
    assert rows[[0, -1], 2, 0] == pytest.approx(torques, abs=1e-11)
    assert view.stat().st_size > 50_000


def test_commands_move_the_plant_within_a_tick_and_time_out(tmp_path):
    path = tmp_path / 'run.mcap'
    arguments = node_arguments(
        drive='torque', log=path, rate_hz=500.0, torque_limit=4.0, command_timeout=0.3,
        gravity='[0.0, 0.0]', **{'motor.damping': 0.1},
    )  # fmt: skip
    with watched([STATES], *arguments) as (listener, node):
        reliable, best_effort = (
            listener.node.create_publisher(
                JointState, 'joint_commands', QoSProfile(depth=10, reliability=reliability)
            )
            for reliability in (ReliabilityPolicy.RELIABLE, ReliabilityPolicy.BEST_EFFORT)
        )
        wait_for(reliable.get_subscription_count)
        listener.await_more(1)

        def acts(torque):
            """Whether the last state has the effort that goes with its speed."""
            _, numbers = CODEC.decode(listener.received[STATES][-1])
            return numbers[6] == pytest.approx(torque - 0.1 * numbers[3], abs=1e-12)

        def held(command, torque, publisher):
            publisher.publish(JointState(name=['crank'], effort=[command]))
            return acts(torque)

        for held_now in ((1.5, 1.5, reliable), (0.75, 0.75, best_effort), (-99.0, -4.0, reliable)):
            wait_for(lambda held_now=held_now: held(*held_now))
        for name, efforts in (('crank', [math.nan]), ('rocker', [1.0]), ('crank', [1.0, 2.0])):
            reliable.publish(JointState(name=[name], effort=efforts))
        wait_for(lambda: acts(0.0))
        listener.await_more(100)
        output = stop(node)
    # Refused one by one, and said at most once a second.
    assert output.count('a message on /joint_commands is left out: effort nan') == 1
    assert output.count('is left out') <= 2
    assert 'no command within command_timeout: the motor drove alone' in output
    assert '/joint_commands' in verified(path).others
    _, messages = logged(path)
    heard = [deserialize_message(m.data, JointState).effort for m in messages['/joint_commands']]
    assert [heard[0].tolist(), heard[-1].tolist()] == [[1.5], [1.0, 2.0]]  # bad ones too


def test_a_flood_of_commands_costs_neither_memory_nor_ticks(tmp_path):
    path = tmp_path / 'run.mcap'
    arguments = node_arguments(
        **{'drive': 'torque', 'rate_hz': 1000.0, 'log': path, 'motor.damping': 0.5}
    )
    good, bad = (
        serialize_message(JointState(name=['crank'], effort=[effort]))
        for effort in (1.0, math.nan)
    )
    with watched([STATES], *arguments) as (listener, node):
        publisher = listener.node.create_publisher(JointState, 'joint_commands', 10)
        wait_for(publisher.get_subscription_count)
        listener.await_more(1)
        sent, used = 15_000, {}
        for number in range(sent):
            publisher.publish(bad if number % 7 == 0 else good)
            if number % 10 == 0:
                time.sleep(1e-3)  # at most 10 000 a second
            if number in (5000, sent - 1):
                used[number] = int(Path(f'/proc/{node.pid}/statm').read_text().split()[1])
        time.sleep(1.0)  # it says at most once a second what it refuses
        publisher.publish(b'\0\1\0\0' + b'\xff' * 40)  # no message at all
        listener.await_more(100)
        output = stop(node)
    # In pages of 4096 bytes: 300 bytes of each command would be seen.
    assert used[sent - 1] - used[5000] < 3 * 2**20 / 4096
    assert 'is left out: effort nan: must be' in output
    assert 'is left out: its bytes are no JointState' in output
    assert 'sequence size' not in output  # Fast CDR's line for each
    log, messages = logged(path)
    assert sent / 4 < len(messages['/joint_commands']) <= sent + 1
    first, last = (CODEC.decode(messages[STATES][i].data)[0] for i in (0, -1))
    assert output.count('is left out') <= 2 + (last - first) / 1e9  # once a second
    # When each command woke a thread of the node, five of six ticks were missed.
    due = Simulator(log.configuration).tick_at(last - first)
    assert len(messages[STATES]) > due / 3


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
