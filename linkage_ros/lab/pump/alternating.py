# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Motions that alternate between the assemblies, but are not found as Fourier series.

An example is a motion whose crank nearly stops in each period.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from linkage_ros.numeric import Array

_PERIODS = 1, 2, 4  # turns
_TURNS = 16  # last turns, all of which must repeat: a slowing motion repeats for a few turns
# Largest relative differences of the speeds of turns that repeat, and of the means of two halves.
_REPEATS, _DRIFT = 0.015, 0.001
_LEAST = 0.02  # smallest share of the starts; fewer starts may only seem to repeat
# Largest relative differences in mean speed: of two equal motions, of one on its way to a state.
_SAME, _ON_ITS_WAY = 0.005, 0.02


def alternating_motions(
    courses: Iterable[Array], known: Iterable[float], starts: int
) -> list[dict[str, Any]]:
    """Groups the motions that repeat after 1, 2 or 4 turns.

    Args:
        courses: For each alternating motion without a known state, the mean speeds of its last
            turns, rad/s.
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
        elif all(abs(mean / speed - 1) > _ON_ITS_WAY for speed in known):
            found.append({
                'period': period, 'speed': mean, 'speeds': speeds, 'share_of_starts': 1 / starts,
            })  # fmt: skip
    return [one for one in found if one['share_of_starts'] >= _LEAST]


def alternating_lines(motions: Iterable[dict[str, Any]], count: int) -> Iterator[str]:
    """Lines of text about the records of `alternating_motions`; count: number of starts."""
    for motion in motions:
        turns = ', '.join(f'{speed:.2f}' for speed in motion['speeds'])
        yield (
            f'{motion["share_of_starts"]:.1%} of {count} starts alternate between the assemblies '
            f'at {motion["speed"]:.4g} rad/s (period {motion["period"]}, turns of {turns} rad/s): '
            'no Fourier series was found for it, so its curve and multipliers are not known'
        )


def _period(speeds: Array) -> list[float]:
    """Returns the speeds of the turns of a period, the slowest first; empty without a period."""
    last = speeds[-_TURNS:]
    for period in _PERIODS:
        turns = last[-period:]
        if len(last) < _TURNS:
            break
        early, late = last.reshape(2, -1).mean(axis=1)
        repeats = np.abs(last.reshape(-1, period) / turns - 1).max() < _REPEATS
        if repeats and abs(early / late - 1) < _DRIFT:
            found: list[float] = np.roll(turns, -int(turns.argmin())).tolist()
            return found
    return []
