# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Polled subscriptions: they wake no other thread, match every publisher and report rarely."""

import itertools
import re
from contextlib import contextmanager, suppress
from types import SimpleNamespace

import pytest
import rclpy
from rclpy import impl
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import (
    DurabilityPolicy,
    LivelinessPolicy,
    QoSProfile,
    ReliabilityPolicy,
)
from ros_harness import fresh_domain, wait_for
from sensor_msgs.msg import JointState

from linkage_ros.errors import ConfigurationError
from linkage_ros.messages.topics import JOINT_COMMANDS
from linkage_ros.node import endpoints, process

MESSAGES = 300


def reject(data, received):
    raise ValueError(f'byte {data[-1] % 7}: its value is {data[-1]}')


@contextmanager
def node_of(name, domain):
    context = Context()
    rclpy.init(context=context, domain_id=domain)
    try:
        yield Node(name, context=context, start_parameter_services=False)
    finally:
        with suppress(RuntimeError):
            context.shutdown()


@pytest.fixture
def polled(monkeypatch):
    """Returns a subscription with its node, and a publisher with the node of a robot."""
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    domain = fresh_domain()
    with node_of('subscriber', domain) as node, node_of('robot', domain) as robot:
        subscription = endpoints.PolledSubscription(node, JOINT_COMMANDS, reject, lambda *_: None)
        publisher = endpoints.create_publisher(robot, JOINT_COMMANDS)
        # Each side matches the other on its own; before that, best effort loses messages.
        wait_for(publisher.get_subscription_count)
        wait_for(subscription._subscription.get_publisher_count)
        yield node, subscription, publisher, robot


def test_every_publisher_is_compatible(polled):
    """So a subscription without an event handler for incompatible publishers misses nothing."""
    *_, robot = polled
    times = Duration(), Duration(seconds=1)
    policies = itertools.product(
        (ReliabilityPolicy.RELIABLE, ReliabilityPolicy.BEST_EFFORT),
        (DurabilityPolicy.TRANSIENT_LOCAL, DurabilityPolicy.VOLATILE),
        (LivelinessPolicy.AUTOMATIC, LivelinessPolicy.MANUAL_BY_TOPIC),
        times, times,
    )  # fmt: skip
    publishers = []
    for reliability, durability, liveliness, deadline, lease in policies:
        qos = QoSProfile(
            depth=1, reliability=reliability, durability=durability, liveliness=liveliness,
            deadline=deadline, liveliness_lease_duration=lease,
        )  # fmt: skip
        publishers.append(robot.create_publisher(JointState, 'joint_commands', qos))
    wait_for(lambda: all(one.get_subscription_count() for one in publishers))


def test_rejected_messages_call_the_logger_at_most_once_a_second(polled, monkeypatch):
    """rclpy's throttled logger takes as long as several ticks for calls that it suppresses."""
    node, subscription, publisher, _ = polled
    lines, kinds, now = [], [], [0.0]
    monkeypatch.setattr(process, 'time', SimpleNamespace(monotonic=lambda: now[0]))
    monkeypatch.setattr(node.get_logger(), 'log', lambda words, *_, **__: lines.append(words))
    monkeypatch.setattr(subscription, '_log', lambda _, __, data: kinds.append(data[-1]))
    for number in range(MESSAGES):
        publisher.publish(b'\0\1\0\0' + bytes([number % 251]))
        wait_for(lambda number=number: [*subscription.take()] or len(kinds) > number)
    assert len(lines) == 1
    now[0] = 0.999
    assert [*subscription.take()] == []
    assert len(lines) == 1
    now[0] = 1.0
    assert [*subscription.take()] == []
    assert len(lines) == 2
    said = ' '.join(lines)
    causes = re.findall(r'byte (\d): its value is (\d+) \(', said)
    assert all(int(value) % 7 == int(cause) for cause, value in causes)
    assert len(causes) == 1 + 5  # the last one of each cause
    assert 'other causes (' in said
    assert sum(int(text.split()[0]) for text in said.split('(')[1:]) == MESSAGES


def test_rejected_messages_are_counted_by_linkage_and_cause():
    found = endpoints.Rejections()
    for number in range(3):
        for linkage in ('left', 'right'):
            found.add(ValueError(f'first: {number}'), linkage)
    found.add(ValueError('second: 3'), 'left')
    found.add(ValueError('first: 4'))
    counts = re.findall(r'((?:\w+: )*\d) \((\d) x\)', str(found))
    assert counts == [
        ('left: first: 2', '3'), ('left: second: 3', '1'), ('right: first: 2', '3'),
        ('first: 4', '1'),
    ]  # fmt: skip


def test_another_rclpy_is_refused_in_one_line(polled, monkeypatch):
    node, *_ = polled
    with monkeypatch.context() as other:
        other.setattr(impl.implementation_singleton, 'rclpy_implementation', object())
        with pytest.raises(ConfigurationError, match=r'^this rclpy .*Jazzy[^\n]*$'):
            endpoints.PolledSubscription(node, JOINT_COMMANDS, reject, lambda *_: None)


def test_a_publisher_whose_node_is_not_discovered_yet_has_no_name(polled, monkeypatch):
    node, subscription, *_ = polled
    other = SimpleNamespace(topic_type='x', node_name='_NODE_NAME_UNKNOWN_', node_namespace='_')
    monkeypatch.setattr(node, 'get_publishers_info_by_topic', lambda _: [other])
    (words,) = subscription.mistyped()
    assert words.startswith('a node publishes x on ')


def test_waiting_for_delivery_leaves_the_interpreter_to_other_threads():
    """rclpy holds the interpreter lock for as long as it may wait."""
    asked = []

    def answers(duration):
        asked.append(duration.nanoseconds)
        return len(asked) > 3

    late, dead = (SimpleNamespace(wait_for_all_acked=x) for x in (answers, lambda duration: False))
    endpoints.wait_for_delivery([late])
    endpoints.wait_for_delivery([dead, late], 0.0)
    assert asked == [0] * 4
