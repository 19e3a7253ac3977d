# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Keeps time: calls for a step at each tick of a rate, at absolute deadlines, in its own thread.

The tick number comes from the monotonic clock, never from counting calls: a late thread skips
ticks, and says so, and the next state is right again. The stamp of tick n is t0 + n / rate on
the wall clock; where somebody steps that clock, t0 moves with it.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

from linkage_ros.run.lateness import Lateness
from linkage_ros.run.punctual import Insistence, go_first, wake_on_time
from linkage_ros.units import NS_PER_S

# A step of the wall clock above this moves t0 (ns). Below it, stamps keep the old count, so that
# the jitter of two clock readings never shows in them.
CLOCK_STEP = 50_000_000
# Readings of two clocks belong together if no more ns than these are between them.
_TOGETHER = 1_000_000
# Longest uninterrupted sleep, s: how long a slow node may take to notice that it should stop.
_NAP = 0.1


class Ticks(Protocol):
    """Which tick falls when, in whole ns (see `machine.Machine`)."""

    def elapsed(self, tick: int) -> int:
        """Time from tick 0 to a tick, ns."""

    def tick_at(self, elapsed: int) -> int:
        """The last tick at or before an elapsed time, ns."""


@dataclass
class Timekeeping:
    """What became of the ticks so far.

    Attributes:
        kept: Ticks that were carried out.
        missed: Ticks that were skipped because the thread was late by a period or more.
        clock_steps: How often the wall clock was stepped.
        late: How late the ticks began.
        favoured: Whether the thread goes before others.
    """

    kept: int = 0
    missed: int = 0
    clock_steps: int = 0
    late: Lateness = field(default_factory=Lateness)
    favoured: bool = False


class Stepping:
    """What every stepper calls: `step(stamp)` at a tick, `restamp(old, new)` at a clock's step.

    Attributes:
        counts: What became of the ticks.
        error: What a call failed with, which ended the motion; None while all is well.
    """

    def __init__(
        self,
        ticks: Ticks,
        step: Callable[[int], None],
        restamp: Callable[[int, int], None],
        on_error: Callable[[BaseException], None],
    ) -> None:
        """Prepares the motion; `start` starts it.

        Args:
            ticks: The rate.
            step: Called at each tick with its stamp, ns.
            restamp: Called before a step whose stamp was to be `old`, ns, and will be `new`.
            on_error: Called with what a call failed with, from where the steps are made.
        """
        self.counts = Timekeeping()
        self.error: BaseException | None = None
        self._ticks, self._step, self._restamp = ticks, step, restamp
        self._on_error = on_error

    def _fail(self, error: BaseException) -> None:
        self.error = error
        self._on_error(error)


class Stepper(Stepping):
    """Steps in real time, in its own thread."""

    def __init__(self, *calls: Any) -> None:
        super().__init__(*calls)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name='stepper', daemon=True)

    def now(self) -> int:
        """The time of day, ns."""
        return time.time_ns()

    def start(self, begin: Callable[[int], None]) -> None:
        """Starts ticking at once.

        Args:
            begin: Called, in the caller's thread, with the stamp of tick 0, ns.
        """
        self._offset = _clock_offset()
        self._origin = time.monotonic_ns()
        self._t0 = self._origin + self._offset
        begin(self._t0)
        self._thread.start()

    def stop(self) -> None:
        """Ends the thread after the step it is in."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()

    def _run(self) -> None:
        wake_on_time()
        self.counts.favoured = go_first()
        insistence = Insistence()
        try:
            tick = 0
            while not self._stop.is_set():
                due = self._await(tick, insistence)
                if self._stop.is_set():
                    return
                self.counts.missed += due - tick
                self._step(self._stamp(due))
                self.counts.kept += 1
                tick = due + 1
        except BaseException as error:  # noqa: BLE001, the node must learn of it, whatever it is
            self._fail(error)

    def _await(self, tick: int, insistence: Insistence) -> int:
        """Sleeps until a tick is due; returns it, or a later one where it is too late for it."""
        deadline = self._origin + self._ticks.elapsed(tick)
        while (left := deadline - time.monotonic_ns()) > 0:
            if left > NS_PER_S * _NAP:
                if self._stop.wait(_NAP):
                    return tick
            else:
                time.sleep(left * 1e-9)
        self.counts.late.add(-left)
        insistence.follow(-left)
        return self._ticks.tick_at(time.monotonic_ns() - self._origin)

    def _stamp(self, tick: int) -> int:
        """The stamp of a tick on the wall clock as it stands."""
        stamp = self._t0 + self._ticks.elapsed(tick)
        stepped = _clock_offset() - self._offset
        if abs(stepped) > CLOCK_STEP:
            self._offset += stepped
            self._t0 += stepped
            self.counts.clock_steps += 1
            self._restamp(stamp, stamp + stepped)
            stamp += stepped
        return stamp


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
