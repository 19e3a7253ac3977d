# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Trajectories that other nodes send to a crank that follows a law of motion."""

import math
import struct
from contextlib import suppress
from itertools import pairwise

import pytest
from builtin_interfaces.msg import Duration, Time
from diagnostic_msgs.msg import DiagnosticArray
from one_linkage import inputs_of
from rclpy.serialization import deserialize_message, serialize_message
from ros_harness import (
    CODEC,
    SteppedClock,
    logged,
    node_arguments,
    stop,
    verified,
    wait_for,
    watched,
)
from std_msgs.msg import Header
from test_motion_law import SERVO
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from linkage_ros.messages.cdr import decode_trajectory
from linkage_ros.run.states import Simulator
from linkage_ros.settings.configuration import configure

MS, NOW = 10**6, 1_795_000_000_123_456_789
STEADY = {**SERVO, 'motion.times': [0.0], 'motion.angles': [1.2]}


def trajectory(*points, stamp=0, names=('crank',)):
    """Makes a message; a point is its time, s, and up to four values."""
    found = []
    for time, *values in points:
        rows = [[value] for value in values] + [[]] * (4 - len(values))
        whole, rest = divmod(round(time * 10**9), 10**9)
        found.append(JointTrajectoryPoint(
            positions=rows[0], velocities=rows[1], accelerations=rows[2], effort=rows[3],
            time_from_start=Duration(sec=whole, nanosec=rest),
        ))  # fmt: skip
    whole, rest = divmod(stamp, 10**9)
    header = Header(stamp=Time(sec=whole, nanosec=rest), frame_id='somewhere')
    return JointTrajectory(header=header, joint_names=names, points=found)


@pytest.fixture
def crank():
    """Returns a function that sends a message at a stamp, and the simulator's first motion."""
    simulator = Simulator(configure(STEADY).only)
    (source,), first = inputs_of(simulator).values(), simulator.begin(NOW)

    def send(message, stamp, motion=first):
        data = serialize_message(message)
        source.prepare(motion, stamp)
        return source.applied(motion, stamp, 0, [source.read(data, 0)])

    return send, first, source


def test_messages_are_decoded_as_by_ros():
    message = trajectory((0.0, 1.0), (1.25, 2.0, 3.0, 4.0, 5.0), stamp=NOW, names=('a', 'crank'))
    stamp, names, points = decode_trajectory(serialize_message(message))
    assert (stamp, names) == (NOW, ['a', 'crank'])
    assert points == [((1.0,), (), (), (), 0), ((2.0,), (3.0,), (4.0,), (5.0,), 1_250_000_000)]


def test_cut_and_changed_messages_raise_only_value_errors():
    data = serialize_message(trajectory((0.1, 1.0, 2.0), (0.2, 2.0, 0.0)))
    size = data.rindex(struct.pack('<I', 200 * MS)) + 4  # rclpy adds arbitrary bytes
    for end in range(size):
        with pytest.raises(ValueError, match='not a JointTrajectory'):
            decode_trajectory(data[:end])
    for at in range(4, size - 3):
        changed = data[:at] + struct.pack('<I', 2**31) + data[at + 4 :]
        with suppress(ValueError):
            decode_trajectory(changed)


def plan(time):
    """Returns the crank angle, rad, that a sender wants at a time, s."""
    return 1.2 + 0.4 * (1 - math.cos(2.0 * time))


BAD = {
    'empty': (trajectory(), 'it has no points'),
    'another joint': (trajectory((1, 1.0), names=('rocker',)), 'it names rocker: must name crank'),
    'two joints': (trajectory((1, 1.0), names=('crank', 'rocker')), 'it names crank, rocker'),
    'no joint': (trajectory((1, 1.0), names=()), 'it names nothing'),
    'unsorted': (trajectory((1, 1.0), (0.5, 1.1)), 'its times do not increase'),
    'repeated time': (trajectory((1, 1.0), (1, 1.1)), 'its times do not increase'),
    'NaN': (trajectory((1, math.nan)), 'a number of it is not finite'),
    'infinite': (trajectory((1, 1.0, math.inf)), 'a number of it is not finite'),
    'no positions': (trajectory((1,)), 'its points do not match'),
    'a velocity missing': (trajectory((1, 1.0, 0.0), (2, 1.0)), 'its points do not match'),
    'late': (trajectory((1, 1.0), stamp=NOW - 10**9), 'in the past: the last one by 0.100 s'),
    'ends moving': (trajectory((1, 1.0, 2.0)), 'its last velocity is 2: must be 0'),
    'leaves the arc': (trajectory((1, -1.0), (2, 1.2)), r'at t = 1 s, .* move at .*-57.* reach'),
    'overshoots the arc': (trajectory((1, 1.0, -90.0), (2, 1.2, 0.0)), 'cannot move at .*reach'),
    'too fast': (trajectory((1e-9, 1.3)), r'up to .* rad/s\^2: must be at most 1e\+12'),
}  # fmt: skip


@pytest.mark.parametrize('name', BAD)
def test_a_bad_trajectory_is_rejected_in_one_line_and_changes_nothing(crank, name):
    send, first, source = crank
    message, words = BAD[name]
    with pytest.raises(ValueError, match=words) as raised:
        send(message, NOW + 10**8)
    assert '\n' not in str(raised.value)
    assert source.counts == {'trajectories taken': 0, 'trajectories rejected': 1}
    assert source.applied(first, NOW + 10**8, 0, ()) is first


def test_a_trajectory_starts_now_or_at_its_stamp_and_points_in_the_past_are_dropped(crank):
    send, *_ = crank
    for stamp, due in ((0, 10**8 + 5 * 10**8), (NOW + 3 * 10**8, 3 * 10**8 + 5 * 10**8)):
        motion = send(trajectory((0.5, 1.4), stamp=stamp), NOW + 10**8)
        assert motion.at(NOW + 10**8).q == (1.2,)
        assert motion.at(NOW + due)[:3] == ((1.4,), (0.0,), (0.0,))
        assert motion.at(NOW + due - 1).q[0] < 1.4 + 1e-15
    points = (0.0, 7.0), (0.1, 8.0), (0.2, 1.3), (0.4, 1.4)
    motion = send(trajectory(*points, stamp=NOW), NOW + 10**8)
    assert motion.segment.law.times == (0, 10**8, 3 * 10**8)
    assert motion.at(NOW + 2 * 10**8).q[0] == 1.3


def test_overlapping_trajectories_never_make_the_crank_jump(crank):
    send, motion, source = crank
    last = motion.at(NOW)
    for n in range(40):
        stamp = NOW + n * 10**8
        wish = [(t, plan(0.1 * n + t)) for t in (0.1, 0.25, 0.5, 1.0)]
        before = motion.at(stamp)
        motion = send(trajectory(*wish), stamp, motion)
        assert motion.at(stamp)[:3] == before[:3]
        for step in range(1, 101):
            now = motion.at(stamp + step * MS)
            for value, before, rate in zip(
                (*now.q, *now.u), (*last.q, *last.u), (*now.u, *now.a), strict=True
            ):
                assert abs(value - before) <= abs(rate) * 1.5e-3 + 2e-3
            last = now
    assert source.counts['trajectories taken'] == 40


# ---------------------------------------------------------------- the real node


def test_a_stream_of_trajectories_moves_the_real_node(tmp_path):
    path = tmp_path / 'run.mcap'
    ahead = {'effort_command_topic': 'effort', 'lead_time': 0.02, 'rate_hz': 100.0,
             'trajectory_command_topic': 'planned', 'use_sim_time': 'true'}  # fmt: skip
    topics = {
        '/joint_states': 'sensor_msgs/msg/JointState',
        '/diagnostics': 'diagnostic_msgs/msg/DiagnosticArray',
        '/planned': 'trajectory_msgs/msg/JointTrajectory',
    }
    arguments = node_arguments(**{**STEADY, **ahead}, log=path)
    with watched(topics, *arguments) as (listener, process):
        publisher = listener.node.create_publisher(JointTrajectory, '/crank_trajectory', 10)
        said = listener.received['/diagnostics']
        wait_for(publisher.get_subscription_count)
        clock, sent = SteppedClock(listener, 10 * MS, NOW), 0
        clock.step()
        for n in range(25):  # 10 Hz
            points = [(t, plan(0.1 * n + t)) for t in (0.1, 0.3, 0.6)]
            publisher.publish(trajectory(*points))
            sent += 1
            if n % 5 == 4:
                for message, _ in BAD.values():
                    publisher.publish(message)
            for _ in range(10):
                clock.step()
        bad = 5 * len(BAD)

        def counts():
            found = deserialize_message(said[-1], DiagnosticArray).status[0].values
            values = {one.key: one.value for one in found}
            return values['trajectories taken'], values['trajectories rejected']

        wait_for(lambda: clock.step() or (said and counts() == (str(sent), str(bad))))
        stop(process)
    report = verified(path)
    log, messages = logged(path)
    assert report.states == len(messages['/joint_states'])
    # On a busy machine, a tick may take two trajectories, of which the last one makes a segment.
    assert sent // 2 < len(log.motions['']) <= sent + 1
    assert len(messages['/crank_trajectory']) == sent + bad
    assert len(messages['/planned']) > sent / 2
    rows = [CODEC.decode(message.data) for message in messages['/joint_states']]
    assert max(values[0] for _, values in rows) > 1.5
    for (stamp, before), (later, after) in pairwise(rows):
        assert abs(after[0] - before[0]) < 5.0 * (later - stamp) / 1e9
