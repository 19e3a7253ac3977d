# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The crank measured by a robot's joint states: from a message's bytes to coordinates."""

from __future__ import annotations

import math
from typing import cast

from linkage_ros.errors import LinkageError
from linkage_ros.motion.coordinates import Coordinates
from linkage_ros.motion.drives import FollowDrive
from linkage_ros.motion.follow import FollowMotion, Measurement
from linkage_ros.numeric import Real
from linkage_ros.run.simulator import Simulator
from linkage_ros.wire.untrusted_command import decode_joint_state

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
        self._motion = FollowMotion(cast('FollowDrive', simulator.configuration.drive))
        self._simulator, self._solver = simulator, simulator.solver
        self._crank = simulator.crank_joint
        self.left_out = self._motion.left_out

    def hear(self, data: bytes, received: int) -> tuple[int, Coordinates] | None:
        """Takes a message.

        Args:
            data: CDR bytes of a JointState.
            received: Time of receipt, ns; the stamp of a message without one.

        Returns:
            The stamp, ns, and the crank; None: the message was rejected and counted.
        """
        try:
            heard = decode_joint_state(data)
        except ValueError:
            self.left_out[NO_JOINT_STATE] += 1
            return None
        named = zip(heard.names, range(len(heard.positions)), strict=False)
        index = next((i for name, i in named if name == self._crank), None)
        if index is None:
            self.left_out[NO_CRANK] += 1
            return None
        position, stamp = heard.positions[index], heard.stamp or received
        velocity = heard.velocities[index] if index < len(heard.velocities) else None
        if math.isfinite(position) and not self._has_state(position):
            self.left_out[OUT_OF_REACH] += 1
            return None
        found = self._motion.at(Measurement(stamp, position, velocity))
        if found is None:
            return None
        # At a limit of the crank rates have no bound; a moment later it may be passed.
        for one in filter(None, (found, self._simulator.later(found))):
            if not self._has_state(one.q[0], one.u[0], one.a[0]):
                self.left_out[OUT_OF_REACH] += 1
                return None
        return stamp, found

    def diagnostics(self) -> dict[str, str]:
        """Counts of the rejected messages, for diagnostics."""
        # In one step: the thread of the ticks may be counting.
        counts = list(self.left_out.items())
        return {f'left out, {cause}': str(count) for cause, count in counts}

    def _has_state(self, *motion: Real) -> bool:
        try:
            self._solver.state(*motion)
        except LinkageError:
            return False
        return True
