# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Log and live view of a node: its states, and the messages that it publishes and receives."""

from collections.abc import Callable, Iterable, Mapping
from ipaddress import ip_address
from pathlib import Path
from typing import Any

from rclpy.node import Node

from linkage_ros import cli
from linkage_ros.errors import LogError
from linkage_ros.log.records import Event, LoggedSegment, TorqueEnd
from linkage_ros.log.rows import LoggedState
from linkage_ros.mechanism.kinematics import State
from linkage_ros.messages.topics import Topic
from linkage_ros.motion.segments import Segment
from linkage_ros.node.health import Health
from linkage_ros.node.workers import Worker, accompany_ticker
from linkage_ros.run.robot import Robot
from linkage_ros.settings.parameters import SPAWN, WEB

# Queue lengths: for a stalled disk, half a minute at 1 kHz, within 64 MB; for a slow viewer.
_LOG_CAPACITY, _VIEW_CAPACITY = 30_000, 4_000
# s between batches, each of which is a chunk. A killed run loses at most this time plus delays of
# a busy machine; the documentation promises 0.3 s. Between batches, the thread's code and data
# leave the processor's caches, so that smaller batches cost two to three times as much.
_LOG_PERIOD = 0.15
# s between syncs to the disk, which limit the loss in a power cut.
_SYNC_PERIOD = 1.0
_LOG_CLOSE_SECONDS, _VIEW_CLOSE_SECONDS = 30.0, 5.0


class Outputs:
    """Log and live view of a run, if configured, in separate threads; any thread may add to them.

    MCAP and Rerun are imported when they are needed, because they are optional.

    Attributes:
        has_view: Whether there is a view.
    """

    def __init__(self, node: Node, robot: Robot, others: Iterable[Topic]) -> None:
        """Opens log and view; `others` are topics of the log other than those of the states.

        Raises:
            ViewerError: The view cannot be opened.
            LogError: The log cannot be created.
            ImportError: MCAP or Rerun is not installed.
        """
        self._node, self._session = node, robot.configuration.session
        self._workers: dict[str, Worker[Any]] = {}
        self._channels: dict[str, int] = {}
        self._view: Any = None
        self.has_view = bool(self._session.viewer)
        if self.has_view:
            self._open_view(robot)
        if self._session.log:
            try:
                self._open_log(robot, others)
            except (LogError, ImportError):
                if self._view:
                    self._workers['viewer'].close(_VIEW_CLOSE_SECONDS)
                    self._view.discard()
                raise

    def _open_view(self, robot: Robot) -> None:
        """Opens the view, and says where it is."""
        from linkage_ros.view.rerun_connection import View
        from linkage_ros.view.viewer_process import open_page

        session, logger = self._session, self._node.get_logger()
        self._view = view = View(
            robot.configuration,
            session.viewer,
            session.viewer_bind,
            overwrite=session.log_overwrite,
        )
        if view.page:
            logger.info(f'watch it in a browser, until Ctrl-C: {view.page}')
            open_page(view.page)
        if session.viewer in (SPAWN, WEB) and not ip_address(session.viewer_bind).is_loopback:
            logger.warning(
                f'the view is served at {session.viewer_bind} to every host that can reach it; '
                'viewer_bind = 127.0.0.1 restricts it to this machine'
            )
        self._start(
            'viewer', view, _VIEW_CAPACITY, view.period, 'the run continues without a view'
        )

    def _open_log(self, robot: Robot, others: Iterable[Topic]) -> None:
        """Creates the log, and syncs it to the disk from time to time."""
        from linkage_ros.log.disk import DiskSync
        from linkage_ros.log.records import Gap
        from linkage_ros.log.writer import LogWriter

        path, resolve = Path(self._session.log).expanduser(), self._node.resolve_topic_name
        log = LogWriter(path, robot.configuration, overwrite=self._session.log_overwrite)
        self._channels = log.add_states(robot.templates, lambda topic: resolve(topic.name))
        self._channels |= {t.name: log.add_topic(t, resolve(t.name)) for t in others}
        ended = 'the run continues without a log'
        self._start('log', log, _LOG_CAPACITY, _LOG_PERIOD, ended, gap=Gap)
        # A slow sync must not delay the flushes.
        sync = DiskSync(path, log.file.stream.fileno())
        self._start('sync', sync, 1, _SYNC_PERIOD, 'a power cut may lose part of the log')

    def _start(
        self,
        name: str,
        consumer: Any,
        capacity: int,
        period: float,
        consequence: str,
        gap: Callable[[int], Any] | None = None,
    ) -> None:
        """Starts the thread of a consumer; `consequence` describes the effect of a failure."""
        logger = self._node.get_logger()

        def report(error: Exception) -> None:
            if name == 'log':
                consumer.has_end = False  # it ends before the run
            logger.error(f'{consequence}: {error}')

        self._workers[name] = Worker(
            name, consumer, capacity=capacity, period=period, on_start=accompany_ticker,
            on_error=report, gap=gap,
        )  # fmt: skip

    def log_state(self, state: LoggedState) -> None:
        """Logs a state."""
        if self._session.log:
            self._workers['log'].offer(state, len(state.messages))

    def log_segment(self, segment: Segment, linkage: str) -> None:
        """Logs a segment of the motion of a linkage, which is not dropped; see `Worker`."""
        if self._session.log:
            item = LoggedSegment(segment, linkage)
            self._workers['log'].offer(item, segment.size, keep=True)

    def log_event(self, event: Event) -> None:
        """Logs an event, which is not dropped; see `Worker`."""
        if self._session.log:
            self._workers['log'].offer(event, keep=True)

    def log_torque_end(self, end: TorqueEnd, zeros: Mapping[str, bytes]) -> None:
        """Logs the end of a torque and its zeros, CDR bytes by name of the topic; see `Worker`."""
        self.log_event(end)
        for name, message in zeros.items() if self._session.log else ():
            item = self._channels[name], end.stamp, message
            self._workers['log'].offer(item, len(message), keep=True)

    def log_message(self, stamp: int, topic: Topic, message: bytes) -> None:
        """Logs a message, CDR bytes, with the time of publishing or receipt, ns.

        A latched message, which is not repeated, is not dropped.
        """
        if self._session.log:
            item = self._channels[topic.name], stamp, message
            self._workers['log'].offer(item, len(message), keep=topic.latched)

    def show(self, stamp: int, states: Mapping[str, State]) -> None:
        """Shows the states of linkages, by name, at a stamp, ns, in the view."""
        self._workers['viewer'].offer((stamp, states))

    def health(self) -> dict[str, Health]:
        """Returns the health of log and viewer, by name."""
        workers, session = self._workers, self._session
        health = {'log': Health(''), 'viewer': Health('')}
        if session.log:
            log = workers['log']
            health['log'] = Health(session.log, log.dropped, log.error or workers['sync'].error)
        if session.viewer:
            # States are lost before they reach the view, and in the view if the viewer lags.
            viewer, view = workers['viewer'], self._view
            lost = viewer.dropped + view.dropped
            health['viewer'] = Health(session.viewer, lost, viewer.error, view.trouble)
        return health

    def close(self, join: Callable[..., object]) -> bool:
        """Completes log and view; returns whether the log succeeded."""
        closed = True
        if 'log' in self._workers:
            closed = self._workers['log'].close(_LOG_CLOSE_SECONDS, join)
            # The sync is closed after all data are written, and left if the disk hangs.
            closed = closed and self._workers['sync'].close(_LOG_CLOSE_SECONDS, join)
        if not closed:
            words = 'the disk hangs: the log is incomplete; linkage_log recover saves its contents'
            cli.print_error(self._node.get_name(), words)
        if self._view:
            self._workers['viewer'].close(_VIEW_CLOSE_SECONDS, join)
        return closed and self.health()['log'].error is None
