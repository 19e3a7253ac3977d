# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A thread with deadlines gets what the system grants, and its children do not."""

from __future__ import annotations

import ctypes
import gc
import os
import sys
from concurrent.futures import ThreadPoolExecutor

import pytest

from linkage_ros.run import punctual


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
        punctual.wake_on_time()
        return before, slack()

    assert in_thread(work) == (50_000, 1)


def test_it_goes_first_and_what_it_starts_does_not():
    def work():
        return punctual.go_first(), policy(), in_thread(policy)

    granted, own, child = in_thread(work)
    assert own == (os.SCHED_FIFO if granted else os.SCHED_OTHER)
    assert child == os.SCHED_OTHER
    assert policy() == os.SCHED_OTHER


def test_without_the_right_it_says_so(monkeypatch):
    def refuse(*_):
        raise PermissionError(1, 'Operation not permitted')

    monkeypatch.setattr(os, 'sched_setscheduler', refuse)
    assert punctual.go_first() is False


def test_elsewhere_it_does_without(monkeypatch):
    monkeypatch.delattr(os, 'SCHED_FIFO')
    assert punctual.go_first() is False


@pytest.fixture
def interval():
    before = sys.getswitchinterval()
    yield
    sys.setswitchinterval(before)
    gc.unfreeze()


def test_what_was_made_so_far_is_searched_no_more(interval):
    punctual.prepare_process()
    assert gc.get_freeze_count() > 0
    assert sys.getswitchinterval() <= 1e-4
