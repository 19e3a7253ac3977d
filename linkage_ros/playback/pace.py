# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where a replay is in its log: it runs at a rate, stands while paused, waits for what lags."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import NamedTuple

from linkage_ros.units import NS_PER_S

SLOWEST, FASTEST = 1e-3, 1e6

# Real time, ns, up to which a message that comes late is caught up with. A process that was
# suspended, or told a rate that no machine keeps, goes on from where it is instead.
_LAG = NS_PER_S // 10


class _Line(NamedTuple):
    """Position over real time: at `log` when it was `real`, `rate` from there, up to `limit`."""

    log: int
    real: int
    rate: float
    limit: int


class Pace:
    """The position of a replay, ns of log time; it never goes back.

    Deadlines are absolute: what one wait wakes late does not add up. The position does not pass
    the next message before that is out, so that a clock made of it never leads the messages.
    One thread may steer it while others read it.
    """

    def __init__(
        self, start: int, rate: float, now: Callable[[], int] = time.monotonic_ns
    ) -> None:
        """Stands at the start, paused.

        Args:
            start: Log time, ns.
            rate: Log time over real time.
            now: Real time, ns.
        """
        self._now = now
        self._rate = rate
        # Replaced as a whole, so that a reader in another thread never sees half a change.
        self._line = _Line(start, now(), 0.0, start)
        self._passed = start - 1

    @property
    def rate(self) -> float:
        """Log time over real time, while it is not paused."""
        return self._rate

    @property
    def paused(self) -> bool:
        """Whether it stands."""
        return self._line.rate == 0

    def position(self) -> int:
        """The log time that has come, ns."""
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
            s; not above 0: now; infinite while paused.
        """
        line = self._line
        if time <= self._passed:  # of one log time all come or none
            return 0.0
        if line.rate == 0:
            return math.inf
        now = self._now()
        left = line.real + (time - line.log) / line.rate - now
        if left < -_LAG:
            self._line = line._replace(log=time, real=now)
        if left <= 0:
            self._passed = time
        return left / NS_PER_S

    def toggle(self) -> None:
        """Pauses, or goes on."""
        self._turn(self._rate if self.paused else 0.0)

    def change_rate(self, difference: float) -> None:
        """Changes the rate; one out of bounds is left alone.

        Args:
            difference: To add.
        """
        rate = round(self._rate + difference, 6)  # 1.1 - 0.1 is 1
        if SLOWEST <= rate <= FASTEST:
            self._rate = rate
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
