# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a node hears: commands, measurements of the crank, and simulated time."""

from __future__ import annotations

import time
from collections.abc import Callable

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

from linkage_ros.errors import ConfigurationError
from linkage_ros.motion.coordinates import Coordinates
from linkage_ros.motion.drives import TorqueDrive
from linkage_ros.run.measured_crank import MeasuredCrank
from linkage_ros.run.ticker import MeasurementTicker
from linkage_ros.run.torque_commands import TorqueCommands
from linkage_ros.units import NS_PER_S
from linkage_ros.wire.topics import JOINT_COMMANDS, JOINT_STATES, MEASURED_JOINT_STATES
from linkage_ros.wire.untrusted_command import LARGEST_COMMAND, decode_joint_state

# Commands that wait for a tick; of more, the last ones. It bounds what a flood can cost a tick.
# As many times of /clock wait: a burst is not thinned out.
_DEPTH = 100


def _best_effort(depth: int) -> QoSProfile:
    """Hears every publisher, whatever its quality of service; a lost message is not sent again."""
    return QoSProfile(depth=depth, reliability=ReliabilityPolicy.BEST_EFFORT)


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
            JointState, JOINT_COMMANDS.name, lambda _: None, _best_effort(_DEPTH), raw=True,
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
            reason = self._receive(data, max(0, now - received) / NS_PER_S)
            wrong = wrong or reason
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


class MeasurementSubscriber:
    """Hears the measurements, and has each one answered, in the executor's thread."""

    def __init__(self, node: Node, measured: MeasuredCrank, ticker: MeasurementTicker) -> None:
        """Subscribes.

        Args:
            node: The node.
            measured: Takes the messages.
            ticker: Makes a tick of each.

        Raises:
            ConfigurationError: The node publishes on that topic: it would answer itself for ever.
        """
        topics = JOINT_STATES, MEASURED_JOINT_STATES
        ours, theirs = (node.resolve_topic_name(topic.name) for topic in topics)
        if ours == theirs:
            raise ConfigurationError(
                f'measured_joint_states and joint_states are one topic, {ours}: the node would '
                'answer itself; give its own another name, -r joint_states:=linkage/joint_states'
            )
        self._measured, self._ticker, self._logger = measured, ticker, node.get_logger()
        self._topic = theirs
        node.create_subscription(
            JointState, MEASURED_JOINT_STATES.name, self._receive,
            _best_effort(MEASURED_JOINT_STATES.depth), raw=True,
        )  # fmt: skip

    def _receive(self, data: bytes) -> None:
        received = time.time_ns()
        self._ticker.answer(received, data)

    def take(self, received: int, data: bytes) -> tuple[int, Coordinates] | None:
        """Takes a message.

        Args:
            received: When it came, ns.
            data: Its CDR bytes.

        Returns:
            Stamp, ns, and crank; None: it is left out, counted and said.
        """
        before = self._measured.left_out.copy()
        heard = self._measured.hear(data, received)
        if heard is None:
            (cause,) = self._measured.left_out - before
            words = f'a message on {self._topic} is left out: {cause}'
            self._logger.warning(words, throttle_duration_sec=1.0)
        return heard


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

    node.create_subscription(Clock, '/clock', receive, _best_effort(_DEPTH))
