# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Keeps simulated time: the ticks that /clock has passed, however it runs, stands or jumps."""

from __future__ import annotations

from collections.abc import Callable

from linkage_ros.run.ticker import Calls, Ticker, Ticks

# Ticks that one message of the clock may make due; what a jump forward skips is missed.
_AT_ONCE = 1000


class SimTimeTicker(Ticker):
    """Makes every tick up to the time of a clock that is heard.

    Tick 0 is the first time heard; no tick is invented while the clock stands. Where the clock
    goes back, t0 moves with it and the motion goes on from there: the step is counted, as one of
    the wall clock is.
    """

    def __init__(self, ticks: Ticks, calls: Calls) -> None:
        super().__init__(ticks, calls)
        self._heard = False
        self._begin: Callable[[int], None] | None = None
        self._t0 = self._tick = self._now = 0

    def start(self, begin: Callable[[int], None]) -> None:
        """Lets the motion begin.

        Args:
            begin: Called with the stamp of tick 0, ns, once the clock is heard.
        """
        self._begin = begin

    def now(self) -> int:
        """What the clock said last, ns; 0: nothing yet."""
        return self._now

    def stop(self) -> None:
        """Ends the motion: what is heard from now on makes no tick."""
        self._begin = None

    def hear(self, now: int) -> None:
        """Makes the ticks that are due; only one thread may do so.

        Args:
            now: What the clock says, ns.
        """
        if self._begin is None or self.error is not None:
            return
        try:
            self._advance(self._begin, now)
        except BaseException as error:  # noqa: BLE001, the node must learn of it, whatever it is
            self._fail(error)

    def _advance(self, begin: Callable[[int], None], now: int) -> None:
        before, self._now = self._now, now
        if not self._heard:
            self._heard = True
            self._t0 = now
            begin(now)
        elif now < before:
            # The next state gets the new time, and the crank goes on from where it is.
            owed = self._t0 + self._ticks.elapsed(self._tick)
            self._t0 += now - owed
            self.counts.clock_steps += 1
            self._calls.restamp(owed, now)
        due = self._ticks.tick_at(now - self._t0) if now >= self._t0 else -1
        if due - self._tick >= _AT_ONCE:
            self.counts.missed += due - self._tick
            self.counts.clock_steps += 1
            self._tick = due
        while self._tick <= due and self._begin is not None:
            self._calls.tick(self._t0 + self._ticks.elapsed(self._tick))
            self.counts.kept += 1
            self._tick += 1
