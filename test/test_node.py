# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The real node as a process, on real DDS, watched from this one."""

from __future__ import annotations

import math
import re
import signal
import subprocess
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import pairwise, product
from pathlib import Path
from types import SimpleNamespace

import pytest
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters, SetParameters
from ros_harness import (
    Listener,
    command,
    environment,
    fresh_domain,
    node_arguments,
    running,
    wait_for,
)

from linkage_ros.log.reader import LogReader
from linkage_ros.model.registry import MECHANISMS
from linkage_ros.motion.drives import DRIVES
from linkage_ros.node import LinkageNode
from linkage_ros.parameters.configuration import Kind, load, parameter_leaves
from linkage_ros.parameters.presets import preset_path
from linkage_ros.run.machine import Machine
from linkage_ros.run.ticker import Timekeeping
from linkage_ros.wire.codecs import JointStateCodec

JOINTS = ('crank', 'coupler', 'rocker')
TYPES = {
    '/joint_states': 'sensor_msgs/msg/JointState',
    '/driving_torque': 'std_msgs/msg/Float64',
    '/coupler_point': 'geometry_msgs/msg/PointStamped',
    '/robot_description': 'std_msgs/msg/String',
}
CODEC = JointStateCodec(JOINTS)


def decoded(messages):
    return [CODEC.decode(data) for data in messages]


def stop(process, number=signal.SIGINT):
    process.send_signal(number)
    out, err = process.communicate(timeout=20)
    return process.returncode, out + err


def logged(path):
    with LogReader(path) as log:
        messages = {topic.name: [] for topic in log.topics}
        for message in log.messages():
            messages[message.topic].append(message)
        return log, messages


def call(listener, kind, name, request):
    client = listener.node.create_client(kind, f'/linkage_node/{name}')
    assert client.wait_for_service(10.0)
    future = client.call_async(request)
    wait_for(future.done)
    listener.node.destroy_client(client)
    return future.result()


def set_parameter(listener, name, **value):
    parameter = Parameter(name=name, value=ParameterValue(**value))
    request = SetParameters.Request(parameters=[parameter])
    return call(listener, SetParameters, 'set_parameters', request).results[0]


@pytest.fixture(scope='module')
def ten_seconds(tmp_path_factory):
    """A 10 s run at 200 Hz: what a subscriber received and what the log holds."""
    path = tmp_path_factory.mktemp('run') / 'run.mcap'
    domain = fresh_domain()
    with (
        Listener(domain, TYPES) as listener,
        running('node', *node_arguments(log=path), domain=domain) as process,
    ):
        wait_for(lambda: len(listener.received['/joint_states']) > 2000)
        status = Path(f'/proc/{process.pid}/status').read_text()
        code, output = stop(process)
        assert code == 0, output
        _, messages = logged(path)
        # The last ones may be on their way.
        heard = listener.received
        wait_for(lambda: all(heard[t][-1] == messages[t][-1].data for t in TYPES))
    return listener, path, output, status


def test_every_message_arrives_in_order_with_stamps_one_period_apart(ten_seconds):
    listener, path, output, _ = ten_seconds
    log, messages = logged(path)
    for topic in TYPES:
        # All up to the last; a busy machine may find one subscriber after the node began.
        sent, heard = [message.data for message in messages[topic]], listener.received[topic]
        assert sent[-len(heard) :] == heard, topic
    stamps = [stamp for stamp, _ in decoded(listener.received['/joint_states'])]
    assert len(stamps) > 2000
    gaps = {later - earlier for earlier, later in pairwise(stamps)}
    missed = int(re.search(r'(\d+) ticks? missed,', output)[1])
    assert {gap % 5_000_000 for gap in gaps} == {0}
    assert gaps == {5_000_000} or missed
    session = replace(load('quadrilateral').session, log=str(path))
    assert log.configuration == replace(load('quadrilateral'), session=session)


@pytest.mark.parametrize(
    ('number', 'words'),
    [(0, '0 ticks missed, 0 clock steps,'), (1, '1 tick missed, 1 clock step,')],
)
def test_the_closing_line_counts_one_in_the_singular(number, words):
    said, counts = [], Timekeeping()
    counts.missed = counts.clock_steps = number
    node = SimpleNamespace(
        _ticker=SimpleNamespace(counts=counts), _health=dict,
        get_logger=lambda: SimpleNamespace(info=said.append),
    )  # fmt: skip
    LinkageNode._say_what_became(node)
    assert words in said[0]


def test_the_log_explains_every_state_to_the_bit(ten_seconds):
    log, messages = logged(ten_seconds[1])
    machine = Machine(log.configuration)
    (motion,) = log.motions
    topics = [f'/{topic.name}' for topic in machine.topics]
    assert topics == ['/joint_states', '/driving_torque', '/mechanism_state', '/coupler_point']
    for published in zip(*(messages[topic] for topic in topics), strict=True):
        stamp, _ = CODEC.decode(published[0].data)
        snapshot = machine.snapshot_at(motion, stamp)
        assert snapshot.messages == tuple(message.data for message in published)


def test_node_and_record_give_equal_bits_at_equal_elapsed_times(ten_seconds, tmp_path):
    log, messages = logged(ten_seconds[1])
    path = tmp_path / 'record.mcap'
    subprocess.run(command('record', 'quadrilateral', path, '--duration', 10.5), check=True)
    _, recorded = logged(path)
    by_elapsed = dict(decoded(message.data for message in recorded['/joint_states']))
    (motion,) = log.motions
    live = decoded(message.data for message in messages['/joint_states'])
    equal = [by_elapsed[stamp - motion.stamp] == numbers for stamp, numbers in live[:2000]]
    assert all(equal)


def test_memory_with_the_log_on_stays_below_130_mb(ten_seconds):
    peak = int(re.search(r'VmHWM:\s+(\d+) kB', ten_seconds[3])[1])
    assert peak < 130_000


def test_start_line_names_the_preset_and_the_mechanism(ten_seconds):
    assert (
        'no mechanism given, so the quadrilateral: four_bar, open, crank-rocker'
        in (ten_seconds[2])
    )
    assert 'Traceback' not in ten_seconds[2]


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_it_with_code_0_and_a_complete_log(tmp_path, number):
    path, domain = tmp_path / 'run.mcap', fresh_domain()
    with (
        Listener(domain, {'/joint_states': TYPES['/joint_states']}) as listener,
        running('node', *node_arguments(log=path, rate_hz='1000.0'), domain=domain) as process,
    ):
        wait_for(lambda: len(listener.received['/joint_states']) > 300)
        code, output = stop(process, number)
    assert code == 0
    assert 'Traceback' not in output
    _, messages = logged(path)
    assert len(messages['/joint_states']) >= len(listener.received['/joint_states'])


def test_rpm_is_set_live_and_the_phase_goes_on(tmp_path):
    path, domain = tmp_path / 'run.mcap', fresh_domain()
    arguments = node_arguments(log=path, crank_acceleration='20.0')
    with (
        Listener(domain, {'/joint_states': TYPES['/joint_states']}) as listener,
        running('node', *arguments, domain=domain) as process,
    ):
        wait_for(lambda: len(listener.received['/joint_states']) > 100)
        assert set_parameter(
            listener, 'rpm', type=ParameterType.PARAMETER_INTEGER, integer_value=-60
        ).successful
        wait_for(lambda: decoded(listener.received['/joint_states'][-1:])[0][1][3] < -6.28)
        assert set_parameter(
            listener, 'rpm', type=ParameterType.PARAMETER_DOUBLE, double_value=0.5
        ).successful
        count = len(listener.received['/joint_states'])
        wait_for(lambda: len(listener.received['/joint_states']) > count + 100)
        assert stop(process)[0] == 0
    log, messages = logged(path)
    assert [motion.rpm for motion in log.motions] == [150.0, -60.0, 0.5]
    states = decoded(message.data for message in messages['/joint_states'])
    machine = Machine(log.configuration)
    for stamp, numbers in states:
        motion = [motion for motion in log.motions if motion.stamp <= stamp][-1]
        position, velocity, _, effort = machine.snapshot_at(motion, stamp).values
        assert numbers == (*position, *velocity, *effort)
    for (t0, a), (t1, b) in pairwise(states):
        seconds = (t1 - t0) * 1e-9
        mean = (a[3] + b[3]) / 2
        # The trapezoid is exact but where a ramp ends or begins inside the gap.
        assert b[0] - a[0] == pytest.approx(mean * seconds, abs=20.0 * seconds**2)


def test_the_help_lists_the_parameters_of_every_kind():
    shown = subprocess.run(
        command('node', '--help'), env=environment(fresh_domain()), capture_output=True,
        text=True, timeout=30, check=True,
    ).stdout  # fmt: skip
    lines = shown.splitlines()
    for mechanism, drive in product(MECHANISMS, DRIVES):
        for name, quantity, _ in parameter_leaves(Kind(mechanism, drive)):
            values = ', '.join(quantity.choices) if quantity.choices else quantity.span
            found = [line for line in lines if line.startswith(f'  {name}: ')]
            assert found, name
            assert quantity.kind in ('text', 'switch') or any(values in line for line in found)


def test_parameters_are_described_and_bad_values_refused():
    domain = fresh_domain()
    with (
        Listener(domain, {'/joint_states': TYPES['/joint_states']}) as listener,
        running('node', *node_arguments(), domain=domain) as process,
    ):
        wait_for(lambda: listener.received['/joint_states'])
        names = call(listener, ListParameters, 'list_parameters', ListParameters.Request())
        leaves = {leaf.name: leaf.quantity for leaf in parameter_leaves(Kind('four_bar'))}
        own = set(names.result.names) & set(leaves)
        assert own == set(leaves)
        request = DescribeParameters.Request(names=sorted(own))
        described = call(listener, DescribeParameters, 'describe_parameters', request)
        for descriptor in described.descriptors:
            quantity = leaves[descriptor.name]
            assert descriptor.description.startswith(quantity.meaning)
            assert quantity.unit in descriptor.description
            assert descriptor.read_only != quantity.live
            if quantity.kind == 'number':
                (span,) = descriptor.floating_point_range
                assert (span.from_value, span.to_value) == (quantity.low, quantity.high)
        values = call(
            listener, GetParameters, 'get_parameters', GetParameters.Request(names=['rpm'])
        )
        assert values.values[0].double_value == 150.0
        assert set_parameter(listener, '').reason == 'a parameter without a name'
        double = ParameterType.PARAMETER_DOUBLE
        for name, value in (('rpm', math.nan), ('rpm', 1e7), ('crank.length', 0.2)):
            refused = set_parameter(listener, name, type=double, double_value=value)
            assert not refused.successful
            assert refused.reason
        text = set_parameter(
            listener, 'rpm', type=ParameterType.PARAMETER_STRING, string_value='fast'
        )
        assert not text.successful
        assert stop(process)[0] == 0
    speeds = {numbers[3] for _, numbers in decoded(listener.received['/joint_states'])}
    assert speeds == {5 * math.pi}


BAD = [
    (['-p', 'rpm:=fast'], r"rpm = 'fast': must be a number from -1e\+06 to 1e\+06 rpm"),
    (['-p', 'rpm:=.nan'], 'rpm = nan: must be'),
    (['-p', 'crank.length:=-1'], 'crank.length = -1: must be a number from 1e-09'),
    (['-p', 'crank.lenght:=1.0'], 'did you mean crank.length'),
    (['-p', 'crank.length:=0.3'], 'cannot turn fully: .* it reaches'),
    (['-p', 'crank.length:=2.0'], 'longer than the other three'),
    (['-p', 'mechanism:=five_bar'], 'must be one of four_bar'),
    (['-p', 'mechanism:=four_bar'], 'frame.length is missing'),
    (['-p', 'gravity:=[0, -9.81]'], 'same type'),
    (['-p', 'coupler.center:=[1.0]'], 'two numbers'),
    (['-p', 'log:='], 'override rule'),
    (['-p', 'log:=/nowhere/run.mcap'], 'cannot be written: No such file'),
    (['-p', 'viewer:=nonsense'], 'nonsense'),
    (['-p', 'use_sim_time:=3'], 'use_sim_time'),
    (['-r', '__ns:=9x'], 'remap rule'),
    (['--params-file', '/nowhere.yaml'], '/nowhere.yaml'),
    (['--params-file', '/dev/null'], 'is no file'),
]


def test_every_bad_start_ends_with_one_line_and_code_2():
    def start(arguments, domain=None):
        return subprocess.run(
            command('node', '--ros-args', *arguments),
            env=environment(domain or fresh_domain()),
            capture_output=True,
            text=True,
            timeout=60,
        )

    with ThreadPoolExecutor(2) as pool:
        results = list(pool.map(start, [arguments for arguments, _ in BAD]))
    for (arguments, pattern), result in zip(BAD, results, strict=True):
        assert result.returncode == 2, (arguments, result.stderr)
        assert re.fullmatch(r'linkage_node: [^\n]+\n', result.stderr), (arguments, result.stderr)
        assert re.search(pattern, result.stderr), (arguments, result.stderr)
        assert result.stdout == ''
    assert start([], 233).stderr == (
        'linkage_node: ROS_DOMAIN_ID = 233: must be a whole number from 0 to 232\n'
    )


@pytest.mark.parametrize('name', ['node', 'controller'])
def test_a_preset_in_place_of_a_parameter_file_is_told_as_its_path(name, tmp_path):
    def start(file):
        return subprocess.run(
            command(name, '--ros-args', '--params-file', file), env=environment(fresh_domain()),
            cwd=tmp_path, capture_output=True, text=True, timeout=60,
        )  # fmt: skip

    done = start('quadrilateral')
    assert done.returncode == 2
    assert done.stderr == (
        f'linkage_{name}: quadrilateral is a preset, and --params-file takes a path: '
        f'{preset_path("quadrilateral")}\n'
    )
    done = start('missing.yaml')
    assert done.stderr == (
        f'linkage_{name}: missing.yaml: No such file or directory; give the path of a parameter '
        'file\n'
    )


@pytest.mark.parametrize('name', ['node', 'controller'])
def test_parameters_before_ros_args_are_told_where_they_belong(name):
    done = subprocess.run(
        command(name, '-p', 'rpm:=30'), env=environment(fresh_domain()), capture_output=True,
        text=True, timeout=60, check=False,
    )  # fmt: skip
    assert done.returncode == 2
    assert re.fullmatch(
        rf'linkage_{name}: unknown: -p rpm:=30; parameters stand behind --ros-args[^\n]*\n',
        done.stderr,
    )


def test_node_and_record_refuse_a_file_in_the_same_words(tmp_path):
    path = tmp_path / 'bad.yaml'
    path.write_text('/**:\n  ros__parameters:\n    gravity: [0, -9.81]\n')
    domain = fresh_domain()
    node, record = (
        subprocess.run(words, env=environment(domain), capture_output=True, text=True)
        for words in (
            command('node', '--ros-args', '--params-file', path),
            command('record', path, tmp_path / 'out.mcap'),
        )
    )
    assert node.returncode == record.returncode == 2
    assert node.stderr.split(': ', 1)[1] == record.stderr.split(': ', 1)[1]
    assert not (tmp_path / 'out.mcap').exists()


def test_a_namespace_moves_topics_and_log_alike(tmp_path):
    path, domain = tmp_path / 'run.mcap', fresh_domain()
    arguments = [*node_arguments(log=path), '-r', '__ns:=/left', '-r', 'driving_torque:=torque']
    with (
        Listener(domain, {'/left/joint_states': TYPES['/joint_states']}) as listener,
        running('node', *arguments, domain=domain) as process,
    ):
        wait_for(lambda: listener.received['/left/joint_states'])
        assert stop(process)[0] == 0
    log, _ = logged(path)
    names = {topic.name for topic in log.topics}
    moved = 'joint_states', 'torque', 'mechanism_state', 'coupler_point', 'robot_description'
    assert names == {'/diagnostics', *(f'/left/{name}' for name in moved)}


def test_a_bad_viewer_or_log_leaves_nothing_behind(tmp_path):
    log, view = tmp_path / 'run.mcap', tmp_path / 'run.rrd'

    def start(**parameters):
        return subprocess.run(
            command('node', *node_arguments(**parameters)),
            env=environment(fresh_domain()),
            capture_output=True,
            text=True,
            timeout=60,
        )

    log.write_text('an earlier log')
    result = start(log=log, log_overwrite='true', viewer='nonsense')
    assert result.returncode == 2
    assert log.read_text() == 'an earlier log'
    result = start(log=log, viewer=view)
    assert result.returncode == 2
    assert 'exists already' in result.stderr
    assert not view.exists()
