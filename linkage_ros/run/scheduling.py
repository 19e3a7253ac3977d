# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Scheduling of a thread with deadlines, by Linux and by Python."""

from __future__ import annotations

import ctypes
import gc
import os
import sys
import time
from contextlib import suppress

from linkage_ros.units import NS_PER_MS

_PR_SET_TIMERSLACK = 29  # of prctl
# Priority of the ticker, as in ros2_control, and of other threads that use the interpreter.
_PRIORITY, _COMPANION_PRIORITY = 50, 40
# Switch intervals of the interpreter, s: Python's default, and the one while ticks are due.
_LONG_INTERVAL, _SHORT_INTERVAL = 5e-3, 1e-5
_VERY_LATE = 20 * NS_PER_MS
_RECOVERY_SECONDS = 2.0  # s with the default interval


def freeze_heap() -> None:
    """Excludes all existing objects from garbage collection; call it after set-up.

    Otherwise each collection would visit all these objects.
    """
    gc.collect()
    gc.freeze()


def shorten_switch_interval() -> None:
    """Makes other Python threads release the interpreter at once, not after 5 ms."""
    sys.setswitchinterval(_SHORT_INTERVAL)


def minimize_timer_slack() -> None:
    """Makes the calling thread, and threads that it starts, wake on time.

    By default Linux may wake threads up to 50 us late, to wake several together.
    """
    with suppress(AttributeError, OSError):  # not Linux
        ctypes.CDLL(None).prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0)


def take_real_time_priority(priority: int = _PRIORITY) -> bool:
    """Gives the calling thread, but not threads that it starts, real-time priority.

    This needs root or rtprio in limits.conf, as ros2_control does.

    Args:
        priority: From 1 to 99; the thread with the highest runs first.

    Returns:
        Whether the system permits it.
    """
    try:
        policy = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
        os.sched_setscheduler(0, policy, os.sched_param(priority))
    except (AttributeError, OSError):
        return False
    return True


def accompany_ticker() -> None:
    """Gives the calling thread a real-time priority below the ticker's.

    Otherwise a thread preempted while it holds the interpreter lock would delay the ticker.
    """
    take_real_time_priority(_COMPANION_PRIORITY)


class SwitchInterval:
    """Requests the interpreter from other threads at once, unless the machine is overloaded.

    Such requests are repeated every 10 us. With sixty nodes in discovery on two cores, they use
    the core that the other thread needs. So the ticker uses Python's default interval at the start
    and after a very late tick.
    """

    def __init__(self) -> None:
        self._long_until = time.monotonic() + _RECOVERY_SECONDS
        sys.setswitchinterval(_LONG_INTERVAL)

    def follow(self, late: int) -> None:
        """Adapts to the lateness of a tick; to be called at each tick.

        Args:
            late: Lateness of the tick, ns.
        """
        now = time.monotonic()
        if late > _VERY_LATE:
            self._long_until = now + _RECOVERY_SECONDS
        sys.setswitchinterval(_LONG_INTERVAL if now < self._long_until else _SHORT_INTERVAL)
