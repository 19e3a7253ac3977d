# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Shows the joint states of a log in Rerun while it is played."""

from __future__ import annotations

from linkage_ros import cli
from linkage_ros.errors import ViewerError
from linkage_ros.log.reader import LogReader, paired
from linkage_ros.playback.feed import Item
from linkage_ros.run.worker import Worker
from linkage_ros.view.rerun_view import Sample, View
from linkage_ros.wire.topics import JOINT_STATES

_CAPACITY = 1_000_000  # samples
_CLOSE_SECONDS = 10.0


class ReplayView:
    """A view of a log, as a sink for its messages."""

    def __init__(self, name: str, log: LogReader, target: str, *, alone: bool) -> None:
        """Opens the view, served to this machine alone.

        Args:
            name: Name of the program, for its messages to the user.
            log: The log.
            target: As for a View.
            alone: Whether this is the only sink, so that the replay ends with the view.

        Raises:
            ViewerError: No viewer answers, or the view cannot be opened.
        """
        self._name, self._alone = name, alone
        # Commands have the same type.
        self._topics = {channel.name for channel, _ in paired(log, [JOINT_STATES])}
        self._view = View(log.configuration, target)
        if self._view.sender.trouble:
            raise ViewerError(
                f'no viewer answers at {target}: start one there first, with `rerun`'
            )
        if self._view.page:
            print(f'watch it in a browser: {self._view.page}', flush=True)
        self._worker: Worker[Sample] = Worker(
            'view', self._view, capacity=_CAPACITY, period=self._view.period, on_error=self._report
        )

    def __call__(self, item: Item) -> None:
        """Shows a message, if it contains joint states.

        Raises:
            ViewerError: The view has ended, and it is the only sink.
        """
        self._check()
        if item.message.topic in self._topics:
            # In a loop, each round follows the one before.
            self._worker.offer((item.time - item.message.time, item.message.data))

    def __enter__(self) -> ReplayView:
        return self

    def __exit__(self, kind: type | None, *_: object) -> None:
        self._worker.close(_CLOSE_SECONDS)
        lost = self._worker.dropped + self._view.dropped
        if lost and self._worker.error is None:
            words = f'{lost} states were not shown: the viewer lagged or ended'
            cli.print_error(self._name, words)
        if kind is None:
            self._check()

    def _check(self) -> None:
        if self._alone and self._worker.error:
            raise ViewerError(f'the view ended: {self._worker.error}') from self._worker.error

    def _report(self, error: Exception) -> None:
        if not self._alone:
            cli.print_error(self._name, f'the view ends here, the topics go on: {error}')
