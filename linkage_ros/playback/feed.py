# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads an excerpt of a log ahead of a replay, in a thread, once or in a loop."""

import itertools
from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from typing import NamedTuple

from linkage_ros.log.reader import LoggedMessage, LogReader
from linkage_ros.units import NS_PER_S

# Messages per batch, and batches read ahead, so that decompressing a chunk delays no message.
# Without batches, every message would wake the reading thread for milliseconds, which delays a
# subscriber on the same processor.
_BATCH, _BATCHES = 16, 256


class Excerpt(NamedTuple):
    """Time range and topics of a replay.

    Attributes:
        start: First log time, ns.
        end: End of the excerpt in log time, ns, exclusive. At the end of the log, this is one
            period after the last message, so that the repetitions of a loop are evenly spaced.
        topics: Fully qualified names of the topics.
    """

    start: int
    end: int
    topics: list[str]


class Item(NamedTuple):
    """A message to play.

    Attributes:
        time: Log time, ns; each round of a loop adds the length of the excerpt.
        message: The logged message.
    """

    time: int
    message: LoggedMessage


def excerpt_of(
    log: LogReader, offset: float, duration: float | None, topics: list[str] | None
) -> Excerpt:
    """Selects an excerpt of a log.

    Args:
        log: The log to read.
        offset: Time to skip at the beginning, s.
        duration: Length of the excerpt, s; None: to the end of the log.
        topics: Fully qualified names of the topics; None: all topics.

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
    """Reads an excerpt in a separate thread.

    Args:
        log: The log; while the feed is open, nothing else may use it.
        excerpt: The part to play; earlier latched messages come first.
        loop: Whether to repeat the excerpt indefinitely.

    Yields:
        An iterator over the items; it raises a LogError where the file is damaged.
    """
    batches = _batches(log, excerpt, loop=loop)
    with ThreadPoolExecutor(1, 'reader') as reader:

        def read() -> Future[list[Item] | None]:
            return reader.submit(next, batches, None)

        ahead = deque(read() for _ in range(_BATCHES))

        def items() -> Iterator[Item]:
            while (batch := ahead.popleft().result()) is not None:
                ahead.append(read())
                yield from batch

        try:
            yield items()
        finally:
            reader.shutdown(cancel_futures=True)


def _batches(log: LogReader, excerpt: Excerpt, *, loop: bool) -> Iterator[list[Item]]:
    # Latched messages that a subscriber would have received before the excerpt begins.
    names = [topic.name for topic in log.topics if topic.latched and topic.name in excerpt.topics]
    before = log.messages(names, end=excerpt.start) if excerpt.start > log.start else ()
    last = {message.topic: message for message in before}
    yield [Item(excerpt.start, message) for message in last.values()]
    shift, count = 0, 1
    while count and (loop or not shift):  # after a round without messages, no round has any
        messages, count = log.messages(excerpt.topics, excerpt.start, excerpt.end), 0
        while batch := [Item(m.time + shift, m) for m in itertools.islice(messages, _BATCH)]:
            yield batch
            count += 1
        shift += excerpt.end - excerpt.start
