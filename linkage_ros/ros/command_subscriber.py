# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Torque commands from a topic, fetched by the tick that needs them."""

from __future__ import annotations

import time

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState

from linkage_ros.motion.drives import TorqueDrive
from linkage_ros.run.torque_commands import TorqueCommands
from linkage_ros.units import NS_PER_S
from linkage_ros.wire.topics import JOINT_COMMANDS
from linkage_ros.wire.untrusted_command import LARGEST_COMMAND, decode_joint_state

# Commands that wait for a tick; of more, the last ones. It bounds what a flood can cost a tick.
_DEPTH = 100
# Best effort hears every publisher, whatever its quality of service; reliable would not hear a
# best-effort one. A command that the network loses is not sent again: the next one replaces it.
_QOS = QoSProfile(depth=_DEPTH, reliability=ReliabilityPolicy.BEST_EFFORT)


class _PolledGroup(ReentrantCallbackGroup):  # type: ignore[misc]  # rclpy has no types
    """Keeps a subscription from the executor.

    Its thread would be woken by each command, and thousands a second took the interpreter from
    the thread that ticks: at 10 kHz, five of six ticks were missed.
    """

    def can_execute(self, entity: object) -> bool:  # noqa: ARG002, the executor's signature
        """Never."""
        return False


class CommandSubscriber:
    """The commands on a node's joint_commands.

    Attributes:
        commands: What was commanded, and what became of it.
    """

    def __init__(self, node: Node, drive: TorqueDrive, crank: str) -> None:
        """Subscribes.

        Args:
            node: The node.
            drive: Drive of the mechanism.
            crank: Name of the crank's joint.
        """
        self.commands = TorqueCommands(drive.torque_limit, drive.command_timeout, crank=crank)
        self._logger = node.get_logger()
        self._subscription = node.create_subscription(
            JointState, JOINT_COMMANDS.name, lambda _: None, _QOS, raw=True,
            callback_group=_PolledGroup(),
        )  # fmt: skip

    def poll(self) -> list[tuple[int, bytes]]:
        """Takes what has come since the last call, good or bad, but for what is too large.

        Returns:
            When each command came, ns, and its bytes.
        """
        fetched: list[tuple[int, bytes]] = []
        handle = self._subscription.handle
        with handle:
            # A flood must not keep the tick here while more comes.
            while len(fetched) < _DEPTH and (taken := handle.take_message(JointState, True)):
                data, info = taken
                fetched.append((info['received_timestamp'] or time.time_ns(), data))
        now, wrong = time.time_ns(), ''
        for received, data in fetched:
            wrong = self._receive(data, max(0, now - received) / NS_PER_S) or wrong
        if wrong:
            words = f'a command on {JOINT_COMMANDS.name} is refused: {wrong}'
            self._logger.warning(words, throttle_duration_sec=1.0)
        # Megabytes would be a log's largest chunk, and nobody's command.
        return [(received, data) for received, data in fetched if len(data) <= LARGEST_COMMAND]

    def _receive(self, data: bytes, age: float) -> str:
        try:
            command = decode_joint_state(data)
        except ValueError as error:
            return self.commands.refuse(str(error))
        return self.commands.receive(command.names, command.efforts, age)
