# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The position of a replay in its log: it runs at a rate, and stands while paused."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import NamedTuple

from linkage_ros.units import NS_PER_S

SLOWEST, FASTEST = 1e-3, 1e6

# A replay that is late by more real time than this, ns, does not catch up: its process was
# suspended, or its rate is too high for the machine.
_LARGEST_LAG = NS_PER_S // 10


class _Line(NamedTuple):
    """Position over real time: at `log` when it was `real`, `rate` from there, up to `limit`."""

    log: int
    real: int
    rate: float
    limit: int


class Pace:
    """The position of a replay, ns of log time; it never goes back.

    Deadlines are absolute: delays of single waits do not add up. The position does not pass the
    next message before that is published, so that a clock made of it never leads the messages.
    One thread may steer it while others read it.
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
        self._line = _Line(start, now(), 0.0, start)
        self._passed = start - 1

    @property
    def paused(self) -> bool:
        """Whether it is paused."""
        return self._line.rate == 0

    def position(self) -> int:
        """Log time reached, ns."""
        line = self._line
        return min(line.log + round((self._now() - line.real) * line.rate), line.limit)

    def expect(self, time: int) -> None:
        """Lets the position run up to the next message.

        Args:
            time: Its log time, ns.
        """
        self._line = self._line._replace(limit=time)

    def left(self, time: int) -> float:
        """Real time until the expected message is due.

        Args:
            time: Its log time, ns.

        Returns:
            s; 0 or less: now; infinite while paused.
        """
        line = self._line
        if time <= self._passed:  # messages of one log time come together
            return 0.0
        if self.paused:
            return math.inf
        now = self._now()
        left = line.real + (time - line.log) / line.rate - now
        if left < -_LARGEST_LAG:
            self._line = line._replace(log=time, real=now)
        if left <= 0:
            self._passed = time
        return left / NS_PER_S

    def toggle(self) -> None:
        """Pauses, or goes on."""
        self._turn(self.rate if self.paused else 0.0)

    def change_rate(self, difference: float) -> None:
        """Changes the rate, unless it would be out of bounds.

        Args:
            difference: Difference to add.
        """
        rate = round(self.rate + difference, 6)  # 1.1 - 0.1 is 1
        if SLOWEST <= rate <= FASTEST:
            self.rate = rate
            self._turn(0.0 if self.paused else rate)

    def go_to(self, time: int) -> None:
        """Goes to the expected message at once.

        Args:
            time: Its log time, ns.
        """
        self._line = self._line._replace(log=time, real=self._now())
        self._passed = time

    def _turn(self, rate: float) -> None:
        self._line = _Line(self.position(), self._now(), rate, self._line.limit)
