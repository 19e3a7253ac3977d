# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A commanded torque ends with the node, and with the measurements on which it depends.

The plant is a real node that holds its last command for ever, as behind a controller that repeats
it: it must move as under a torque of 0.
"""

import itertools
import math
import signal
from contextlib import contextmanager

import numpy as np
import pytest
import yaml
from mechanisms import FOLLOWED
from one_linkage import TrajectoryAlone, run_alone
from rclpy.serialization import deserialize_message
from ros_harness import (
    CODEC,
    PATIENCE,
    SteppedClock,
    finished,
    fresh_domain,
    logged,
    node_arguments,
    report_of,
    running,
    stop,
    verified,
    wait_for,
    watched,
)
from sensor_msgs.msg import JointState
from state_messages import messages_at
from trajectory_msgs.msg import JointTrajectory

from linkage_ros.log.reader import LogReader
from linkage_ros.log.records import TorqueEnd
from linkage_ros.log.recover import recover
from linkage_ros.log.rows import LoggedState
from linkage_ros.log.tables import write_csv
from linkage_ros.log.writer import LogWriter
from linkage_ros.messages.templates import encode_efforts
from linkage_ros.messages.topics import DIAGNOSTICS
from linkage_ros.motion.inputs import Losses
from linkage_ros.motion.segments import Coordinates
from linkage_ros.motion.under_torque import Motor, TorqueMotion
from linkage_ros.node import commanded_torque
from linkage_ros.node.commanded_torque import CommandedTorque
from linkage_ros.programs.log_commands import info
from linkage_ros.run.states import RowPart, Simulator
from linkage_ros.settings.configuration import configure, read_values

PLANT, EFFORTS, TRAJECTORIES = '/plant/joint_states', '/arm/efforts', '/arm/trajectory'
TYPES = {
    PLANT: 'sensor_msgs/msg/JointState', EFFORTS: 'std_msgs/msg/Float64MultiArray',
    TRAJECTORIES: 'trajectory_msgs/msg/JointTrajectory',
}  # fmt: skip
# A node in which something happens instead of a state, once there is a file.
ALTERED = """
import os, sys, time
from linkage_ros.executables import node
from linkage_ros.node.health import HealthMonitor
from linkage_ros.run.states import Simulator

function = {function}

def altered(*arguments):
    if os.path.exists({now!r}):
        {action}
    return function(*arguments)

{function} = altered
sys.exit(node())
"""


LIMIT, ROUNDING = 5.0, 1e-9  # N m; a published effort is computed from the acceleration


def is_zero(effort):
    return effort == 0.0


def is_torque(effort):
    return abs(effort) > 1e-3


def effort_in(topic, data):
    """Returns the effort that a controller holds for ever after a message."""
    if topic == EFFORTS:
        (effort,) = np.frombuffer(data[-8:], '<f8')
        return float(effort)
    return deserialize_message(data, JointTrajectory).points[-1].effort[0]


class Plant:
    """A plant that holds the last command of a topic for ever, although it could time out.

    Attributes:
        listener: Listener of its states and of the commands.
        commands: Received messages with commands.
    """

    def __init__(self, listener, topic):
        self.listener, self._topic = listener, topic
        self.commands, self._states = listener.received[topic], listener.received[PLANT]
        self._passed = 0
        self._publisher = listener.node.create_publisher(JointState, '/plant/joint_commands', 10)
        wait_for(lambda: self._publisher.get_subscription_count() and self._states)

    def effort(self):
        """Passes the last command on; returns the effort of the last state."""
        if self.commands:
            effort = effort_in(self._topic, self.commands[-1])
            self._publisher.publish(JointState(name=['crank'], effort=[effort]))
        return CODEC.decode(self._states[-1])[1][6]

    def await_effort(self, holds):
        wait_for(lambda: holds(self.effort()))

    def await_held(self, holds):
        """Waits until 50 states in a row have the effort of the last command, which must hold."""

        def is_held():
            self.effort()
            if not self.commands:
                return False
            torque = effort_in(self._topic, self.commands[-1])
            due = min(max(torque, -LIMIT), LIMIT)
            last = [CODEC.decode(data)[1][6] for data in self._states[-50:]]
            return holds(torque) and last == pytest.approx([due] * 50, abs=ROUNDING)

        wait_for(is_held)


@contextmanager
def plant(path, topic=EFFORTS):
    """Runs a plant with a log in a domain of its own; yields it and the domain."""
    domain = fresh_domain()
    arguments = node_arguments(
        drive='torque', rate_hz=500.0, log=path, command_timeout=1e6, gravity='[0.0, 0.0]',
        torque_limit=LIMIT,
    )  # fmt: skip
    topics = {name: TYPES[name] for name in (PLANT, topic)}
    spaced = '-r', '__ns:=/plant'
    with watched(topics, *arguments, *spaced, domain=domain) as (listener, node):
        yield Plant(listener, topic), domain
        stop(node)


def assert_moves_without_torque(path):
    """Integrates the last 50 states of a plant's log again, under a torque of 0."""
    verified(path)
    log, messages = logged(path)
    states = [CODEC.decode(message.data) for message in messages[PLANT][-50:]]
    solver = Simulator(log.configuration.only).solver
    (first, numbers), *_ = states
    angle, speed = numbers[0], numbers[3]
    start = Coordinates((math.remainder(angle, 4 * math.pi),), (speed,), (0.0,), angle)
    motion = TorqueMotion(solver, Motor(), start, first, 2_000_000)
    assert abs(speed) > 0.01
    for stamp, numbers in states:
        assert motion.at(stamp).unwrapped == pytest.approx(numbers[0], abs=1e-9)


LAW = {
    'drive': 'motion', 'motion.times': '[0.0, 2.0]', 'motion.angles': '[0.0, 8.0]',
    'motion.speeds': '[0.0, 8.0]',
}  # fmt: skip
ENDS = {
    'SIGINT': (signal.SIGINT, 0, EFFORTS),
    'SIGTERM': (signal.SIGTERM, 0, EFFORTS),
    'SIGQUIT': (signal.SIGQUIT, 0, EFFORTS),
    'SIGHUP': (signal.SIGHUP, 0, TRAJECTORIES),
    'error': ('raise ZeroDivisionError', 1, EFFORTS),
    'error in a report': ('raise ZeroDivisionError', 1, EFFORTS),
    'end of the motion': (LAW, 1, EFFORTS),
    'hanging tick': ("print('hangs', flush=True) or time.sleep(1e6)", 1, EFFORTS),
    'killed': (signal.SIGKILL, -9, EFFORTS),
}


@pytest.mark.parametrize('cause', ENDS)
def test_plant_moves_without_torque_after_the_end_of_the_node(tmp_path, cause):
    how, code, topic = ENDS[cause]
    path, own = tmp_path / 'plant.mcap', tmp_path / 'run.mcap'
    given = {'effort_command_topic': EFFORTS, 'trajectory_command_topic': TRAJECTORIES,
             'log': own}  # fmt: skip
    machine = FOLLOWED if isinstance(how, dict) else read_values('quadrilateral')
    given |= {**machine, **how} if isinstance(how, dict) else machine
    now, program = tmp_path / 'now', 'node'
    if isinstance(how, str):
        function = 'HealthMonitor.report' if 'report' in cause else 'Simulator.state'
        program = ALTERED.format(action=how, now=str(now), function=function)
    if how is LAW:
        given['use_sim_time'] = 'true'
    with plant(path, topic) as (held, domain):
        clock = SteppedClock(held.listener, 0)
        with running(program, *node_arguments(**given), domain=domain) as node:
            # Commands before both sides are connected are lost, so that the end must wait.
            held.await_effort(lambda effort: clock.go_on(10**6) or is_torque(effort))
            now.touch()
            if how is LAW:
                wait_for(lambda: node.poll() is not None or clock.go_on(20 * 10**6))
            if cause == 'hanging tick':
                wait_for(lambda: node.stdout.readline() == 'hangs\n')
                node.send_signal(signal.SIGINT)
                wait_for(lambda: effort_in(topic, held.commands[-1]) == 0.0)
                wait_for(lambda: node.poll() is not None or node.send_signal(signal.SIGINT),
                         pause=0.2)  # fmt: skip
            elif isinstance(how, signal.Signals):
                node.send_signal(how)
            node.communicate(timeout=PATIENCE)
            assert node.returncode == code
        held.await_held(is_torque if cause == 'killed' else is_zero)
    if cause == 'killed':  # nothing can be sent: the negative control
        return
    assert_moves_without_torque(path)
    (end,) = LogReader(own).torque_ends
    causes = {'hanging tick': 'SIGINT', 'error in a report': 'error'}
    assert end.cause == causes.get(cause, cause)
    verified(own)
    zeros = [m for m in logged(own)[1][topic] if m.time == end.stamp]
    assert [effort_in(topic, zero.data) for zero in zeros] == [0.0]


def test_plant_moves_without_torque_while_measurements_are_frozen(tmp_path):
    path, own, again = (tmp_path / f'{name}.mcap' for name in ('plant', 'run', 'again'))
    given = {**FOLLOWED, 'effort_command_topic': EFFORTS, 'measurement_timeout': 0.5}
    renamed = '-r', 'measured_joint_states:=/robot/joint_states'
    followed = *node_arguments(**given, log=own), *renamed
    with (
        plant(path) as (held, domain),
        running('node', *node_arguments(), '-r', '__ns:=/robot', domain=domain) as robot,
        running('node', *followed, domain=domain) as node,
    ):
        held.await_effort(is_torque)
        for _ in range(2):
            robot.send_signal(signal.SIGSTOP)
            held.await_held(is_zero)
            robot.send_signal(signal.SIGCONT)
            held.await_effort(is_torque)
        robot.send_signal(signal.SIGSTOP)
        held.await_held(is_zero)
        stop(node)
    assert_moves_without_torque(path)
    verified(own)
    log = LogReader(own)
    *timeouts, last = [end.cause for end in log.torque_ends]
    assert len(timeouts) >= 3
    assert {*timeouts} == {'measurement_timeout'}
    assert last == 'SIGINT'
    # A recording of the same measurements commands nobody.
    parameters = tmp_path / 'follow.yaml'
    parameters.write_text(yaml.safe_dump({'/**': {'ros__parameters': given}}))
    measured = '--measured', own, '--topic', '/robot/joint_states'
    done = finished('record', parameters, again, *measured)
    assert done.returncode == 0, done.stderr
    assert LogReader(again).torque_ends == ()
    assert verified(again).states == verified(own).states


# A node that reports nothing by itself but what is new.
SILENT = """
import sys
from linkage_ros.executables import node
from linkage_ros.node import linkage_node

linkage_node._REPORT_SECONDS = 1e9
sys.exit(node())
"""
LOST = {
    'joint_commands': (
        {'drive': 'torque', 'command_timeout': 0.5}, 'no command on /joint_commands',
    ),
    'measured_joint_states': (
        {**FOLLOWED, 'effort_command_topic': EFFORTS, 'measurement_timeout': 0.5},
        'no measurement of crank on /measured_joint_states for 0.5 s: a torque of 0',
    ),
}  # fmt: skip


@pytest.mark.parametrize('topic', LOST)
def test_a_lost_source_and_its_return_are_reported_before_the_next_report_is_due(topic):
    parameters, words = LOST[topic]
    words, said = words.encode(), '/diagnostics'
    arguments = node_arguments(**parameters)
    with watched([said, '/joint_states'], *arguments, program=SILENT) as (listener, node):
        reports, states = listener.received.values()
        publisher = listener.node.create_publisher(JointState, topic, 10)
        wait_for(publisher.get_subscription_count)
        times = itertools.count(1)

        def send():
            message = JointState(name=['crank'], position=[0.5], effort=[0.1])
            message.header.stamp.sec = next(times)
            publisher.publish(message)

        def is_lost(report):
            return words in report

        wait_for(lambda: send() or (states and CODEC.decode(states[-1])[1][6]))
        for _ in range(2):
            wait_for(lambda: reports and is_lost(reports[-1]))
            wait_for(lambda: send() or not is_lost(reports[-1]))
        output = stop(node)
    assert output.count(words.decode()) >= 2


# A node to which all sources seem lost once it has stopped, as if its end took long.
LATE = """
import sys
from linkage_ros.executables import node
from linkage_ros.node.live_run import LiveRun

pause = LiveRun.pause

def paused(run, *given):
    run._lost_sources = lambda: ['too late']
    return pause(run, *given)

LiveRun.pause = paused
sys.exit(node())
"""


def test_a_source_is_not_lost_to_a_node_that_ends():
    with watched(['/joint_states'], *node_arguments(), program=LATE) as (listener, node):
        wait_for(lambda: listener.received['/joint_states'])
        assert 'too late' not in stop(node)


@pytest.mark.parametrize(
    ('topic', 'given'),
    [('/joint_commands', {'drive': 'torque'}), ('/clock', {'use_sim_time': 'true'})],
)
def test_a_publisher_of_another_type_on_an_input_topic_is_named(topic, given):
    said = '/diagnostics'
    with watched([said], *node_arguments(**given)) as (listener, node):
        listener.node.create_publisher(JointTrajectory, topic, 10)
        words = f'/listener publishes trajectory_msgs/msg/JointTrajectory on {topic}, which'
        words = words.encode()
        wait_for(lambda: any(words in report for report in listener.received[said]))
        assert words.decode() in stop(node)


# ---------------------------------------------------------------- without a node


@pytest.fixture
def clock(monkeypatch):
    """Replaces the monotonic clock by a list with the time, s."""
    now = [100.0]
    monkeypatch.setattr(commanded_torque.time, 'monotonic', lambda: now[0])
    return now


@pytest.mark.parametrize('timeout', [0.0, 0.125])
def test_torque_ends_once_if_it_is_not_renewed_in_time(clock, timeout):
    ends = []
    torque = CommandedTorque([''], ends.append, timeout)
    torque.end_if_due()  # nothing was commanded
    for _ in range(2):
        torque.renew({'': RowPart((), 1.5)})
        assert torque.seconds_left == (timeout or math.inf)
        clock[0] += 0.0625
        torque.renew({'': RowPart((), 2.5)})
        assert torque.efforts == {'': 2.5}
        clock[0] += 0.0625
        torque.end_if_due()
        before = len(ends)
        for _ in range(2):
            clock[0] += 1e3
            torque.end_if_due()
        assert len(ends) == before + bool(timeout)
        assert torque.seconds_left == math.inf or not timeout
        assert torque.efforts == {'': 0.0 if timeout else 2.5}
    assert {end.cause for end in ends} <= {'measurement_timeout'}


def test_frequent_losses_of_a_source_are_named_for_ten_seconds(clock):
    losses = Losses()
    for _ in range(3):
        assert not losses.note
        losses.add()
        clock[0] += 3.0
    assert losses.note
    clock[0] += 1.0
    assert not losses.note


def test_torque_that_a_late_tick_commands_after_the_end_is_ended_again():
    ends = []
    torque = CommandedTorque([''], ends.append)
    torque.end_for_good('SIGTERM')
    torque.renew({'': RowPart((), 1.5)})
    assert [end.cause for end in ends] == ['SIGTERM', 'SIGTERM']
    assert torque.efforts == {'': 0.0}
    torque.renew({})  # a trajectory alone
    assert [end.cause for end in ends] == ['SIGTERM'] * 3
    torque.end_for_good('end')  # it has ended
    assert len(ends) == 3


START, CAUSES = 1_795_000_000_000_000_000, ('measurement_timeout', 'SIGINT')
ZERO_EFFORT, NOT_ZERO = encode_efforts([0.0]), encode_efforts([1e-300])


def write(path, ends, efforts):
    """Writes a log with 30 states, records of ends, and efforts between states by log time, ns."""
    given = {**read_values('quadrilateral'), 'effort_command_topic': EFFORTS,
             'trajectory_command_topic': TRAJECTORIES}  # fmt: skip
    configuration = configure(given)
    simulator = Simulator(configuration.only)
    motion, ahead = simulator.begin(START), TrajectoryAlone(simulator)
    with LogWriter(path, configuration, overwrite=True) as log:
        channels = log.add_states(run_alone(simulator).templates, lambda topic: topic.name)
        trajectories = log.add_topic(ahead.topic, TRAJECTORIES)
        log.add_topic(DIAGNOSTICS, '/diagnostics')  # as in a live run
        log.write_motion(motion.segment)
        for tick in range(30):
            stamp = START + simulator.ticks.elapsed(tick)
            log.consume(
                [LoggedState(stamp, b''.join(messages_at(simulator, motion, stamp).messages))]
            )
            if data := ahead.message_at(motion, stamp):
                log.write(trajectories, stamp, data)
            if tick in {10, 29}:
                stamp += 1000
                log.consume([end for end in ends if end.stamp == stamp])
                if stamp in efforts:
                    log.write(channels[EFFORTS], stamp, efforts[stamp])
                    log.write(trajectories, stamp, ahead.zero({'': 1.25}))
    return path


STAMPS = [START + tick * 5_000_000 + 1000 for tick in (10, 29)]
RECORDED = [TorqueEnd(stamp, cause) for stamp, cause in zip(STAMPS, CAUSES, strict=True)]


def test_zeros_are_verified_recovered_listed_and_left_out_of_tables(tmp_path):
    zeros = dict.fromkeys(STAMPS, ZERO_EFFORT)
    path = write(tmp_path / 'run.mcap', RECORDED, zeros)
    saved = tmp_path / 'saved.mcap'
    cut = tmp_path / 'cut.mcap'
    cut.write_bytes(path.read_bytes()[:-900])
    recover(cut, saved)
    for each in (path, saved):
        log = LogReader(each)
        assert [*log.torque_ends] == RECORDED
        assert verified(each).states == 30
        replayed = [m for m in log.messages([EFFORTS]) if m.time in zeros]
        assert [m.data for m in replayed] == [ZERO_EFFORT] * 2
        (line,) = [line for line in info(log) if 'torque ended' in line]
        assert line.endswith('measurement_timeout (1 x), SIGINT (1 x)')
        assert write_csv(each, tmp_path / 'run.csv', overwrite=True).rows == 30


@pytest.mark.parametrize(
    ('ends', 'efforts', 'words'),
    [
        (RECORDED, dict.fromkeys(STAMPS[:1], ZERO_EFFORT), 'is not in the log'),
        (RECORDED, dict.fromkeys(STAMPS, NOT_ZERO), 'is not a torque of 0'),
        (RECORDED[:1], dict.fromkeys(STAMPS, ZERO_EFFORT), 'not the next message of state'),
        ([], {STAMPS[0]: ZERO_EFFORT}, 'not the next message of state'),
    ],
)
def test_a_zero_without_its_record_or_a_record_without_its_zero_differs(
    tmp_path, ends, efforts, words
):
    assert words in report_of(write(tmp_path / 'run.mcap', ends, efforts)).difference
