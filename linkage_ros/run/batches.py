# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The states of a run in batches, as fast as possible.

Each linkage computes its states in batches of its own, as if it were alone. A batch of the run has
as many states as all of them have computed.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from linkage_ros.errors import ConfigurationError, MotionError, UnreachableError, in_linkage
from linkage_ros.mechanism.ranges import Ranges
from linkage_ros.motion.segments import Coordinates, Motion, Segment
from linkage_ros.numeric import Real
from linkage_ros.run.robot import Robot
from linkage_ros.run.states import RowPart, Simulator
from linkage_ros.units import NS_PER_S

_BATCH = 2048  # states
_LONGEST_WAIT = 3600  # s; a torque-driven crank must make its revolutions within this time


class Batch(NamedTuple):
    """States at adjacent ticks.

    Attributes:
        stamps: Their stamps, ns.
        numbers: Numbers in their messages; see `Robot.row`.
        linkages: Names of the linkages that they hold.
        segments: Segments of motion that begin with them, by linkage.
        ends: Errors that ended the motion of a linkage before them, by linkage.
    """

    stamps: Sequence[int]
    numbers: Sequence[Real]
    linkages: tuple[str, ...]
    segments: Mapping[str, Segment]
    ends: Mapping[str, MotionError | UnreachableError]


class LinkageStates:
    """The states of one linkage, in order.

    Attributes:
        name: Name of the linkage.
        simulator: Simulator of the linkage.
        motion: Motion of the linkage.
        ranges: The ranges of its load curves that the motion has left.
        completed: Number of states until its turns are complete; None before that.
        available: Number of states that were computed, but not taken.
    """

    def __init__(self, simulator: Simulator, motion: Motion) -> None:
        """Initializes before the first state, with the motion from t = 0."""
        self.name, self.simulator, self.motion = simulator.name, simulator, motion
        self.ranges = Ranges(simulator.solver)
        self.completed: int | None = None
        self.available, self._tick, self._batch = 0, 0, _BATCH
        self._segment = motion.segment
        self._part = RowPart(())

    def fill(self, count: int | None, turns: int) -> None:
        """Computes further states if none are available; see `batches` for the arguments.

        Raises:
            ConfigurationError: The crank does not complete its turns within an hour.
            MotionError: The motion cannot continue.
            UnreachableError: The next state is impossible.
        """
        if self.available:
            return
        ticks = self.simulator.ticks
        # If turns are counted, compute at most one second beyond the last turn.
        most = ticks.tick_at(NS_PER_S) + 1 if count is None else count - self._tick
        while True:
            stamps = [ticks.elapsed(self._tick + i) for i in range(min(self._batch, most))]
            coordinates, ahead = self._coordinates(stamps)
            size = len(coordinates.unwrapped)
            try:
                self._part = self.simulator.part(coordinates, ahead, self.ranges.see)
                break
            except UnreachableError:
                if size == 1:
                    raise
                self._batch = size // 2  # take all states before an impossible one
        self.available = size
        if count is None and self.completed is None:
            self._find_completion(coordinates.unwrapped, turns, stamps[size - 1])

    def _coordinates(self, stamps: list[int]) -> tuple[Coordinates, Coordinates | None]:
        """Returns the coordinates at stamps, ns, until the motion ends, and those ahead of them.

        Raises:
            MotionError: The motion cannot continue.
        """
        coordinates = self.motion.at_all(stamps)
        count = len(coordinates.unwrapped)
        ahead = self.simulator.ahead(self.motion, stamps[:count])
        if ahead is not None and len(ahead.unwrapped) < count:  # the motion ends
            coordinates = self.motion.at_all(stamps[: len(ahead.unwrapped)])
        return coordinates, ahead

    def _find_completion(self, unwrapped: Real, turns: int, stamp: int) -> None:
        """Finds the first new state at which the turns are complete.

        `unwrapped` are the crank angles of the new states, with all turns, rad, and `stamp` is
        that of the last one, ns.

        Raises:
            ConfigurationError: The turns are not complete within an hour.
        """
        turned = np.abs(unwrapped - self.simulator.linkage.drive.crank_angle) / (2 * math.pi)
        first = int((turned < turns).argmin())
        if turned[first] >= turns:
            self.completed = self._tick + first
        elif stamp > _LONGEST_WAIT * NS_PER_S:
            raise ConfigurationError(
                f'the crank has made only {turned[-1]:.3g} of {turns} revolutions within '
                f'{_LONGEST_WAIT} s: give a --duration'
            )

    def take(self, count: int) -> tuple[RowPart, Segment | None]:
        """Returns the next states, and the segment that begins with them, if one does."""
        new_segment = None if self.motion.segment is self._segment else self.motion.segment
        self._segment = self.motion.segment
        part = self._part
        if count < self.available:
            part, self._part = part.at(slice(count)), part.at(slice(count, None))
        self.available -= count
        self._tick += count
        return part, new_segment


def batches(
    robot: Robot, linkages: Sequence[LinkageStates], count: int | None, turns: int
) -> Iterator[Batch]:
    """Yields the states of a run in batches; the end of one motion does not affect the others.

    The last batch has no states if the motions of all linkages end.

    Args:
        robot: The linkages of the run.
        linkages: Their states.
        count: Number of states; None to continue until all cranks have completed the turns.
        turns: Number of crank turns in either direction, used if `count` is None.
    """
    moving, tick = [*linkages], 0
    while moving and tick != count:
        ends = _filled(moving, count, turns)
        moving = [linkage for linkage in moving if linkage.name not in ends]
        length = min((linkage.available for linkage in moving), default=0)
        completed = [x.completed for x in moving if x.completed is not None]
        if count is None and moving and len(completed) == len(moving):
            count = max(tick, *completed)
            length = min(length, count - tick)
        parts, segments = dict[str, RowPart](), dict[str, Segment]()
        for linkage in moving:
            parts[linkage.name], new_segment = linkage.take(length)
            if new_segment:
                segments[linkage.name] = new_segment
        stamps = [robot.ticks.elapsed(tick + i) for i in range(length)]
        yield Batch(stamps, robot.row(parts), tuple(parts), segments, ends)
        tick += length


def _filled(
    linkages: Sequence[LinkageStates], count: int | None, turns: int
) -> dict[str, MotionError | UnreachableError]:
    """Computes further states; returns the errors that end motions, by linkage.

    Raises:
        ConfigurationError: As for `LinkageStates.fill`.
    """
    ends = dict[str, MotionError | UnreachableError]()
    for linkage in linkages:
        try:
            with in_linkage(linkage.name):
                linkage.fill(count, turns)
        except (MotionError, UnreachableError) as error:  # noqa: PERF203, others continue
            ends[linkage.name] = error
    return ends
