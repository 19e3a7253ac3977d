# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A thread with deadlines gets what the system grants, and its children do not."""

import ctypes
import gc
import os
import sys
from concurrent.futures import ThreadPoolExecutor

import pytest

from linkage_ros.run import scheduling


def in_thread(work):
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(work).result()


def slack():
    return ctypes.CDLL(None).prctl(30)  # PR_GET_TIMERSLACK


def usual_slack():
    ctypes.CDLL(None).prctl(29, 50_000, 0, 0, 0)  # other tests may have changed that of pytest


def policy():
    return os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK


def test_a_thread_wakes_when_it_asked_for():
    def work():
        usual_slack()
        before = slack()
        scheduling.minimize_timer_slack()
        return before, slack()

    assert in_thread(work) == (50_000, 1)


def test_it_goes_first_and_what_it_starts_does_not():
    def work():
        return scheduling.take_real_time_priority(), policy(), in_thread(policy)

    def beside():
        scheduling.accompany_ticker()
        return policy(), os.sched_getparam(0).sched_priority

    granted, own, child = in_thread(work)
    assert in_thread(beside) == (own, 40 if granted else 0)
    assert own == (os.SCHED_FIFO if granted else os.SCHED_OTHER)
    assert child == os.SCHED_OTHER
    assert policy() == os.SCHED_OTHER


def test_without_the_right_it_says_so(monkeypatch):
    def refuse(*_):
        raise PermissionError(1, 'Operation not permitted')

    monkeypatch.setattr(os, 'sched_setscheduler', refuse)
    assert scheduling.take_real_time_priority() is False
    monkeypatch.delattr(os, 'SCHED_FIFO')  # as on other systems
    assert scheduling.take_real_time_priority() is False


@pytest.fixture
def interval():
    before = sys.getswitchinterval()
    yield
    sys.setswitchinterval(before)
    gc.unfreeze()


def test_what_was_made_so_far_is_searched_no_more(interval):
    scheduling.freeze_heap()
    assert gc.get_freeze_count() > 0


class Clock:
    def __init__(self):
        self.now = 100.0

    def monotonic(self):
        return self.now


def patient_for(switch_interval, clock):
    """How long it is patient, s."""
    begin = clock.now
    while sys.getswitchinterval() > 1e-4:
        assert clock.now < begin + 1000
        clock.now += 0.5
        switch_interval.follow(0)
    return clock.now - begin


def test_a_tick_that_is_far_too_late_makes_the_ticker_patient_for_two_seconds(
    monkeypatch, interval
):
    clock = Clock()
    monkeypatch.setattr(scheduling, 'time', clock)
    switch_interval = scheduling.SwitchInterval()
    assert patient_for(switch_interval, clock) == 2.0
    switch_interval.follow(19_000_000)
    assert sys.getswitchinterval() < 1e-4
    clock.now += 100
    switch_interval.follow(21_000_000)
    assert patient_for(switch_interval, clock) == 2.0
    switch_interval.follow(21_000_000)
    clock.now += 1.5
    switch_interval.follow(21_000_000)  # still far too late: the two seconds begin anew
    assert patient_for(switch_interval, clock) == 2.0
