# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Motions that stretch the dyad in every period, and so alternate between the assemblies."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from linkage_ros.numeric import Array

_PERIODS = 1, 2, 4  # turns
_REPEATS = 0.03  # largest relative difference of the speeds of two turns that count as equal
_SAME = 0.02  # largest relative difference of the mean speeds of two equal motions


def alternating_motions(courses: Iterable[Array], starts: int) -> list[dict[str, Any]]:
    """Groups the motions that repeat after 1, 2 or 4 turns.

    Args:
        courses: For each motion that alternates between the assemblies, the mean speeds of its
            last turns, rad/s.
        starts: Number of all starts.

    Returns:
        Records with the period in turns, the mean speed of the motion and of each turn of the
        period, rad/s, the slowest turn first, and the share of the starts.
    """
    found: list[dict[str, Any]] = []
    for speeds in filter(None, map(_period, courses)):
        period, mean = len(speeds), len(speeds) / sum(1 / speed for speed in speeds)
        for known in found:
            if known['period'] == period and abs(mean / known['speed'] - 1) < _SAME:
                known['share_of_starts'] += 1 / starts
                break
        else:
            found.append({
                'period': period, 'speed': mean, 'speeds': speeds, 'share_of_starts': 1 / starts,
            })  # fmt: skip
    return found


def alternating_lines(motions: Iterable[dict[str, Any]], count: int) -> Iterator[str]:
    """Lines of text about the records of `alternating_motions`; count: number of starts."""
    for motion in motions:
        turns = ', '.join(f'{speed:.2f}' for speed in motion['speeds'])
        yield (
            f'{motion["share_of_starts"]:.1%} of {count} starts alternate between the assemblies '
            f'at {motion["speed"]:.4g} rad/s (period {motion["period"]}, turns of {turns} rad/s): '
            'this motion stretches the dyad, so its curve and multipliers are not known'
        )


def _period(speeds: Array) -> list[float]:
    """The speeds of the turns of one period, the slowest first; empty if there is no period."""
    for period in _PERIODS:
        last, before = speeds[-2 * period :], speeds[-3 * period : -period]
        if len(speeds) >= 3 * period and np.abs(last / before - 1).max() < _REPEATS:
            turns = speeds[-period:]
            found: list[float] = np.roll(turns, -int(turns.argmin())).tolist()
            return found
    return []
