# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Ticks in real time and on a simulated clock that runs, stops, speeds up and jumps."""

import threading
from fractions import Fraction
from itertools import accumulate

import pytest
from hypothesis import given
from hypothesis import strategies as st
from ros_harness import PATIENCE

from linkage_ros.node import ticker as ticker_module
from linkage_ros.node.ticker import CLOCK_STEP, RealTimeTicker, SimTimeTicker
from linkage_ros.run.ticks import TickRate

MS = 1_000_000


class Clock:
    """Simulates both clocks of a machine; sleeping advances them, and so may a slow tick."""

    def __init__(self):
        self.mono, self.wall = 5_000, 1_700_000_000 * 10**9
        self.delays = []  # ns, after the next readings of the wall clock, in reverse order

    def monotonic_ns(self):
        return self.mono

    def time_ns(self):
        read = self.wall
        self.advance(self.delays.pop() if self.delays else 0)
        return read

    def sleep(self, seconds):
        self.advance(round(seconds * 1e9))

    def advance(self, ns):
        self.mono += ns
        self.wall += ns


@pytest.fixture
def clock(monkeypatch):
    clock = Clock()
    monkeypatch.setattr(ticker_module, 'time', clock)
    return clock


class Run:
    """Records what a ticker does: stamps, t0 at the first, steps of the clock, errors."""

    def __init__(self, kind, rate, last=None, act=lambda tick: None, receive=tuple):
        self.stamps, self.begun, self.moved, self.failed = [], [], [], []
        self._last, self._act = last, act
        self.ticker = kind(
            rate, self._tick, lambda *pair: self.moved.append(pair), self.failed.append,
            lambda: receive(self.ticker),
        )  # fmt: skip
        self.ticker.start()
        self.ticker._thread.join(PATIENCE)
        assert not self.ticker._thread.is_alive()
        self.counts = self.ticker.counts

    def _tick(self, stamp):
        self.begun = self.begun or [self.ticker.t0]
        self.stamps.append(stamp)
        self._act(len(self.stamps))
        if len(self.stamps) == self._last:
            self.ticker._stop.set()


def real(rate_hz, ticks, act=lambda tick: None):
    return Run(RealTimeTicker, TickRate(rate_hz), ticks, act)


def test_stamps_are_the_start_plus_whole_periods_whatever_the_lateness(clock):
    first = clock.mono
    run = real(30.0, 200, lambda tick: clock.advance((tick * 7919) % (20 * MS)))
    assert run.stamps == [run.begun[0] + n * 10**9 // 30 for n in range(200)]
    assert (run.counts.missed, run.counts.kept, run.moved) == (0, 200, [])
    assert run.counts.start == (first + 7919) / 1e9  # after the first tick


def test_ticks_missed_by_a_late_thread_are_skipped_and_counted(clock):
    run = real(1000.0, 50, lambda tick: clock.advance(7_300_000 if tick == 10 else 0))
    # Tick 9 starts at 9 ms and lasts until 16.3 ms, so ticks 10 to 15 are lost.
    assert run.stamps == [run.begun[0] + n * MS for n in (*range(10), *range(16, 56))]
    assert run.counts.missed == 6
    assert run.counts.max_lateness == max(run.counts.lateness) == 6_300_000


@pytest.mark.parametrize('jump', [-3_600 * 10**9, CLOCK_STEP + 1, CLOCK_STEP])
def test_a_step_of_the_wall_clock_moves_the_stamps_once_and_is_counted(clock, jump):
    """A smaller step, such as drift between the clocks, changes nothing."""

    def act(tick):
        clock.wall += jump if tick == 20 else 0

    run = real(100.0, 40, act)
    moved = jump if abs(jump) > CLOCK_STEP else 0
    (t0,) = run.begun
    assert run.stamps[:20] == [t0 + n * 10 * MS for n in range(20)]
    assert run.stamps[20:] == [t0 + moved + n * 10 * MS for n in range(20, 40)]
    assert run.moved == ([(t0 + 200 * MS, t0 + 200 * MS + jump)] if moved else [])
    assert run.counts.clock_steps == bool(moved)


def test_a_thread_stopped_between_readings_of_the_clocks_sees_no_step(clock):
    def act(tick):
        if tick in (10, 20):
            clock.delays = [3 * CLOCK_STEP, 2 * CLOCK_STEP]  # at two attempts in a row

    clock.delays = [2 * CLOCK_STEP]  # at the reading of t0
    run = real(100.0, 40, act)
    assert (run.moved, run.counts.clock_steps) == ([], 0)
    assert clock.delays == []
    assert {(stamp - run.begun[0]) % (10 * MS) for stamp in run.stamps} == {0}
    assert run.begun == [1_700_000_000 * 10**9]


def test_ticker_at_a_low_rate_stops_at_once():
    rate, first = TickRate(0.01), threading.Event()
    ticker = RealTimeTicker(rate, lambda _: first.set(), lambda *_: None, lambda _: None)
    ticker.start()
    assert first.wait(PATIENCE)
    ticker.stop()
    assert ticker.counts.kept == 1


@given(
    rate=st.one_of(st.floats(0.01, 1e5), st.sampled_from([30.0, 1 / 3, 99999.0, 0.1])),
    tick=st.integers(0, 10**12),
)
def test_tick_at_a_time_is_the_last_one_due(rate, tick):
    rate_of_ticks = TickRate(rate)
    exact = Fraction(10**9) / Fraction(repr(rate))
    assert rate_of_ticks.elapsed(tick) == int(tick * exact)
    assert rate_of_ticks.tick_at(rate_of_ticks.elapsed(tick)) == tick
    assert rate_of_ticks.tick_at(rate_of_ticks.elapsed(tick + 1) - 1) == tick


# ---------------------------------------------------------------- simulated time


def simulated(*times, rate_hz=200.0, **options):
    """The run of a clock that told some times before it was stopped."""
    times, rate = list(times), TickRate(rate_hz)

    def receive(ticker):
        if not times:
            ticker._stop.set()
        while times:
            yield times.pop(0)

    return Run(SimTimeTicker, rate, receive=receive, **options)


@pytest.mark.parametrize(
    ('times', 'stamps'),
    [
        ((100, 104, 105, 122), [100, 105, 110, 115, 120]),  # all ticks up to the current time
        ((7, *[10] * 100), [7]),  # the clock stops
        ((0, 10**6, 10**6 + 5), [0, 10**6, 10**6 + 5]),  # a long jump forward
        # 1015 ms was due next; the clock is now at 300 ms, from which the grid continues.
        ((1000, 1012, 300, 306), [1000, 1005, 1010, 300, 305]),
    ],
)
def test_tick_0_is_the_first_clock_time_and_others_follow_the_clock(times, stamps):
    run = simulated(*(time * MS for time in times))
    assert run.begun == [times[0] * MS]
    assert run.stamps == [stamp * MS for stamp in stamps]
    is_back, is_jump = 300 in times, 10**6 in times
    assert run.moved == ([(1015 * MS, 300 * MS)] if is_back else [])
    assert (run.counts.kept, run.counts.clock_steps) == (len(stamps), is_back + is_jump)
    assert run.counts.missed == 0  # the clock skipped ticks, not a late thread
    assert run.counts.last_step == (10**6 * is_jump - 715 * is_back) * MS


@given(st.lists(st.integers(0, 40 * MS), max_size=60))
def test_clock_rate_does_not_change_the_ticks(gaps):
    times = list(accumulate(gaps, initial=0))
    run = simulated(*times)
    assert run.stamps == list(range(0, times[-1] + 1, 5 * MS))
    assert run.counts.clock_steps == 0


def test_a_stopped_ticker_makes_no_more_of_the_ticks_that_are_due():
    run = simulated(0, 10**9, rate_hz=500.0, last=3)
    assert run.stamps == [0, 2 * MS, 4 * MS]


def test_failing_tick_ends_the_motion_and_is_reported(clock):
    def act(tick):
        if tick == 3:
            raise RuntimeError('broken')

    for run in (real(100.0, 40, act), simulated(0, 10**9, act=act)):
        assert len(run.stamps) == 3
        assert [str(error) for error in run.failed] == ['broken']
