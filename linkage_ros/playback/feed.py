# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Feeds a replay with an excerpt of a log, once or over and over, read ahead of its time."""

from __future__ import annotations

import itertools
import queue
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import NamedTuple

from linkage_ros.errors import LinkageError
from linkage_ros.log.reader import LoggedMessage, LogReader
from linkage_ros.playback.excerpt import Excerpt

# Messages read ahead are at most the product, so that unpacking a chunk holds up no message.
# Handing them over one by one would wake the reading thread at every message; where it works
# for milliseconds on end, a subscriber that sleeps on the same processor gets its message late.
_BATCH, _BATCHES = 16, 256
_LOOK = 0.1  # s, within which the reading thread sees that nobody takes its batches any more


class Item(NamedTuple):
    """A message to play.

    Attributes:
        time: Log time, ns, later by the length of the excerpt in each round: it never goes back.
        message: As it was logged.
    """

    time: int
    message: LoggedMessage


@contextmanager
def feed(log: LogReader, excerpt: Excerpt, *, loop: bool) -> Iterator[Iterator[Item]]:
    """Reads an excerpt in a thread of its own.

    Args:
        log: The log; only for the feed from here on.
        excerpt: What to play of it; latched messages of earlier times come first.
        loop: Whether to begin again at its end, for ever.

    Yields:
        The items; raises a LogError where the file is damaged.
    """
    batches: queue.Queue[list[Item] | LinkageError | None] = queue.Queue(_BATCHES)
    closed = threading.Event()

    def put(batch: list[Item] | LinkageError | None) -> None:
        while not closed.is_set():
            with suppress(queue.Full):
                batches.put(batch, timeout=_LOOK)
                return

    def read() -> None:
        try:
            for batch in itertools.takewhile(
                lambda _: not closed.is_set(), _batches(log, excerpt, loop=loop)
            ):
                put(batch)
            put(None)
        except LinkageError as error:
            put(error)

    thread = threading.Thread(target=read, name='reader', daemon=True)
    thread.start()
    try:
        yield _taken(batches)
    finally:
        closed.set()
        thread.join(1.0)  # a disk that hangs must not hold up the end


def _taken(batches: queue.Queue[list[Item] | LinkageError | None]) -> Iterator[Item]:
    while (batch := batches.get()) is not None:
        if isinstance(batch, LinkageError):
            raise batch
        yield from batch


def _batches(log: LogReader, excerpt: Excerpt, *, loop: bool) -> Iterator[list[Item]]:
    yield _latched(log, excerpt)
    for turn in itertools.count():
        shift = turn * (excerpt.end - excerpt.start)
        messages = log.messages(excerpt.topics, excerpt.start, excerpt.end)
        size = 1  # the first are needed at once
        while batch := [Item(m.time + shift, m) for m in itertools.islice(messages, size)]:
            yield batch
            size = min(2 * size, _BATCH)
        if not loop or size == 1:  # a round without a message would be followed by others
            return


def _latched(log: LogReader, excerpt: Excerpt) -> list[Item]:
    """What a subscriber of the latched topics would have got by the start of an excerpt."""
    names = [topic.name for topic in log.topics if topic.latched and topic.name in excerpt.topics]
    if not names or excerpt.start <= log.start:
        return []
    last = {message.topic: message for message in log.messages(names, end=excerpt.start)}
    return [Item(excerpt.start, message) for message in last.values()]
