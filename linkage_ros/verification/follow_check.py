# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Checks the states of a log with a measured crank against its measurements."""

from __future__ import annotations

from collections import deque
from contextlib import suppress

from linkage_ros.errors import LinkageError
from linkage_ros.log.reader import LoggedMessage
from linkage_ros.motion.coordinates import Coordinates
from linkage_ros.run.measured_crank import MeasuredCrank
from linkage_ros.run.simulator import Simulator
from linkage_ros.verification.row_comparison import RowComparison
from linkage_ros.verification.timeline import seconds
from linkage_ros.wire.rows import RowLayout


class FollowCheck:
    """Compares the states of one log with those recomputed from its measurements.

    Attributes:
        states: Number of equal states so far.
        missed: Always 0: there are no ticks.
    """

    def __init__(
        self, simulator: Simulator, layout: RowLayout, comparison: RowComparison, topic: str
    ) -> None:
        """Prepares a check.

        Args:
            simulator: Recomputes the states.
            layout: Layout of the logged rows.
            comparison: Compares rows of this layout.
            topic: Name of the channel with the measurements.
        """
        self.states, self.missed = 0, 0
        self._simulator, self._layout, self._comparison = simulator, layout, comparison
        self._topic, self._crank = topic, MeasuredCrank(simulator)
        self._asked: deque[tuple[int, Coordinates]] = deque()

    def hear(self, message: LoggedMessage) -> None:
        """Takes a message that is not a state, in the order of writing."""
        if message.topic == self._topic:
            with suppress(ValueError):  # the node rejected it as well
                self._asked.append(self._crank.read(message.data, message.time))

    def add(self, rows: bytes) -> str:
        """Compares the next states.

        Args:
            rows: Their bytes.

        Returns:
            The first difference; empty if there is none.
        """
        size = self._layout.size
        for start in range(0, len(rows), size):
            row = rows[start : start + size]
            if not self._asked:
                return f'state {self.states + 1} answers no measurement on {self._topic}'
            stamp, coordinates = self._asked.popleft()
            name = f'state {self.states + 1}, the answer of {seconds(stamp)}'
            try:
                snapshot = self._simulator.snapshot_measured(stamp, coordinates)
            except LinkageError as error:
                return f'{name}: {error}'
            (time,) = self._layout.column(row, self._layout.times).tolist()
            made = bytearray(snapshot._replace(layout=self._layout).row(time))
            if not self._comparison.equal(row, made):
                return f'{name}: {self._comparison.difference(row, made)}'
            self.states += 1
        return ''

    def end(self) -> str:
        """Reports measurements without an answer; empty if there are none."""
        if not self._asked:
            return ''
        stamp, _ = self._asked[0]
        return f'the measurement of {seconds(stamp)} on {self._topic} has no answer'
