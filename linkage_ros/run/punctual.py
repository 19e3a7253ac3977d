# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What keeps a thread with deadlines from being late, as far as the system lets it."""

from __future__ import annotations

import ctypes
import gc
import os
import sys
from contextlib import suppress

_PR_SET_TIMERSLACK = 29  # of prctl
_PRIORITY = 50  # as ros2_control's


def prepare_process() -> None:
    """Lets no other thread of Python hold up one that is due; call it when all has been set up.

    By default a thread may keep the interpreter for 5 ms, and each search for garbage walks
    through everything made so far.
    """
    sys.setswitchinterval(1e-5)
    gc.collect()
    gc.freeze()


def wake_on_time() -> None:
    """Lets the calling thread, and those that it starts, wake when it asked for.

    By default Linux wakes a thread up to 50 us later, to wake several at once.
    """
    with suppress(AttributeError, OSError):  # it is not Linux
        ctypes.CDLL(None).prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0)


def go_first() -> bool:
    """Lets the calling thread, but none that it starts, go before others that want a core.

    That takes the right to do so, root's or rtprio in limits.conf, as for ros2_control.

    Returns:
        Whether the system lets it.
    """
    try:
        policy = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
        os.sched_setscheduler(0, policy, os.sched_param(_PRIORITY))
    except (AttributeError, OSError):
        return False
    return True
