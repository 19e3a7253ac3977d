# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""States that a log must contain according to its segments of motion or its measurements.

A step of the clock starts a new segment, but tick numbers continue.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import accumulate, product, takewhile
from typing import Any, ClassVar, NamedTuple, TypeAlias, cast

import numpy as np
import numpy.typing as npt

from linkage_ros.errors import LinkageError, MotionError
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
    prefix_of,
)
from linkage_ros.motion.drives.follow import MeasuredCrank
from linkage_ros.motion.segments import Coordinates, Segment
from linkage_ros.run.measured import Measurement, measurement_of
from linkage_ros.run.robot import HeldEfforts, Robot
from linkage_ros.run.states import RowPart, Simulator
from linkage_ros.units import TIME_END


def _begin(segment: Segment) -> int:
    """Returns the start of a segment on the clock of the previous segment, ns."""
    return segment.stamp if segment.old_stamp is None else segment.old_stamp


def _leading(values: npt.NDArray[np.bool_]) -> int:
    """Counts the leading true values."""
    return int(np.append(values, False).argmin())


class Rows(NamedTuple):
    """Rows of a log.

    Attributes:
        layout: Layout of a row.
        data: The rows.
    """

    layout: RowLayout
    data: bytes


# Index of a segment of motion, by linkage.
Segments: TypeAlias = dict[str, int]


class Fit(NamedTuple):
    """A segment that may contain the next states of a linkage.

    Attributes:
        number: Index of the segment.
        ticks: The ticks of all leading states that fit the segment.
    """

    number: int
    ticks: list[int]


def _combined(linkages: tuple[str, ...], fits: Sequence[Fit]) -> tuple[Segments, list[int]]:
    """Returns the segment of each linkage, and the ticks that fit the segments of all."""
    segments = {name: fit.number for name, fit in zip(linkages, fits, strict=True)}
    return segments, min((fit.ticks for fit in fits), key=len)


def check_motions(simulator: Simulator, motions: tuple[Segment, ...]) -> str:
    """Checks that each segment follows from the configuration and from the previous segment.

    The time of a change and the new rpm, torque, gravity or clock are user inputs, which are not
    checked.

    Args:
        simulator: Simulator of a linkage.
        motions: Logged segments of the linkage.

    Returns:
        Description of the first difference; empty if there is none.
    """
    previous: Segment | None = None
    for number, logged in enumerate(motions, 1):
        if previous and logged.motion() and _begin(logged) < previous.stamp:
            return f'motion record {number} starts before the previous one'
        try:
            expected = _expected_segment(simulator, previous, logged)
        except MotionError as error:
            return f'motion record {number}: {error}'
        for name, value in reversed(vars(expected).items()):  # values set by users come first
            logged_value = vars(logged).get(name)
            if logged_value != value:
                return f'motion record {number} has {name} = {logged_value}, recomputed {value}'
        previous = logged
    return ''


def _expected_segment(simulator: Simulator, previous: Segment | None, logged: Segment) -> Segment:
    """Recomputes a logged segment; returns it unchanged if nothing determines it.

    Raises:
        MotionError: The motion of the previous segment ends before the logged segment.
    """
    if previous is None:
        if simulator.linkage.drive.is_measured:
            return logged
        return simulator.begin(logged.stamp).segment
    motion = previous.motion()
    return motion.next_segment(logged) if motion else logged


class ExpectedStates(ABC):
    """The states that a log must contain, in order.

    Attributes:
        needed: Topics of which the log must have one, or another one of the same type.
        needs_motion: Whether the log must have a segment of motion of each linkage.
        missed: Number of ticks so far without a state.
        is_record: Whether linkage_record wrote the log, so that every tick has a state.
    """

    needed: ClassVar[tuple[Topic, ...]] = MECHANISM_STATE, JOINT_STATES, POINTS
    needs_motion: ClassVar[bool] = True
    missed, is_record = 0, False

    def handle(self, message: LoggedMessage) -> None:  # noqa: B027, most ignore it
        """Handles a message that is not part of a state; called in the order of writing."""

    def end_efforts(self, linkages: Iterable[str]) -> None:  # noqa: B027, most end by themselves
        """Ends the efforts of linkages that the run had commanded."""

    @abstractmethod
    def cross_gap(self) -> bool:
        """Prepares for the states after missing messages; returns whether they can be compared."""

    @abstractmethod
    def fitting(
        self, linkages: tuple[str, ...], stamps: npt.NDArray[np.int64]
    ) -> Iterator[tuple[Segments, list[int]]]:
        """Finds the segments that may contain the next stamps, starting with the current ones.

        If the clock was set back, segments may overlap. The caller must then compare the states to
        find the right ones.

        Args:
            linkages: Names of the linkages that the states hold.
            stamps: The next stamps, ns; at least one.

        Yields:
            Index of the segment of each linkage, by its name, and the ticks of all leading stamps
            that fit the segments.
        """

    @abstractmethod
    def coordinates(
        self, linkage: str, number: int, stamps: list[int], rows: Rows, forces: Forces
    ) -> tuple[Coordinates, Coordinates | None]:
        """Computes the coordinates of a linkage in states.

        Args:
            linkage: Name of the linkage.
            number: Index of its segment.
            stamps: Stamps of the states, ns.
            rows: Logged rows of the states, and their layout.
            forces: Forces of its live loads, by name.

        Returns:
            The coordinates, and those for the feed-forward torque or None.

        Raises:
            LinkageError: A stamp has no state, or the messages give an invalid motion.
        """

    def elapsed(self, _: Segments, stamps: list[int]) -> list[int]:
        """Returns the times of states, ns, which a step of the clock does not change.

        They determine when messages expire.
        """
        return stamps

    def efforts_of_others(self) -> dict[str, float]:
        """Returns the efforts of the linkages that are not in the next states, by linkage."""
        return {}

    def has_ended(self, linkage: str, stamp: int) -> bool:  # noqa: ARG002, most cannot tell
        """Returns whether a motion may have ended before a stamp, ns, at which it has no state."""
        return True

    @abstractmethod
    def take(
        self, segments: Segments, ticks: list[int], parts: Mapping[str, RowPart]
    ) -> tuple[int, str]:
        """Advances past states whose messages are equal.

        Args:
            segments: Index of the states' segment, by linkage.
            ticks: Ticks of the states.
            parts: Numbers of at least these states, by linkage.

        Returns:
            The number of states consistent with their predecessors, and the error of the next
            state, empty if all are consistent.
        """


class SegmentStates:
    """The states of a linkage at the ticks of its logged segments.

    Attributes:
        number: Index of the current segment.
        anchors: Stamp of tick 0 on the clock of each segment, ns.
    """

    def __init__(self, run: 'TickStates', simulator: Simulator, motions: Sequence[Any]) -> None:
        """Starts with the first segment, of which there is at least one."""
        self.number, self._run = 0, run
        self._simulator, self._motions = simulator, motions
        clock_steps = accumulate(motion.stamp - _begin(motion) for motion in motions)
        self.anchors = [motions[0].stamp + step for step in clock_steps]
        self._ends = [*map(_begin, motions[1:]), TIME_END]

    def fitting(self, stamps: npt.NDArray[np.int64]) -> Iterator[Fit]:
        """Yields the segments that may contain the next stamps, ns."""
        run, clock = self._run, self._simulator.ticks
        for number in range(self.number, len(self._motions)):
            start, end = self._motions[number].stamp, self._ends[number]
            in_segment = stamps[: _leading((start <= stamps) & (stamps < end))]
            elapsed = in_segment.astype(object) - self.anchors[number]
            ticks = clock.tick_at(elapsed)
            steps = np.diff(ticks, prepend=run.tick)
            fits = (clock.elapsed(ticks) == elapsed) & (steps > 0)
            if run.is_record:  # it misses no tick, except in a gap
                first = 1 if run.is_after_gap else 0
                fits[first:] &= steps[first:] == 1
            if count := _leading(fits):
                yield Fit(number, ticks[:count].tolist())

    def coordinates(
        self,
        number: int,
        stamps: list[int],
        rows: Rows | None,  # noqa: ARG002, others read them
        forces: Forces,
    ) -> tuple[Coordinates, Coordinates | None]:
        """Follows the motion of a segment; see `ExpectedStates`."""
        motion = self._motions[number].motion()
        motion.conditions = Conditions(motion.conditions.gravity, forces=forces)
        return motion.at_all(stamps), self._simulator.ahead(motion, stamps)

    def has_ended(self, stamp: int) -> bool:
        """Returns whether the motion ends before a stamp, ns; see `ExpectedStates`."""
        forces = dict(self._simulator.conditions.forces)
        try:
            last = len(self._motions) - 1
            self._simulator.part(*self.coordinates(last, [stamp], None, forces))
        except LinkageError:
            return True
        return False

    def take(self, number: int, ticks: list[int]) -> tuple[int, str]:
        """Advances past states; see `ExpectedStates`."""
        self.number = number
        return len(ticks), ''


class TickStates(ExpectedStates):
    """States at the ticks of the logged segments.

    Attributes:
        kind: Class of the states of a linkage.
        tick: The last tick; -1 before the first one.
        is_after_gap: Whether messages are missing after that tick.
    """

    kind: ClassVar[type[SegmentStates]] = SegmentStates

    def __init__(self, robot: Robot, log: LogReader) -> None:
        """Starts with the first segments; the log must have one or more of each linkage."""
        self.missed, self.tick, self.is_after_gap = 0, -1, False
        # A live run with simulated time may also start at 0, but always has diagnostics.
        starts = {motions[0].stamp for motions in log.motions.values()}
        self.is_record = starts == {0} and not log.channel(DIAGNOSTICS)
        self._linkages = {
            name: self.kind(self, simulator, log.motions[name])
            for name, simulator in robot.simulators.items()
        }

    def cross_gap(self) -> bool:
        """Expects any later tick next; see `ExpectedStates`."""
        self.is_after_gap = True
        return True

    def fitting(
        self, linkages: tuple[str, ...], stamps: npt.NDArray[np.int64]
    ) -> Iterator[tuple[Segments, list[int]]]:
        """Finds segments by their stamps; see `ExpectedStates`."""
        first, *others = ([*self._linkages[name].fitting(stamps)] for name in linkages)
        for start in first:
            tick = start.ticks[0]
            same_tick = [[fit for fit in fits if fit.ticks[0] == tick] for fits in others]
            for fits in product([start], *same_tick):
                yield _combined(linkages, fits)

    def coordinates(
        self, linkage: str, number: int, stamps: list[int], rows: Rows, forces: Forces
    ) -> tuple[Coordinates, Coordinates | None]:
        """Follows the motion of a segment; see `ExpectedStates`."""
        return self._linkages[linkage].coordinates(number, stamps, rows, forces)

    def has_ended(self, linkage: str, stamp: int) -> bool:
        """Computes the motion up to a stamp; see `ExpectedStates`."""
        return self._linkages[linkage].has_ended(stamp)

    def elapsed(self, segments: Segments, stamps: list[int]) -> list[int]:
        """Returns the times since tick 0; see `ExpectedStates`."""
        name, number = next(iter(segments.items()))
        return [stamp - self._linkages[name].anchors[number] for stamp in stamps]

    def take(
        self,
        segments: Segments,
        ticks: list[int],
        parts: Mapping[str, RowPart],  # noqa: ARG002, others need their efforts
    ) -> tuple[int, str]:
        """Counts the ticks before and between states; see `ExpectedStates`."""
        wrong = ''
        for name, number in segments.items():
            count, difference = self._linkages[name].take(number, ticks)
            if difference:
                ticks, wrong = ticks[:count], f'{prefix_of(name, ": ")}{difference}'
        if ticks:
            self.missed += ticks[-1] - self.tick - len(ticks)
            self.tick, self.is_after_gap = ticks[-1], False
        return len(ticks), wrong


class MeasuredStates(ExpectedStates):
    """States at logged measurements."""

    needs_motion = False

    def __init__(self, robot: Robot, log: LogReader) -> None:
        """Initializes without a measurement; see `TickStates`."""
        self._cranks = robot.inputs()[MEASURED_JOINT_STATES]
        self._channel = log.channel(MEASURED_JOINT_STATES)
        self._motions: dict[str, tuple[Any, ...]] = log.motions
        self._segments = dict.fromkeys(robot.names, 0)
        # The ends that have not been reached, by linkage.
        self._ends = dict(log.linkage_ends)
        # Measurements whose states are still to be compared.
        self._next: list[Measurement] = []
        self._efforts = HeldEfforts(robot.names)

    def handle(self, message: LoggedMessage) -> None:
        """Reads a measurement; see `ExpectedStates`."""
        if self._channel and message.channel == self._channel.number:
            try:
                received = self._cranks.read(message.data, message.time)
            except ValueError:  # it is for other joints; `suppress` takes longer
                return
            self._next.append(measurement_of(message.time, received))

    def end_efforts(self, linkages: Iterable[str]) -> None:
        """Holds efforts of 0; see `ExpectedStates`."""
        self._efforts.clear(linkages)

    def fitting(
        self, linkages: tuple[str, ...], stamps: npt.NDArray[np.int64]
    ) -> Iterator[tuple[Segments, list[int]]]:
        """Yields the leading stamps that match the next measurements; see `ExpectedStates`."""
        while self._next:
            self._end_motions(linkages, int(stamps[0]))
            if self._next[0].linkages:
                break
            self._efforts.clear(self._next.pop(0).ended)  # it has no state
        if not self._next:
            return
        ended, matching = self._next[0].ended, list[int]()
        for stamp, measurement in zip(stamps.tolist(), self._next, strict=False):
            expected = measurement.stamp, measurement.linkages, measurement.ended
            if expected != (stamp, linkages, ended):
                break
            matching.append(stamp)
        if not matching:
            return
        for fits in product(*(self._segments_of(name, matching) for name in linkages)):
            yield _combined(linkages, fits)

    def _end_motions(self, linkages: tuple[str, ...], stamp: int) -> None:
        """Ends the motions that end at the next measurement, given the next state."""
        now = self._next[0].stamp
        for name in self._next[0].linkages:
            has_state = stamp == now and name in linkages
            if has_state or name not in self._ends or self._ends[name].stamp != now:
                continue
            del self._ends[name]
            self._efforts.clear([name])
            self._cranks.sources[name].has_ended = True
            self._next = [one.without(name) for one in self._next]

    def _segments_of(self, name: str, stamps: list[int]) -> list[Fit]:
        """Returns the segments of a linkage that may begin with stamps; the ticks are stamps."""
        number, fits = self._segments[name], list[Fit]()
        first, *others = stamps
        next_begins = [motion.stamp for motion in self._motions[name][number : number + 2]]
        # If a bag is looped, the stamp at which gravity changes occurs again.
        if next_begins and first == next_begins[0]:
            own = takewhile(lambda x: x not in next_begins[1:], others)
            fits.append(Fit(number + 1, [first, *own]))
        own = takewhile(lambda x: x not in next_begins[:1], others)
        fits.append(Fit(number, [first, *own]))
        return fits

    def coordinates(
        self, linkage: str, number: int, stamps: list[int], _: Rows, forces: Forces
    ) -> tuple[Coordinates, Coordinates | None]:
        """Returns the coordinates of the next measurements; see `ExpectedStates`."""
        gravity = self._motions[linkage][number - 1].gravity if number else None
        crank = cast('MeasuredCrank', self._cranks.sources[linkage])
        measured = [one.coordinates(linkage) for one in self._next[: len(stamps)]]
        now, ahead = crank.stacked(measured)

        def under(coordinates: Coordinates) -> Coordinates:
            conditions = Conditions(gravity, coordinates.conditions.frame, forces)
            return coordinates._replace(conditions=conditions)

        return under(now), under(ahead) if ahead else None

    def cross_gap(self) -> bool:
        """Returns False, because later states depend on all measurements; see `ExpectedStates`."""
        return False

    def efforts_of_others(self) -> dict[str, float]:
        """Returns the last efforts, except those that end; see `ExpectedStates`."""
        return {**self._efforts.efforts, **dict.fromkeys(self._next[0].ended, 0.0)}

    def take(
        self, segments: Segments, ticks: list[int], parts: Mapping[str, RowPart]
    ) -> tuple[int, str]:
        """Advances past measurements; see `ExpectedStates`."""
        self._segments |= segments
        self._efforts.clear(self._next[0].ended)
        self._efforts.hold(parts, len(ticks) - 1)
        del self._next[: len(ticks)]
        return len(ticks), ''
