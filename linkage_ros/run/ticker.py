# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Makes ticks at a rate, in real time or in the simulated time of /clock.

In real time the tick number comes from the monotonic clock, never from counting calls: a late
thread skips ticks, and counts them, and the next state is right again. The stamp of tick n is
t0 + n / rate on the wall clock; if that clock is stepped, t0 moves with it.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from linkage_ros.run.scheduling import (
    SwitchInterval,
    minimize_timer_slack,
    take_real_time_priority,
)
from linkage_ros.run.simulator import Simulator
from linkage_ros.units import NS_PER_MS, NS_PER_S

_LATENESS_SAMPLES = 10_000  # ticks whose lateness is kept
# A step of the wall clock above this moves t0 (ns). Below it, stamps keep the old count, so that
# the jitter of two clock readings never shows in them.
CLOCK_STEP = 50 * NS_PER_MS
# Readings of two clocks belong together if no more ns than these are between them.
_MAX_READING_GAP = NS_PER_MS
# Longest uninterrupted sleep, s: how long a slow node may take to notice that it should stop.
_MAX_SLEEP = 0.1
# Ticks that one message of the clock may make due; those that a longer jump skips are missed.
_MAX_TICKS_PER_MESSAGE = 1000


@dataclass
class TickCounts:
    """Counts of ticks so far.

    Attributes:
        kept: Ticks that were carried out.
        missed: Ticks that were skipped because the thread was late by a period or more.
        clock_steps: How often the clock was stepped.
        lateness: Lateness of the last ticks, ns.
        max_lateness: Largest lateness of all ticks, ns.
        real_time_priority: Whether the thread has real-time priority.
    """

    kept: int = 0
    missed: int = 0
    clock_steps: int = 0
    lateness: deque[int] = field(default_factory=lambda: deque(maxlen=_LATENESS_SAMPLES))
    max_lateness: int = 0
    real_time_priority: bool = False


class Callbacks(NamedTuple):
    """Callbacks of a ticker, in the thread of the ticks.

    Attributes:
        tick: Called at each tick, with its stamp, ns.
        restamp: Called before the tick after a step of the clock, with that tick's stamp before
            and after the step, ns.
        fail: Called with the error of another callback, which ends the motion.
    """

    tick: Callable[[int], None]
    restamp: Callable[[int, int], None]
    fail: Callable[[BaseException], None]


class Ticker:
    """Makes the ticks of a motion.

    Attributes:
        counts: Counts of the ticks.
        error: The error of a callback; None: no error.
        t0: Stamp of tick 0 on the present clock, ns; set at the first tick.
    """

    def __init__(self, simulator: Simulator, callbacks: Callbacks) -> None:
        """Prepares the ticks.

        Args:
            simulator: Knows when ticks are due.
            callbacks: What to call.
        """
        self.counts = TickCounts()
        self.error: BaseException | None = None
        self.t0 = 0
        self._simulator, self._callbacks = simulator, callbacks
        self._is_running = False

    def start(self) -> None:
        """Starts the ticks."""
        self._is_running = True

    def stop(self) -> None:
        """Ends the ticks, after the one that is being made."""
        self._is_running = False

    def _stamp(self, tick: int) -> int:
        return self.t0 + self._simulator.elapsed(tick)

    def _make_tick(self, tick: int) -> None:
        self._callbacks.tick(self._stamp(tick))
        self.counts.kept += 1

    def _step_clock(self, tick: int, shift: int) -> None:
        """Moves the next tick, and those after it, by a step of the clock, ns."""
        old = self._stamp(tick)
        self.t0 += shift
        self.counts.clock_steps += 1
        self._callbacks.restamp(old, old + shift)

    def _report_failure(self, act: Callable[..., None], *arguments: Any) -> None:
        try:
            act(*arguments)
        except BaseException as error:  # noqa: BLE001, the node must learn of every error
            self.error = error
            self._callbacks.fail(error)


class RealTimeTicker(Ticker):
    """Makes ticks in real time, in a separate thread."""

    def __init__(self, simulator: Simulator, callbacks: Callbacks) -> None:
        super().__init__(simulator, callbacks)
        self._origin = 0  # tick 0 on the monotonic clock, ns
        self._stop = threading.Event()
        self._thread = threading.Thread(
            target=self._report_failure, args=(self._run,), name='ticker', daemon=True
        )

    def start(self) -> None:
        """Starts the ticks at once."""
        self._origin = time.monotonic_ns()
        self.t0 = self._origin + _clock_offset()
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
            due = self._wait_for_tick(tick, switch_interval)
            if self._stop.is_set():
                return
            self.counts.missed += due - tick
            stepped = self._origin + _clock_offset() - self.t0
            if abs(stepped) > CLOCK_STEP:
                self._step_clock(due, stepped)
            self._make_tick(due)
            tick = due + 1

    def _wait_for_tick(self, tick: int, switch_interval: SwitchInterval) -> int:
        """Sleeps until a tick is due; returns its number, or a later one if ticks were missed."""
        deadline = self._origin + self._simulator.elapsed(tick)
        while (left := deadline - time.monotonic_ns()) > 0:
            if left > NS_PER_S * _MAX_SLEEP:
                if self._stop.wait(_MAX_SLEEP):
                    return tick
            else:
                time.sleep(left / NS_PER_S)
        self.counts.lateness.append(-left)
        self.counts.max_lateness = max(self.counts.max_lateness, -left)
        switch_interval.follow(-left)
        return self._simulator.tick_at(time.monotonic_ns() - self._origin)


def _clock_offset() -> int:
    """Offset of the wall clock from the monotonic clock, ns.

    Three readings tell a step of the clock from a delay of the thread between two readings.
    """
    while True:
        before = time.monotonic_ns()
        wall = time.time_ns()
        after = time.monotonic_ns()
        if after - before < _MAX_READING_GAP:
            return wall - after


class MeasurementTicker(RealTimeTicker):
    """Makes a tick for each measurement, in a separate thread."""

    def __init__(
        self,
        simulator: Simulator,
        callbacks: Callbacks,
        receive: Callable[[], Iterable[tuple[int, bytes]]],
        answer: Callable[[int, bytes], bool],
    ) -> None:
        """Prepares the ticks.

        Args:
            simulator: As for every ticker.
            callbacks: What to call; `answer` takes the place of `tick`.
            receive: Waits a little; returns the measurements: times of receipt, ns, and bytes.
            answer: Called with each measurement; returns whether it was accepted.
        """
        super().__init__(simulator, callbacks)
        self._receive, self._answer = receive, answer

    def _run(self) -> None:
        minimize_timer_slack()
        self.counts.real_time_priority = take_real_time_priority()
        while not self._stop.is_set():
            for received, data in self._receive():
                self.counts.kept += self._answer(received, data)


class SimTimeTicker(Ticker):
    """Makes every tick up to the received time of a clock.

    Tick 0 is the first received time; there are no ticks while the clock stops. If the clock goes
    back, t0 moves with it and the motion continues from there; the step is counted, as for the
    wall clock.
    """

    def __init__(self, simulator: Simulator, callbacks: Callbacks) -> None:
        super().__init__(simulator, callbacks)
        self._now: int | None = None
        self._tick = 0

    def advance_to(self, now: int) -> None:
        """Makes the ticks that are due; only one thread may do so.

        Args:
            now: The time of the clock, ns.
        """
        if self._is_running and self.error is None:
            self._report_failure(self._make_due_ticks, now)

    def _make_due_ticks(self, now: int) -> None:
        last, self._now = self._now, now
        if last is None:
            self.t0 = now
        elif now < last:
            # The next state gets the new time, and the crank continues from where it is.
            self._step_clock(self._tick, now - self._stamp(self._tick))
        due = self._simulator.tick_at(now - self.t0) if now >= self.t0 else -1
        if due - self._tick >= _MAX_TICKS_PER_MESSAGE:
            self.counts.missed += due - self._tick
            self.counts.clock_steps += 1
            self._tick = due
        while self._tick <= due and self._is_running:
            self._make_tick(self._tick)
            self._tick += 1
