# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The simulated time of /clock."""

from __future__ import annotations

from collections.abc import Callable

from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock

from linkage_ros.units import NS_PER_S

# As ROS's own clocks listen, but a burst is not thinned out.
_QOS = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)


def subscribe_to_clock(node: Node, advance_to: Callable[[int], None]) -> None:
    """Subscribes to /clock.

    Args:
        node: The node.
        advance_to: Called with each time, ns, in the executor's thread.
    """

    def receive(message: Clock) -> None:
        seconds, rest = message.clock.sec, message.clock.nanosec
        if seconds >= 0 and rest < NS_PER_S:
            advance_to(seconds * NS_PER_S + rest)
        else:
            words = f'/clock says {seconds} s and {rest} ns, which is no time: left out'
            node.get_logger().error(words, throttle_duration_sec=1.0)

    node.create_subscription(Clock, '/clock', receive, _QOS)
