# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Hands out the messages of a log when they are due, and does what keys ask for meanwhile."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from typing import TypeAlias

from linkage_ros.cli import Stop
from linkage_ros.playback.feed import Item
from linkage_ros.playback.keyboard import DOWN, RIGHT, SPACE, UP, Keyboard
from linkage_ros.playback.pace import Pace

KEYS = (
    'keys, in a terminal:\n'
    '  space        pause or go on\n'
    '  right arrow  while paused: play the next message, with all others of its log time\n'
    '  up, down     rate 0.1 higher or lower'
)

Sink: TypeAlias = Callable[[Item], None]
# Gets the log time of a moment, ns, for people.
Show: TypeAlias = Callable[[int], None]

# s. A request to stop, which may not end a wait, and keys at high rates are seen within this.
_LOOK = 0.1
_RATE_STEP = 0.1


class Player:
    """Plays items into sinks; in the main thread."""

    def __init__(self, pace: Pace, keyboard: Keyboard, stop: Stop, show: Show) -> None:
        """Sets it up.

        Args:
            pace: Says what is due.
            keyboard: Steers the pace.
            stop: Ends it early.
            show: Is called a few times a second at least.
        """
        self._pace, self._keyboard, self._stop, self._show = pace, keyboard, stop, show
        self._look_at = 0.0

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
            if not self._await(item):
                break
            for sink in sinks:
                sink(item)
            count += 1
        return count

    def _await(self, item: Item) -> bool:
        """Whether an item is due, and not the end."""
        self._pace.expect(item.time)
        # Where every message is late, nothing waits; keys are looked at all the same.
        while (left := self._pace.left(item.time)) > 0 or time.monotonic() >= self._look_at:
            if self._stop.is_set():
                return False
            self._look_at = time.monotonic() + _LOOK
            self._obey(self._keyboard.read(min(max(left, 0.0), _LOOK)), item.time)
            self._show(self._pace.position() + item.message.time - item.time)
        return True

    def _obey(self, key: bytes | None, next_time: int) -> None:
        if key == SPACE:
            self._pace.toggle()
        elif key == RIGHT and self._pace.paused:
            self._pace.go_to(next_time)
        elif key in (UP, DOWN):
            self._pace.change_rate(_RATE_STEP if key == UP else -_RATE_STEP)
