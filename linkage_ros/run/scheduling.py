# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Settings of Linux and Python that let a thread meet its deadlines."""

from __future__ import annotations

import ctypes
import gc
import os
import sys
from contextlib import suppress

_PR_SET_TIMERSLACK = 29  # option of prctl
# Priority of the ticker, as in ros2_control, and of other threads that use the interpreter.
_PRIORITY, _COMPANION_PRIORITY = 50, 40
# Switch interval of the interpreter, s. A thread waiting for the interpreter wakes up after each
# interval. At 10 us, two waiting real-time threads kept both processors busy for a second, which
# blocked the thread that held the interpreter.
_SWITCH_INTERVAL = 1e-4


def freeze_heap() -> None:
    """Excludes all existing objects from garbage collection; call this after set-up.

    This shortens collections, which otherwise visit all objects.
    """
    gc.collect()
    gc.freeze()


def shorten_switch_interval() -> None:
    """Makes Python threads release the interpreter after 0.1 ms instead of 5 ms."""
    sys.setswitchinterval(_SWITCH_INTERVAL)


def minimize_timer_slack() -> None:
    """Makes the calling thread, and threads started by it, wake up on time.

    By default, Linux may wake threads up to 50 us late to group wake-ups.
    """
    with suppress(AttributeError, OSError):  # not Linux
        ctypes.CDLL(None).prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0)


def take_real_time_priority(priority: int = _PRIORITY) -> bool:
    """Gives the calling thread real-time priority; threads started by it do not inherit it.

    As for ros2_control, this requires root or rtprio in limits.conf.

    Args:
        priority: Priority from 1 to 99; higher priorities run first.

    Returns:
        Whether the system granted the priority.
    """
    try:
        policy = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
        os.sched_setscheduler(0, policy, os.sched_param(priority))
    except (AttributeError, OSError):
        return False
    return True


def accompany_ticker() -> None:
    """Gives the calling thread a real-time priority below that of the ticker.

    Otherwise, if the thread were preempted while it held the interpreter lock, it would delay the
    ticker.
    """
    take_real_time_priority(_COMPANION_PRIORITY)
