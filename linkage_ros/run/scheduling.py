# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How Linux and Python schedule a thread with deadlines: as far as they let it, it is not late."""

from __future__ import annotations

import ctypes
import gc
import math
import os
import sys
import time
from contextlib import suppress

from linkage_ros.units import NS_PER_MS

_PR_SET_TIMERSLACK = 29  # of prctl
_PRIORITY = 50  # as ros2_control's
# s for which a thread may keep the interpreter while another waits: Python's own, and where ticks
# are due.
_PATIENT, _INSISTENT = 5e-3, 1e-5
_FAR_TOO_LATE = 20 * NS_PER_MS
_CALM, _LONGEST = 2.0, 64.0  # s to be patient


def freeze_heap() -> None:
    """Lets searches for garbage leave out what is there now; call it when all has been set up.

    Each would walk through everything made so far.
    """
    gc.collect()
    gc.freeze()


def shorten_switch_interval() -> None:
    """Lets no other thread of Python keep the interpreter; by default each may for 5 ms."""
    sys.setswitchinterval(_INSISTENT)


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
    """Insists on the interpreter while ticks are on time, and is patient where they are not.

    A thread that insists asks every 10 us. Where whoever has the interpreter gets no core, as
    among sixty nodes that find each other, these questions take that core for ever. So a thread is
    patient at first and after a tick that is far too late; each next time for twice as long.
    """

    def __init__(self) -> None:
        self._insists, self._pause, self._again = True, _CALM, -math.inf
        self._be_patient()

    def follow(self, late: int) -> None:
        """To be called at each tick.

        Args:
            late: How late it is, ns.
        """
        if late > _FAR_TOO_LATE:
            self._be_patient()
        elif not self._insists and time.monotonic() >= self._again:
            self._insists = True
            shorten_switch_interval()

    def _be_patient(self) -> None:
        now = time.monotonic()
        if self._insists:
            has_lasted = now - self._again > _LONGEST
            self._pause = _CALM if has_lasted else min(2 * self._pause, _LONGEST)
            self._insists = False
            sys.setswitchinterval(_PATIENT)
        self._again = now + self._pause
