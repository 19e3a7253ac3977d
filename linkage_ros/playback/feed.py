# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Feeds a replay with an excerpt of a log, once or in a loop, read ahead in a thread."""

from __future__ import annotations

import itertools
import queue
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import NamedTuple

from linkage_ros.errors import LinkageError
from linkage_ros.log.reader import LoggedMessage, LogReader
from linkage_ros.units import NS_PER_S

# The product is the greatest number of messages read ahead, so that unpacking a chunk delays no
# message. Handing them over one by one would wake the reading thread at every message; while that
# works for milliseconds on end, a subscriber on the same processor gets its message late.
_BATCH, _BATCHES = 16, 256
_CHECK_SECONDS = 0.1  # within which the reading thread notices that the feed is closed


class Excerpt(NamedTuple):
    """A part of a log.

    Attributes:
        start: First log time, ns.
        end: Log time before which it ends, ns. An excerpt that ends with the log ends one message
            period after its last message, so that the rounds of a loop join.
        topics: Fully qualified names.
    """

    start: int
    end: int
    topics: list[str]


class Item(NamedTuple):
    """A message to play.

    Attributes:
        time: Log time, ns; in each round of a loop later by the length of the excerpt.
        message: As it was logged.
    """

    time: int
    message: LoggedMessage


def excerpt_of(
    log: LogReader, offset: float, duration: float | None, topics: list[str] | None
) -> Excerpt:
    """The excerpt of a log that options describe.

    Args:
        log: The log.
        offset: s to leave out at the beginning.
        duration: s to play from there; None: to the end.
        topics: Fully qualified names; None: all.

    Returns:
        The excerpt.
    """
    start = log.start + round(offset * NS_PER_S)
    end = log.end + round(NS_PER_S / log.configuration.session.rate_hz)
    if duration is not None:
        end = min(end, start + max(1, round(duration * NS_PER_S)))
    return Excerpt(start, end, topics or [topic.name for topic in log.topics])


@contextmanager
def feed(log: LogReader, excerpt: Excerpt, *, loop: bool) -> Iterator[Iterator[Item]]:
    """Reads an excerpt in a thread of its own.

    Args:
        log: The log; from here on, only the feed may use it.
        excerpt: The part to play; latched messages of earlier times come first.
        loop: Whether to start again at its end, without limit.

    Yields:
        The items; raises a LogError where the file is damaged.
    """
    batches: queue.Queue[list[Item] | LinkageError | None] = queue.Queue(_BATCHES)
    closed = threading.Event()

    def put(batch: list[Item] | LinkageError | None) -> None:
        while not closed.is_set():
            with suppress(queue.Full):
                batches.put(batch, timeout=_CHECK_SECONDS)
                return

    def read() -> None:
        try:
            for batch in _batches(log, excerpt, loop=loop):
                put(batch)
                if closed.is_set():
                    return
            put(None)
        except LinkageError as error:
            put(error)

    thread = threading.Thread(target=read, name='reader', daemon=True)
    thread.start()
    try:
        yield _items(batches)
    finally:
        closed.set()
        thread.join(1.0)  # a disk that hangs does not delay the end


def _items(batches: queue.Queue[list[Item] | LinkageError | None]) -> Iterator[Item]:
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
        if not loop or size == 1:  # in a round without a message, the next would have none either
            return


def _latched(log: LogReader, excerpt: Excerpt) -> list[Item]:
    """Latched messages that a subscriber would have got by the start of an excerpt."""
    names = [topic.name for topic in log.topics if topic.latched and topic.name in excerpt.topics]
    if not names or excerpt.start <= log.start:
        return []
    last = {message.topic: message for message in log.messages(names, end=excerpt.start)}
    return [Item(excerpt.start, message) for message in last.values()]
