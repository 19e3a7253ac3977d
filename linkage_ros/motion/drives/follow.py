# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A measured crank."""

import math
import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import NoReturn, TypeAlias

from linkage_ros.errors import ConfigurationError, LinkageError
from linkage_ros.mechanism.kinematics import Reach
from linkage_ros.messages.cdr import JointReader
from linkage_ros.messages.topics import MEASURED_JOINT_STATES, Topic
from linkage_ros.motion.drives.base import Drive, Given, Input, Machine
from linkage_ros.motion.drives.feed_forward import FeedForward
from linkage_ros.motion.measured import FollowMotion, FollowSegment, extrapolated
from linkage_ros.motion.segments import Coordinates, stacked
from linkage_ros.numeric import Real
from linkage_ros.quantities import Checked, quantity
from linkage_ros.units import NS_PER_S

# Computes the numbers in messages from coordinates, and those for the feed-forward torque.
Numbers: TypeAlias = Callable[[Coordinates, Coordinates | None], Sequence[Real]]

_SILENCE = 2.0  # s without a measurement after which a warning is issued
NO_CRANK, NO_JOINT_STATE, OUT_OF_REACH = (
    'without a position of the crank', 'no JointState', 'out of reach'
)  # fmt: skip


class MeasuredCrank(Input):
    """Reads measurements of the crank, in order of arrival.

    Attributes:
        rejected: Number of rejected messages, by cause.
    """

    def __init__(self, machine: Machine, bandwidth: float) -> None:
        """Initializes without a measurement.

        Args:
            machine: The mechanism.
            bandwidth: Bandwidth of the filter, Hz; see `FollowDrive`.
        """
        self._machine, self._joint = machine, JointReader(machine.crank)
        reach = machine.solver.reach
        self._motion = FollowMotion(bandwidth, reach.period_turns)
        self._is_limited = not reach.turns_fully
        self.rejected: Counter[str] = Counter()
        self._last = -math.inf  # time of the last accepted measurement, s

    def read(self, data: bytes, received: int) -> tuple[int, Coordinates]:
        """Reads a measurement from a message.

        Args:
            data: CDR bytes of a JointState.
            received: Time of receipt, ns; replaces the stamp if the message has none.

        Returns:
            The stamp, ns, and the coordinates of the crank.

        Raises:
            ValueError: The message is rejected and counted. The error text is the cause, which may
                be followed by a colon and details.
        """
        found = self._measure(data, received)
        self._require_states(found[1])
        self._last = time.monotonic()
        return found

    def answers(
        self, messages: Iterable[tuple[int, bytes]], numbers: Numbers
    ) -> tuple[list[int], list[int], Sequence[Real]]:
        """Answers many messages, with the same results as `read`.

        Args:
            messages: Time of receipt, ns, and CDR bytes of each JointState.
            numbers: Computes the numbers in messages, given a result of `stacked`.

        Returns:
            The time of receipt of each accepted message, ns, the stamp of its state, ns, and the
            numbers in the messages of the states. Rejected messages are counted.
        """
        heard = list[tuple[int, int, Coordinates]]()
        for received, data in messages:
            try:
                stamp, found = self._measure(data, received)
            except ValueError:  # counted; `suppress` takes a twentieth of the time of a record
                continue
            heard.append((received, stamp, found))
        try:
            return self._answers(heard, numbers)
        except LinkageError:  # of at least one state
            return self._answers([x for x in heard if self._has_states(x[-1])], numbers)

    def _answers(
        self, heard: Sequence[tuple[int, int, Coordinates]], numbers: Numbers
    ) -> tuple[list[int], list[int], Sequence[Real]]:
        if not heard:
            return [], [], ()
        times, stamps, found = zip(*heard, strict=True)
        return [*times], [*stamps], numbers(*self.stacked(found))

    def _has_states(self, found: Coordinates) -> bool:
        """Returns whether a measurement has states; if not, it is counted as rejected."""
        with suppress(ValueError):
            self._require_states(found)
            return True
        return False

    def stacked(self, found: Sequence[Coordinates]) -> tuple[Coordinates, Coordinates | None]:
        """Stacks the coordinates of accepted measurements.

        Args:
            found: The coordinates of each measurement.

        Returns:
            The coordinates as arrays, and those for the feed-forward torque or None.
        """
        later = [x for one in found if (x := self.later(one))]
        return stacked(found), stacked(later) if later else None

    def later(self, coordinates: Coordinates) -> Coordinates | None:
        """Extrapolates a measurement by `Machine.lead`; returns None without feed-forward."""
        lead = self._machine.lead
        return None if lead is None else extrapolated(coordinates, lead / NS_PER_S)

    def _measure(self, data: bytes, received: int) -> tuple[int, Coordinates]:
        """Reads the coordinates of the crank; see `read`.

        Raises:
            ValueError: The message is rejected and counted.
        """
        try:
            stamp, value, velocity = self._decode(data)
            position, joint = value, self._machine.joint
            if joint.is_mapped:
                position = joint.own(value)
                velocity = velocity if velocity is None else velocity / joint.ratio
            if self._is_limited and math.isfinite(position):
                self._require_state(position)  # the filter must not see other angles
            stamp = stamp or received
            found = self._motion.at(stamp, position, velocity)
            return stamp, found._replace(unwrapped=value) if joint.is_mapped else found
        except ValueError as error:
            self._reject(error)
            raise

    def _decode(self, data: bytes) -> tuple[int, float, float | None]:
        """Returns the stamp, ns, and position and, if it was measured, velocity of the joint.

        Raises:
            ValueError: The message has no measurement. The error text is the cause.
        """
        try:
            stamp, position, velocity = self._joint.read(data)
        except ValueError as error:
            raise ValueError(NO_JOINT_STATE) from error
        if position is None:
            raise ValueError(NO_CRANK)
        return stamp, position, velocity

    def _require_states(self, found: Coordinates) -> None:
        """Checks the states of a measurement; near a limit of the crank, rates may overflow.

        Raises:
            ValueError: The message is rejected and counted.
        """
        try:
            for one in filter(None, (found, self.later(found))):
                self._require_state(one.q[0], one.u[0], one.a[0])
        except ValueError as error:
            self._reject(error)
            raise

    def _require_state(self, *motion: Real) -> None:
        try:
            self._machine.solver.state(*motion)
        except LinkageError as error:
            raise ValueError(f'{OUT_OF_REACH}: {error}') from error

    def _reject(self, error: ValueError) -> None:
        self.rejected[str(error).partition(':')[0]] += 1

    def troubles(self, topic: str) -> list[str]:
        """Returns a warning if no measurement has been accepted for 2 s."""
        if time.monotonic() < self._last + _SILENCE:
            return []
        crank = self._machine.crank
        return [f'no measurement of {crank} on {topic} in the last {_SILENCE:g} s']

    def diagnostics(self) -> dict[str, str]:
        """Returns the counts of rejected messages, for diagnostics."""
        # Copy in one step, because the tick thread may add a count meanwhile.
        counts = list(self.rejected.items())
        return {f'rejected, {cause}': str(count) for cause, count in counts}


@dataclass(frozen=True)
class _Follow(Checked):
    """Parameters of a measured crank; see `FollowDrive`."""

    follow_bandwidth: float = quantity(
        'number', 'bandwidth of the filter for rates and accelerations; 0 sets them to 0',
        'Hz', span=(0.0, 1e4), default=20.0,
    )  # fmt: skip


@dataclass(frozen=True)
class FollowDrive(FeedForward, _Follow, Drive):
    """A measured crank that the other links follow.

    Attributes:
        follow_bandwidth: Bandwidth of the filter that estimates rates and accelerations, Hz; 0 to
            set both to 0.
    """

    given, segment, subject = Given.MEASUREMENT, FollowSegment, 'measured {}'

    @property
    def crank_angle(self) -> float:
        """The crank angle before the first measurement, rad."""
        return 0.0

    def words(self) -> str:
        """Describes the filter."""
        return f'follows a measured crank, filter of {self.follow_bandwidth:g} Hz'

    def begin(self, stamp: int, machine: Machine) -> NoReturn:  # noqa: ARG002
        """Refuses to simulate a measured motion.

        Raises:
            ConfigurationError: Always.
        """
        raise ConfigurationError(
            'drive: follow needs a crank that is measured: run linkage_node, or give '
            'linkage_record --measured BAG'
        )

    def inputs(self, machine: Machine) -> dict[Topic, Input]:
        """Receives measurements; see `Drive.inputs`."""
        return {MEASURED_JOINT_STATES: MeasuredCrank(machine, self.follow_bandwidth)}

    def drawn_angle(self, reach: Reach | None) -> float:
        """Returns a crank angle that the mechanism can reach; see `Drive.drawn_angle`."""
        return 0.5 * sum(reach.arcs[0]) if reach and not reach.turns_fully else self.crank_angle
