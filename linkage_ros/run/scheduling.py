# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Scheduling of a thread with deadlines, by Linux and by Python."""

from __future__ import annotations

import ctypes
import gc
import os
import sys
from contextlib import suppress

_PR_SET_TIMERSLACK = 29  # of prctl
# Priority of the ticker, as in ros2_control, and of other threads that use the interpreter.
_PRIORITY, _COMPANION_PRIORITY = 50, 40
# Switch interval of the interpreter, s. After each interval, a thread that waits for the
# interpreter asks for it again. At 10 us, two waiting threads with real-time priority took both
# processors for a second from the thread that they were waiting for.
_SWITCH_INTERVAL = 1e-4


def freeze_heap() -> None:
    """Excludes all existing objects from garbage collection; call it after set-up.

    Otherwise each collection would visit all these objects.
    """
    gc.collect()
    gc.freeze()


def shorten_switch_interval() -> None:
    """Makes other Python threads release the interpreter after 0.1 ms, not after 5 ms."""
    sys.setswitchinterval(_SWITCH_INTERVAL)


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
