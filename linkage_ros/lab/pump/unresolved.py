# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Motions that repeat, but that Newton's method does not find as Fourier series.

Examples are a crank that nearly stops in each period, and a dyad that stretches if the rod is not
longer than crank and coupler together.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from linkage_ros.numeric import Array

_PERIODS = 1, 2, 4  # turns
_REPEATS = 0.03  # largest relative difference of the speeds of two turns that count as equal
_SAME = 0.02  # largest relative difference of the mean speeds of two equal motions


def unresolved_motions(
    courses: Iterable[Array], known: Iterable[float], starts: int
) -> list[dict[str, Any]]:
    """Groups the motions that repeat after 1, 2 or 4 turns.

    Args:
        courses: For each motion without a known state, the mean speeds of its last turns, rad/s.
        known: Mean speeds of the known states, rad/s; a motion near one of them may be on its way.
        starts: Number of all starts.

    Returns:
        Records with the period in turns, the mean speed of the motion and of each turn of the
        period, rad/s, the slowest turn first, and the share of the starts.
    """
    found: list[dict[str, Any]] = []
    for speeds in filter(None, map(_period, courses)):
        period, mean = len(speeds), len(speeds) / sum(1 / speed for speed in speeds)
        same = [
            one for one in found
            if one['period'] == period and abs(mean / one['speed'] - 1) < _SAME
        ]  # fmt: skip
        if same:
            same[0]['share_of_starts'] += 1 / starts
        elif all(abs(mean / speed - 1) > _SAME for speed in known):
            found.append({
                'period': period, 'speed': mean, 'speeds': speeds, 'share_of_starts': 1 / starts,
            })  # fmt: skip
    return found


def unresolved_lines(motions: Iterable[dict[str, Any]], count: int) -> Iterator[str]:
    """Lines of text about the records of `unresolved_motions`; count: number of starts."""
    for motion in motions:
        turns = ', '.join(f'{speed:.2f}' for speed in motion['speeds'])
        yield (
            f'{motion["share_of_starts"]:.1%} of {count} starts settle at {motion["speed"]:.4g} '
            f'rad/s (period {motion["period"]}, turns of {turns} rad/s): Fourier series do not '
            'represent this motion, so its curve and multipliers are not known'
        )


def _period(speeds: Array) -> list[float]:
    """Returns the speeds of the turns of a period, the slowest first; empty without a period."""
    for period in _PERIODS:
        last, before = speeds[-2 * period :], speeds[-3 * period : -period]
        if len(speeds) >= 3 * period and np.abs(last / before - 1).max() < _REPEATS:
            turns = speeds[-period:]
            found: list[float] = np.roll(turns, -int(turns.argmin())).tolist()
            return found
    return []
