# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Simulated time: what a clock that runs, stands, hastens and jumps makes of the ticks."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from linkage_ros.run.ticker import Callbacks, SimTimeTicker

MS = 10**6


class Every:
    """Ticks a whole period apart."""

    def __init__(self, period):
        self.period = period

    def elapsed(self, tick):
        return tick * self.period

    def tick_at(self, elapsed):
        return elapsed // self.period


class Run:
    """What a ticker called for."""

    def __init__(self, period=5 * MS):
        self.stamps, self.begun, self.moved, self.failed = [], [], [], []
        self.callbacks = Callbacks(
            self._tick, lambda *pair: self.moved.append(pair), self.failed.append
        )
        self.ticker = SimTimeTicker(Every(period), self.callbacks)
        self.ticker.start()

    def _tick(self, stamp):
        self.begun = self.begun or [self.ticker.t0]
        self.stamps.append(stamp)

    def advance_to(self, *times):
        for time in times:
            self.ticker.advance_to(time)
        return self


def test_tick_0_is_the_first_time_heard_and_every_tick_up_to_now_is_made():
    run = Run().advance_to(100 * MS, 104 * MS, 105 * MS, 122 * MS)
    assert run.begun == [100 * MS]
    assert run.stamps == [(100 + 5 * i) * MS for i in range(5)]
    assert (run.ticker.counts.kept, run.ticker.counts.missed) == (5, 0)


def test_nothing_happens_while_the_clock_stands():
    run = Run().advance_to(7, *[10 * MS] * 100)
    assert run.stamps == [7, 5 * MS + 7]
    assert run.moved == []


@given(st.lists(st.integers(0, 40 * MS), max_size=60))
def test_how_often_the_clock_speaks_makes_no_difference(gaps):
    run, now = Run().advance_to(0), 0
    for gap in gaps:
        now += gap
        run.advance_to(now)
    assert run.stamps == list(range(0, now + 1, 5 * MS))
    assert run.ticker.counts.clock_steps == 0


def test_a_clock_that_goes_back_moves_the_motion_with_it():
    run = Run().advance_to(1000 * MS, 1012 * MS, 300 * MS, 306 * MS)
    # 1015 ms was due next: it is 300 ms now, and the grid goes on from there.
    assert run.moved == [(1015 * MS, 300 * MS)]
    assert run.stamps == [1000 * MS, 1005 * MS, 1010 * MS, 300 * MS, 305 * MS]
    assert run.ticker.counts.clock_steps == 1


def test_a_long_jump_forward_is_missed_and_counted():
    run = Run().advance_to(0, 10**12)
    assert run.stamps == [0, 10**12]
    assert run.ticker.counts.missed == 10**12 // (5 * MS) - 1
    run.advance_to(10**12 + 5 * MS)
    assert run.stamps[-1] == 10**12 + 5 * MS


def test_it_ends_when_it_is_stopped_and_not_before_it_begins():
    run = Run()
    ticker = SimTimeTicker(Every(MS), run.callbacks)
    ticker.advance_to(5)
    ticker.stop()
    assert run.stamps == []
    run.advance_to(0)
    run.ticker.stop()
    run.advance_to(10**9)
    assert run.stamps == [0]


def test_a_tick_that_fails_ends_the_motion_and_is_told():
    def fail(_):
        raise ValueError('on purpose')

    failed = []
    ticker = SimTimeTicker(Every(MS), Callbacks(fail, fail, failed.append))
    ticker.start()
    ticker.advance_to(0)
    ticker.advance_to(10**9)
    assert [str(error) for error in failed] == ['on purpose']
    assert ticker.error is failed[0]
    with pytest.raises(ValueError, match='on purpose'):
        raise ticker.error
