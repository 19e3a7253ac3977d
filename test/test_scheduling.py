# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A thread with deadlines gets the available priority, and its children do not inherit it."""

import ctypes
import gc
import os
import sys
from concurrent.futures import ThreadPoolExecutor

from ros_harness import finished

from linkage_ros.run import scheduling


def in_thread(work):
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(work).result()


def policy():
    return os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK


def test_thread_wakes_at_the_requested_time():
    def work():
        prctl = ctypes.CDLL(None).prctl
        prctl(29, 50_000, 0, 0, 0)  # PR_SET_TIMERSLACK, which other tests may have changed
        before = prctl(30)
        scheduling.minimize_timer_slack()
        return before, prctl(30)

    assert in_thread(work) == (50_000, 1)


def test_real_time_priority_is_not_inherited():
    def work():
        return scheduling.take_real_time_priority(), policy(), in_thread(policy)

    def beside():
        scheduling.accompany_ticker()
        return policy(), os.sched_getparam(0).sched_priority

    granted, own, child = in_thread(work)
    assert in_thread(beside) == (own, 40 if granted else 0)
    assert own == (os.SCHED_FIFO if granted else os.SCHED_OTHER)
    assert child == policy() == os.SCHED_OTHER


def test_missing_real_time_permission_is_reported(monkeypatch):
    def refuse(*_):
        raise PermissionError(1, 'Operation not permitted')

    monkeypatch.setattr(os, 'sched_setscheduler', refuse)
    assert scheduling.take_real_time_priority() is False
    monkeypatch.delattr(os, 'SCHED_FIFO')  # as on other systems
    assert scheduling.take_real_time_priority() is False


def test_frozen_objects_are_not_garbage_collected():
    scheduling.freeze_heap()
    assert gc.get_freeze_count() > 0
    gc.unfreeze()


WAITERS = """
import os, sys, threading, time
from linkage_ros.run import scheduling

os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:2])

latest = 0.0
end = time.monotonic() + 1.5

def tick(take_priority):
    global latest
    take_priority()
    while time.monotonic() < end:
        due = time.monotonic() + 1e-3
        time.sleep(1e-3)
        latest = max(latest, time.monotonic() - due)

scheduling.shorten_switch_interval()
{change}
scheduling.minimize_timer_slack()
beside = scheduling.accompany_ticker
works = scheduling.take_real_time_priority, beside, beside
threads = [threading.Thread(target=tick, args=(work,)) for work in works]
for thread in threads:
    thread.start()
while time.monotonic() < end:  # holds the interpreter, at normal priority
    sum(range(1000))
print(latest)
"""


def latest(change=''):
    """The largest lateness, s, of three such threads on two processors."""
    return float(finished([sys.executable, '-c', WAITERS.format(change=change)]).stdout)


def test_threads_with_real_time_priority_leave_time_to_the_thread_they_wait_for():
    """Without this, Linux would stop them only after 0.95 s."""
    assert latest() < 0.5
    if in_thread(scheduling.take_real_time_priority):
        assert latest('sys.setswitchinterval(1e-6)') > 0.5  # each waits only 1 us
