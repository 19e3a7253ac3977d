# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Makes ticks: in real time, in the simulated time of /clock, or one for each measurement.

In real time the tick number comes from the monotonic clock, never from counting calls: a late
thread skips and counts ticks, and the next state is right again. The stamp of tick n is
t0 + n / rate on the wall clock; if the wall clock is stepped, t0 is stepped by the same time.
"""

from __future__ import annotations

import threading
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

from linkage_ros.run.scheduling import (
    minimize_timer_slack,
    shorten_switch_interval,
    take_real_time_priority,
)
from linkage_ros.run.simulator import Simulator
from linkage_ros.units import NS_PER_MS, NS_PER_S

_LATENESS_SAMPLES = 10_000  # number of ticks whose lateness is kept
# Only a larger step of the wall clock, ns, moves t0, so that the jitter between the readings of
# the two clocks does not appear in the stamps.
CLOCK_STEP = 50 * NS_PER_MS
# Longest uninterrupted sleep, s: how long a slow node may take to notice that it should stop.
_MAX_SLEEP = 0.1
# Largest number of ticks for one clock message; a longer jump skips ticks, which count as missed.
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


class Ticker(ABC):
    """Makes the ticks of a motion, in a thread.

    Attributes:
        counts: Counts of the ticks.
        error: The error of a callback; None: no error.
        t0: Stamp of tick 0 on the current clock, ns; set at the first tick.
    """

    def __init__(
        self,
        simulator: Simulator,
        tick: Callable[..., None],
        restamp: Callable[[int, int], None],
        fail: Callable[[BaseException], None],
        receive: Callable[[], Iterable[Any]] = tuple,
    ) -> None:
        """Prepares the ticks.

        Args:
            simulator: Determines when ticks are due.
            tick: Called at each tick, with its stamp, ns, or the fields of a measurement.
            restamp: Called before the first tick after a step of the clock, with the stamps of
                this tick before and after the step, ns.
            fail: Called with the error of a failed callback, which ends the motion.
            receive: Waits briefly and returns the messages since the last call; for tickers driven
                by messages.
        """
        self.counts = TickCounts()
        self.error: BaseException | None = None
        self.t0 = 0
        self._simulator, self._tick, self._restamp, self._fail = simulator, tick, restamp, fail
        self._receive = receive
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name='ticker', daemon=True)

    def start(self) -> None:
        """Starts the ticks."""
        self._thread.start()

    def stop(self) -> None:
        """Ends the thread after the current tick."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()

    def _run(self) -> None:
        minimize_timer_slack()
        shorten_switch_interval()
        self.counts.real_time_priority = take_real_time_priority()
        try:
            for due in self._due():
                self._tick(*due)
                self.counts.kept += 1
        except BaseException as error:  # noqa: BLE001, the node must learn of every error
            self.error = error
            self._fail(error)

    @abstractmethod
    def _due(self) -> Iterator[tuple[Any, ...]]:
        """Waits for ticks; yields the arguments of each until the ticker is stopped."""

    def _stamp(self, tick: int) -> int:
        return self.t0 + self._simulator.elapsed(tick)

    def _step_clock(self, tick: int, shift: int) -> None:
        """Shifts the next tick, and all later ticks, by a step of the clock, ns."""
        old = self._stamp(tick)
        self.t0 += shift
        self.counts.clock_steps += 1
        self._restamp(old, old + shift)


class RealTimeTicker(Ticker):
    """Makes ticks in real time."""

    def _due(self) -> Iterator[tuple[int]]:
        tick, origin = 0, time.monotonic_ns()
        self.t0 = origin + _clock_offset()
        while True:
            late = self._sleep_until(origin + self._simulator.elapsed(tick))
            if self._stop.is_set():
                return
            self.counts.lateness.append(late)
            self.counts.max_lateness = max(self.counts.max_lateness, late)
            due = self._simulator.tick_at(time.monotonic_ns() - origin)
            self.counts.missed += due - tick
            stepped = origin + _clock_offset() - self.t0
            if abs(stepped) > CLOCK_STEP:
                self._step_clock(due, stepped)
            yield (self._stamp(due),)
            tick = due + 1

    def _sleep_until(self, deadline: int) -> int:
        """Sleeps until a time of the monotonic clock or the stop; returns the lateness, ns."""
        while (left := deadline - time.monotonic_ns()) > 0 and not self._stop.is_set():
            time.sleep(min(left / NS_PER_S, _MAX_SLEEP))
        return -left


def _clock_offset() -> int:
    """Offset of the wall clock from the monotonic clock, ns.

    The wall clock is read between two readings of the monotonic clock. If these are 1 ms or more
    apart, the thread was delayed, and all three readings are repeated.
    """
    while True:
        before = time.monotonic_ns()
        wall = time.time_ns()
        after = time.monotonic_ns()
        if after - before < NS_PER_MS:
            return wall - after


class SimTimeTicker(Ticker):
    """Makes every tick up to the times of a clock, ns, that it receives.

    Tick 0 is at the first received time; there are no ticks while the clock stops. If the clock is
    set back, t0 is shifted by the same time, and the motion continues without a jump. The step is
    counted, as for the wall clock.
    """

    def _due(self) -> Iterator[tuple[int]]:
        tick, last = 0, None
        while not self._stop.is_set():
            for now in self._receive():
                if last is None:
                    self.t0 = now
                elif now < last:
                    # The next state gets the new time, and the motion continues without a jump.
                    self._step_clock(tick, now - self._stamp(tick))
                last = now
                due = self._simulator.tick_at(now - self.t0) if now >= self.t0 else -1
                if due - tick >= _MAX_TICKS_PER_MESSAGE:
                    self.counts.missed += due - tick
                    self.counts.clock_steps += 1
                    tick = due
                while tick <= due and not self._stop.is_set():
                    yield (self._stamp(tick),)
                    tick += 1


class MeasurementTicker(Ticker):
    """Makes a tick for each measurement that it receives."""

    def _due(self) -> Iterator[tuple[Any, ...]]:
        while not self._stop.is_set():
            yield from self._receive()
