# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The states of a log beside those that the same machine makes, thousands at a time.

Most states are those of the next ticks of the motion in force. Where they are not, one state is
looked into: ticks may be missing, the motion may have changed, or it is the first difference.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from linkage_ros.errors import LinkageError, LogError
from linkage_ros.motion.segments import Segment, SpeedSegment
from linkage_ros.motion.speed_driven import SpeedMotion
from linkage_ros.run.simulator import Simulator
from linkage_ros.run.ticker import CLOCK_STEP
from linkage_ros.units import NS_PER_S
from linkage_ros.verification.row_comparison import RowComparison
from linkage_ros.verification.timeline import MotionPiece, Timeline, seconds
from linkage_ros.verification.torque_check import TorqueCheck
from linkage_ros.wire.rows import RowLayout


class StateCheck:
    """Compares the states of one log.

    Attributes:
        states: Found equal so far.
        comparison: Compares their bytes.
        timeline: Where the last state is.
    """

    def __init__(
        self,
        simulator: Simulator,
        layout: RowLayout,
        comparison: RowComparison,
        timeline: Timeline,
        torque: TorqueCheck | None,
        *,
        recorded: bool,
    ) -> None:
        """Prepares a check.

        Args:
            simulator: Recomputes the states.
            layout: Layout of the logged rows; at least one message has a stamp.
            comparison: Compares rows of this layout.
            timeline: Timeline of the log.
            torque: Recomputes a torque-driven motion; None: the speed is given.
            recorded: Whether every tick has a state, logged at its stamp.
        """
        self.states, self.comparison = 0, comparison
        self.timeline, self._simulator, self._layout = timeline, simulator, layout
        self._torque, self._recorded = torque, recorded
        self._stamp = [
            next(place for place in layout.places if place.name == f'header.stamp.{unit}')
            for unit in ('sec', 'nanosec')
        ]
        self._motion: SpeedMotion | None = None
        # What is wrong with the log time of the last state, unless the clock was set back there.
        self._fell, self._latest = '', 0
        self._piece_before = timeline.piece

    @property
    def missed(self) -> int:
        """Ticks without a state so far."""
        return self.timeline.missed

    def end(self) -> str:
        """Nothing is left to compare."""
        return ''

    def add(self, rows: bytes) -> str:
        """Compares the next states.

        Args:
            rows: Their bytes.

        Returns:
            The first difference; empty if there is none.
        """
        size, at, window = self._layout.size, 0, len(rows)
        while at < len(rows):
            part = rows[at : at + window]
            equal = part[: self._run(part) * size]
            if equal and (wrong := self._take(equal, self._stamps(equal))):
                return wrong
            at, window = at + len(equal), 8 * window
            if len(equal) < len(part):
                if wrong := self._resume(rows[at : at + size]):
                    return wrong
                at, window = at + size, size  # where ticks are missing, more may be
        return ''

    def _run(self, rows: bytes) -> int:
        """Compares states with those of the next ticks; returns how many are equal."""
        stamps = self._stamps(rows)
        due = self.timeline.following(len(stamps))
        count = _in_common(stamps, due)
        part = rows[: count * self._layout.size]
        try:
            made = self._make(self.timeline.piece.segment, stamps[:count], part)
        except LinkageError:
            return 0  # one of them is not a state
        count = self.comparison.equal(part, made) if count else 0
        if count:
            self.timeline.advance(count, stamps[count - 1])
        return count

    def _stamps(self, rows: bytes) -> list[int]:
        whole, rest = (self._layout.column(rows, place).astype(np.int64) for place in self._stamp)
        stamps: list[int] = (whole * NS_PER_S + rest).tolist()
        return stamps

    def _times(self, rows: bytes) -> npt.NDArray[np.int64]:
        return self._layout.column(rows, self._layout.times).astype(np.int64)

    def _make(self, segment: Segment, stamps: list[int], rows: bytes) -> bytearray:
        """The rows of stamps, with the log times of others.

        Raises:
            LogError: What is logged describes no state.
        """
        if not stamps:
            return bytearray()
        ahead = None
        if isinstance(segment, SpeedSegment):
            if self._motion is None or self._motion.segment is not segment:
                self._motion = SpeedMotion(segment)
            coordinates = self._motion.at_all(stamps)
            ahead = self._simulator.ahead(self._motion, stamps)
        elif self._torque:
            coordinates = self._torque.coordinates(rows)
        else:
            raise LogError('has a motion under a torque, the configuration a speed')
        times = self._layout.column(rows, self._layout.times)
        return self._simulator.rows(stamps, coordinates, ahead, times=times, layout=self._layout)

    def _resume(self, row: bytes) -> str:
        """Compares a state that is not that of the next tick."""
        (stamp,) = self._stamps(row)
        likeliest: tuple[MotionPiece, bytearray] | None = None
        for piece in self.timeline.pieces_at(stamp):
            try:
                made = self._make(piece.segment, [stamp], row)
            except LinkageError as error:
                return f'{self._state(stamp)} {error}'
            if self.comparison.equal(row, made):
                self.timeline.take(piece, stamp)
                return self._take(row, [stamp])
            likeliest = likeliest or (piece, made)
        if likeliest is None:
            return f'{self._state(stamp)} {self.timeline.why_none(stamp)}'
        piece, made = likeliest
        words = self.comparison.difference(row, made)
        where = f'state {self.states + 1}, stamp {seconds(stamp)}'
        return f'{words}; {where}, in piece of motion {piece.number}'

    def _state(self, stamp: int) -> str:
        return f'the stamp {seconds(stamp)} of state {self.states + 1}'

    def _take(self, rows: bytes, stamps: Sequence[int]) -> str:
        """Goes on behind states whose bytes are right.

        Returns:
            What is wrong with their times or, under a torque, with what they follow from.
        """
        times = self._times(rows)
        number, wrong = self._mistimed(times, stamps)
        if self._torque and not wrong:
            first = self.timeline.tick - len(stamps) + 1
            number, wrong = self._torque.follow(first, rows)
        self.states += number
        return f'{self._state(stamps[number])} {wrong}' if wrong else ''

    def _mistimed(self, times: npt.NDArray[np.int64], stamps: Sequence[int]) -> tuple[int, str]:
        """How many log times are right, and what is wrong with the next one."""
        if self._recorded:
            return self._unlike_a_record(times, stamps)
        piece, self._piece_before = self._piece_before, self.timeline.piece
        fell, self._fell = self._fell, ''
        if piece is not self._piece_before and self._piece_before.segment.old_stamp is not None:
            # The clock may have been set back between the stamp of a state and its log time.
            self._latest, fell = int(times[0]), ''
        latest = np.maximum.accumulate([self._latest, *times.tolist()])
        self._latest = int(latest[-1])
        early = np.flatnonzero(times < latest[1:] - 2 * CLOCK_STEP)
        if fell or not len(early):
            return (0, fell) if fell else (len(times), '')
        place = int(early[0])
        words = f'was logged at {seconds(int(times[place]))}, before states that it follows'
        if place < len(times) - 1:
            return place, words
        self._fell = words
        return len(times), ''

    def _unlike_a_record(
        self, times: npt.NDArray[np.int64], stamps: Sequence[int]
    ) -> tuple[int, str]:
        if missed := self.timeline.missed:
            return 0, f'comes after {missed} lost states: a record has every tick'
        wrong = np.flatnonzero(times != np.array(stamps))
        if not len(wrong):
            return len(times), ''
        place = int(wrong[0])
        return place, f'was logged at {seconds(int(times[place]))}: a record has its stamp'


def _in_common(found: Sequence[int], due: Sequence[int]) -> int:
    """How many numbers at the beginning of two sequences are equal."""
    pairs = zip(found, due, strict=False)
    return next((i for i, (a, b) in enumerate(pairs) if a != b), min(len(found), len(due)))
