# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The real node on simulated time, what it says of its health, and what it says on demand."""

from __future__ import annotations

import math
import time
from dataclasses import replace
from itertools import pairwise

import pytest
import yaml
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import (
    GetParameters,
    ListParameters,
    SetParameters,
    SetParametersAtomically,
)
from rclpy.serialization import deserialize_message
from ros_harness import Listener, fresh_domain, node_arguments, running, wait_for
from rosgraph_msgs.msg import Clock
from test_node import CODEC, TYPES, call, decoded, logged, set_parameter, stop
from trajectory_msgs.msg import JointTrajectory

from linkage_ros.log.reader import LogReader
from linkage_ros.parameters.configuration import load
from linkage_ros.run.machine import Machine
from linkage_ros.verification.verify import verify

STATES = {'/joint_states': TYPES['/joint_states']}
MS = 10**6


class FakeClock:
    """Publishes /clock as a simulator does."""

    def __init__(self, listener):
        self._listener = listener
        self._publisher = listener.node.create_publisher(Clock, '/clock', 10)
        self.now = 50 * 10**9

    def tell(self, now=None):
        self.now = self.now if now is None else now
        message = Clock()
        message.clock.sec, message.clock.nanosec = divmod(self.now, 10**9)
        self._publisher.publish(message)

    def reach(self, now):
        """Tells a time until there is a state of it: who lags hears the latest time only."""
        self.tell(now)
        wait_for(lambda: stamps(self._listener)[-1:] == [now] or self.tell())

    def run(self, seconds, rate=1.0, step=0.01):
        """Lets it run for a while of its own time, at a rate of real time or slower."""
        for _ in range(round(seconds / step)):
            time.sleep(step / rate)
            self.reach(self.now + round(step * 1e9))


def stamps(listener):
    return [stamp for stamp, _ in decoded(listener.received['/joint_states'])]


def test_states_follow_a_clock_that_runs_at_half_rate_stands_and_goes_back(tmp_path):
    path, domain = tmp_path / 'run.mcap', fresh_domain()
    arguments = node_arguments(use_sim_time='true', log=path)
    with (
        Listener(domain, STATES) as listener,
        running('node', *arguments, domain=domain) as process,
    ):
        clock = FakeClock(listener)
        time.sleep(1.0)
        assert stamps(listener) == []  # no clock, no time
        clock.reach(clock.now)
        start = clock.now
        clock.run(1.0, rate=0.5)
        for _ in range(50):
            clock.tell()
            time.sleep(0.01)
        count = len(stamps(listener))
        time.sleep(0.2)
        assert len(stamps(listener)) == count == 201  # it stood still
        clock.reach(start - 10**9)
        clock.run(0.5)
        code, output = stop(process)
    assert code == 0, output
    assert 'the clock was stepped by -2.005 s' in output
    got = stamps(listener)
    first, second = got[:201], got[201:]
    assert first == [start + 5 * MS * i for i in range(201)]
    assert second == [start - 10**9 + 5 * MS * i for i in range(101)]
    # The crank goes on from where it was. The log is in the order of publishing.
    log, messages = logged(path)
    numbers = [values for _, values in decoded(m.data for m in messages['/joint_states'])]
    turned = [b[0] - a[0] for a, b in pairwise(numbers)]
    assert turned == pytest.approx([numbers[0][3] * 0.005] * 301, rel=1e-9)
    assert [motion.stamp for motion in log.motions] == [start, start - 10**9]
    machine = Machine(log.configuration)
    for message, number in zip(messages['/joint_states'], range(302), strict=True):
        motion = log.motions[number > 200]
        assert (
            machine.snapshot_at(motion, CODEC.decode(message.data)[0]).messages[0] == message.data
        )


def test_the_description_does_not_wait_for_the_clock(tmp_path):
    path, domain = tmp_path / 'run.mcap', fresh_domain()
    topic = '/robot_description'
    with (
        Listener(domain, {topic: TYPES[topic]}) as listener,
        running('node', *node_arguments(use_sim_time='true', log=path), domain=domain) as process,
    ):
        wait_for(lambda: listener.received[topic])
        code, output = stop(process)
    assert code == 0
    assert ' 0 states published' in output
    _, messages = logged(path)
    assert [message.data for message in messages[topic]] == listener.received[topic]


def test_a_clock_that_tells_no_time_ends_nothing(tmp_path):
    path, domain = tmp_path / 'run.mcap', fresh_domain()
    arguments = node_arguments(use_sim_time='true', rate_hz=100.0, log=path)
    with (
        Listener(domain, STATES) as listener,
        running('node', *arguments, domain=domain) as process,
    ):
        clock = FakeClock(listener)
        wait_for(lambda: clock.tell() or stamps(listener))
        clock.run(0.05)
        for seconds, rest in ((2**31 - 1, 2**32 - 1), (60, 10**9), (-1, 0)):
            message = Clock()
            message.clock.sec, message.clock.nanosec = seconds, rest
            clock._publisher.publish(message)
        time.sleep(1.5)  # a report falls into this time
        clock.run(0.05)
        code, output = stop(process)
    assert code == 0
    assert '/clock says 2147483647 s and 4294967295 ns, which is no time: left out' in output
    assert 'Traceback' not in output
    with LogReader(path) as log:
        report = verify(log)
    assert (report.states, report.difference) == (len(stamps(listener)), '')


def test_simulated_time_cannot_be_switched_while_running():
    domain = fresh_domain()
    with (
        Listener(domain, STATES) as listener,
        running('node', *node_arguments(), domain=domain) as process,
    ):
        wait_for(lambda: listener.received['/joint_states'])
        result = set_parameter(
            listener, 'use_sim_time', type=ParameterType.PARAMETER_BOOL, bool_value=True
        )
        assert not result.successful
        assert 'start it again' in result.reason
        assert stop(process)[0] == 0


def dump(listener):
    """The names and the values of all parameters, as `ros2 param dump` asks for them."""
    listed = call(listener, ListParameters, 'list_parameters', ListParameters.Request())
    names = sorted(listed.result.names)
    got = call(listener, GetParameters, 'get_parameters', GetParameters.Request(names=names))
    return names, got.values


def test_parameters_dumped_as_ros2_param_does_give_the_same_run_again(tmp_path):
    domain = fresh_domain()
    with (
        Listener(domain, STATES) as listener,
        running('node', *node_arguments(rpm='-42.5'), domain=domain) as process,
    ):
        wait_for(lambda: listener.received['/joint_states'])
        names, values = dump(listener)
        assert stop(process)[0] == 0
    tree = {}
    for name, value in zip(names, map(plain, values), strict=True):
        *folders, leaf = name.split('.')
        place = tree
        for folder in folders:
            place = place.setdefault(folder, {})
        place[leaf] = value
    dumped = tmp_path / 'linkage_node.yaml'
    dumped.write_text(yaml.dump({'/linkage_node': {'ros__parameters': tree}}))
    original = load('quadrilateral')
    drive = replace(original.drive, rpm=-42.5, start_rpm=-42.5)
    assert load(str(dumped)) == replace(original, drive=drive)


@pytest.mark.parametrize('kind', [SetParameters, SetParametersAtomically])
def test_a_node_takes_its_own_dump_back_and_nothing_else_that_is_read_only(kind):
    domain = fresh_domain()
    with (
        Listener(domain, STATES) as listener,
        running('node', *node_arguments(), domain=domain) as process,
    ):
        wait_for(lambda: listener.received['/joint_states'])

        def load_values(**changes):
            parameters = [Parameter(name=n, value=v) for n, v in {**dumped, **changes}.items()]
            name = 'set_parameters' + '_atomically' * (kind is SetParametersAtomically)
            answer = call(listener, kind, name, kind.Request(parameters=parameters))
            results = getattr(answer, 'results', None) or [answer.result]
            return [result.reason for result in results if not result.successful]

        dumped = dict(zip(*dump(listener), strict=True))
        assert {'mechanism', 'coupler.center', 'use_sim_time', 'rpm'} <= set(dumped)
        assert load_values() == []
        assert load_values(rpm=ParameterValue(type=3, double_value=60.0)) == []
        assert dict(zip(*dump(listener), strict=True))['rpm'].double_value == 60.0
        center = ParameterValue(type=8, double_array_value=[0.1, 0.0])
        (reason,) = load_values(**{'coupler.center': center})
        assert 'read-only parameter: coupler.center' in reason
        (reason,) = load_values(nonsense=center)
        assert 'undeclared' in reason
        assert stop(process)[0] == 0


def plain(value):
    """A ParameterValue as `ros2 param dump` writes it."""
    fields = {1: 'bool', 2: 'integer', 3: 'double', 4: 'string', 8: 'double_array'}
    got = getattr(value, f'{fields[value.type]}_value')
    return list(got) if value.type == ParameterType.PARAMETER_DOUBLE_ARRAY else got


def test_two_nodes_live_side_by_side_in_one_graph():
    domain = fresh_domain()
    types = {
        '/left/joint_states': STATES['/joint_states'],
        '/right/joint_states': STATES['/joint_states'],
        '/diagnostics': 'diagnostic_msgs/msg/DiagnosticArray',
    }
    left = [*node_arguments(rpm='30.0'), '-r', '__ns:=/left']
    right = [*node_arguments(rpm='-90.0'), '-r', '__ns:=/right']
    with (
        Listener(domain, types) as listener,
        running('node', *left, domain=domain) as first,
        running('node', *right, domain=domain) as second,
    ):
        wait_for(lambda: all(len(listener.received[topic]) > 100 for topic in list(types)[:2]))
        wait_for(lambda: len({m.status[0].name for m in diagnostics(listener)}) == 2)
        assert stop(first)[0] == stop(second)[0] == 0
    names = {status.name for message in diagnostics(listener) for status in message.status}
    assert {'left/linkage_node: motion', 'right/linkage_node: motion'} <= names
    for topic, rpm in (('/left/joint_states', 30.0), ('/right/joint_states', -90.0)):
        speeds = {numbers[3] for _, numbers in decoded(listener.received[topic])}
        assert list(speeds) == pytest.approx([rpm * math.pi / 30], rel=1e-15)


def diagnostics(listener):
    return [
        deserialize_message(data, DiagnosticArray) for data in listener.received['/diagnostics']
    ]


def test_diagnostics_come_once_a_second_and_stand_in_the_log(tmp_path):
    path, domain = tmp_path / 'run.mcap', fresh_domain()
    types = {**STATES, '/diagnostics': 'diagnostic_msgs/msg/DiagnosticArray'}
    with (
        Listener(domain, types) as listener,
        running('node', *node_arguments(log=path), domain=domain) as process,
    ):
        wait_for(lambda: len(listener.received['/diagnostics']) >= 4)
        assert stop(process)[0] == 0
    told = diagnostics(listener)
    times = [m.header.stamp.sec + m.header.stamp.nanosec * 1e-9 for m in told]
    assert all(0.5 < b - a < 2.5 for a, b in pairwise(times[:4]))
    motion, log, viewer = told[2].status
    names = ['linkage_node: motion', 'linkage_node: log', 'linkage_node: viewer']
    assert [motion.name, log.name, viewer.name] == names
    values = {pair.key: pair.value for pair in motion.values}
    assert 100 < float(values['rate kept, Hz']) < 250
    assert float(values['loop residual, m']) < 1e-15
    assert float(values['crank speed, rad/s']) == pytest.approx(15.708)
    assert (log.level, log.message, viewer.message) == (b'\0', 'well', 'off')
    assert {status.hardware_id for status in told[2].status} == {'four_bar'}
    assert {pair.key: pair.value for pair in log.values} == {'target': str(path), 'lost': '0'}
    _, messages = logged(path)
    recorded = [message.data for message in messages['/diagnostics']]
    # Before it is discovered, and after the node ends, a listener hears nothing.
    heard = [data for data in listener.received['/diagnostics'] if data in recorded]
    start = recorded.index(heard[0])
    assert len(heard) >= 3
    assert recorded[start : start + len(heard)] == heard


def test_mechanism_state_is_published_only_while_somebody_listens():
    domain = fresh_domain()
    types = {**STATES, '/mechanism_state': 'trajectory_msgs/msg/JointTrajectory'}
    with (
        Listener(domain, types) as listener,
        running('node', *node_arguments(), domain=domain) as process,
    ):
        wait_for(lambda: len(listener.received['/mechanism_state']) > 100)
        assert stop(process)[0] == 0
    states = dict(decoded(listener.received['/joint_states']))
    for data in listener.received['/mechanism_state']:
        message = deserialize_message(data, JointTrajectory)
        stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
        (point,) = message.points
        assert list(message.joint_names) == ['crank', 'coupler', 'rocker']
        assert [*point.positions, *point.velocities, *point.effort] == [*states[stamp]]
        assert len(point.accelerations) == 3
        assert point.accelerations[0] == 0.0
