# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Subscriptions of a node: commands, measurements of the crank, and simulated time."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

from linkage_ros.errors import ConfigurationError
from linkage_ros.motion.coordinates import Coordinates
from linkage_ros.motion.drives import TorqueDrive
from linkage_ros.run.measured_crank import MeasuredCrank
from linkage_ros.run.simulator import Simulator
from linkage_ros.run.torque_commands import TorqueCommands
from linkage_ros.units import NS_PER_S
from linkage_ros.wire.topics import JOINT_COMMANDS, MEASURED_JOINT_STATES, Topic
from linkage_ros.wire.untrusted_command import LARGEST_COMMAND, decode_joint_state

# Commands that wait for a tick; of more, the last ones. It bounds what a flood can cost a tick.
# As many times of /clock wait: a burst is not thinned out.
_DEPTH = 100
_SILENCE = 2.0  # s without a measurement after which it is said
_PATIENCE = 0.1  # s that the end of a node waits for a measurement at most


def _best_effort(depth: int) -> QoSProfile:
    """Best-effort quality of service: compatible with every publisher; losses are not resent."""
    return QoSProfile(depth=depth, reliability=ReliabilityPolicy.BEST_EFFORT)


class _PolledGroup(ReentrantCallbackGroup):  # type: ignore[misc]  # rclpy has no types
    """Hides a subscription from the executor.

    Each message would wake its thread. Thousands a second took the interpreter from the thread of
    the ticks: at 10 kHz, five of six ticks were missed.
    """

    def can_execute(self, entity: object) -> bool:  # noqa: ARG002, the executor's signature
        """Always False."""
        return False


class _PolledSubscription:
    """Keeps the last JointState messages until the thread of the ticks takes them.

    Attributes:
        topic: Resolved name of the topic.
    """

    def __init__(self, node: Node, topic: Topic, depth: int, outputs: Iterable[str]) -> None:
        """Subscribes.

        Args:
            node: The node.
            topic: The topic.
            depth: Length of the queue; older messages are dropped.
            outputs: Names of the topics on which the node publishes.

        Raises:
            ConfigurationError: The topic is one of these; the node would receive its own messages.
        """
        self.topic, self._depth = node.resolve_topic_name(topic.name), depth
        for name in outputs:
            if node.resolve_topic_name(name) == self.topic:
                own = name.lstrip('/')
                # A remapping of one name cannot tell the two apart.
                cure = '' if own == topic.name else f', -r {name}:=linkage/{own}'
                raise ConfigurationError(
                    f'{topic.name} and {name} are one topic, {self.topic}: the node would hear '
                    f'itself; give its own another name{cure}'
                )
        self._subscription = node.create_subscription(
            JointState, topic.name, lambda _: None, _best_effort(depth), raw=True,
            callback_group=_PolledGroup(),
        )  # fmt: skip
        self._wait_set = rclpy_implementation.WaitSet(1, 0, 0, 0, 0, 0, node.context.handle)

    def wait(self, seconds: float) -> None:
        """Waits for a message or a timeout."""
        handle = self._subscription.handle
        with handle:
            self._wait_set.clear_entities()
            self._wait_set.add_subscription(handle)
            self._wait_set.wait(round(seconds * NS_PER_S))

    def take(self) -> list[tuple[int, bytes]]:
        """Takes the queued messages, up to the depth.

        Returns:
            When each came, ns, and its CDR bytes.
        """
        taken: list[tuple[int, bytes]] = []
        handle = self._subscription.handle
        with handle:
            # A flood must not keep the thread here while more comes.
            while len(taken) < self._depth and (found := handle.take_message(JointState, True)):
                data, info = found
                taken.append((info['received_timestamp'] or time.time_ns(), data))
        return taken


class CommandSubscriber:
    """Subscription to joint_commands.

    Attributes:
        commands: The command in force, and counts of all commands.
    """

    def __init__(self, node: Node, drive: TorqueDrive, crank: str, outputs: Iterable[str]) -> None:
        """Subscribes.

        Args:
            node: The node.
            drive: Drive of the mechanism.
            crank: Name of the crank's joint.
            outputs: Names of the topics on which the node publishes.

        Raises:
            ConfigurationError: joint_commands is one of these.
        """
        self.commands = TorqueCommands(drive.torque_limit, drive.command_timeout, crank=crank)
        self._logger = node.get_logger()
        self._subscription = _PolledSubscription(node, JOINT_COMMANDS, _DEPTH, outputs)

    def poll(self) -> list[tuple[int, bytes]]:
        """Takes all commands since the last call, valid or not, except those that are too large.

        Returns:
            When each command came, ns, and its bytes.
        """
        fetched = self._subscription.take()
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
    """Subscription to the measurements.

    Attributes:
        diagnostics: Returns counts of the messages that were left out.
    """

    def __init__(self, node: Node, simulator: Simulator, outputs: Iterable[str]) -> None:
        """Subscribes.

        Args:
            node: The node.
            simulator: Simulator of its configuration.
            outputs: Names of the topics on which the node publishes.

        Raises:
            ConfigurationError: measured_joint_states is one of these.
        """
        topic, self._logger = MEASURED_JOINT_STATES, node.get_logger()
        self._measured, self._crank = MeasuredCrank(simulator), simulator.crank_joint
        self._last = -math.inf  # when a measurement counted, s
        self.diagnostics = self._measured.diagnostics
        self._subscription = _PolledSubscription(node, topic, topic.depth, outputs)
        self._topic = self._subscription.topic

    def receive(self) -> list[tuple[int, bytes]]:
        """Waits for messages for a short time.

        Returns:
            When each came, ns, and its CDR bytes.
        """
        self._subscription.wait(_PATIENCE)
        return self._subscription.take()

    def take(self, received: int, data: bytes) -> tuple[int, Coordinates] | None:
        """Takes a message.

        Args:
            received: When it came, ns.
            data: Its CDR bytes.

        Returns:
            Stamp, ns, and crank; None: it was rejected, counted and reported.
        """
        before = self._measured.left_out.copy()
        heard = self._measured.hear(data, received)
        if heard is None:
            (cause,) = self._measured.left_out - before
            words = f'a message on {self._topic} is left out: {cause}'
            self._logger.warning(words, throttle_duration_sec=1.0)
        else:
            self._last = time.monotonic()
        return heard

    def troubles(self) -> list[str]:
        """A warning if no measurements arrive; else empty."""
        if time.monotonic() < self._last + _SILENCE:
            return []
        return [f'no measurement of {self._crank} on {self._topic} in the last {_SILENCE:g} s']


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
