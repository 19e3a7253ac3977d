# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The measurements of the crank on a node's measured_joint_states, answered one by one."""

from __future__ import annotations

from collections.abc import Callable

from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState

from linkage_ros.errors import ConfigurationError
from linkage_ros.wire.topics import JOINT_STATES, MEASURED_JOINT_STATES

# Best effort hears every publisher, whatever its quality of service.
_QOS = QoSProfile(depth=MEASURED_JOINT_STATES.depth, reliability=ReliabilityPolicy.BEST_EFFORT)


def hear_measurements(node: Node, take: Callable[[bytes], None]) -> None:
    """Subscribes to measured_joint_states.

    Args:
        node: The node.
        take: Called with the CDR bytes of each message, in the executor's thread.

    Raises:
        ConfigurationError: The node publishes on that topic: it would answer itself for ever.
    """
    topics = JOINT_STATES, MEASURED_JOINT_STATES
    ours, measured = (node.resolve_topic_name(topic.name) for topic in topics)
    if ours == measured:
        raise ConfigurationError(
            f'measured_joint_states and joint_states are one topic, {ours}: the node would answer '
            'itself; give its own another name, -r joint_states:=linkage/joint_states'
        )
    node.create_subscription(JointState, MEASURED_JOINT_STATES.name, take, _QOS, raw=True)
