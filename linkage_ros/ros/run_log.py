# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The log of a node: the messages that it publishes and receives."""

from __future__ import annotations

from collections.abc import Iterable

from rclpy.node import Node

from linkage_ros import cli
from linkage_ros.log.writer import LogItem, LogWriter
from linkage_ros.motion.drives import Drive, FollowDrive, TorqueDrive
from linkage_ros.motion.segments import Segment
from linkage_ros.run.health import Health
from linkage_ros.run.scheduling import accompany_ticker
from linkage_ros.run.simulator import Simulator
from linkage_ros.run.worker import Worker
from linkage_ros.wire.topics import JOINT_COMMANDS, MEASURED_JOINT_STATES, Topic
from linkage_ros.wire.untrusted_command import LARGEST_COMMAND

# Items that wait for a stalled disk: half a minute's at 1 kHz.
_CAPACITY = 30_000
# s between batches, each of which is a chunk. A killed run loses at most this and what a busy
# machine adds to it; 0.3 s are promised. A thread that wakes finds neither code nor data in the
# processor's caches any more: smaller batches take two to three times as long.
_PERIOD = 0.15
# s between orders to bring them to the disk itself, which bounds what a power cut costs.
_SYNC_PERIOD = 1.0
_CLOSE_SECONDS = 30.0


class RunLog:
    """Writes a log in separate threads; any thread may add to it."""

    def __init__(self, node: Node, simulator: Simulator, others: Iterable[Topic]) -> None:
        """Creates the log.

        Args:
            node: Its logger reports how the log ends.
            simulator: Makes the states.
            others: Topics published besides the states; received messages are logged too.

        Raises:
            LogError: The file cannot be created.
        """
        session = simulator.configuration.session
        self._node, self._path = node, session.log
        self._heard = heard_topics(simulator.configuration.drive)
        self._segment: Segment | None = None
        log = LogWriter(session.log, simulator.configuration, overwrite=session.log_overwrite)
        names = ((topic, node.resolve_topic_name(topic.name)) for topic in simulator.topics)
        log.add_states(simulator.layout, names)
        self._channels = {
            topic.name: log.add_topic(topic, node.resolve_topic_name(topic.name))
            for topic in (*others, *self._heard)
        }
        # A disk that is slow to keep things must not hold up the flushes.
        self._sync: Worker[None] = Worker(
            'sync',
            log.disk_sync(),
            capacity=1,
            period=_SYNC_PERIOD,
            on_error=self._report_sync_error,
        )
        self._worker: Worker[LogItem] = Worker(
            'log',
            log,
            capacity=_CAPACITY,
            period=_PERIOD,
            on_error=self._fail,
            on_start=accompany_ticker,
        )

    def write_row(self, row: bytes) -> None:
        """Logs the messages of a state, in the layout of the simulator."""
        self._worker.offer(row)

    def write(self, stamp: int, topic: Topic, message: bytes) -> None:
        """Logs a message.

        Args:
            stamp: Time of publishing or receipt, ns.
            topic: One of the other topics.
            message: CDR bytes.
        """
        self._worker.offer((self._channels[topic.name], stamp, message))

    def write_heard(self, received: int, data: bytes) -> None:
        """Logs a received message: a command or a measurement.

        Args:
            received: Time of receipt, ns.
            data: CDR bytes; a message of megabytes is left out.
        """
        (topic,) = self._heard
        if len(data) <= LARGEST_COMMAND:
            self.write(received, topic, data)

    def write_motion(self, segment: Segment) -> None:
        """Logs a segment of motion, unless it is the last logged one."""
        if segment is not self._segment:
            self._worker.offer(segment)
        self._segment = segment

    def health(self) -> Health:
        """Health of the log."""
        return Health(self._path, self._worker.dropped, self.error)

    @property
    def error(self) -> Exception | None:
        """The error that ended it; None: it works."""
        return self._worker.error or self._sync.error

    def close(self) -> bool:
        """Completes the log; returns whether it succeeded."""
        # The disk last: what it is to keep comes first.
        closed = self._worker.close(_CLOSE_SECONDS) and self._sync.close(_CLOSE_SECONDS)
        if not closed:
            words = f'the log could not be completed within {_CLOSE_SECONDS:g} s: the disk hangs'
            cli.print_error(self._node.get_name(), words)
        return closed and self.error is None

    def _fail(self, error: Exception) -> None:
        self._node.get_logger().error(f'the log ends here, the motion goes on: {error}')

    def _report_sync_error(self, error: Exception) -> None:
        if self._worker.error is None:  # else it was said that the log has ended
            words = f'the log goes on, but may not outlive a power cut: {error}'
            self._node.get_logger().error(words)


def heard_topics(drive: Drive) -> list[Topic]:
    """The topics that a node with this drive subscribes to."""
    topics = {TorqueDrive: JOINT_COMMANDS, FollowDrive: MEASURED_JOINT_STATES}
    return [topic for kind, topic in topics.items() if isinstance(drive, kind)]
