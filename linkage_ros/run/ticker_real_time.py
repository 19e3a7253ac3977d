# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Keeps real time: makes the ticks of a rate, at absolute deadlines, in its own thread.

The tick number comes from the monotonic clock, never from counting calls: a late thread skips
ticks, and says so, and the next state is right again. The stamp of tick n is t0 + n / rate on
the wall clock; where somebody steps that clock, t0 moves with it.
"""

from __future__ import annotations

import threading
import time

from linkage_ros.run.machine import Machine
from linkage_ros.run.scheduling import (
    SwitchInterval,
    minimize_timer_slack,
    take_real_time_priority,
)
from linkage_ros.run.ticker import Callbacks, Ticker
from linkage_ros.units import NS_PER_MS, NS_PER_S

# A step of the wall clock above this moves t0 (ns). Below it, stamps keep the old count, so that
# the jitter of two clock readings never shows in them.
CLOCK_STEP = 50 * NS_PER_MS
# Readings of two clocks belong together if no more ns than these are between them.
_TOGETHER = NS_PER_MS
# Longest uninterrupted sleep, s: how long a slow node may take to notice that it should stop.
_NAP = 0.1


class RealTimeTicker(Ticker):
    """Makes ticks when they are due, in its own thread."""

    def __init__(self, machine: Machine, callbacks: Callbacks) -> None:
        super().__init__(machine, callbacks)
        self._origin = self._offset = 0  # tick 0 on the monotonic clock, the wall clock ahead, ns
        self._stop = threading.Event()
        self._thread = threading.Thread(
            target=self._guard, args=(self._run,), name='ticker', daemon=True
        )

    def start(self) -> None:
        """Starts the ticks at once."""
        self._offset = _clock_offset()
        self._origin = time.monotonic_ns()
        self.t0 = self._origin + self._offset
        self._thread.start()

    def stop(self) -> None:
        """Ends the thread after the tick that it makes."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()

    def _run(self) -> None:
        minimize_timer_slack()
        self.counts.real_time_priority = take_real_time_priority()
        switch_interval = SwitchInterval()
        tick = 0
        while not self._stop.is_set():
            due = self._await(tick, switch_interval)
            if self._stop.is_set():
                return
            self.counts.missed += due - tick
            stepped = _clock_offset() - self._offset
            if abs(stepped) > CLOCK_STEP:
                self._offset += stepped
                self._step(due, stepped)
            self._make(due)
            tick = due + 1

    def _await(self, tick: int, switch_interval: SwitchInterval) -> int:
        """Sleeps until a tick is due; returns it, or a later one if it is too late for it."""
        deadline = self._origin + self._machine.elapsed(tick)
        while (left := deadline - time.monotonic_ns()) > 0:
            if left > NS_PER_S * _NAP:
                if self._stop.wait(_NAP):
                    return tick
            else:
                time.sleep(left / NS_PER_S)
        self.counts.late.append(-left)
        self.counts.latest = max(self.counts.latest, -left)
        switch_interval.follow(-left)
        return self._machine.tick_at(time.monotonic_ns() - self._origin)


def _clock_offset() -> int:
    """What the wall clock is ahead of the monotonic one, ns.

    A thread that is held up between two readings would see a step; three of them tell.
    """
    while True:
        before = time.monotonic_ns()
        wall = time.time_ns()
        after = time.monotonic_ns()
        if after - before < _TOGETHER:
            return wall - after
