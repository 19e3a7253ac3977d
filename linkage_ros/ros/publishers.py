# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Publishers that take bytes, and their subscribers."""

from __future__ import annotations

import time
from collections.abc import Iterable
from importlib import import_module

from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from linkage_ros.errors import ConfigurationError
from linkage_ros.wire.topics import Topic

# s given to subscribers to find a node, and to be matched with it.
_DISCOVERY_SECONDS, _MATCH_SECONDS = 0.8, 0.2


def message_class(name: str) -> type:
    """The Python class of a message type.

    Args:
        name: Such as 'std_msgs/msg/Float64'.

    Returns:
        The class.
    """
    package, _, kind = name.split('/')
    found: type = getattr(import_module(f'{package}.msg'), kind)
    return found


def create_publisher(node: Node, topic: Topic) -> Publisher:
    """Creates a publisher with the topic's quality of service; it takes CDR bytes.

    Args:
        node: The node.
        topic: Name, type and quality of service.

    Returns:
        The publisher.
    """
    durability = DurabilityPolicy.TRANSIENT_LOCAL if topic.latched else DurabilityPolicy.VOLATILE
    qos = QoSProfile(
        depth=topic.depth, reliability=ReliabilityPolicy.RELIABLE, durability=durability
    )
    kind = message_class(topic.interface.name)
    return node.create_publisher(kind, topic.name, qos)


def create_publishers(node: Node, topics: Iterable[Topic]) -> dict[str, Publisher]:
    """Publishers of topics, by the topics' names.

    Args:
        node: Their node.
        topics: The topics.

    Returns:
        The publishers.

    Raises:
        ConfigurationError: The node has a topic of the same name already.
        RuntimeError: ROS refuses one for another reason.
    """
    found: dict[str, Publisher] = {}
    for topic in topics:
        name = node.resolve_topic_name(topic.name)
        taken = any(publisher.topic_name == name for publisher in found.values())
        try:
            found[topic.name] = create_publisher(node, topic)
        except RuntimeError as error:
            taken = 'incompatible type' in str(error)
            if not taken:
                raise
        if taken:
            raise ConfigurationError(
                f'{name} is a topic of this node already: give effort_command_topic, '
                'trajectory_command_topic or the remapping (-r FROM:=TO) another name'
            )
    return found


def wait_for_subscribers(
    publishers: Iterable[Publisher],
    patience: float = _DISCOVERY_SECONDS,
    settle: float = _MATCH_SECONDS,
) -> bool:
    """Waits until existing subscribers have found a node, so that they miss no message.

    Args:
        publishers: Publishers of the node.
        patience: Longest time to wait until one of them has a subscriber, s.
        settle: Further time for other subscribers, s.

    Returns:
        Whether there is a subscriber.
    """
    publishers, end = list(publishers), time.monotonic() + patience
    while time.monotonic() < end:
        if any(publisher.get_subscription_count() for publisher in publishers):
            time.sleep(settle)
            return True
        time.sleep(0.01)
    return False
