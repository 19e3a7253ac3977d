# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The crank measured by a robot's joint states: from a message's bytes to coordinates."""

from __future__ import annotations

import math
import time
from typing import cast

from linkage_ros.errors import LinkageError
from linkage_ros.motion.coordinates import Coordinates
from linkage_ros.motion.drives import FollowDrive
from linkage_ros.motion.follow import FollowMotion, Measurement
from linkage_ros.numeric import Real
from linkage_ros.run.simulator import Simulator
from linkage_ros.wire.cdr import decode_joint_state

_SILENCE = 2.0  # s without a measurement after which it is said
NO_CRANK, NO_JOINT_STATE, OUT_OF_REACH = 'without the crank', 'no JointState', 'out of reach'


class MeasuredCrank:
    """Reads measurements in the order of their arrival.

    Attributes:
        left_out: Numbers of rejected messages, by cause.
    """

    def __init__(self, simulator: Simulator) -> None:
        """Begins without a measurement.

        Args:
            simulator: Simulator of a configuration with `drive: follow`.
        """
        self._simulator = simulator
        self._motion = FollowMotion(cast('FollowDrive', simulator.configuration.drive))
        self.left_out = self._motion.left_out
        self._last = -math.inf  # when a measurement was accepted, s

    def read(self, data: bytes, received: int) -> tuple[int, Coordinates]:
        """Takes a message.

        Args:
            data: CDR bytes of a JointState.
            received: Time of receipt, ns; the stamp of a message without one.

        Returns:
            The stamp, ns, and the crank.

        Raises:
            ValueError: The message is rejected and counted; the text is the cause.
        """
        try:
            heard = decode_joint_state(data)
        except ValueError as error:
            raise self._rejected(NO_JOINT_STATE) from error
        names = heard.names[: len(heard.positions)]
        if self._simulator.crank_joint not in names:
            raise self._rejected(NO_CRANK)
        index, stamp = names.index(self._simulator.crank_joint), heard.stamp or received
        position = heard.positions[index]
        velocity = heard.velocities[index] if index < len(heard.velocities) else None
        if math.isfinite(position) and not self._has_state(position):
            raise self._rejected(OUT_OF_REACH)
        before = self.left_out.copy()
        found = self._motion.at(Measurement(stamp, position, velocity))
        if found is None:
            (cause,) = self.left_out - before
            raise ValueError(cause)
        # At a limit of the crank rates have no bound; a moment later it may be passed.
        for one in filter(None, (found, self._simulator.later(found))):
            if not self._has_state(one.q[0], one.u[0], one.a[0]):
                raise self._rejected(OUT_OF_REACH)
        self._last = time.monotonic()
        return stamp, found

    def _rejected(self, cause: str) -> ValueError:
        self.left_out[cause] += 1
        return ValueError(cause)

    def troubles(self, topic: str) -> list[str]:
        """A warning if no measurements arrive on their topic; else empty."""
        if time.monotonic() < self._last + _SILENCE:
            return []
        crank = self._simulator.crank_joint
        return [f'no measurement of {crank} on {topic} in the last {_SILENCE:g} s']

    def diagnostics(self) -> dict[str, str]:
        """Counts of the rejected messages, for diagnostics."""
        # In one step: the thread of the ticks may be counting.
        counts = list(self.left_out.items())
        return {f'left out, {cause}': str(count) for cause, count in counts}

    def _has_state(self, *motion: Real) -> bool:
        try:
            self._simulator.solver.state(*motion)
        except LinkageError:
            return False
        return True
