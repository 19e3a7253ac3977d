# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Shows the joint states of a log in Rerun while it is played."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from linkage_ros import cli
from linkage_ros.errors import ViewerError
from linkage_ros.log.reader import LogReader, paired
from linkage_ros.playback.feed import Item
from linkage_ros.playback.player import Sink
from linkage_ros.run.threads import Worker
from linkage_ros.view.rerun_view import Sample, View
from linkage_ros.wire.topics import JOINT_STATES

_CAPACITY = 1_000_000  # samples
_CLOSE_SECONDS = 10.0


@contextmanager
def showing(name: str, log: LogReader, target: str, *, alone: bool) -> Iterator[Sink]:
    """Opens a view of a replay that only this machine can access.

    Args:
        name: Name of the program, for its messages to the user.
        log: The log to show.
        target: Target of the view; see `View`.
        alone: Whether this is the only sink; the replay then ends with the view.

    Yields:
        A function that shows a message if it contains joint states, and ignores other messages.

    Raises:
        ViewerError: No viewer answers, the view cannot be opened, or it has ended and is the only
            sink.
    """

    def report(error: Exception) -> None:
        if not alone:
            cli.print_error(name, f'the replay continues without a view: {error}')

    def check() -> None:
        if alone and worker.error:
            raise ViewerError(f'the view ended: {worker.error}') from worker.error

    def show(item: Item) -> None:
        check()
        if item.message.topic in topics:
            # In a loop, the stamps of each round continue those of the previous round.
            worker.offer((item.time - item.message.time, item.message.data))

    # Selected by name, because joint_commands has the same type.
    topics = {channel.name for channel in paired(log, [JOINT_STATES]).values()}
    view = View(log.configuration, target)
    if view.trouble:
        raise ViewerError(f'no viewer answers at {target}: start one there first, with `rerun`')
    if view.page:
        print(f'watch it in a browser: {view.page}', flush=True)
    worker: Worker[Sample] = Worker(
        'view', view, capacity=_CAPACITY, period=view.period, on_error=report
    )
    try:
        yield show
    finally:
        worker.close(_CLOSE_SECONDS)
        lost = worker.dropped + view.dropped
        if lost and worker.error is None:
            cli.print_error(
                name, f'{cli.counted(lost, "state")} not shown: the viewer lagged or ended'
            )
    check()
