# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Generates ticks: in real time, in the simulated time of /clock, or one per measurement.

In real time, the tick number is computed from the monotonic clock. If the thread is late, it skips
and counts ticks, so the next state is on time again. The stamp of tick n is t0 + n / rate on the
wall clock; if the wall clock is stepped, t0 is shifted by the same amount.
"""

import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

from linkage_ros.node.workers import show_name, take_real_time_priority, wake_on_time
from linkage_ros.run.ticks import TickRate
from linkage_ros.units import NS_PER_MS, NS_PER_S

_LATENESS_SAMPLES = 10_000  # number of ticks whose lateness is stored
# Smallest step of the wall clock that shifts t0, ns. Smaller differences are jitter between the
# readings of the two clocks, which must not affect the stamps.
CLOCK_STEP = 50 * NS_PER_MS
# Longest uninterrupted sleep, s, which limits the time that a stop takes.
_MAX_SLEEP = 0.05
# Largest number of ticks per clock message. A longer jump skips ticks and counts as a clock step.
_MAX_TICKS_PER_MESSAGE = 1000


@dataclass
class TickCounts:
    """Counts of ticks so far.

    Attributes:
        kept: Number of executed ticks.
        start: Time after the first tick on the monotonic clock, s.
        missed: Number of ticks skipped because the thread was late by a period or more.
        clock_steps: Number of steps of the clock.
        last_step: Size of the last of them, ns.
        lateness: Lateness of the most recent ticks, ns.
        max_lateness: Largest lateness of all ticks, ns.
        real_time_priority: Whether the thread has real-time priority.
    """

    kept: int = 0
    start: float = 0.0
    missed: int = 0
    clock_steps: int = 0
    last_step: int = 0
    lateness: deque[int] = field(default_factory=lambda: deque(maxlen=_LATENESS_SAMPLES))
    max_lateness: int = 0
    real_time_priority: bool = False


class Ticker:
    """Generates a tick for each received message, such as a measurement, in a separate thread.

    Attributes:
        counts: Counts of the ticks.
        t0: Stamp of tick 0 on the current clock, ns; set at the first tick.
    """

    def __init__(
        self,
        ticks: TickRate,
        tick: Callable[..., None],
        restamp: Callable[[int, int], None],
        fail: Callable[[BaseException], None],
        receive: Callable[[], Iterable[Any]] = tuple,
    ) -> None:
        """Prepares the thread.

        Args:
            ticks: Times of the ticks.
            tick: Called at each tick, with its stamp, ns, or the fields of a measurement.
            restamp: Called before the first tick after a step of the clock, with the stamps of
                this tick on the old and the new clock, ns.
            fail: Called with the error raised by a callback, which ends the motion.
            receive: Waits briefly and returns the messages since the last call; used by tickers
                driven by messages.
        """
        self.counts = TickCounts()
        self.t0 = self._next = 0
        self._ticks, self._tick, self._restamp, self._fail = ticks, tick, restamp, fail
        self._receive = receive
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None

    @property
    def is_stopped(self) -> bool:
        """Whether the thread has ended or is to end."""
        return self._stop.is_set()

    def start(self) -> None:
        """Starts the thread, if none runs; after a stop, the ticks continue with the next one."""
        if self._thread and self._thread.is_alive():
            return
        self._stop.clear()
        self._thread = threading.Thread(target=self._run, name='ticker', daemon=True)
        self._thread.start()

    def stop(self, join: Callable[[threading.Thread], object] = threading.Thread.join) -> bool:
        """Ends the thread, if it runs, after the current tick; returns whether it has ended."""
        self._stop.set()
        thread = self._thread
        if thread and thread.is_alive():
            join(thread)
        return not (thread and thread.is_alive())

    def _run(self) -> None:
        """Runs the ticks; the ticker's thread."""
        show_name()
        wake_on_time()
        self.counts.real_time_priority = take_real_time_priority()
        try:
            for due in self._due():
                self._tick(*due)
                self.counts.kept += 1
                if self.counts.kept == 1:
                    self.counts.start = time.monotonic_ns() / NS_PER_S
        except BaseException as error:  # noqa: BLE001, the node must learn of every error
            self._fail(error)

    def _due(self) -> Iterator[tuple[Any, ...]]:
        """Waits for ticks, and yields the arguments of each tick until the ticker is stopped."""
        while not self._stop.is_set():
            yield from self._receive()

    def _stamp(self, tick: int) -> int:
        return self.t0 + self._ticks.elapsed(tick)

    def _begin(self, now: int) -> None:
        """Stamps the next tick with the current time, ns; after a stop, the motion continues."""
        old = self._stamp(self._next)
        self.t0 = now - self._ticks.elapsed(self._next)
        if self._next:
            self._restamp(old, now)

    def _step_clock(self, tick: int, shift: int) -> None:
        """Shifts the stamps of a tick and all later ticks by a step of the clock, ns."""
        old = self._stamp(tick)
        self.t0 += shift
        self.counts.clock_steps += 1
        self.counts.last_step = shift
        self._restamp(old, old + shift)


class RealTimeTicker(Ticker):
    """Generates ticks in real time."""

    def _due(self) -> Iterator[tuple[int]]:
        """Sleeps until each tick is due, and yields its stamp; late ticks are skipped."""
        now = time.monotonic_ns()
        origin = now - self._ticks.elapsed(self._next)
        self._begin(now + _clock_offset())
        while True:
            late = self._sleep_until(origin + self._ticks.elapsed(self._next))
            if self._stop.is_set():
                return
            self.counts.lateness.append(late)
            self.counts.max_lateness = max(self.counts.max_lateness, late)
            newest = self._ticks.tick_at(time.monotonic_ns() - origin)
            self.counts.missed += newest - self._next
            step = origin + _clock_offset() - self.t0
            if abs(step) > CLOCK_STEP:
                self._step_clock(newest, step)
            yield (self._stamp(newest),)
            self._next = newest + 1

    def _sleep_until(self, deadline: int) -> int:
        """Sleeps until a time of the monotonic clock or a stop; returns the lateness, ns."""
        while (left := deadline - time.monotonic_ns()) > 0 and not self._stop.is_set():
            time.sleep(min(left / NS_PER_S, _MAX_SLEEP))
        return -left


def _clock_offset() -> int:
    """Returns the offset of the wall clock from the monotonic clock, ns.

    The wall clock is read between two readings of the monotonic clock. If these are 1 ms or more
    apart, the thread was delayed, and all readings are repeated.
    """
    while True:
        before = time.monotonic_ns()
        wall = time.time_ns()
        after = time.monotonic_ns()
        if after - before < NS_PER_MS:
            return wall - after


class SimTimeTicker(Ticker):
    """Generates ticks in the simulated time of received clock messages.

    Tick 0 is at the first received time, and there are no ticks while the clock is paused. If the
    clock is set back, t0 is shifted by the same amount, so that the motion continues without a
    jump. The step is counted, like a step of the wall clock.
    """

    def _due(self) -> Iterator[tuple[int]]:
        """Waits for messages of the clock, and yields the stamp of each tick up to them."""
        last = None
        while not self._stop.is_set():
            for now in self._receive():
                if last is None:
                    self._begin(now)
                    last = now
                if now < last:
                    # Stamp the next state with the new time, without a jump of the motion.
                    self._step_clock(self._next, now - self._stamp(self._next))
                newest = self._ticks.tick_at(now - self.t0) if now >= self.t0 else -1
                if newest - self._next >= _MAX_TICKS_PER_MESSAGE:  # a jump forwards
                    self.counts.clock_steps += 1
                    self.counts.last_step = now - last
                    self._next = newest
                last = now
                while self._next <= newest and not self._stop.is_set():
                    yield (self._stamp(self._next),)
                    self._next += 1
