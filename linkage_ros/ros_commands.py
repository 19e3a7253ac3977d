# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Torque commands heard on a topic."""

from __future__ import annotations

from rclpy.node import Node
from sensor_msgs.msg import JointState

from linkage_ros.run.commands import Commands
from linkage_ros.run.drives import TorqueDrive
from linkage_ros.wire.messages import JOINT_COMMANDS


def listen(node: Node, drive: object) -> Commands | None:
    """Lets a node take commands where a torque drives the mechanism.

    Args:
        node: The node.
        drive: Of the mechanism.

    Returns:
        The commands; None where the drive takes none.
    """
    if not isinstance(drive, TorqueDrive):
        return None
    commands = Commands(drive.torque_limit, drive.command_timeout)

    def hear(message: JointState) -> None:
        if wrong := commands.hear(message.name, message.effort):
            node.get_logger().warning(
                f'a command on {JOINT_COMMANDS.name} is refused: {wrong}',
                throttle_duration_sec=1.0,
            )

    node.create_subscription(JointState, JOINT_COMMANDS.name, hear, JOINT_COMMANDS.depth)
    return commands
