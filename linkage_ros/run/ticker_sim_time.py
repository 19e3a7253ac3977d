# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Keeps simulated time: the ticks that /clock has passed, however it runs, stands or jumps."""

from __future__ import annotations

from linkage_ros.run.machine import Machine
from linkage_ros.run.ticker import Callbacks, Ticker

# Ticks that one message of the clock may make due; those that a longer jump skips are missed.
_AT_ONCE = 1000


class SimTimeTicker(Ticker):
    """Makes every tick up to the time of a clock that is heard.

    Tick 0 is the first time heard; no tick is invented while the clock stands. If the clock goes
    back, t0 moves with it and the motion continues from there: the step is counted, as one of the
    wall clock is.
    """

    def __init__(self, machine: Machine, callbacks: Callbacks) -> None:
        super().__init__(machine, callbacks)
        self._is_running = False
        self._now: int | None = None
        self._tick = 0

    def start(self) -> None:
        """Lets the motion begin once the clock is heard."""
        self._is_running = True

    def stop(self) -> None:
        """Ends the motion: the clock makes no tick from now on."""
        self._is_running = False

    def hear(self, now: int) -> None:
        """Makes the ticks that are due; only one thread may do so.

        Args:
            now: The time of the clock, ns.
        """
        if self._is_running and self.error is None:
            self._guard(self._advance, now)

    def _advance(self, now: int) -> None:
        last, self._now = self._now, now
        if last is None:
            self.t0 = now
        elif now < last:
            # The next state gets the new time, and the crank continues from where it is.
            self._step(self._tick, now - self._stamp(self._tick))
        due = self._machine.tick_at(now - self.t0) if now >= self.t0 else -1
        if due - self._tick >= _AT_ONCE:
            self.counts.missed += due - self._tick
            self.counts.clock_steps += 1
            self._tick = due
        while self._tick <= due and self._is_running:
            self._make(self._tick)
            self._tick += 1
