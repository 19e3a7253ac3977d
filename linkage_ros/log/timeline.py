# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which piece of motion each logged stamp lies in, and which stamps cannot be right."""

from __future__ import annotations

from linkage_ros.run.machine import Machine
from linkage_ros.run.motion import CrankMotion
from linkage_ros.log.records import write_motion

_NS = 10**9
# Ticks enough to show whether a period is whole ns.
_MANY = 10**18


def seconds(stamp: int) -> str:
    """A stamp to the nanosecond, in seconds."""
    whole, rest = divmod(stamp, _NS)
    return f'{whole}.{rest:09d} s'


def check_begin(machine: Machine, motions: tuple[CrankMotion, ...]) -> str:
    """Compares the first piece of motion with the one that the configuration asks for.

    Args:
        machine: Of the configuration.
        motions: The logged pieces.

    Returns:
        What differs; empty if nothing does.
    """
    if not motions:
        return ''
    logged = write_motion(motions[0])
    asked = write_motion(machine.begin(motions[0].stamp))
    for name in ('phase', 'rpm', 'acceleration', 'speed'):
        if logged[name] != asked[name]:
            return (
                f'the first motion record has {name} = {logged[name]}, the configuration gives '
                f'{asked[name]}'
            )
    return ''


class Timeline:
    """Follows the stamps of a log in the order in which they were written.

    A piece of motion begins with a state: where rpm was set, on the next tick; where the clock
    was stepped, forward or back, on a grid of ticks of its own.

    Attributes:
        motion: The piece that the last stamp lies in.
        number: Which piece that is, from 1.
        missed: Ticks so far that have no state.
    """

    def __init__(self, machine: Machine, motions: tuple[CrankMotion, ...]) -> None:
        """Begins with the first piece.

        Args:
            machine: Knows the ticks.
            motions: All pieces, in order; at least one.
        """
        self._machine, self._motions = machine, motions
        self.motion, self.number, self.missed = motions[0], 1, 0
        self._anchor, self._tick = self.motion.stamp, -1
        self.last = self._anchor - 1
        # Which tick a clock step fell on is not logged. Ticks that are no whole ns apart may
        # then be rounded to either side.
        self._slack = 0

    def offset(self, stamp: int) -> int:
        """How far a stamp is behind the last tick at or before it, ns; 0 on a tick."""
        elapsed = stamp - self._anchor
        offset = elapsed - self._machine.elapsed(self._machine.tick_at(elapsed))
        return 0 if offset <= self._slack else offset

    def follows(self, stamp: int) -> bool:
        """Tells whether a stamp may lie in the piece of the one before it.

        Args:
            stamp: The next one, ns.

        Returns:
            Whether it is a later tick.
        """
        return stamp > self.last and not self.offset(stamp)

    def place(self, stamp: int) -> str:
        """Goes on to a stamp and the piece of motion that it should lie in.

        Args:
            stamp: The next one, ns.

        Returns:
            What is wrong with the stamp; empty if nothing is.
        """
        while self._is_next_due(stamp):
            self._begin_next()
        if stamp <= self.last:
            return f'is not after the one before it, {seconds(self.last)}'
        if offset := self.offset(stamp):
            rate = self._machine.configuration.session.rate_hz
            return f'is no tick of rate_hz = {rate:g}: {offset} ns late'
        self.take(stamp)
        return ''

    def take(self, stamp: int) -> None:
        """Counts a stamp as one of the piece it was found to lie in."""
        tick = self._machine.tick_at(stamp - self._anchor)
        self.missed += tick - self._tick - 1
        self._tick, self.last = tick, stamp

    def skip_to(self, stamp: int) -> bool:
        """Goes on to the next piece for a stamp that was placed already, if it can lie there.

        Where pieces overlap because the clock was set back, only the values tell which it is.

        Args:
            stamp: The one that was placed last, ns.

        Returns:
            Whether there is such a piece.
        """
        if self.number == len(self._motions) or self._motions[self.number].stamp > stamp:
            return False
        self._begin_next()
        self._tick, self.last = self._machine.tick_at(stamp - self._anchor), stamp
        return True

    def _is_next_due(self, stamp: int) -> bool:
        if self.number == len(self._motions):
            return False
        begin = self._motions[self.number].stamp
        # A clock that is to be set back later calls an earlier moment by a time gone by.
        goes_on = begin <= self.last < stamp and not self.offset(stamp)
        return begin <= stamp and not goes_on

    def _begin_next(self) -> None:
        self.motion = self._motions[self.number]
        self.number += 1
        begin = self.motion.stamp
        if begin <= self.last or self.offset(begin):
            self._anchor, self._tick = begin, -1
            self._slack = int(self._machine.elapsed(_MANY) != _MANY * self._machine.elapsed(1))
        self.last = min(self.last, begin - 1)
