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
from linkage_ros.wire.untrusted_command import decode_joint_state

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
        """Takes a message, as `hear` does.

        Args:
            data: CDR bytes of a JointState.
            received: Time of receipt, ns; the stamp of a message without one.

        Returns:
            The stamp, ns, and the crank.

        Raises:
            ValueError: The message was rejected and counted.
        """
        before = self.left_out.copy()
        heard = self.hear(data, received)
        if heard is None:
            (cause,) = self.left_out - before
            raise ValueError(cause)
        self._last = time.monotonic()
        return heard

    def hear(self, data: bytes, received: int) -> tuple[int, Coordinates] | None:
        """Takes a message.

        Args:
            data: CDR bytes of a JointState.
            received: Time of receipt, ns; the stamp of a message without one.

        Returns:
            The stamp, ns, and the crank; None: the message was rejected and counted.
        """
        measured = self._measurement(data, received)
        if not isinstance(measured, Measurement):
            self.left_out[measured] += 1
            return None
        found = self._motion.at(measured)
        if found is None:
            return None
        # At a limit of the crank rates have no bound; a moment later it may be passed.
        for one in filter(None, (found, self._simulator.later(found))):
            if not self._has_state(one.q[0], one.u[0], one.a[0]):
                self.left_out[OUT_OF_REACH] += 1
                return None
        return measured.stamp, found

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

    def _measurement(self, data: bytes, received: int) -> Measurement | str:
        """Reads a message; returns the cause if it has no measurement within reach."""
        try:
            heard = decode_joint_state(data)
        except ValueError:
            return NO_JOINT_STATE
        names = heard.names[: len(heard.positions)]
        if self._simulator.crank_joint not in names:
            return NO_CRANK
        index = names.index(self._simulator.crank_joint)
        position = heard.positions[index]
        velocity = heard.velocities[index] if index < len(heard.velocities) else None
        if math.isfinite(position) and not self._has_state(position):
            return OUT_OF_REACH
        return Measurement(heard.stamp or received, position, velocity)

    def _has_state(self, *motion: Real) -> bool:
        try:
            self._simulator.solver.state(*motion)
        except LinkageError:
            return False
        return True
