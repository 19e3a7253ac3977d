# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The measurements of the crank on a node's measured_joint_states, answered one by one."""

from __future__ import annotations

import time

from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState

from linkage_ros.errors import ConfigurationError
from linkage_ros.motion.coordinates import Coordinates
from linkage_ros.run.measured_crank import MeasuredCrank
from linkage_ros.run.ticker import MeasurementTicker
from linkage_ros.wire.topics import JOINT_STATES, MEASURED_JOINT_STATES

# Best effort hears every publisher, whatever its quality of service.
_QOS = QoSProfile(depth=MEASURED_JOINT_STATES.depth, reliability=ReliabilityPolicy.BEST_EFFORT)


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
            JointState, MEASURED_JOINT_STATES.name, self._receive, _QOS, raw=True
        )

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
