# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The parameter services of the real node, called as by `ros2 param`; all tests share a node."""

import math
from dataclasses import replace

import pytest
import yaml
from one_linkage import with_linkage
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import (
    DescribeParameters,
    SetParameters,
    SetParametersAtomically,
)
from rclpy.parameter import Parameter as LocalParameter
from rclpy.parameter import parameter_value_to_python
from ros_harness import (
    PATIENCE,
    call,
    decoded,
    dump,
    node_arguments,
    set_parameter,
    stop,
    wait_for,
    watched,
)

from linkage_ros.node.parameter_node import _descriptor
from linkage_ros.quantities import Quantity
from linkage_ros.settings.configuration import load
from linkage_ros.settings.parameters import MechanismAndDrive, parameter_leaves

RPM = -42.5


@pytest.fixture(scope='module')
def listener():
    """Returns a listener to a running node."""
    with watched(['/joint_states'], *node_arguments(rpm=RPM)) as (listener, process):
        listener.await_more(1)
        yield listener
        stop(process)


def test_every_kind_of_quantity_has_the_type_of_its_values():
    values = {
        'number': 0.5, 'whole': 2, 'pair': (0.0, 1.0), 'list': (0.0, 1.0, 2.0), 'choice': 'open',
        'text': '', 'switch': True,
    }  # fmt: skip
    for kind, value in values.items():
        due = LocalParameter.Type.from_parameter_value(value).value
        assert _descriptor('x', Quantity(kind, 'a value')).type == due


def test_each_is_described_with_its_range(listener):
    leaves = {leaf.name: leaf.quantity for leaf in parameter_leaves(MechanismAndDrive('four_bar'))}
    groups = {'dyads', 'points', 'joints', 'plane', 'publish_description', 'linkages'}
    unset = {name for name in leaves if name.split('.')[0] in groups}
    assert set(leaves) - set(dump(listener)) == unset
    leaves = {name: quantity for name, quantity in leaves.items() if name not in unset}
    request = DescribeParameters.Request(names=sorted(leaves))
    described = call(listener, DescribeParameters, 'describe_parameters', request)
    for descriptor in described.descriptors:
        quantity = leaves[descriptor.name]
        assert descriptor.description.startswith(quantity.meaning)
        assert quantity.unit in descriptor.description
        assert descriptor.read_only != quantity.live
        if quantity.kind == 'number':
            (span,) = descriptor.floating_point_range
            assert (span.from_value, span.to_value) == (quantity.low, quantity.high)


def test_a_node_that_is_not_managed_has_no_services_of_one(listener):
    def names():
        return [name for name, _ in listener.node.get_service_names_and_types()]

    wait_for(lambda: '/linkage_node/set_parameters' in names())
    assert '/linkage_node/change_state' not in names()


def test_bad_values_are_refused_and_change_nothing(listener):
    bad = [
        ('rpm', {'type': 3, 'double_value': math.nan}, 'rpm = nan'),
        ('rpm', {'type': 3, 'double_value': 1e7}, 'rpm = 10000000.0'),
        ('rpm', {'type': 3, 'double_value': 1000000.5}, 'rpm = 1000000.5'),  # rclpy accepts it
        ('rpm', {'type': 4, 'string_value': 'fast'}, "rpm = 'fast'"),
        ('crank.length', {'type': 3, 'double_value': 0.2}, 'read-only parameter: crank.length'),
        ('use_sim_time', {'type': 1, 'bool_value': True}, 'start it again'),
    ]
    for name, value, words in bad:
        refused = set_parameter(listener, name, **value)
        assert not refused.successful, name
        assert words in refused.reason
    listener.await_more(20)
    speeds = {numbers[3] for _, numbers in decoded(listener.received['/joint_states'])}
    assert list(speeds) == pytest.approx([RPM * math.pi / 30], rel=1e-15)


def test_dump_reproduces_the_run(listener, tmp_path):
    values = {name: parameter_value_to_python(value) for name, value in dump(listener).items()}
    dumped = tmp_path / 'linkage_node.yaml'
    dumped.write_text(yaml.dump({'/linkage_node': {'ros__parameters': values}}))
    original = load('quadrilateral')
    drive = replace(original.drive, rpm=RPM, start_rpm=RPM)
    assert load(str(dumped)) == with_linkage(original, drive=drive)


@pytest.mark.parametrize('kind', [SetParameters, SetParametersAtomically])
def test_node_accepts_its_own_dump_but_no_other_read_only_value(listener, kind):
    def load_values(**changes):
        parameters = [Parameter(name=n, value=v) for n, v in {**dumped, **changes}.items()]
        name = 'set_parameters' + '_atomically' * (kind is SetParametersAtomically)
        answer = call(listener, kind, name, kind.Request(parameters=parameters))
        results = getattr(answer, 'results', None) or [answer.result]
        return [result.reason for result in results if not result.successful]

    dumped = dump(listener)
    assert {'mechanism', 'coupler.center', 'use_sim_time', 'rpm'} <= set(dumped)
    assert load_values() == []
    assert load_values(rpm=ParameterValue(type=3, double_value=60.0)) == []
    assert dump(listener)['rpm'].double_value == 60.0
    assert load_values() == []
    center = ParameterValue(type=8, double_array_value=[0.1, 0.0])
    (reason,) = load_values(**{'coupler.center': center})
    assert 'read-only parameter: coupler.center' in reason
    (reason,) = load_values(nonsense=center)
    assert 'nonsense' in reason


def test_a_value_of_no_type_does_not_end_the_service_of_others(listener):
    client = listener.node.create_client(SetParameters, '/linkage_node/set_parameters')
    parameter = Parameter(name='rpm', value=ParameterValue(type=200))
    client.wait_for_service(PATIENCE)
    for _ in range(3):
        future = client.call_async(SetParameters.Request(parameters=[parameter]))
        assert set_parameter(listener, 'rpm', type=3, double_value=30.0).successful
        assert not future.done()
