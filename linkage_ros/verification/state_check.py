# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Compares the states of a log with recomputed ones, in large batches."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from linkage_ros.errors import LinkageError, LogError
from linkage_ros.log.reader import LoggedMessage, LogReader
from linkage_ros.motion.drives import TorqueDrive
from linkage_ros.motion.segments import Segment, SpeedSegment, TorqueSegment
from linkage_ros.motion.speed_driven import SpeedMotion
from linkage_ros.run.simulator import Simulator
from linkage_ros.units import NS_PER_S
from linkage_ros.verification.row_comparison import RowComparison
from linkage_ros.verification.timeline import MotionPiece, Timeline, seconds
from linkage_ros.verification.torque_check import TorqueCheck
from linkage_ros.wire.rows import RowLayout
from linkage_ros.wire.topics import DIAGNOSTICS

Stamps: TypeAlias = npt.NDArray[np.int64]  # ns


class StateCheck:
    """Compares the states of one log.

    Attributes:
        states: Number of equal states so far.
    """

    def __init__(
        self, log: LogReader, simulator: Simulator, layout: RowLayout, comparison: RowComparison
    ) -> None:
        """Prepares a check.

        Args:
            log: The log.
            simulator: Recomputes the states.
            layout: Layout of the logged rows.
            comparison: Compares rows of this layout.

        Raises:
            LogError: The log lacks the configuration or the segments of its states.
        """
        places = {place.name: place for place in layout.places}
        if 'header.stamp.sec' not in places:
            raise LogError(f'{log.path} cannot be verified: none of its topics has stamps')
        if not log.motions:
            raise LogError(f'{log.path} cannot be verified: it has states but no motion record')
        self.states, self._simulator, self._layout = 0, simulator, layout
        self._comparison, self._timeline = comparison, Timeline(simulator, log.motions)
        self._stamp = [places[f'header.stamp.{unit}'] for unit in ('sec', 'nanosec')]
        # Whether every tick has a state, logged at its stamp. A run on simulated time may begin
        # at 0 as well.
        live = any(topic.type == DIAGNOSTICS.interface.name for topic in log.topics)
        self._recorded = not live and log.motions[0].stamp == 0
        drive, self._torque = simulator.configuration.drive, None
        if isinstance(drive, TorqueDrive):
            self._torque = TorqueCheck(simulator, drive, layout, recorded=self._recorded)

    @property
    def missed(self) -> int:
        """Ticks without a state so far."""
        return self._timeline.missed

    def add(self, rows: bytes) -> str:
        """Compares the next states.

        Args:
            rows: Their bytes.

        Returns:
            The first difference; empty if there is none.
        """
        wrong = ''
        while rows and not wrong:
            count, wrong = self._next(rows)
            self.states += count
            rows = rows[count * self._layout.size :]
        return wrong

    def hear(self, message: LoggedMessage) -> None:
        """Takes a message that is no state: no state depends on it."""

    def end(self) -> str:
        """Says what lacks behind the last state: nothing that is known."""
        return ''

    def _next(self, rows: bytes) -> tuple[int, str]:
        """Compares states at the beginning of rows.

        Returns:
            The number of equal states, and the error of one of them or of the next one.
        """
        whole, rest = (self._layout.column(rows, place).astype(np.int64) for place in self._stamp)
        stamps, difference = whole * NS_PER_S + rest, ''
        name = self._state(1, stamps[0])
        for piece, ticks in self._timeline.pieces_at(stamps):
            try:
                made = self._make(piece.segment, stamps[: len(ticks)].tolist(), rows)
            except LinkageError as error:
                return 0, f'{name} {error}'
            if count := self._comparison.equal(rows[: len(made)], made):
                return self._take(piece, ticks[:count], stamps[:count], rows)
            words = self._comparison.difference(rows, made)  # of the first row
            place = f'state {self.states + 1}, stamp {seconds(int(stamps[0]))}'
            difference = difference or f'{words}; {place}, in piece of motion {piece.number}'
        return 0, difference or f'{name} {self._timeline.why_none()}'

    def _make(self, segment: Segment, stamps: list[int], rows: bytes) -> bytearray:
        """Recomputes rows at stamps, with given log times; fewer if a stamp has no state.

        Raises:
            LinkageError: The first logged row does not describe a state.
            LogError: It belongs to another drive.
        """
        rows, ahead = rows[: len(stamps) * self._layout.size], None
        try:
            if isinstance(segment, SpeedSegment):
                motion = SpeedMotion(segment)
                coordinates = motion.at_all(stamps)
                ahead = self._simulator.ahead(motion, stamps)
            elif self._torque and isinstance(segment, TorqueSegment):
                coordinates = self._torque.coordinates(segment, rows)
            else:
                raise LogError('has a motion under a torque, the configuration a speed')
            times = self._layout.column(rows, self._layout.times)
            return self._simulator.rows(
                stamps, coordinates, ahead, times=times, layout=self._layout
            )
        except LinkageError:
            if len(stamps) == 1:
                raise
        return self._make(segment, stamps[: len(stamps) // 2], rows)

    def _take(
        self, piece: MotionPiece, ticks: list[int], stamps: Stamps, rows: bytes
    ) -> tuple[int, str]:
        """Checks states whose bytes are right, and advances.

        Returns:
            How many have the times of a record, if it is one, and, under a torque, follow from the
            state before them; what is wrong with the next one.
        """
        rows, number, wrong = rows[: len(ticks) * self._layout.size], len(ticks), ''
        if self._recorded:
            number, wrong = self._unlike_a_record(ticks, stamps, rows)
        if self._torque and isinstance(piece.segment, TorqueSegment) and not wrong:
            number, words = self._torque.follow(piece.segment, ticks, rows)
            wrong = words and f'{self._state(number + 1, stamps[number])} {words}'
        self._timeline.take(piece, ticks)
        return number, wrong

    def _state(self, number: int, stamp: int) -> str:
        """Describes a state by its number, counted from the last equal one."""
        return f'the stamp {seconds(int(stamp))} of state {self.states + number}'

    def _unlike_a_record(self, ticks: list[int], stamps: Stamps, rows: bytes) -> tuple[int, str]:
        """Counts states with the log times of a record; returns the error of the next one, too."""
        times = self._layout.column(rows, self._layout.times).astype(np.int64)
        lost = np.diff(ticks, prepend=self._timeline.tick) - 1
        wrong = (times != stamps) | (lost > 0)
        if not wrong.any():
            return len(ticks), ''
        i = int(wrong.argmax())
        words = f'was logged at {seconds(int(times[i]))}: a record has its stamp'
        if lost[i]:
            words = f'comes after {lost[i]} lost states: a record has every tick'
        return i, f'{self._state(i + 1, stamps[i])} {words}'
