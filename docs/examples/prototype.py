# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Keeps the crank of a torque-driven node at 15.7 rad/s by proportional control."""

from contextlib import suppress

import rclpy
from rclpy.executors import ExternalShutdownException
from sensor_msgs.msg import JointState


def answer(state: JointState) -> None:
    """Answers a state with a torque; messages of another robot do not name the crank."""
    speeds = dict(zip(state.name, state.velocity, strict=False))
    if 'crank' in speeds:
        commands.publish(JointState(name=['crank'], effort=[2.0 * (15.7 - speeds['crank'])]))


rclpy.init()
node = rclpy.create_node('prototype')
commands = node.create_publisher(JointState, 'joint_commands', 10)
node.create_subscription(JointState, 'joint_states', answer, 10)
with suppress(KeyboardInterrupt, ExternalShutdownException):
    # A SIGTERM between two waits of rclpy 7.1.5 wakes neither, so that each has an end.
    while rclpy.ok():
        rclpy.spin_once(node, timeout_sec=0.1)
