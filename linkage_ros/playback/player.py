# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Plays the messages of a log when they are due; keys control rate and pause."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable
from typing import NamedTuple, TypeAlias

from linkage_ros.cli import Stop
from linkage_ros.playback.feed import Item
from linkage_ros.playback.keyboard import DOWN, RIGHT, SPACE, UP, Keyboard
from linkage_ros.units import NS_PER_S

KEYS = (
    'keys, in a terminal:\n'
    '  space        pause or go on\n'
    '  right arrow  while paused: play the next message, with all others of its log time\n'
    '  up, down     rate 0.1 higher or lower'
)

Sink: TypeAlias = Callable[[Item], None]
# Shows a log time, ns, to the user.
Show: TypeAlias = Callable[[int], None]

_CHECK_SECONDS = 0.1  # between two checks for keys and for a request to stop
_RATE_STEP = 0.1

MIN_RATE, MAX_RATE = 1e-3, 1e6

# A replay that is late by more real time than this, ns, does not catch up: its process was
# suspended, or its rate is too high for the machine.
_LARGEST_LAG = NS_PER_S // 10


class _Timing(NamedTuple):
    """Position over real time: `log` at the time `real`, then at `rate` up to `limit`."""

    log: int
    real: int
    rate: float
    limit: int


class Pace:
    """The position of a replay in log time, ns; it never decreases.

    Deadlines are absolute: delays of single waits do not add up. The position does not pass the
    next message before that is published, so that a clock made of it never leads the messages.
    One thread may control it while others read it.
    """

    def __init__(
        self, start: int, rate: float, now: Callable[[], int] = time.monotonic_ns
    ) -> None:
        """Starts paused.

        Args:
            start: Log time, ns.
            rate: Log time over real time.
            now: Real time, ns.
        """
        self._now = now
        self.rate = rate  # log time over real time, while it is not paused
        # Replaced as a whole, so that a reader in another thread never sees half a change.
        self._timing = _Timing(start, now(), 0.0, start)
        self._played_until = start - 1

    @property
    def paused(self) -> bool:
        """Whether the replay is paused."""
        return self._timing.rate == 0

    def position(self) -> int:
        """Log time reached, ns."""
        timing = self._timing
        return min(timing.log + round((self._now() - timing.real) * timing.rate), timing.limit)

    def set_next(self, time: int) -> None:
        """Lets the position advance up to the next message.

        Args:
            time: Its log time, ns.
        """
        self._timing = self._timing._replace(limit=time)

    def seconds_until(self, time: int) -> float:
        """Real time until the expected message is due.

        Args:
            time: Its log time, ns.

        Returns:
            Time, s; 0 or less: due now; infinite while paused.
        """
        timing = self._timing
        if time <= self._played_until:  # messages of one log time come together
            return 0.0
        if self.paused:
            return math.inf
        now = self._now()
        left = timing.real + (time - timing.log) / timing.rate - now
        if left < -_LARGEST_LAG:
            self._timing = timing._replace(log=time, real=now)
        if left <= 0:
            self._played_until = time
        return left / NS_PER_S

    def toggle(self) -> None:
        """Pauses or resumes."""
        self._set_rate(self.rate if self.paused else 0.0)

    def change_rate(self, difference: float) -> None:
        """Changes the rate, unless it would be out of bounds.

        Args:
            difference: Difference to add.
        """
        rate = round(self.rate + difference, 6)  # 1.1 - 0.1 is 1
        if MIN_RATE <= rate <= MAX_RATE:
            self.rate = rate
            self._set_rate(0.0 if self.paused else rate)

    def jump_to(self, time: int) -> None:
        """Jumps to the expected message.

        Args:
            time: Its log time, ns.
        """
        self._timing = self._timing._replace(log=time, real=self._now())
        self._played_until = time

    def _set_rate(self, rate: float) -> None:
        self._timing = _Timing(self.position(), self._now(), rate, self._timing.limit)


class Player:
    """Plays items into sinks; in the main thread."""

    def __init__(self, pace: Pace, keyboard: Keyboard, stop: Stop, show: Show) -> None:
        """Creates the player.

        Args:
            pace: Determines when a message is due.
            keyboard: Controls the pace.
            stop: Ends the replay early.
            show: Called at least a few times a second.
        """
        self._pace, self._keyboard, self._stop, self._show = pace, keyboard, stop, show
        self._check_at = 0.0

    def play(self, items: Iterable[Item], sinks: Iterable[Sink], *, paused: bool) -> int:
        """Hands items to sinks, each when it is due.

        Args:
            items: In the order of their times.
            sinks: Each gets every item.
            paused: Whether to wait for a key before the first.

        Returns:
            The number of items.
        """
        count = 0
        for item in items:
            if count == 0 and not paused:
                self._pace.toggle()  # not before: reading the first message takes a while
            if not self._wait_for(item):
                break
            for sink in sinks:
                sink(item)
            count += 1
        return count

    def _wait_for(self, item: Item) -> bool:
        """Waits until an item is due; returns False if the replay is to stop."""
        self._pace.set_next(item.time)
        # If every message is late, nothing waits, but keys must be read all the same.
        while (
            left := self._pace.seconds_until(item.time)
        ) > 0 or time.monotonic() >= self._check_at:
            if self._stop.is_set():
                return False
            self._check_at = time.monotonic() + _CHECK_SECONDS
            key = self._keyboard.read(min(max(left, 0.0), _CHECK_SECONDS))
            if key == SPACE:
                self._pace.toggle()
            elif key == RIGHT and self._pace.paused:
                self._pace.jump_to(item.time)
            elif key in (UP, DOWN):
                self._pace.change_rate(_RATE_STEP if key == UP else -_RATE_STEP)
            self._show(self._pace.position() + item.message.time - item.time)
        return True
