# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""States that a log must contain according to its segments of motion or its measurements.

A step of the clock starts a new segment, but tick numbers continue.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import suppress
from itertools import accumulate, takewhile
from typing import Any, ClassVar, cast

import numpy as np
import numpy.typing as npt

from linkage_ros.errors import MotionError
from linkage_ros.log.logged_forces import Forces
from linkage_ros.log.reader import LoggedMessage, LogReader
from linkage_ros.log.rows import RowLayout
from linkage_ros.mechanism.conditions import Conditions
from linkage_ros.messages.topics import (
    DIAGNOSTICS,
    JOINT_STATES,
    MEASURED_JOINT_STATES,
    MECHANISM_STATE,
    POINTS,
    Topic,
)
from linkage_ros.motion.drives.follow import MeasuredCrank
from linkage_ros.motion.segments import Coordinates, Segment
from linkage_ros.run.states import Simulator
from linkage_ros.units import TIME_END


def _moment(segment: Segment) -> int:
    """Returns the start of a segment on the clock of the previous segment, ns."""
    return segment.stamp if segment.old_stamp is None else segment.old_stamp


def check_motions(simulator: Simulator, motions: tuple[Segment, ...]) -> str:
    """Checks that each segment follows from the configuration and from the previous segment.

    The time of a change and the new rpm, torque, gravity or clock are user inputs, which are not
    checked.

    Args:
        simulator: Simulator of the logged configuration.
        motions: The logged segments.

    Returns:
        Description of the first difference; empty if there is none.
    """
    past: Segment | None = None
    for number, logged in enumerate(motions, 1):
        due, motion = logged, past.motion() if past else None
        if past and logged.motion() and _moment(logged) < past.stamp:
            return f'motion record {number} starts before the previous one'
        if past is None and not simulator.configuration.drive.is_measured:
            due = simulator.begin(logged.stamp).segment
        elif motion:
            try:
                due = motion.next_segment(logged)
            except MotionError as error:
                return f'motion record {number}: {error}'
        for name, value in reversed(vars(due).items()):  # compare values set by users first
            if (found := vars(logged).get(name)) != value:
                return f'motion record {number} has {name} = {found}, recomputed {value}'
        past = logged
    return ''


class ExpectedStates(ABC):
    """The states that a log must contain, in order.

    Attributes:
        needed: Topics of which the log must have one, or another one of the same type.
        needs_motion: Whether the log must have a segment of motion.
        missed: Number of ticks so far without a state.
        is_record: Whether linkage_record wrote the log, so that every tick has a state.
    """

    needed: ClassVar[tuple[Topic, ...]] = MECHANISM_STATE, JOINT_STATES, POINTS
    needs_motion: ClassVar[bool] = True
    missed, is_record = 0, False

    def handle(self, message: LoggedMessage) -> None:  # noqa: B027, most ignore it
        """Handles a message that is not part of a state; called in the order of writing."""

    @abstractmethod
    def cross_gap(self) -> bool:
        """Prepares for the states after missing messages; returns whether they can be compared."""

    @abstractmethod
    def fitting(self, stamps: npt.NDArray[np.int64]) -> Iterator[tuple[int, list[int]]]:
        """Finds the segments that may contain the next stamps, starting with the current one.

        If the clock was set back, segments may overlap. The caller must then compare the states to
        find the right one.

        Args:
            stamps: The next stamps, ns; at least one.

        Yields:
            Index of a segment, and the ticks of all leading stamps that fit the segment.
        """

    @abstractmethod
    def coordinates(
        self, number: int, stamps: list[int], rows: bytes, forces: Forces
    ) -> tuple[Coordinates, Coordinates | None]:
        """Computes the coordinates of states.

        Args:
            number: Index of the states' segment.
            stamps: Stamps of the states, ns.
            rows: Logged rows of the states.
            forces: Forces of live loads, by name.

        Returns:
            The coordinates, and those for the feed-forward torque or None.

        Raises:
            LinkageError: A stamp has no state, or the messages give an invalid motion.
        """

    def elapsed(self, _number: int, stamps: list[int]) -> list[int]:
        """Returns the times of states of a segment, ns, which a step of the clock does not change.

        They determine when messages expire.
        """
        return stamps

    @abstractmethod
    def take(self, number: int, ticks: list[int]) -> tuple[int, str]:
        """Advances past states whose messages are equal.

        Args:
            number: Index of the states' segment.
            ticks: Ticks of the states.

        Returns:
            The number of states consistent with their predecessors, and the error of the next
            state, empty if all are consistent.
        """


class TickStates(ExpectedStates):
    """States at the ticks of the logged segments."""

    def __init__(self, simulator: Simulator, log: LogReader, layout: RowLayout) -> None:
        """Starts with the first segment.

        Args:
            simulator: Simulator of the logged configuration.
            log: The log, which must have at least one segment.
            layout: Layout of the log's rows.
        """
        self.missed, self._tick, self._number, self._is_after_gap = 0, -1, 0, False
        self._simulator, self._layout = simulator, layout
        self._motions: tuple[Any, ...] = log.motions
        # A live run with simulated time may also start at 0, but always has diagnostics.
        self.is_record = log.motions[0].stamp == 0 and not log.channel(DIAGNOSTICS)
        steps = accumulate(motion.stamp - _moment(motion) for motion in log.motions)
        self._anchors = [log.motions[0].stamp + step for step in steps]  # stamps of tick 0
        self._ends = [*map(_moment, log.motions[1:]), TIME_END]

    def cross_gap(self) -> bool:
        """Expects any later tick next; see `ExpectedStates`."""
        self._is_after_gap = True
        return True

    def fitting(self, stamps: npt.NDArray[np.int64]) -> Iterator[tuple[int, list[int]]]:
        """Finds segments by their stamps; see `ExpectedStates`."""
        for number in range(self._number, len(self._motions)):
            start, end = self._motions[number].stamp, self._ends[number]
            inside = (start <= stamps) & (stamps < end)
            # With False at the end, argmin counts the leading true values.
            leading = stamps[: np.append(inside, False).argmin()]
            elapsed = leading.astype(object) - self._anchors[number]
            ticks = self._simulator.ticks.tick_at(elapsed)
            steps = np.diff(ticks, prepend=self._tick)
            fits = self._simulator.ticks.elapsed(ticks) == elapsed
            fits &= steps > 0
            if self.is_record:
                fits[self._is_after_gap :] &= steps[self._is_after_gap :] == 1
            if count := np.append(fits, False).argmin():
                yield number, ticks[:count].tolist()

    def coordinates(
        self,
        number: int,
        stamps: list[int],
        rows: bytes,  # noqa: ARG002, others read them
        forces: Forces,
    ) -> tuple[Coordinates, Coordinates | None]:
        """Follows the motion of a segment; see `ExpectedStates`."""
        motion = self._motions[number].motion()
        motion.conditions = Conditions(motion.conditions.gravity, forces=forces)
        return motion.at_all(stamps), self._simulator.ahead(motion, stamps)

    def elapsed(self, number: int, stamps: list[int]) -> list[int]:
        """Returns the times since tick 0; see `ExpectedStates`."""
        return [stamp - self._anchors[number] for stamp in stamps]

    def take(self, number: int, ticks: list[int]) -> tuple[int, str]:
        """Counts the ticks before and between states; see `ExpectedStates`."""
        self.missed += ticks[-1] - self._tick - len(ticks)
        self._number, self._tick, self._is_after_gap = number, ticks[-1], False
        return len(ticks), ''


class MeasuredStates(ExpectedStates):
    """States at logged measurements."""

    needs_motion = False

    def __init__(self, simulator: Simulator, log: LogReader, _: RowLayout) -> None:
        """Initializes without a measurement; see `TickStates`."""
        self._crank = cast('MeasuredCrank', simulator.inputs()[MEASURED_JOINT_STATES])
        self._channel = log.channel(MEASURED_JOINT_STATES)
        self._simulator, self._number = simulator, 0
        self._motions: tuple[Any, ...] = log.motions
        # Stamps, ns, and coordinates of measurements whose states are still to be compared.
        self._next: list[tuple[int, Coordinates]] = []

    def handle(self, message: LoggedMessage) -> None:
        """Reads a measurement; see `ExpectedStates`."""
        if self._channel and message.channel == self._channel.number:
            with suppress(ValueError):  # a rejected measurement has no state
                self._next.append(self._crank.read(message.data, message.time))

    def fitting(self, stamps: npt.NDArray[np.int64]) -> Iterator[tuple[int, list[int]]]:
        """Yields the leading stamps that match the next measurements; see `ExpectedStates`."""
        pairs = zip(stamps.tolist(), self._next, strict=False)
        fit = [stamp for stamp, _ in takewhile(lambda pair: pair[0] == pair[1][0], pairs)]
        ends = [motion.stamp for motion in self._motions[self._number : self._number + 2]]
        # If a bag is looped, the stamp at which gravity changes occurs again.
        if fit and fit[:1] == ends[:1]:
            yield self._number + 1, [*fit[:1], *takewhile(lambda x: x not in ends[1:], fit[1:])]
        if before := [*fit[:1], *takewhile(lambda x: x not in ends[:1], fit[1:])]:
            yield self._number, before

    def coordinates(
        self, number: int, stamps: list[int], _: bytes, forces: Forces
    ) -> tuple[Coordinates, Coordinates | None]:
        """Returns the coordinates of the next measurements; see `ExpectedStates`."""
        gravity = self._motions[number - 1].gravity if number else None
        now, ahead = (
            x and x._replace(conditions=Conditions(gravity, x.conditions.frame, forces))
            for x in self._crank.stacked([one for _, one in self._next[: len(stamps)]])
        )
        return cast('Coordinates', now), ahead

    def cross_gap(self) -> bool:
        """Returns False, because later states depend on all measurements; see `ExpectedStates`."""
        return False

    def take(self, number: int, ticks: list[int]) -> tuple[int, str]:
        """Advances past measurements; see `ExpectedStates`."""
        self._number = number
        del self._next[: len(ticks)]
        return len(ticks), ''
