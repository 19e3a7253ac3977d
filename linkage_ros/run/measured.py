# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""States of measured cranks in batches: the answers of a run to the messages of a bag."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import groupby
from operator import attrgetter
from typing import Any, NamedTuple

from linkage_ros.errors import LinkageError
from linkage_ros.messages.topics import prefix_of
from linkage_ros.motion.drives.follow import MeasuredCrank
from linkage_ros.motion.inputs import Received, SharedInput
from linkage_ros.motion.segments import Coordinates
from linkage_ros.numeric import Real
from linkage_ros.run.robot import HeldEfforts, Robot
from linkage_ros.run.states import RowPart


class Measurement(NamedTuple):
    """A message with measurements.

    Attributes:
        time: Time of receipt, ns.
        stamp: Stamp of the message, ns; 0 if no linkage accepts the message.
        values: Stamp, and coordinates of each linkage that accepts it, by name.
        linkages: Names of these linkages.
        ended: Names of the linkages whose efforts it ends, because they reject it.
    """

    time: int
    stamp: int
    values: dict[str, tuple[int, Coordinates]]
    linkages: tuple[str, ...]
    ended: tuple[str, ...]

    def without(self, linkage: str) -> 'Measurement':
        """Returns the measurement if a linkage had not accepted it."""
        found = {name: x for name, x in self.values.items() if name != linkage}
        return self._replace(values=found, linkages=tuple(found))

    def coordinates(self, linkage: str) -> Coordinates:
        """Returns the coordinates of a linkage that accepts it."""
        _, found = self.values[linkage]
        return found


def measurement_of(time: int, received: Received) -> Measurement:
    """Returns a measurement, given its time of receipt, ns, and its contents."""
    values, refused = received
    stamp, _ = next(iter(values.values()), (0, None))
    ended = received.invalid if refused else ()
    return Measurement(time, stamp, values, tuple(values), ended)


class Answers(NamedTuple):
    """The states of adjacent measurements that have the same linkages.

    Attributes:
        times: Times of receipt, ns.
        stamps: Stamps, ns.
        numbers: Numbers in the messages; see `Robot.row`.
        linkages: Names of the linkages that the states hold.
    """

    times: Sequence[int]
    stamps: Sequence[int]
    numbers: Sequence[Real]
    linkages: tuple[str, ...]


class MeasuredRun:
    """Answers messages with states, with the same results as `SharedInput.read` for each of them.

    Attributes:
        cranks: Reader of the measurements.
    """

    def __init__(self, robot: Robot, cranks: SharedInput) -> None:
        """Initializes without a measurement; each source of `cranks` is a `MeasuredCrank`."""
        self._robot, self.cranks = robot, cranks
        self._sources: dict[str, Any] = {**cranks.sources}
        self._held = HeldEfforts(robot.names)

    def rejected(self) -> Counter[str]:
        """Returns the number of rejected messages by cause, with the name of the linkage."""
        return Counter({
            f'{prefix_of(name, ": ")}{cause}': count
            for name, crank in self._sources.items() for cause, count in crank.rejected.items()
        })  # fmt: skip

    def answers(self, messages: Iterable[tuple[int, bytes]]) -> list[Answers]:
        """Answers messages; rejected ones are counted.

        The messages, JointStates with their times of receipt, ns, are first read without checking
        that each state exists, which is faster. If one does not, filters, counts and efforts are
        restored, and all messages are read again with the check.
        """
        messages = [*messages]
        cranks, efforts = self._sources.values(), {**self._held.efforts}
        before = [(crank.tracked(), crank.rejected.copy()) for crank in cranks]
        try:
            return [*self._answers(messages, MeasuredCrank.measure)]
        except LinkageError:  # of at least one state
            for crank, (filters, rejected) in zip(cranks, before, strict=True):
                crank.take_back(filters)
                crank.rejected = rejected
            self._held.efforts = efforts
            return [*self._answers(messages, MeasuredCrank.read)]

    def _answers(
        self,
        messages: Iterable[tuple[int, bytes]],
        read: Callable[[MeasuredCrank, bytes, int], tuple[int, Coordinates]],
    ) -> Iterator[Answers]:
        """Yields the states of adjacent measurements that hold and end the same linkages."""
        measurements = self._measurements(messages, read)
        for (names, ended), group in groupby(measurements, attrgetter('linkages', 'ended')):
            adjacent = [*group]
            self._held.clear(ended)
            if not names:
                continue
            parts = dict[str, RowPart]()
            for name in names:
                coordinates = [measurement.coordinates(name) for measurement in adjacent]
                now, ahead = self._sources[name].stacked(coordinates)
                parts[name] = self._robot.simulators[name].part(now, ahead)
            numbers = self._robot.row(parts, self._held.efforts)
            self._held.hold(parts)
            yield Answers(
                [one.time for one in adjacent], [one.stamp for one in adjacent], numbers, names
            )

    def _measurements(
        self,
        messages: Iterable[tuple[int, bytes]],
        read: Callable[[MeasuredCrank, bytes, int], tuple[int, Coordinates]],
    ) -> Iterator[Measurement]:
        """Yields the measurements in messages; rejected ones are counted."""
        for time, data in messages:
            try:
                received = self.cranks.collect(read, data, time)
            except ValueError:  # counted; `suppress` takes a twentieth of the time of a record
                continue
            # An effort that ends shows in the states of others alone.
            if received.values or len(self._sources) > 1:
                yield measurement_of(time, received)
