# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Torque commands heard on a topic."""

from __future__ import annotations

from collections.abc import Callable

from rclpy.node import Node
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState

from linkage_ros.run.commands import Commands
from linkage_ros.run.drives import TorqueDrive
from linkage_ros.wire.messages import JOINT_COMMANDS


def listen(node: Node, drive: TorqueDrive, keep: Callable[[bytes], None]) -> Commands:
    """Lets a node take commands.

    Args:
        node: The node.
        drive: Of the mechanism.
        keep: Called with the bytes of each command, good or bad.

    Returns:
        The commands.
    """
    commands = Commands(drive.torque_limit, drive.command_timeout)

    def hear(data: bytes) -> None:
        keep(data)
        message = deserialize_message(data, JointState)
        if wrong := commands.hear(message.name, message.effort):
            node.get_logger().warning(
                f'a command on {JOINT_COMMANDS.name} is refused: {wrong}',
                throttle_duration_sec=1.0,
            )

    depth = JOINT_COMMANDS.depth
    node.create_subscription(JointState, JOINT_COMMANDS.name, hear, depth, raw=True)
    return commands
