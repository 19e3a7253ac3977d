# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Gravity that changes while the node runs, as for a linkage on a link of a robot that turns."""

import cmath
import math
import time
from dataclasses import replace

import numpy as np
import pytest
from rclpy.serialization import deserialize_message
from ros_harness import logged, node_arguments, stop, verified, wait_for, watched
from sensor_msgs.msg import JointState
from test_node_parameters import set_parameter
from trajectory_msgs.msg import JointTrajectory

from linkage_ros.log.reader import LogReader
from linkage_ros.log.verify import verify
from linkage_ros.mechanism.solver import Solver
from linkage_ros.messages.cdr import stamp_of
from linkage_ros.programs.log_commands import info
from linkage_ros.settings.configuration import load
from linkage_ros.units import NS_PER_S

TURNED = (-3.0, 5.0)  # m/s^2
HIP = 0.3  # rad, direction of base_link with drive: follow
DRIVES = {
    'speed': {'rpm': 90.0},
    'motion': {'motion.center': 0.3, 'motion.amplitude': 0.8, 'motion.frequency': 2.0},
    'follow': {'frame_joint.name': 'hip', 'frame_joint.ratio': 2.0},
}


@pytest.mark.parametrize('drive', DRIVES)
def test_each_change_is_logged_and_verified(drive, tmp_path):
    links = load('quadrilateral').mechanism
    given = {
        name: [*value] if isinstance(value, tuple) else value
        for name, value in load('quadrilateral').parameters().items()
        if name.split('.')[0] in ('mechanism', 'frame', 'crank', 'coupler', 'rocker')
    }
    log = tmp_path / 'run.mcap'
    arguments = node_arguments(**given, **DRIVES[drive], drive=drive, log=log)
    with watched(['/joint_states'], *arguments) as (listener, process):
        heard, sent = listener.received['/joint_states'], [0]
        robot = listener.node.create_publisher(JointState, '/measured_joint_states', 10)

        def measure():
            sent[0] += 1
            message = JointState(name=['crank', 'hip'], position=[0.01 * sent[0], 2.0 * HIP])
            stamp = time.time_ns()
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, NS_PER_S)
            robot.publish(message)

        def await_states(count):
            """Waits for states whose stamps are later than now."""
            now = time.time_ns()
            wait_for(
                lambda: (
                    (drive == 'follow' and measure())
                    or (len(heard) >= count and stamp_of(heard[-count]) > now)
                )
            )

        await_states(10)
        for values, words in (
            ([math.nan, 0.0], 'gravity'), ([1.0], 'gravity'), ([1e7, 0.0], 'gravity'),
        ):  # fmt: skip
            refused = set_parameter(listener, 'gravity', type=8, double_array_value=values)
            assert not refused.successful
            assert words in refused.reason
            assert 'array' not in refused.reason
        assert set_parameter(listener, 'gravity', type=8, double_array_value=TURNED).successful
        await_states(10)
        # Whole numbers are accepted.
        assert set_parameter(listener, 'gravity', type=7, integer_array_value=[7, 0]).successful
        await_states(10)
        stop(process)
    reader = LogReader(log)
    changes = [x for x in reader.motions[''] if getattr(x, 'gravity', None)]
    assert [change.gravity for change in changes] == [TURNED, (7.0, 0.0)]
    assert verified(log).states >= len(heard)
    assert 'gravity [-3.0, 5.0] m/s^2' in '\n'.join(info(reader))
    turn = cmath.exp(-1j * HIP * (drive == 'follow'))
    moved = [complex(*gravity) * turn for gravity in (links.gravity, TURNED, (7.0, 0.0))]
    solvers = [Solver(replace(links, gravity=(one.real, one.imag))) for one in moved]
    counts, stamps = [0, 0, 0], [change.stamp for change in changes]
    for data in logged(log)[1]['/mechanism_state']:
        state = deserialize_message(data.data, JointTrajectory)
        stamp, (point,) = state.header.stamp, state.points
        stamp = stamp.sec * NS_PER_S + stamp.nanosec
        q, u, a = point.positions[0], point.velocities[0], point.accelerations[0]
        number = int(np.searchsorted(stamps, stamp, side='right'))
        counts[number] += 1
        torque = solvers[number].state(q, u, a).torque
        assert point.effort[0] == pytest.approx(torque, abs=1e-9)
    assert min(counts) > 5
    # A log without the last change, or with another value, differs.
    *usual, last = reader.motions['']
    for wrong in (usual, [*usual, other(last)]):
        forged = LogReader(log)
        forged.motions = {'': tuple(wrong)}
        assert verify(forged).difference


def other(segment):
    return replace(segment, gravity=(7.0, 1e-6))
