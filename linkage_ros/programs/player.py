# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads ahead in an excerpt of a log, and plays its messages on time, controlled by keys."""

import itertools
import math
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from typing import NamedTuple, TypeAlias

from linkage_ros.cli import Stop
from linkage_ros.log.reader import LoggedMessage, LogReader
from linkage_ros.programs.keyboard import DOWN, RIGHT, SPACE, UP, Keyboard
from linkage_ros.units import NS_PER_S

KEYS = (
    'keys, in a terminal:\n'
    '  space        pause or resume\n'
    '  right arrow  while paused: play the next message, and all others with its log time\n'
    '  up, down     increase or decrease the rate by 0.1'
)

_CHECK_SECONDS = 0.1  # between two checks for keys and for a request to stop
_RATE_STEP = 0.1

MIN_RATE, MAX_RATE = 1e-3, 1e6

# A replay that is late by more than this, ns of real time, does not catch up, because its process
# was suspended, or its rate is too high for the machine.
_LARGEST_LAG = NS_PER_S // 10

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


Sink: TypeAlias = Callable[[Item], None]
# Shows a log time, ns, to the user.
Show: TypeAlias = Callable[[int], None]


def excerpt_of(
    log: LogReader, offset: float, duration: float | None, topics: list[str] | None
) -> Excerpt:
    """Selects an excerpt of a log.

    Args:
        log: The log to read.
        offset: Time to skip at the beginning, s.
        duration: Length of the excerpt, s; None to continue to the end of the log.
        topics: Fully qualified names of the topics; None for all topics.
    """
    start = log.start + round(offset * NS_PER_S)
    end = log.end + round(NS_PER_S / log.configuration.session.rate_hz)
    if duration is not None:
        end = min(end, start + max(1, round(duration * NS_PER_S)))
    return Excerpt(start, end, topics or [topic.name for topic in log.topics])


@contextmanager
def feed(log: LogReader, excerpt: Excerpt, *, loop: bool) -> Iterator[Iterator[Item]]:
    """Reads an excerpt of a log, which is not used elsewhere meanwhile, in a separate thread.

    Earlier latched messages come first.

    Yields:
        An iterator over the items; it raises a LogError where the file is damaged.
    """
    stored = _stored(log, excerpt, loop=loop)
    with ThreadPoolExecutor(1, 'reader') as reader:

        def read() -> Future[list[Item]]:
            return reader.submit(lambda: [*itertools.islice(stored, _BATCH)])

        batches = deque(read() for _ in range(_BATCHES))
        try:
            yield _items(batches, read)
        finally:
            reader.shutdown(cancel_futures=True)


def _items(
    batches: 'deque[Future[list[Item]]]', read: Callable[[], 'Future[list[Item]]']
) -> Iterator[Item]:
    """Yields the items of batches, and reads a new batch for each one that is taken."""
    while batch := batches.popleft().result():
        batches.append(read())
        yield from batch


def _stored(log: LogReader, excerpt: Excerpt, *, loop: bool) -> Iterator[Item]:
    """Yields the messages of an excerpt, and of its repetitions."""
    # Latched messages that a subscriber would have received before the excerpt begins.
    latched = [x.name for x in log.topics if x.latched and x.name in excerpt.topics]
    before = log.messages(latched, end=excerpt.start) if excerpt.start > log.start else ()
    last = {message.topic: message for message in before}
    yield from (Item(excerpt.start, message) for message in last.values())
    length = excerpt.end - excerpt.start
    for shift in itertools.count(0, length) if loop else [0]:
        message = None
        for message in log.messages(excerpt.topics, excerpt.start, excerpt.end):
            yield Item(message.time + shift, message)
        if message is None:  # other rounds would be empty as well
            return


class Pace:
    """The position of a replay in log time, ns; it never decreases.

    Deadlines are absolute, so delays of single waits do not accumulate. The position does not pass
    the next message until that message is published, so that a published clock is never ahead of
    the messages. One thread may control the pace while others read it.

    Attributes:
        rate: Ratio of log time to real time while the replay is not paused.
        paused: Whether the replay is paused.
    """

    def __init__(
        self, start: int, rate: float, now: Callable[[], int] = time.monotonic_ns
    ) -> None:
        """Creates a paused replay at a position, ns of log time; `now` returns real time, ns."""
        self.rate, self.paused, self._now = rate, True, now
        # Log time at a real time, and the rate since then; replaced as a whole, so that another
        # thread never sees half a change.
        self._timing = start, now(), 0.0
        self._next, self._played_until = start, start - 1

    def position(self) -> int:
        """Returns the log time that the replay has reached, ns."""
        log, real, rate = self._timing
        return min(log + round((self._now() - real) * rate), self._next)

    def seconds_until(self, time: int) -> float:
        """Lets the position advance up to the log time of the next message, ns.

        Returns:
            Real time until the message is due, s; at most 0 if it is due, infinite while paused.
        """
        self._next = time
        if time <= self._played_until:  # messages of one log time are played together
            return 0.0
        if self.paused:
            return math.inf
        log_time, real_time, rate = self._timing
        now = self._now()
        remaining = real_time + (time - log_time) / rate - now
        if remaining < -_LARGEST_LAG:  # do not catch up
            self._timing = time, now, rate
        if remaining <= 0:
            self._played_until = time
        return remaining / NS_PER_S

    def toggle(self) -> None:
        """Pauses or resumes the replay."""
        self.paused = not self.paused
        self.change_rate(0.0)

    def change_rate(self, difference: float) -> None:
        """Changes the rate by a difference, unless it would be out of bounds."""
        rate = round(self.rate + difference, 6)  # 1.1 - 0.1 is 1
        if MIN_RATE <= rate <= MAX_RATE:
            self.rate = rate
        self._timing = self.position(), self._now(), 0.0 if self.paused else self.rate

    def step(self) -> None:
        """While paused, jumps to the next message."""
        if self.paused:
            self._timing = self._next, self._now(), 0.0
            self._played_until = self._next


def play(
    items: Iterable[Item], sinks: Iterable[Sink], pace: Pace, keyboard: Keyboard, stop: Stop,
    show: Show, *, paused: bool,
) -> int:  # fmt: skip
    """Passes each item to all sinks when it is due; returns how many were played.

    It must run in the main thread. The keyboard controls the pace; if `paused`, it waits for a key
    before the first item. `show` is called at least a few times a second.
    """
    actions: dict[bytes, Callable[[], None]] = {
        SPACE: pace.toggle,
        RIGHT: pace.step,
        UP: lambda: pace.change_rate(_RATE_STEP),
        DOWN: lambda: pace.change_rate(-_RATE_STEP),
    }
    count, check_at = 0, 0.0
    for item in items:
        if count == 0 and not paused:
            pace.toggle()  # not before: reading the first message takes a while
        # Keys must be read even if every message is late and the loop never waits.
        while (left := pace.seconds_until(item.time)) > 0 or time.monotonic() >= check_at:
            if stop.is_set():
                return count
            check_at = time.monotonic() + _CHECK_SECONDS
            if key := keyboard.read(min(max(left, 0.0), _CHECK_SECONDS)):
                actions[key]()
            show(pace.position() + item.message.time - item.time)
        for sink in sinks:
            sink(item)
        count += 1
    return count
