# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which segment of motion each logged stamp lies in, and which stamps cannot be right."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from linkage_ros.motion.segments import Segment
from linkage_ros.run.simulator import Simulator
from linkage_ros.units import NS_PER_S


def seconds(stamp: int) -> str:
    """A stamp to the nanosecond, in seconds."""
    whole, rest = divmod(stamp, NS_PER_S)
    return f'{whole}.{rest:09d} s'


def moment(segment: Segment) -> int:
    """The start of a segment on the clock of the one before it."""
    return segment.stamp if segment.old_stamp is None else segment.old_stamp


@dataclass(frozen=True)
class MotionPiece:
    """A segment on the grid of ticks, which keeps its count when the clock is stepped.

    Attributes:
        segment: The segment.
        number: Which piece that is, from 1.
        anchor: Stamp of tick 0 on the clock as it stands, ns.
        end: First stamp that belongs to the next piece, on this piece's clock; None: it is last.
    """

    segment: Segment
    number: int
    anchor: int
    end: int | None


class Timeline:
    """Follows the stamps of a log in the order in which they were written.

    Attributes:
        piece: The piece that the last stamp lies in.
        missed: Ticks so far that have no state.
        last: The last stamp, ns; None: there was none.
        tick: Number of its tick; -1: there was none.
    """

    def __init__(self, simulator: Simulator, motions: tuple[Segment, ...]) -> None:
        """Begins with the first piece.

        Args:
            simulator: Knows the ticks.
            motions: All segments, in order; at least one.
        """
        self._simulator = simulator
        self._pieces: list[MotionPiece] = []
        anchor = motions[0].stamp
        for number, motion in enumerate(motions, 1):
            if motion.old_stamp is not None:
                anchor += motion.stamp - motion.old_stamp
            following = motions[number] if number < len(motions) else None
            end = None if following is None else moment(following)
            self._pieces.append(MotionPiece(motion, number, anchor, end))
        self.piece, self.missed = self._pieces[0], 0
        self.last: int | None = None
        self.tick = -1

    def late(self, stamp: int) -> int:
        """How far a stamp is behind the last tick at or before it, ns; 0 on a tick."""
        return self._late(self.piece, stamp)

    def pieces_at(self, stamp: int) -> Iterator[MotionPiece]:
        """The pieces that the next stamp may lie in, the likeliest first.

        It is a tick of theirs, later than the last one. Where clocks overlap because one was set
        back, only the values of the state tell which piece it is.

        Args:
            stamp: The next one, ns.

        Yields:
            The pieces, in order.
        """
        for piece in self._pieces[self.piece.number - 1 :]:
            if stamp < piece.segment.stamp or (piece.end is not None and stamp >= piece.end):
                continue
            if not self._late(piece, stamp) and self._tick_of(piece, stamp) > self.tick:
                yield piece

    def following(self, count: int) -> list[int]:
        """The stamps of the next ticks, as far as they lie in the same piece; at most so many."""
        anchor, end, first = self.piece.anchor, self.piece.end, self.tick + 1
        stamps = [anchor + self._simulator.elapsed(tick) for tick in range(first, first + count)]
        return [stamp for stamp in stamps if end is None or stamp < end]

    def advance(self, count: int, last: int) -> None:
        """Goes on by so many ticks, to a stamp, ns."""
        self.tick, self.last = self.tick + count, last

    def take(self, piece: MotionPiece, stamp: int) -> None:
        """Goes on to a stamp.

        Args:
            piece: From `pieces_at`.
            stamp: The next one, ns.
        """
        tick = self._tick_of(piece, stamp)
        self.missed += tick - self.tick - 1
        self.piece, self.tick, self.last = piece, tick, stamp

    def why_none(self, stamp: int) -> str:
        """What is wrong with a stamp that lies in no piece."""
        if self.last is not None and stamp <= self.last:
            return f'is not after the one before it, {seconds(self.last)}'
        if late := self.late(stamp):
            rate = self._simulator.configuration.session.rate_hz
            return f'is no tick of rate_hz = {rate:g}: {late} ns late'
        return 'lies in no piece of motion'

    def _tick_of(self, piece: MotionPiece, stamp: int) -> int:
        return self._simulator.tick_at(stamp - piece.anchor)

    def _late(self, piece: MotionPiece, stamp: int) -> int:
        elapsed = stamp - piece.anchor
        return elapsed - self._simulator.elapsed(self._simulator.tick_at(elapsed))
