# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Makes ticks at a rate: what the tickers of real and of simulated time have in common."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from linkage_ros.run.machine import Machine

_LATELY = 10_000  # ticks whose lateness is kept


@dataclass
class Timekeeping:
    """Counts of ticks so far.

    Attributes:
        kept: Ticks that were carried out.
        missed: Ticks that were skipped because the thread was late by a period or more.
        clock_steps: How often the clock was stepped.
        late: How late the last ticks began, ns.
        latest: How late the latest tick of all began, ns.
        real_time_priority: Whether the thread has real-time priority.
    """

    kept: int = 0
    missed: int = 0
    clock_steps: int = 0
    late: deque[int] = field(default_factory=lambda: deque(maxlen=_LATELY))
    latest: int = 0
    real_time_priority: bool = False


class Callbacks(NamedTuple):
    """What a ticker calls, in the thread that makes the ticks.

    Attributes:
        tick: At each tick, with its stamp, ns.
        restamp: Where the clock was stepped, before a tick: with the tick's stamp before and after
            the step, ns.
        fail: With the error of one of these, which ends the motion.
    """

    tick: Callable[[int], None]
    restamp: Callable[[int, int], None]
    fail: Callable[[BaseException], None]


class Ticker(ABC):
    """Makes the ticks of a motion.

    Attributes:
        counts: Counts of the ticks.
        error: The error of a callback; None: there was none.
        t0: Stamp of tick 0 on the clock as it stands, ns; known from the first tick on.
    """

    def __init__(self, machine: Machine, callbacks: Callbacks) -> None:
        """Prepares the ticks.

        Args:
            machine: Knows when ticks are due.
            callbacks: What to call.
        """
        self.counts = Timekeeping()
        self.error: BaseException | None = None
        self.t0 = 0
        self._machine, self._callbacks = machine, callbacks

    @abstractmethod
    def start(self) -> None:
        """Starts the ticks."""

    @abstractmethod
    def stop(self) -> None:
        """Ends the ticks, after the one that is being made."""

    def _stamp(self, tick: int) -> int:
        return self.t0 + self._machine.elapsed(tick)

    def _make(self, tick: int) -> None:
        self._callbacks.tick(self._stamp(tick))
        self.counts.kept += 1

    def _step(self, tick: int, shift: int) -> None:
        """Moves the next tick, and those after it, by a step of the clock, ns."""
        old = self._stamp(tick)
        self.t0 += shift
        self.counts.clock_steps += 1
        self._callbacks.restamp(old, old + shift)

    def _guard(self, act: Callable[..., None], *arguments: Any) -> None:
        try:
            act(*arguments)
        except BaseException as error:  # noqa: BLE001, the node must learn of every error
            self.error = error
            self._callbacks.fail(error)
