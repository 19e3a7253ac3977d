# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a wind pump settles at, from many starts: every end is explained by a state, or counted."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from linkage_ros.lab.pump.harmonic_balance import HarmonicBalance, at_torque
from linkage_ros.lab.pump.motions import TURN, Course, Motions
from linkage_ros.lab.pump.periodic_motion import PeriodicMotion
from linkage_ros.motion.drives import Motor

_STEPS, _BLOCKS = 250, 5  # between two looks where the motions are; a turn takes some 15
_BACK = 100  # steps ago from which a motion must have come nearer
_NEAR = 0.05  # of crank length and speed: a motion so near to a state has settled there
_COMING, _NEARER = 0.5, 0.9  # or as near as this, and that much nearer than before
_LED = 2.0  # or as near as this to a state that Newton's method finds from its last turns
_ASKED = 6  # motions whose state is asked for at one look; at the last, failures to find one
_PERIODS = 8  # turns after which a motion may repeat
_REPEATS = 0.02  # of a motion's spread: difference of two turns of a motion that repeats
_GUESSES = 1, 2, 4  # turns, of a motion that has not yet settled


class Search:
    """Motions from many starts, and the stable states at which they settle.

    Attributes:
        motions: The motions.
        states: The stable states that are known.
        belongs: The number of the state at which each motion settles, or -1.
    """

    def __init__(
        self, balance: HarmonicBalance, motor: Motor, motions: Motions,
        states: Iterable[PeriodicMotion] = (),
    ) -> None:  # fmt: skip
        """Begins with the states that are known."""
        self._balance, self._motor = balance, motor
        self.motions, self.states = motions, list(states)
        self.belongs: Any = np.full(len(motions.ended), -1)

    def run(self, progress: Callable[[Iterable[Any], str], Any], blocks: int = _BLOCKS) -> None:
        """Follows the motions until all have settled or ended, for a bounded time."""
        for block in progress(range(blocks), 'motions'):
            self.motions.advance(_STEPS)
            self._assign()
            rest = np.flatnonzero(self.unidentified)
            apart = 1 if block == blocks - 1 else max(len(rest) // _ASKED, 1)
            failures = 0
            for number in rest[::apart].tolist():
                if self.unidentified[number] and failures < _ASKED:
                    failures += not self._identify(number)
            if not self.unidentified.any():
                return

    @property
    def unidentified(self) -> Any:
        """Whether each motion neither ended nor settled at a state."""
        return (self.belongs < 0) & ~self.motions.ended

    def _assign(self) -> None:
        now, before = self.motions.rows(0), self.motions.rows(_BACK)
        for number, state in enumerate(self.states):
            away, was = state.distance(now), state.distance(before)
            near = (away < _NEAR) | ((away < _COMING) & (away < _NEARER * was))
            self.belongs[near & ~self.motions.ended] = number

    def _identify(self, number: int) -> bool:
        """Finds the state to which a motion leads, by Newton's method, and adds it if it is new.

        Returns:
            Whether one is found.
        """
        course = self.motions.course(number)
        if course is None:
            return False
        for turns in _periods(course):
            equations = self._balance.over(turns)
            first = TURN * math.floor(course.angles[-1] / TURN - turns)
            if first < course.angles[0]:
                break
            _, x, w, _ = course.at(first + equations.angles).T
            torque = self._motor.torque
            state = equations.find(equations.fit(x, w, torque), at_torque(torque))
            if state and state.stable and not state.repeats_sooner:
                self._add(state, number)
                return True
        return False

    def _add(self, state: PeriodicMotion, number: int) -> None:
        """Notes that a motion leads to a state."""
        same = [i for i, known in enumerate(self.states) if state.is_same(known)]
        if not same:
            same = [len(self.states)]
            self.states.append(state)
            self._assign()
        if state.distance(self.motions.rows(0)[:, :, number : number + 1]) < _LED:
            self.belongs[number] = same[0]


def _periods(course: Course) -> Iterable[int]:
    """The turns after which a motion may repeat: the least after which it does, then guesses."""
    end, start = course.angles[-1], course.angles[0]
    back = np.arange(min(int((end - start) / TURN), 2 * _PERIODS))
    points = course.at(end - TURN * back)[:, 1:]
    spread = np.ptp(course.values[:, 1:], axis=0)
    repeats = (
        turns
        for turns in range(1, len(points) // 2 + 1)
        if (np.abs(points[turns:] - points[:-turns])[:turns] < _REPEATS * spread).all()
    )
    return dict.fromkeys((*itertools.islice(repeats, 1), *_GUESSES))
