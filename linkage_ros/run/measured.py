# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""States of measured cranks in batches: the answers of a run to the messages of a bag."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import groupby
from typing import Any, NamedTuple

from linkage_ros.errors import LinkageError
from linkage_ros.messages.topics import prefix_of
from linkage_ros.motion.drives.follow import MeasuredCrank
from linkage_ros.motion.inputs import Received, SharedInput
from linkage_ros.motion.segments import Coordinates
from linkage_ros.numeric import Real
from linkage_ros.run.robot import HeldEfforts, Robot


class Measurement(NamedTuple):
    """An accepted message with measurements.

    Attributes:
        time: Time of receipt, ns.
        stamp: Its stamp, ns.
        coordinates: Coordinates of each linkage that accepts it, by name.
        refused: Names of the other linkages that it names.
    """

    time: int
    stamp: int
    coordinates: dict[str, Coordinates]
    refused: tuple[str, ...]

    @property
    def linkages(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Names of the linkages that accept the message, and of those that reject it."""
        return tuple(self.coordinates), self.refused


def measurement_of(time: int, received: Received) -> Measurement:
    """Returns a measurement, given its time of receipt, ns, and what was read."""
    stamp = next(stamp for stamp, _ in received.values.values())
    found = {name: coordinates for name, (_, coordinates) in received.values.items()}
    return Measurement(time, stamp, found, tuple(received.refused))


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


class MeasuredStates:
    """Answers messages, with the same results as `SharedInput.read` for each of them.

    Attributes:
        cranks: Reader of the measurements.
    """

    def __init__(self, robot: Robot, cranks: SharedInput) -> None:
        """Initializes without a measurement.

        Args:
            robot: The linkages of the run.
            cranks: Reader of the measurements, of which each source is a `MeasuredCrank`.
        """
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

        Args:
            messages: Time of receipt, ns, and CDR bytes of each JointState.
        """
        messages, sources = [*messages], self._sources.values()
        before = [(crank, crank.tracked(), crank.rejected.copy()) for crank in sources]
        held = {**self._held.values}
        try:
            return [*self._answers(messages, MeasuredCrank.measure)]
        except LinkageError:  # of at least one state
            for crank, tracked, rejected in before:
                crank.take_back(tracked)
                crank.rejected = rejected
            self._held.values = held
            return [*self._answers(messages, MeasuredCrank.read)]

    def _answers(
        self,
        messages: Iterable[tuple[int, bytes]],
        read: Callable[[MeasuredCrank, bytes, int], tuple[int, Coordinates]],
    ) -> Iterator[Answers]:
        heard = self._heard(messages, read)
        for (names, refused), group in groupby(heard, lambda one: one.linkages):
            found = [*group]
            self._held.end(refused)
            parts = {
                name: self._robot.simulators[name].part(
                    *self._sources[name].stacked([one.coordinates[name] for one in found])
                )
                for name in names
            }
            numbers = self._robot.row(parts, self._held.values)
            self._held.hold(parts)
            yield Answers(
                [one.time for one in found], [one.stamp for one in found], numbers, names
            )

    def _heard(
        self,
        messages: Iterable[tuple[int, bytes]],
        read: Callable[[MeasuredCrank, bytes, int], tuple[int, Coordinates]],
    ) -> Iterator[Measurement]:
        for time, data in messages:
            try:
                received = self.cranks.collect(lambda crank: read(crank, data, time))  # noqa: B023
            except ValueError:  # counted; `suppress` takes a twentieth of the time of a record
                continue
            yield measurement_of(time, received)
