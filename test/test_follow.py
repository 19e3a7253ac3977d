# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A measured crank: the tracking filter, rejected measurements, and the node on DDS."""

import math
import re
import time

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from joint_codec import JointStateCodec
from mechanisms import CHANGE_POINTS, FOLLOWED, LIMITED, four_bar, of
from mpmath import mp
from one_linkage import answers_of, inputs_of, with_linkage
from rclpy.serialization import deserialize_message, serialize_message
from ros_harness import (
    logged,
    node_arguments,
    report_of,
    stop,
    verified,
    wait_for,
    watched,
)
from sensor_msgs.msg import JointState

from linkage_ros import Solver
from linkage_ros.messages.cdr import NAMED_TWICE, NOT_ONE_EACH
from linkage_ros.motion.drives.follow import NO_CRANK, NO_JOINT_STATE, OUT_OF_REACH
from linkage_ros.motion.measured import NOT_FINITE, NOT_NEWER, TrackingFilter, extrapolated
from linkage_ros.run.states import Simulator
from linkage_ros.settings.configuration import configure

TURN = 2 * math.pi
MS = 1_000_000
CODEC = JointStateCodec(('left_crank', 'left_coupler', 'left_rocker'), 'base_link')


def followed(measurements, bandwidth=20.0, period_turns=1):
    motion = TrackingFilter(bandwidth, period_turns)
    return [motion.at(*one) for one in measurements]


def test_between_measurements_the_filter_has_the_solution_of_its_equations():
    """Compares with a Taylor series of x' = v + 2 w (m - x), v' = w^2 (m - x) in 30 digits."""
    points = [(10, 0.3), (13, 0.5), (40, 0.1), (41, 0.12), (90, 0.7)]  # ms, rad
    found = followed([(t * MS, m) for t, m in points])
    with mp.workdps(30):
        w = 2 * mp.pi * 20
        x, v = mp.mpf(points[0][1]), mp.mpf(0)
        for (t0, m0), (t1, m1), got in zip(points, points[1:], found[1:], strict=False):
            span = mp.mpf(t1 - t0) / 1000
            slope = (mp.mpf(m1) - mp.mpf(m0)) / span
            solve = mp.odefun(
                lambda t, y, m=m0, s=slope: [
                    y[1] + 2 * w * (m + s * t - y[0]),
                    w * w * (m + s * t - y[0]),
                ],
                0,
                [x, v],
            )
            x, v = solve(span)
            assert abs(got.u[0] - v) < 1e-12 * (1 + abs(v))
            assert abs(got.a[0] - w * w * (m1 - x)) < 1e-11 * (1 + abs(w * w * (m1 - x)))


@pytest.mark.parametrize('wrapped', [False, True])
@pytest.mark.parametrize('has_velocity', [False, True])
def test_a_steady_speed_and_a_steady_change_of_speed_are_followed(wrapped, has_velocity):
    speed, change = -40.0, 3.0

    def measured(n):
        t = n / 500
        place = speed * t + change * t * t / 2
        angle = math.remainder(place, TURN) if wrapped else place
        return (n + 1) * 2 * MS, angle, speed + change * t if has_velocity else None

    found = followed(map(measured, range(500)))
    _, position, _ = measured(499)
    last = found[-1]
    assert last.unwrapped == position
    assert last.a[0] == pytest.approx(change, rel=1e-6 if has_velocity else 0.02)
    # Without a measured speed, the filtered speed lags by twice the acceleration over w.
    lag = 0.0 if has_velocity else 2 * change / (40 * math.pi)
    assert last.u[0] == pytest.approx(speed + change * 499 / 500 - lag, rel=1e-4)
    later = extrapolated(last, 0.01)
    assert later.q[0] - last.q[0] == pytest.approx(last.u[0] * 0.01 + last.a[0] * 5e-5, rel=1e-12)


@pytest.mark.parametrize('name', ['p0', 'q0_double_crank', 'kite_r_d', 'upper'])
@pytest.mark.parametrize('bandwidth', [0.0, 20.0])
def test_a_linkage_of_two_turns_moves_the_same_whatever_turn_its_sensor_starts(name, bandwidth):
    """An unwrapped sensor gives the true angle; others restart each turn, and one pauses."""
    solver = Solver(of(CHANGE_POINTS[name]))
    assert solver.reach.period_turns == 2
    # Through several change points, forwards and backwards; the gap is longer than 0.5 s.
    times = [5 * MS * n + (600 * MS if n > 700 else 0) for n in range(1, 1500)]
    angles = [1.0 + 25.0 * math.sin(0.004 * n) for n in range(1, 1500)]

    def outputs(sensor):
        found = followed(zip(times, map(sensor, angles), strict=True), bandwidth, 2)
        return np.array([solver.state(*one.q).position[-1] for one in found])

    true = np.array([solver.state(angle).position[-1] for angle in angles])
    for sensor in (lambda x: x, lambda x: math.remainder(x, TURN), lambda x: x % TURN):
        assert np.abs(np.sin(0.5 * (outputs(sensor) - true))).max() < 1e-13


def test_an_unwrapped_sensor_is_believed_after_a_gap_and_a_restart():
    jump = [(1, 97.0), (2, 97.1), (2000, 107.0), (2001, 107.1), (500, 0.0), (501, 0.1)]
    found = followed([(t * MS, angle) for t, angle in jump], period_turns=2)
    assert [math.remainder(one.q[0] - angle, 2 * TURN) for one, (_, angle) in zip(
        found, jump, strict=True
    )] == pytest.approx([0.0] * len(jump), abs=1e-13)  # fmt: skip


@pytest.mark.parametrize('every', [1, 3, 10])
@pytest.mark.parametrize('absent', [None, math.nan])
def test_velocity_in_some_messages_gives_the_same_acceleration(every, absent):
    change = 3.0
    found = followed(
        (n * MS, change * (n / 1000) ** 2 / 2, absent if n % every else change * n / 1000)
        for n in range(1, 991)
    )
    assert found[-1].a[0] == pytest.approx(change, rel=1e-6)
    assert found[-2].a[0] == pytest.approx(change, rel=0.01)


def test_filter_restarts_after_a_gap_and_after_a_step_back():
    start, gap = 11_000 * MS, 501 * MS  # 10 / bandwidth is 500 ms
    found = followed(
        [(start, 0.1, 3.0), (start + 5 * MS, 0.2, 4.0), (start + gap + 5 * MS, 0.9, 5.0),
         (start + gap + 9 * MS, 1.0, 6.0), (1000 * MS, 0.4), (1000 * MS + gap, 0.5)]
    )  # fmt: skip
    assert [one.u[0] for one in found] == [3.0, 4.0, 5.0, 6.0, 0.0, 0.0]
    assert [one.a[0] == 0.0 for one in found] == [True, False, True, False, True, True]


def test_old_or_nonfinite_measurements_are_rejected():
    good = [(1000 * MS, 0.1), (1005 * MS, 0.2), (1010 * MS, 0.4)]
    old = [(1005 * MS, 9.0), (1004 * MS, 9.0), (505 * MS, 9.0)]
    bad = [(1006 * MS, math.nan), (1007 * MS, math.inf), (1008 * MS, 0.3, math.inf)]
    motion = TrackingFilter(20.0, 1)
    for measurement in good[:2]:
        motion.at(*measurement)
    for measurements, cause in ((old, NOT_NEWER), (bad, NOT_FINITE)):
        for measurement in measurements:
            with pytest.raises(ValueError, match=re.escape(cause)):
                motion.at(*measurement)
    assert motion.at(*good[2]) == followed(good)[-1]


def test_without_a_bandwidth_there_are_no_rates():
    found = followed([(MS * n, 0.1 * n, 5.0) for n in range(1, 5)], 0.0)
    assert {(one.u, one.a) for one in found} == {((0.0,), (0.0,))}


def message(stamp=0, name=('arm', 'crank'), position=(7.0, 0.5), velocity=()):
    made = JointState(name=list(name), position=list(position), velocity=list(velocity))
    made.header.stamp.sec, made.header.stamp.nanosec = divmod(stamp, 1_000_000_000)
    return serialize_message(made)


def measured_crank(simulator):
    (crank,) = inputs_of(simulator).values()
    return crank


@pytest.mark.parametrize('name', ['crank', 'arm/motor'])
def test_messages_are_accepted_or_counted_by_cause_of_rejection(name):
    limited = four_bar(LIMITED['rocker_crank'])
    configuration = configure({**FOLLOWED, 'crank_joint': name})
    crank = measured_crank(Simulator(with_linkage(configuration, mechanism=limited).only))
    (start, end), *_ = limited.reach().arcs
    inside, beyond = 0.5 * (start + end), end + 0.01 * (TURN - end + start)
    came, names = 10**18, ('arm', name)
    for given, stamp in ((5, 5), (0, came)):
        stamped, found = crank.read(message(given, names, (0.0, inside)), came)
        assert (stamped, found.unwrapped) == (stamp, inside)
    for data, cause in (
        (b'', NO_JOINT_STATE),
        (b'\0\1\0\0abc', NO_JOINT_STATE),
        (message(0, names, (0.0, inside))[:40], NO_JOINT_STATE),
        (message(0, ('arm', 'wheel'), (0.0, inside)), NO_CRANK),
        (message(0, names, ()), NO_CRANK),
        (message(0, names, (1.0,)), NOT_ONE_EACH),
        (message(0, names, (0.0, inside, 1.0)), NOT_ONE_EACH),
        (message(0, names, (0.0, inside), (1.0,)), NOT_ONE_EACH),
        (message(0, (name, name), (inside, inside)), NAMED_TWICE),
        (message(0, (), (0.0, inside)), NO_CRANK),
        (message(0, names, (0.0, beyond)), OUT_OF_REACH),
    ):
        with pytest.raises(ValueError, match=f'^{cause}(:|$)') as caught:
            crank.read(data, came + 1)
    numbers = np.array(re.findall(r'\d+\.?\d*', str(caught.value)), float)
    for angle in np.degrees((beyond, start, end)):  # the error names angle and reach
        assert np.abs(numbers - angle).min() < 1e-3
    assert crank.rejected == {
        NO_JOINT_STATE: 3, NO_CRANK: 3, NOT_ONE_EACH: 3, NAMED_TWICE: 1, OUT_OF_REACH: 1
    }  # fmt: skip
    others = ('arm', 'arm', name), (0.0, 1.0, inside)  # other joints may be named twice
    assert crank.read(message(0, *others), came + 1)[1].unwrapped == inside


def test_value_out_of_reach_is_named_in_values_of_the_robots_joint():
    limited = four_bar(LIMITED['rocker_crank'])
    mapped = {'joints.crank.name': 'knee', 'joints.crank.zero': 1.0, 'joints.crank.ratio': -2.0}
    crank = measured_crank(
        Simulator(with_linkage(configure({**FOLLOWED, **mapped}), mechanism=limited).only)
    )
    (start, end), *_ = limited.reach().arcs
    values = [-2.0 * (angle - 1.0) for angle in (end + 0.01 * (TURN - end + start), start, end)]
    with pytest.raises(ValueError, match='knee') as caught:
        crank.read(message(0, ('knee',), values[:1]), 10**18)
    numbers = np.array(re.findall(r'-?\d+\.?\d*', str(caught.value)), float)
    for value in values:
        assert np.abs(numbers - value).min() < 1e-5


def test_a_rejected_measurement_leaves_no_trace_in_the_filters():
    """Its crank is within reach, but not after the lead time; another with its stamp is taken."""
    limited = four_bar(LIMITED['rocker_crank'])
    inside = limited.reach().arcs[0][1] - 0.02
    lead = {'effort_command_topic': '/torque', 'lead_time': 0.05}
    simulator = Simulator(with_linkage(configure({**FOLLOWED, **lead}), mechanism=limited).only)
    steady = [message(n * MS, position=(0.0, inside), velocity=(0.0, 0.0)) for n in range(1, 9)]
    spike = message(4 * MS, position=(0.0, inside), velocity=(0.0, 5.0))
    plain, disturbed = (measured_crank(Simulator(simulator.linkage)) for _ in range(2))
    due = [plain.read(data, 0) for data in steady]
    found = [disturbed.read(data, 0) for data in steady[:3]]
    with pytest.raises(ValueError, match=OUT_OF_REACH):
        disturbed.read(spike, 0)
    assert found + [disturbed.read(data, 0) for data in steady[3:]] == due
    mixed = [(n, data) for n, data in enumerate([*steady[:3], spike, *steady[3:]])]
    batch = answers_of(simulator)
    ((times, stamps, numbers, _),) = batch.answers(mixed)
    assert (times, batch.rejected()[OUT_OF_REACH]) == ([0, 1, 2, 4, 5, 6, 7, 8], 1)
    assert stamps == [stamp for stamp, _ in due]
    assert np.ptp(np.array(numbers, float), axis=1).max() == 0  # nothing moves


# ---------------------------------------------------------------- the node

MEASURED = '/joint_states'
REMAPS = ('-r', 'measured_joint_states:=joint_states', '-r', 'joint_states:=linkage/joint_states')
ANSWERS = '/linkage/joint_states'


@pytest.fixture(scope='module')
def answered(tmp_path_factory):
    """Sends more than 300 measurements, some invalid; returns answers, log and output."""
    path = tmp_path_factory.mktemp('follow') / 'run.mcap'
    topics = {
        ANSWERS: 'sensor_msgs/msg/JointState',
        '/diagnostics': 'diagnostic_msgs/msg/DiagnosticArray',
    }
    arguments = *node_arguments(**FOLLOWED, log=path, joint_prefix='left_'), *REMAPS
    silent = b'no measurement of left_crank on /joint_states for 2 s'
    with watched(topics, *arguments) as (listener, process):
        said, answers = listener.received['/diagnostics'], listener.received[ANSWERS]
        publisher = listener.node.create_publisher(JointState, MEASURED, 1000)
        wait_for(lambda: said and silent in said[-1])
        sent, start = [], time.time_ns()

        def measure(*velocity):
            stamp, angle = start + len(sent) * 5 * MS, math.remainder(0.06 * len(sent), TURN)
            publisher.publish(message(stamp, ('arm', 'left_crank'), (0.0, angle), velocity))
            sent.append((stamp, angle))
            return stamp

        def behind():
            return (sent[-1][0] - CODEC.decode(answers[-1])[0]) // (5 * MS)

        wait_for(lambda: measure() and answers, pause=0.1)  # either may be connected late
        wait_for(lambda: behind() < 50 and measure() and silent not in said[-1])
        for n in range(300):
            stamp = measure(*(0.0, 12.0) if n < 150 else ())
            if n % 100 == 50:
                publisher.publish(message(stamp, ('crank',), (0.3,)))
                publisher.publish(message(stamp - MS, ('left_crank',), (0.3,)))
                publisher.publish(message(stamp + MS, ('left_crank',), (math.nan,)))
            # The node keeps only the last 100 messages that it has not read.
            wait_for(lambda: behind() < 50)
            time.sleep(0.004)
        wait_for(lambda: not behind())
        heard_of = len(said)
        wait_for(lambda: silent in said[-1] and len(said) > heard_of)
        output = stop(process)
        diagnosis = deserialize_message(said[-1], DiagnosticArray)
    return sent, listener.received[ANSWERS], logged(path)[1], output, diagnosis, path


def test_each_accepted_measurement_is_answered_once_with_its_stamp(answered):
    sent, received, messages, output, diagnosis, _ = answered
    found = [CODEC.decode(data) for data in received]
    assert len(found) > 300
    assert [(stamp, values[0]) for stamp, values in found] == sent[-len(found) :]
    logged = [message.data for message in messages[ANSWERS]]
    assert logged[-len(found) :] == received
    assert f'{len(logged)} states' in output
    assert len(messages[MEASURED]) == len(logged) + 9
    values = {one.key: one.value for one in diagnosis.status[0].values}
    rejected = {key: value for key, value in values.items() if key.startswith('rejected')}
    assert rejected == {f'rejected, {cause}': '3' for cause in (NO_CRANK, NOT_NEWER, NOT_FINITE)}
    times = [message.time for message in messages[MEASURED]]
    assert len(re.findall('are rejected: ', output)) <= 2 + (times[-1] - times[0]) / 1e9


def test_the_log_is_verified_by_following_its_measurements_again(answered, monkeypatch):
    *_, messages, _, _, path = answered
    report = verified(path)
    assert report.states == len(messages[ANSWERS])
    assert ANSWERS in report.compared
    assert MEASURED in report.others
    begin = TrackingFilter.__init__
    monkeypatch.setattr(
        TrackingFilter, '__init__', lambda motion, _, turns: begin(motion, 21.0, turns)
    )
    assert re.search('^state .*recomputed: off by', report_of(path).difference)
