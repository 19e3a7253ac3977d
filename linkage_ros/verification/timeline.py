# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Finds the segment of motion of each logged stamp, and stamps that cannot be right."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from linkage_ros.motion.segments import Segment
from linkage_ros.run.simulator import Simulator
from linkage_ros.units import NS_PER_S, TIME_END


def seconds(stamp: int) -> str:
    """A stamp to the nanosecond, in seconds."""
    whole, rest = divmod(stamp, NS_PER_S)
    return f'{whole}.{rest:09d} s'


def moment(segment: Segment) -> int:
    """The start of a segment on the clock of the one before it."""
    return segment.stamp if segment.old_stamp is None else segment.old_stamp


@dataclass(frozen=True)
class MotionPiece:
    """A segment on the grid of ticks; a step of the clock does not change the count of ticks.

    Attributes:
        segment: The segment.
        number: Number of the piece, from 1.
        anchor: Stamp of tick 0 on the clock of the piece, ns.
        end: First stamp of the next piece, on this piece's clock.
    """

    segment: Segment
    number: int
    anchor: int
    end: int


class Timeline:
    """Follows the stamps of a log in the order in which they were written.

    Attributes:
        piece: The piece that the last stamp lies in.
        missed: Ticks so far that have no state.
        tick: Number of its tick; -1: there was none.
    """

    def __init__(self, simulator: Simulator, motions: tuple[Segment, ...]) -> None:
        """Begins with the first piece.

        Args:
            simulator: Knows the ticks.
            motions: All segments, in order; at least one.
        """
        self._simulator, self._pieces = simulator, list[MotionPiece]()
        anchor, ends = motions[0].stamp, [*map(moment, motions[1:]), TIME_END]
        for number, (motion, end) in enumerate(zip(motions, ends, strict=True), 1):
            anchor += motion.stamp - moment(motion)
            self._pieces.append(MotionPiece(motion, number, anchor, end))
        self.piece, self.missed, self.tick = self._pieces[0], 0, -1

    def pieces_at(self, stamps: npt.NDArray[np.int64]) -> Iterator[tuple[MotionPiece, list[int]]]:
        """The pieces that may contain the next stamps, the likeliest first.

        Where clocks overlap because one was set back, only the values of the states decide.

        Args:
            stamps: The next ones, ns; at least one.

        Yields:
            A piece, and the increasing ticks of all leading stamps that fit it.
        """
        for piece in self._pieces[self.piece.number - 1 :]:
            if piece.segment.stamp <= stamps[0] < piece.end:
                elapsed = stamps.astype(object) - piece.anchor
                ticks = self._simulator.tick_at(elapsed)
                off = self._simulator.elapsed(ticks) != elapsed
                back = np.diff(ticks, prepend=self.tick) <= 0
                wrong = off | back | (stamps < piece.segment.stamp) | (stamps >= piece.end)
                count = int(wrong.argmax()) if wrong.any() else len(stamps)
                if count:
                    yield piece, ticks[:count].tolist()

    def take(self, piece: MotionPiece, ticks: list[int]) -> None:
        """Advances by some states.

        Args:
            piece: From `pieces_at`.
            ticks: Their ticks.
        """
        self.missed += ticks[-1] - self.tick - len(ticks)
        self.piece, self.tick = piece, ticks[-1]

    def why_none(self) -> str:
        """Describes the error of a stamp outside all pieces."""
        rate = self._simulator.configuration.session.rate_hz
        return f'is no tick of rate_hz = {rate:g} that is later than the one before it'
