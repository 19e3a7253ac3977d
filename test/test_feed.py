# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a replay plays of a log: pieces, rounds, reading ahead."""

from __future__ import annotations

import itertools
import threading
import time

import pytest

from linkage_ros.errors import LogError
from linkage_ros.log.reader import LogReader
from linkage_ros.parameters.configuration import configure
from linkage_ros.playback.excerpt import excerpt_of
from linkage_ros.playback.feed import feed
from linkage_ros.record import record

PERIOD = 5_000_000
STATES = ['/joint_states']


@pytest.fixture(scope='module')
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp('log') / 'run.mcap'
    record(configure({'rpm': 60.0}), path, duration=2.0)
    return path


@pytest.fixture
def log(path):
    with LogReader(path) as log:
        yield log


def taken(log, piece, loop=False, count=None):
    with feed(log, piece, loop=loop) as items:
        return list(itertools.islice(items, count))


def test_a_feed_is_the_messages_of_a_log_and_its_pieces_join(log):
    stored = list(log.messages())
    items = taken(log, excerpt_of(log, 0, None, None))
    assert [item.message for item in items] == stored
    assert [item.time for item in items] == [message.time for message in stored]
    parts = [taken(log, excerpt_of(log, at, 0.5, STATES)) for at in (0, 0.5, 1.0, 1.5)]
    assert [len(part) for part in parts] == [100] * 4
    assert list(itertools.chain(*parts)) == taken(log, excerpt_of(log, 0, None, STATES))


def test_a_piece_may_be_longer_than_the_log(log):
    assert excerpt_of(log, 0.5, 1e9, None) == excerpt_of(log, 0.5, None, None)
    assert excerpt_of(log, 0.5, None, None).end == 400 * PERIOD


def test_rounds_follow_each_other_at_one_period(log):
    piece = excerpt_of(log, 0.5, 0.25, STATES)
    items = taken(log, piece, loop=True, count=170)
    assert [item.time for item in items] == [(100 + n) * PERIOD for n in range(170)]
    first = [item.message for item in items[:50]]
    assert [item.message for item in items] == (4 * first)[:170]
    assert len({message.data for message in first}) == 50
    # To the end of the log as well: the last message has its period.
    end = taken(log, excerpt_of(log, 1.9, None, STATES), loop=True, count=45)
    assert [item.time for item in end] == [(380 + n) * PERIOD for n in range(45)]


def test_latched_messages_from_before_come_first_and_once(log):
    items = taken(log, excerpt_of(log, 1.5, 0.01, None), loop=True, count=13)
    names = [item.message.topic for item in items]
    assert names[0] == '/robot_description'
    assert names.count('/robot_description') == 1
    assert items[0].time == items[1].time == 300 * PERIOD
    assert '/robot_description' not in {
        item.message.topic for item in taken(log, excerpt_of(log, 1.5, 0.01, STATES))
    }


def test_a_loop_over_nothing_ends(log):
    assert len(taken(log, excerpt_of(log, 1.0, 0.5, ['/robot_description']), loop=True)) == 1


def test_it_reads_a_few_thousand_messages_ahead_and_no_more(log, monkeypatch):
    read, messages = [], log.messages
    monkeypatch.setattr(
        log, 'messages', lambda *part: (read.append(1) or message for message in messages(*part))
    )
    with feed(log, excerpt_of(log, 0, None, None), loop=True) as items:
        next(items)
        before = -1
        while before != (before := len(read)):
            time.sleep(0.2)
        assert 1000 < len(read) < 10_000
        assert len(list(itertools.islice(items, 10_000))) == 10_000
        assert len(read) > 10_000
    assert 'reader' not in {thread.name for thread in threading.enumerate()}


def test_damage_is_raised_where_items_are_taken(path, tmp_path):
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 0xFF
    damaged = tmp_path / 'damaged.mcap'
    damaged.write_bytes(data)
    with LogReader(damaged) as log, pytest.raises(LogError, match='damaged'):
        taken(log, excerpt_of(log, 0, None, None))
