# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The log of a node: the messages that it publishes and receives."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from rclpy.node import Node

from linkage_ros import cli
from linkage_ros.run.health import Health
from linkage_ros.run.simulator import Simulator
from linkage_ros.run.threads import DiskSync, Worker, accompany_ticker
from linkage_ros.wire.topics import Topic

# Items queued for a stalled disk, enough for half a minute at 1 kHz.
_CAPACITY = 30_000
# s between batches, each of which is a chunk. A killed run loses at most this time plus delays of
# a busy machine; the documentation promises 0.3 s. Between batches, the thread's code and data
# leave the processor's caches, so that smaller batches cost two to three times as much.
_PERIOD = 0.15
# s between syncs to the disk, which limit the loss in a power cut.
_SYNC_PERIOD = 1.0
_CLOSE_SECONDS = 30.0


class RunLog:
    """Writes the log of a run, if it has one, in separate threads; any thread may add to it.

    Attributes:
        offer: Function that queues an item for the `LogWriter`, such as the row of a state.
    """

    def __init__(self, node: Node, simulator: Simulator, others: Iterable[Topic]) -> None:
        """Creates the log.

        Args:
            node: Node whose logger reports errors.
            simulator: Simulator that makes the states.
            others: Additional topics, published or received.

        Raises:
            LogError: The file cannot be created.
            ImportError: MCAP is not installed.
        """
        self._node, session = node, simulator.configuration.session
        self._path, self._workers = session.log, list[Worker[Any]]()
        self.offer: Callable[[object], None] = lambda _: None
        if not session.log:
            return
        from linkage_ros.log.writer import LogWriter

        log = LogWriter(session.log, simulator.configuration, overwrite=session.log_overwrite)
        names = ((topic, node.resolve_topic_name(topic.name)) for topic in simulator.topics)
        log.add_states(simulator.layout, names)
        self._channels = {
            topic.name: log.add_topic(topic, node.resolve_topic_name(topic.name))
            for topic in others
        }
        writing: Worker[Any] = Worker(
            'log', log, capacity=_CAPACITY, period=_PERIOD, on_error=self._report_end,
            on_start=accompany_ticker,
        )  # fmt: skip
        self.offer = writing.offer
        # A slow sync must not delay the flushes.
        syncing: Worker[Any] = Worker(
            'sync', DiskSync(session.log, log.file.stream.fileno()),
            capacity=1, period=_SYNC_PERIOD,
            on_error=self._report_no_sync, on_start=accompany_ticker,
        )  # fmt: skip
        self._workers = [writing, syncing]

    def write(self, stamp: int, topic: Topic, message: bytes) -> None:
        """Logs a message.

        Args:
            stamp: Time of publishing or receipt, ns.
            topic: One of the `others` given to the constructor.
            message: CDR bytes.
        """
        if self._workers:
            self.offer((self._channels[topic.name], stamp, message))

    def health(self) -> Health:
        """Returns the health of the log."""
        if not self._workers:
            return Health('')
        writing, syncing = self._workers
        return Health(self._path, writing.dropped, writing.error or syncing.error)

    def close(self) -> bool:
        """Completes the log; returns whether it succeeded."""
        # The sync is closed last, after all data are written.
        closed = all(worker.close(_CLOSE_SECONDS) for worker in self._workers)
        if not closed:
            words = f'the log could not be completed within {_CLOSE_SECONDS:g} s: the disk hangs'
            cli.print_error(self._node.get_name(), words)
        return closed and self.health().error is None

    def _report_end(self, error: Exception) -> None:
        self._node.get_logger().error(f'the run continues without a log: {error}')

    def _report_no_sync(self, error: Exception) -> None:
        if self._workers[0].error is None:  # otherwise the end of the log was already reported
            words = f'the log continues, but a power cut may lose part of it: {error}'
            self._node.get_logger().error(words)
