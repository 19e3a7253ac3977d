# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Measurements of the crank, and the states at them."""

import math
import time
from collections import Counter
from collections.abc import Iterable, Sequence
from contextlib import suppress
from typing import cast

from linkage_ros.errors import LinkageError
from linkage_ros.messages.cdr import JointReader
from linkage_ros.motion.drives import FollowDrive
from linkage_ros.motion.measured import FollowMotion
from linkage_ros.motion.segments import Coordinates, stacked
from linkage_ros.numeric import Real
from linkage_ros.run.states import Simulator

_SILENCE = 2.0  # s without a measurement after which a warning is issued
NO_CRANK, NO_JOINT_STATE, OUT_OF_REACH = (
    'without a position of the crank', 'no JointState', 'out of reach'
)  # fmt: skip


class MeasuredCrank:
    """Reads measurements of the crank, in order of arrival.

    Attributes:
        rejected: Number of rejected messages, by cause.
    """

    def __init__(self, simulator: Simulator) -> None:
        """Initializes without a measurement.

        Args:
            simulator: Simulator of a configuration with `drive: follow`.
        """
        self._simulator, self._joint = simulator, JointReader(simulator.crank_joint)
        self._robot_joint = simulator.robot_joints[0]
        drive, reach = cast('FollowDrive', simulator.configuration.drive), simulator.solver.reach
        self._motion, self._is_limited = (
            FollowMotion(drive, reach.period_turns),
            not reach.turns_fully,
        )
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
        self, messages: Iterable[tuple[int, bytes]]
    ) -> tuple[list[int], list[int], Sequence[Real]]:
        """Answers many messages, with the same results as `read`.

        Args:
            messages: Time of receipt, ns, and CDR bytes of each JointState.

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
            return self._answers(heard)
        except LinkageError:  # of at least one state
            return self._answers([one for one in heard if self._has_states(one[-1])])

    def _answers(
        self, heard: Sequence[tuple[int, int, Coordinates]]
    ) -> tuple[list[int], list[int], Sequence[Real]]:
        if not heard:
            return [], [], ()
        times, stamps, found = zip(*heard, strict=True)
        return [*times], [*stamps], self._simulator.numbers(*self.stacked(found))

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
        later = [x for one in found if (x := self._simulator.later(one))]
        return stacked(found), stacked(later) if later else None

    def _measure(self, data: bytes, received: int) -> tuple[int, Coordinates]:
        """Reads the coordinates of the crank; see `read`.

        Raises:
            ValueError: The message is rejected and counted.
        """
        try:
            stamp, value, velocity = self._decode(data)
            position, joint = value, self._robot_joint
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
            for one in filter(None, (found, self._simulator.later(found))):
                self._require_state(one.q[0], one.u[0], one.a[0])
        except ValueError as error:
            self._reject(error)
            raise

    def _require_state(self, *motion: Real) -> None:
        try:
            self._simulator.solver.state(*motion)
        except LinkageError as error:
            raise ValueError(f'{OUT_OF_REACH}: {error}') from error

    def _reject(self, error: ValueError) -> None:
        self.rejected[str(error).partition(':')[0]] += 1

    def troubles(self, topic: str) -> list[str]:
        """Returns a warning if no measurement has been accepted for 2 s."""
        if time.monotonic() < self._last + _SILENCE:
            return []
        crank = self._simulator.crank_joint
        return [f'no measurement of {crank} on {topic} in the last {_SILENCE:g} s']

    def diagnostics(self) -> dict[str, str]:
        """Returns the counts of rejected messages, for diagnostics."""
        # Copy in one step, because the tick thread may add a count meanwhile.
        counts = list(self.rejected.items())
        return {f'rejected, {cause}': str(count) for cause, count in counts}
