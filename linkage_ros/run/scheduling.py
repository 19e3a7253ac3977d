# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How Linux and Python schedule a thread with deadlines: as far as they let it, it is not late."""

from __future__ import annotations

import ctypes
import gc
import os
import sys
import time
from contextlib import suppress

from linkage_ros.units import NS_PER_MS

_PR_SET_TIMERSLACK = 29  # of prctl
_PRIORITY = 50  # as ros2_control's
# s for which a thread may keep the interpreter while another waits: Python's own, and where ticks
# are due.
_LONG_INTERVAL, _SHORT_INTERVAL = 5e-3, 1e-5
_VERY_LATE = 20 * NS_PER_MS
_RECOVERY_SECONDS = 2.0  # s to be patient


def freeze_heap() -> None:
    """Lets searches for garbage leave out what is there now; call it when all has been set up.

    Each would walk through everything made so far.
    """
    gc.collect()
    gc.freeze()


def shorten_switch_interval() -> None:
    """Lets no other thread of Python keep the interpreter; by default each may for 5 ms."""
    sys.setswitchinterval(_SHORT_INTERVAL)


def minimize_timer_slack() -> None:
    """Lets the calling thread, and those that it starts, wake when it asked for.

    By default Linux wakes a thread up to 50 us later, to wake several at once.
    """
    with suppress(AttributeError, OSError):  # it is not Linux
        ctypes.CDLL(None).prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0)


def take_real_time_priority() -> bool:
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


class SwitchInterval:
    """Takes the interpreter from other threads at once, unless the machine has no core to spare.

    A thread that insists asks for it every 10 us. Where sixty nodes discover each other on two
    cores, these questions take the core that the other thread needs to finish: so the ticker is
    patient at the start, and after a tick that was far too late.
    """

    def __init__(self) -> None:
        self._long_until = time.monotonic() + _RECOVERY_SECONDS
        sys.setswitchinterval(_LONG_INTERVAL)

    def follow(self, late: int) -> None:
        """To be called at each tick.

        Args:
            late: How late it is, ns.
        """
        now = time.monotonic()
        if late > _VERY_LATE:
            self._long_until = now + _RECOVERY_SECONDS
        sys.setswitchinterval(_LONG_INTERVAL if now < self._long_until else _SHORT_INTERVAL)
