# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Health of a run: which reports warn, and which of them are logged."""

import itertools
import random
from itertools import pairwise

import pytest

from linkage_ros.messages.cdr import ERROR, OK, WARN
from linkage_ros.node import health
from linkage_ros.node.health import Health, HealthMonitor
from linkage_ros.node.ticker import TickCounts

TICKS = 200  # per second
STEPPED = 'the clock was stepped by +0.000 s in the last 10 s'


@pytest.fixture(autouse=True)
def seconds_pass(monkeypatch):
    """Makes every reading of the clock a second later than the last."""
    monkeypatch.setattr(health.time, 'monotonic', itertools.count().__next__)


def motion(missed, steps=None):
    """Returns the level of each report and the logged lines, for missed ticks per second."""
    monitor, counts = HealthMonitor('node'), TickCounts()
    levels, lines = [], []
    for now, stepped in itertools.zip_longest(missed, steps or [], fillvalue=0):
        counts.missed += now
        counts.kept += TICKS - now
        counts.clock_steps += stepped
        statuses = monitor.report(counts, {}, {}, [])
        levels.append(statuses[0].level)
        lines += [(status.level, status.message) for status in monitor.changes(statuses)]
    return levels, lines


def bursts(share, seconds, seed=7):
    """Returns missed ticks per second that average to a share, in bursts, as under load."""
    chance = random.Random(seed)
    return [12 * sum(chance.random() < share for _ in range(TICKS // 12)) for _ in range(seconds)]


@pytest.mark.parametrize(
    'missed',
    [
        [1] * 30,
        [0, 0, 60, 0, 0, 0, 0] * 5,  # a third of a second, occasionally
        [200, *[0] * 20],  # while the node starts
        bursts(0.03, 300),
    ],
    ids=['one each second', 'a pause now and then', 'at the start', '3 % in bursts'],
)
def test_few_missed_ticks_cause_no_warning(missed):
    assert motion(missed) == ([OK] * len(missed), [])


def test_overload_is_reported_once_and_its_end_once():
    missed = [0] * 10 + [40, 80, 30, 50] * 10 + [0] * 20
    levels, lines = motion(missed)
    assert lines == [(WARN, health._BUSY), (OK, f'192.0 Hz kept; before: {health._BUSY}')]
    changes = [later for earlier, later in pairwise(levels) if later != earlier]
    assert changes == [WARN, OK]


def test_warning_begins_after_some_seconds():
    levels, _ = motion([100] * 12)
    assert levels == [OK] * 9 + [WARN] * 3


PAUSES = [[TICKS // 2 * (second % every == 0) for second in range(60)] for every in (1, 2, 3, 5)]


@pytest.mark.parametrize('missed', [bursts(0.05, 1800), bursts(0.10, 1800), *PAUSES])
def test_share_near_a_limit_and_regular_pauses_do_not_toggle_the_warning(missed):
    levels, lines = motion(missed)
    lasting = [len(list(group)) for _, group in itertools.groupby(levels)]
    assert min(lasting[1:-1], default=3) >= 3
    assert len(lines) < len(missed) / 30


def test_a_clock_step_hides_no_overload():
    _, lines = motion([100] * 30, [0] * 12 + [1])
    (_, busy), (_, both), (_, after) = lines
    assert busy == after == health._BUSY
    assert both == f'{STEPPED}; {health._BUSY}'


def test_the_rate_is_that_of_the_last_seconds():
    monitor, counts = HealthMonitor('node'), TickCounts()
    rates = []
    for kept in (50, *[200] * 10):
        counts.kept += kept
        (status,) = monitor.report(counts, {}, {}, [])
        rates.append(status.values['rate kept, Hz'])
    assert (rates[:2], rates[-2:]) == (['50.00', '125.00'], ['185.00', '200.00'])


def test_the_rate_begins_with_the_first_tick():
    monitor, counts = HealthMonitor('node'), TickCounts()
    rates = []
    for now in range(1, 30):
        counts.start, counts.kept = (0.0, 0) if now < 15 else (14.5, 1 + int(TICKS * (now - 14.5)))
        (status,) = monitor.report(counts, {}, {}, [])
        rates.append(status.message)
    assert rates == ['0.0 Hz kept'] * 14 + ['200.0 Hz kept'] * 15


# ---------------------------------------------------------------- log and viewer


LAGS = 'the viewer is too slow: items were lost in the last 10 s'


def viewer(*parts):
    """Returns the lines logged for successive reports of a viewer's health."""
    monitor, lines = HealthMonitor('node'), []
    for part in parts:
        statuses = monitor.report(TickCounts(), {}, {'viewer': part}, [])
        lines.append([status.message for status in monitor.changes(statuses)])
    return lines


def test_lagging_part_is_reported_once_and_recovers_after_seconds():
    found = viewer(Health('x'), Health('x', 3), Health('x', 3), *[Health('x', 7)] * 12)
    assert found == [[], [LAGS], *[[]] * 11, [f'ok, but items were lost: 7; before: {LAGS}'], []]


def test_losses_while_a_viewer_is_absent_are_not_reported_as_lag():
    gone, back = Health('x', 3, trouble='gone'), Health('x', 7)
    well = 'ok, but items were lost: 7; before: gone'
    assert viewer(gone, *[back] * 12) == [['gone'], [well], *[[]] * 11]
    assert viewer(gone, *[back] * 12, Health('x', 9))[-1] == [LAGS]


@pytest.mark.parametrize(
    ('part', 'level', 'words'),
    [(Health('x', 1, OSError('gone')), ERROR, 'failed: gone'), (Health(''), OK, 'off')],
)
def test_failure_of_a_part_is_an_error_that_the_part_itself_logs(part, level, words):
    assert viewer(part) == [[]]
    _, status = HealthMonitor('node').report(TickCounts(), {}, {'log': part}, [])
    assert (status.level, status.message) == (level, words)
