# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Shows the joint states of a log in Rerun while it is played."""

from __future__ import annotations

from linkage_ros import cli
from linkage_ros.errors import LogError, ViewerError
from linkage_ros.log.channels import paired
from linkage_ros.log.reader import LogReader
from linkage_ros.playback.feed import Item
from linkage_ros.run.machine import Machine
from linkage_ros.run.worker import Worker
from linkage_ros.view.rerun_view import View
from linkage_ros.wire.topics import JOINT_STATES

_CAPACITY, _PERIOD = 1_000_000, 0.03  # samples, s
_CLOSE_SECONDS = 10.0


class ReplayView:
    """A view of a log; a sink of its messages."""

    def __init__(self, name: str, log: LogReader, target: str, *, alone: bool) -> None:
        """Opens the view, on this machine alone, whatever the run's was.

        Args:
            name: Of the program, for what it says.
            log: The log.
            target: As for a View.
            alone: Whether nothing else is done with the messages: then it is no use to go on
                without the view.

        Raises:
            ViewerError: No viewer answers, or the view cannot be opened.
        """
        self._name, self._log, self._alone = name, log, alone
        self._codec = Machine(log.configuration).joint_states
        # Commands are of the same type.
        self._topics = {name for name, _ in paired(log, [JOINT_STATES])}
        self._view = View(log.configuration, target)
        if self._view.trouble:
            raise ViewerError(
                f'no viewer answers at {target}: start one there first, with `rerun`'
            )
        if self._view.page:
            print(f'watch it in a browser: {self._view.page}', flush=True)
        self._worker: Worker[tuple[int, bytes]] = Worker(
            'view', self._view, capacity=_CAPACITY, period=_PERIOD, on_error=self._fail
        )

    def __call__(self, item: Item) -> None:
        """Shows a message, if it is of joint states.

        Raises:
            LogError: It is none of this log's joints.
            ViewerError: The view has ended, and nothing else is done.
        """
        self._check()
        message = item.message
        if message.topic not in self._topics:
            return
        try:
            stamp, _ = self._codec.decode(message.data)
        except ValueError as error:
            raise LogError(f'{self._log.path}: a message on {message.topic} is {error}') from error
        # A round of a loop goes on where the one before ended.
        self._worker.offer((stamp + item.time - message.time, message.data))

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

    def _fail(self, error: Exception) -> None:
        if not self._alone:
            cli.print_error(self._name, f'the view ends here, the topics go on: {error}')
