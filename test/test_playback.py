# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The messages that a replay plays, and its pace on a clock controlled by the tests."""

import itertools
import math
import threading
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st
from ros_harness import wait_for

from linkage_ros.errors import LogError
from linkage_ros.log.reader import LoggedMessage, LogReader
from linkage_ros.programs.keyboard import RIGHT
from linkage_ros.programs.player import MAX_RATE, Item, Pace, excerpt_of, feed, play
from linkage_ros.programs.record import record
from linkage_ros.settings.configuration import configure

PERIOD = 5_000_000
STATES = ['/joint_states']


@pytest.fixture(scope='module')
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp('log') / 'run.mcap'
    record(configure({'rpm': 60.0}), path, duration=2.0)
    return path


@pytest.fixture
def log(path):
    return LogReader(path)


def taken(log, piece, loop=False, count=None):
    with feed(log, piece, loop=loop) as items:
        return list(itertools.islice(items, count))


def test_feed_yields_the_messages_and_excerpts_join(log):
    stored = list(log.messages())
    items = taken(log, excerpt_of(log, 0, None, None))
    assert [item.message for item in items] == stored
    assert [item.time for item in items] == [message.time for message in stored]
    assert excerpt_of(log, 0.5, 1e9, None) == excerpt_of(log, 0.5, None, None)
    parts = [taken(log, excerpt_of(log, at, 0.5, STATES)) for at in (0, 0.5, 1.0, 1.5)]
    assert [len(part) for part in parts] == [100] * 4
    assert list(itertools.chain(*parts)) == taken(log, excerpt_of(log, 0, None, STATES))


def test_rounds_of_a_loop_join_at_one_period(log):
    piece = excerpt_of(log, 0.5, 0.25, STATES)
    items = taken(log, piece, loop=True, count=170)
    assert [item.time for item in items] == [(100 + n) * PERIOD for n in range(170)]
    first = [item.message for item in items[:50]]
    assert [item.message for item in items] == (4 * first)[:170]
    assert len({message.data for message in first}) == 50
    # Also to the end of the log: the last message has its period.
    end = taken(log, excerpt_of(log, 1.9, None, STATES), loop=True, count=45)
    assert [item.time for item in end] == [(380 + n) * PERIOD for n in range(45)]


def test_earlier_latched_messages_come_first_and_once(log):
    items = taken(log, excerpt_of(log, 1.5, 0.01, None), loop=True, count=13)
    names = [item.message.topic for item in items]
    assert names[0] == '/robot_description'
    assert names.count('/robot_description') == 1
    assert items[0].time == items[1].time == 300 * PERIOD
    assert '/robot_description' not in {
        item.message.topic for item in taken(log, excerpt_of(log, 1.5, 0.01, STATES))
    }


def test_loop_over_an_empty_excerpt_ends(log):
    assert len(taken(log, excerpt_of(log, 1.0, 0.5, ['/robot_description']), loop=True)) == 1


def test_read_ahead_is_bounded(log, monkeypatch):
    read, messages = [], log.messages
    monkeypatch.setattr(
        log, 'messages', lambda *part: (read.append(1) or message for message in messages(*part))
    )
    with feed(log, excerpt_of(log, 0, None, None), loop=True) as items:
        next(items)
        wait_for(lambda: len(read) > 1000)
        before = -1
        while before != (before := len(read)):
            time.sleep(0.2)
        assert len(read) < 10_000
        assert len(list(itertools.islice(items, 10_000))) == 10_000
        assert len(read) > 10_000
    assert 'reader_0' not in {thread.name for thread in threading.enumerate()}


def test_damage_is_raised_to_the_consumer(path, tmp_path):
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 0xFF
    damaged = tmp_path / 'damaged.mcap'
    damaged.write_bytes(data)
    log = LogReader(damaged)
    with pytest.raises(LogError, match='damaged'):
        taken(log, excerpt_of(log, 0, None, None))


# ---------------------------------------------------------------- pace

MS, S = 10**6, 10**9


class Clock:
    """Stands still until its time is changed."""

    def __init__(self, time=123 * S):
        self.time = time

    def __call__(self):
        return self.time


def running(rate=1.0, start=0):
    clock = Clock()
    pace = Pace(start, rate, clock)
    pace.toggle()
    return pace, clock


def test_replay_starts_paused():
    clock = Clock()
    pace = Pace(7, 1.0, clock)
    clock.time += 5 * S
    assert pace.seconds_until(7) == pace.seconds_until(S) == math.inf  # not even the first message
    assert (pace.position(), pace.paused) == (7, True)
    pace.toggle()
    clock.time += S // 2
    assert (pace.position(), pace.paused) == (7 + S // 2, False)


@pytest.mark.parametrize('rate', [0.5, 1.0, 4.0])
def test_deadlines_are_absolute(rate):
    pace, clock = running(rate, start=50)
    begin = clock.time
    for n in range(1, 1000):
        due = 50 + n * 5 * MS
        clock.time += round(pace.seconds_until(due) * S) + MS  # each wait ends 1 ms late
        assert pace.seconds_until(due) <= 0
        assert clock.time - begin == pytest.approx(n * 5 * MS / rate + MS, abs=2)


@pytest.mark.parametrize(('late', 'left'), [(99, -0.094), (101, 0.005)])
def test_position_waits_for_the_message_and_only_a_small_lag_is_caught_up(late, left):
    pace, clock = running()
    pace.seconds_until(5 * MS)
    clock.time += (5 + late) * MS
    assert pace.position() == 5 * MS
    assert pace.seconds_until(5 * MS) == pytest.approx(-late / 1000)
    assert pace.seconds_until(10 * MS) == pytest.approx(left)


def test_pausing_keeps_the_position_and_does_not_split_a_log_time():
    pace, clock = running(2.0)
    clock.time += 100 * MS
    assert pace.seconds_until(200 * MS) <= 0
    pace.toggle()
    clock.time += 3600 * S
    assert pace.seconds_until(200 * MS) <= 0  # another message of that time
    assert pace.seconds_until(S) == math.inf
    assert pace.position() == 200 * MS
    pace.toggle()
    assert pace.seconds_until(S) == pytest.approx(0.4)


class HeldKey:
    """A keyboard whose right arrow is held down; each read takes its full timeout."""

    clock = 0

    def read(self, timeout):
        self.clock += round(timeout * 10**9)
        return RIGHT


@pytest.mark.parametrize('paused', [True, False])
def test_right_arrow_steps_only_while_paused(paused):
    keyboard, played = HeldKey(), []
    pace = Pace(0, 1.0, lambda: keyboard.clock)
    item = Item(10**9, LoggedMessage('/topic', 10**9, b'', 10**9))
    stop = threading.Event()
    assert play([item], [played.append], pace, keyboard, stop, print, paused=paused) == 1
    assert played == [item]
    assert (keyboard.clock < 10**9) == paused


def test_rate_changes_by_tenths_and_back():
    pace, clock = running()
    pace.seconds_until(10 * S)
    clock.time += S
    pace.change_rate(0.1)
    assert pace.rate == 1.1
    assert pace.seconds_until(10 * S) == pytest.approx(9 / 1.1)
    pace.change_rate(-0.1)
    assert pace.rate == 1.0
    pace.toggle()
    for _ in range(20):
        pace.change_rate(-0.1)
    assert (pace.rate, pace.paused) == (0.1, True)  # not 0, and it is still paused
    fast, _ = running(MAX_RATE)
    fast.change_rate(0.1)
    assert fast.rate == MAX_RATE


@given(st.lists(st.tuples(st.integers(0, 6), st.integers(0, 400 * MS)), max_size=60))
def test_position_never_goes_back(actions):
    pace, clock = running()
    expected, before = 0, 0
    pace.seconds_until(expected)
    keys = pace.toggle, lambda: pace.change_rate(0.1), lambda: pace.change_rate(-0.1), pace.step
    for action, nanoseconds in actions:
        clock.time += nanoseconds
        if action < len(keys):
            keys[action]()
        elif pace.seconds_until(expected) <= 0:
            expected += nanoseconds
            pace.seconds_until(expected)
        assert before <= pace.position() <= expected
        before = pace.position()
