# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Ticks on real time and on a simulated clock that runs, stands, hastens and jumps."""

import threading
from fractions import Fraction
from itertools import accumulate

import pytest
from hypothesis import given
from hypothesis import strategies as st

from linkage_ros.parameters.configuration import configure
from linkage_ros.run import ticker as ticker_module
from linkage_ros.run.simulator import Simulator
from linkage_ros.run.ticker import CLOCK_STEP, RealTimeTicker, SimTimeTicker

MS = 1_000_000


class Clock:
    """Both clocks of a machine; sleeping moves them, and so may a tick that takes long."""

    def __init__(self, wall=1_700_000_000 * 10**9):
        self.mono, self.wall, self.naps = 5_000, wall, []

    def monotonic_ns(self):
        return self.mono

    def time_ns(self):
        return self.wall

    def sleep(self, seconds):
        self.naps.append(seconds)
        self.advance(round(seconds * 1e9))

    def advance(self, ns):
        self.mono += ns
        self.wall += ns


@pytest.fixture
def clock(monkeypatch):
    clock = Clock()
    monkeypatch.setattr(ticker_module, 'time', clock)
    return clock


def run(clock, rate_hz, ticks, act=lambda tick: None):
    """Ticks until so many were carried out; returns stamps, restamps and the ticker."""
    simulator = Simulator(configure({'rate_hz': rate_hz}))
    stamps, restamps, starts, done = [], [], [], threading.Event()

    def tick(stamp):
        starts.append(ticker.t0)
        stamps.append(stamp)
        act(len(stamps))
        if len(stamps) == ticks:
            ticker._stop.set()
            done.set()

    def restamp(old, new):
        restamps.append((old, new))

    errors = []
    ticker = RealTimeTicker(
        simulator, tick, restamp, lambda error: (errors.append(error), done.set())
    )
    ticker.start()
    assert done.wait(20)
    ticker.stop()
    return stamps, restamps, ticker, starts[0], errors


def test_stamps_are_the_start_plus_whole_periods_whatever_the_lateness(clock):
    stamps, restamps, ticker, t0, _ = run(
        clock, 30.0, 200, lambda tick: clock.advance((tick * 7919) % (20 * MS))
    )
    assert stamps == [t0 + n * 10**9 // 30 for n in range(200)]
    assert (ticker.counts.missed, ticker.counts.kept, restamps) == (0, 200, [])


def test_ticks_that_a_late_thread_cannot_keep_are_skipped_and_counted(clock):
    stamps, _, ticker, t0, _ = run(
        clock, 1000.0, 50, lambda tick: clock.advance(7_300_000 if tick == 10 else 0)
    )
    # Tick 9 is carried out at 9 ms and lasts until 16.3 ms: 10 to 15 are lost.
    assert stamps[:10] == [t0 + n * MS for n in range(10)]
    assert stamps[10:] == [t0 + n * MS for n in range(16, 56)]
    assert ticker.counts.missed == 6
    assert ticker.counts.max_lateness == max(ticker.counts.lateness) == 6_300_000


def test_a_step_of_the_wall_clock_moves_the_stamps_once_and_is_counted(clock):
    jump = -3_600 * 10**9

    def act(tick):
        if tick == 20:
            clock.wall += jump

    stamps, restamps, ticker, t0, _ = run(clock, 100.0, 40, act)
    assert stamps[:20] == [t0 + n * 10 * MS for n in range(20)]
    assert stamps[20:] == [t0 + jump + n * 10 * MS for n in range(20, 40)]
    assert restamps == [(t0 + 200 * MS, t0 + 200 * MS + jump)]
    assert ticker.counts.clock_steps == 1


def test_a_small_difference_of_the_clocks_moves_nothing(clock):
    def act(tick):
        if tick == 20:
            clock.wall += CLOCK_STEP

    stamps, restamps, _, t0, _ = run(clock, 100.0, 40, act)
    assert stamps == [t0 + n * 10 * MS for n in range(40)]
    assert restamps == []


def test_an_error_in_a_tick_ends_the_thread_and_is_reported(clock):
    def act(tick):
        if tick == 3:
            raise RuntimeError('broken')

    stamps, _, ticker, _, errors = run(clock, 100.0, 40, act)
    assert len(stamps) == 3
    assert [str(error) for error in errors] == ['broken']
    assert ticker.error is errors[0]


def test_it_never_sleeps_longer_than_it_may_take_to_stop(monkeypatch):
    simulator = Simulator(configure({'rate_hz': 0.01}))
    first = threading.Event()
    ticker = RealTimeTicker(simulator, lambda _: first.set(), lambda *_: None, lambda _: None)
    ticker.start()
    assert first.wait(5)
    ticker.stop()
    assert ticker.counts.kept == 1


@given(
    rate=st.one_of(st.floats(0.01, 1e5), st.sampled_from([30.0, 1 / 3, 99999.0, 0.1])),
    tick=st.integers(0, 10**12),
)
def test_the_tick_at_a_time_is_the_last_one_that_has_come(rate, tick):
    simulator = Simulator(configure({'rate_hz': rate}))
    exact = Fraction(10**9) / Fraction(repr(rate))
    assert simulator.elapsed(tick) == int(tick * exact)
    assert simulator.tick_at(simulator.elapsed(tick)) == tick
    assert simulator.tick_at(simulator.elapsed(tick + 1) - 1) == tick


# ---------------------------------------------------------------- simulated time


class Every:
    """Ticks a whole period apart."""

    def __init__(self, period):
        self.period = period

    def elapsed(self, tick):
        return tick * self.period

    def tick_at(self, elapsed):
        return elapsed // self.period


class SimulatedRun:
    """What a ticker called for while a clock told some times, before it was stopped."""

    def __init__(self, *times, period=5 * MS, last=None, tick=None):
        self.stamps, self.begun, self.moved, self.failed = [], [], [], []
        self._times, self._last = list(times), last
        self.ticker = SimTimeTicker(
            Every(period), tick or self._tick, lambda *pair: self.moved.append(pair),
            self.failed.append, self._receive,
        )  # fmt: skip
        self.ticker.start()
        self.ticker._thread.join(20)
        assert not self.ticker._thread.is_alive()

    def _receive(self):
        if not self._times:
            self.ticker._stop.set()
        while self._times:
            yield self._times.pop(0)

    def _tick(self, stamp):
        self.begun = self.begun or [self.ticker.t0]
        self.stamps.append(stamp)
        if len(self.stamps) == self._last:
            self.ticker._stop.set()


def test_tick_0_is_the_first_time_heard_and_every_tick_up_to_now_is_made():
    run = SimulatedRun(100 * MS, 104 * MS, 105 * MS, 122 * MS)
    assert run.begun == [100 * MS]
    assert run.stamps == [(100 + 5 * i) * MS for i in range(5)]
    assert (run.ticker.counts.kept, run.ticker.counts.missed) == (5, 0)


def test_nothing_happens_while_the_clock_stands():
    run = SimulatedRun(7, *[10 * MS] * 100)
    assert run.stamps == [7, 5 * MS + 7]
    assert run.moved == []


@given(st.lists(st.integers(0, 40 * MS), max_size=60))
def test_how_often_the_clock_speaks_makes_no_difference(gaps):
    times = list(accumulate(gaps, initial=0))
    run = SimulatedRun(*times)
    assert run.stamps == list(range(0, times[-1] + 1, 5 * MS))
    assert run.ticker.counts.clock_steps == 0


def test_a_clock_that_goes_back_moves_the_motion_with_it():
    run = SimulatedRun(1000 * MS, 1012 * MS, 300 * MS, 306 * MS)
    # 1015 ms was due next: it is 300 ms now, and the grid goes on from there.
    assert run.moved == [(1015 * MS, 300 * MS)]
    assert run.stamps == [1000 * MS, 1005 * MS, 1010 * MS, 300 * MS, 305 * MS]
    assert run.ticker.counts.clock_steps == 1


def test_a_long_jump_forward_is_missed_and_counted():
    run = SimulatedRun(0, 10**12, 10**12 + 5 * MS)
    assert run.stamps == [0, 10**12, 10**12 + 5 * MS]
    assert run.ticker.counts.missed == 10**12 // (5 * MS) - 1


def test_a_stopped_ticker_makes_no_more_of_the_ticks_that_are_due():
    run = SimulatedRun(0, 10**9, period=2 * MS, last=3)
    assert run.stamps == [0, 2 * MS, 4 * MS]


def test_a_tick_that_fails_ends_the_motion_and_is_told():
    def fail(_):
        raise ValueError('on purpose')

    run = SimulatedRun(0, 10**9, tick=fail)
    assert [str(error) for error in run.failed] == ['on purpose']
    assert run.ticker.error is run.failed[0]
