# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Makes ticks at a rate: what is common to tickers, whichever time they keep."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

from linkage_ros.run.lateness import Lateness


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
        real_time_priority: Whether the thread goes before others.
    """

    kept: int = 0
    missed: int = 0
    clock_steps: int = 0
    late: Lateness = field(default_factory=Lateness)
    real_time_priority: bool = False


class Calls(NamedTuple):
    """What a ticker calls, from where it makes the ticks.

    Attributes:
        tick: At each tick, with its stamp, ns.
        restamp: Where the clock was stepped, before a tick, with the stamp that it was to have
            and the one that it will have, ns.
        fail: With what one of these raised, which ends the motion.
    """

    tick: Callable[[int], None]
    restamp: Callable[[int, int], None]
    fail: Callable[[BaseException], None]


class Ticker(ABC):
    """Makes the ticks of a motion, whatever time it keeps.

    Attributes:
        counts: What became of the ticks.
        error: What a call raised; None while all is well.
    """

    def __init__(self, ticks: Ticks, calls: Calls) -> None:
        """Prepares the motion.

        Args:
            ticks: The rate.
            calls: What is to be called.
        """
        self.counts = Timekeeping()
        self.error: BaseException | None = None
        self._ticks, self._calls = ticks, calls

    @abstractmethod
    def start(self, begin: Callable[[int], None]) -> None:
        """Lets the ticks begin.

        Args:
            begin: Called once, with the stamp of tick 0, ns.
        """

    @abstractmethod
    def stop(self) -> None:
        """Ends the ticks, after the one that is being made."""

    @abstractmethod
    def now(self) -> int:
        """The time, ns; 0 where it is not known yet."""

    def _fail(self, error: BaseException) -> None:
        self.error = error
        self._calls.fail(error)
