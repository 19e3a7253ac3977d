# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Plays the messages of a log when they are due, steered by keys."""

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
# Shows a log time, ns, to the user.
Show: TypeAlias = Callable[[int], None]

_CHECK_SECONDS = 0.1  # between two checks for keys and for a request to stop
_RATE_STEP = 0.1


class Player:
    """Plays items into sinks; in the main thread."""

    def __init__(self, pace: Pace, keyboard: Keyboard, stop: Stop, show: Show) -> None:
        """Sets it up.

        Args:
            pace: Determines when a message is due.
            keyboard: Steers the pace.
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
        self._pace.expect(item.time)
        # If every message is late, nothing waits, but keys must be read all the same.
        while (left := self._pace.left(item.time)) > 0 or time.monotonic() >= self._check_at:
            if self._stop.is_set():
                return False
            self._check_at = time.monotonic() + _CHECK_SECONDS
            key = self._keyboard.read(min(max(left, 0.0), _CHECK_SECONDS))
            if key == SPACE:
                self._pace.toggle()
            elif key == RIGHT and self._pace.paused:
                self._pace.go_to(item.time)
            elif key in (UP, DOWN):
                self._pace.change_rate(_RATE_STEP if key == UP else -_RATE_STEP)
            self._show(self._pace.position() + item.message.time - item.time)
        return True
