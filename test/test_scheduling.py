# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A thread with deadlines gets what the system grants, and its children do not."""

import ctypes
import gc
import os
import sys
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import pytest

from linkage_ros.run import scheduling


def in_thread(work):
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(work).result()


def policy():
    return os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK


def test_a_thread_wakes_when_it_asked_for():
    def work():
        prctl = ctypes.CDLL(None).prctl
        prctl(29, 50_000, 0, 0, 0)  # PR_SET_TIMERSLACK; other tests may have changed it
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


@pytest.fixture
def interval():
    before = sys.getswitchinterval()
    yield
    sys.setswitchinterval(before)
    gc.unfreeze()


def test_frozen_objects_are_not_garbage_collected(interval):
    scheduling.freeze_heap()
    assert gc.get_freeze_count() > 0


def test_a_tick_that_is_far_too_late_makes_the_ticker_patient_for_two_seconds(
    monkeypatch, interval
):
    clock = SimpleNamespace(now=100.0)
    monkeypatch.setattr(scheduling, 'time', SimpleNamespace(monotonic=lambda: clock.now))
    switch_interval = scheduling.SwitchInterval()

    def is_patient(wait, late):
        clock.now += wait
        switch_interval.follow(late)
        return sys.getswitchinterval() > 1e-4

    very_late = 21_000_000
    steps = [
        *((0.0, 0, True), (1.9, 0, True), (0.1, 0, False), (0.0, 19_000_000, False)),
        *((100.0, very_late, True), (1.9, 0, True), (0.1, 0, False), (5.0, very_late, True)),
        *((1.5, very_late, True), (1.9, 0, True), (0.1, 0, False)),  # the two seconds begin anew
    ]
    assert [is_patient(wait, late) for wait, late, _ in steps] == [
        patient for *_, patient in steps
    ]
