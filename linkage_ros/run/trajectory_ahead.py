# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Trajectories of the crank with its torque, ahead of time, for a controller."""

from collections import deque
from collections.abc import Mapping, Sequence
from contextlib import suppress

from linkage_ros.errors import MotionError
from linkage_ros.mechanism.solver import NO_FORCES
from linkage_ros.messages.templates import crank_trajectory
from linkage_ros.messages.topics import TRAJECTORY_COMMANDS
from linkage_ros.motion.segments import Motion
from linkage_ros.run.states import Simulator
from linkage_ros.units import NS_PER_MS, NS_PER_S

# Time between points, ns; short, because the controller interpolates the effort linearly.
_STEP = NS_PER_MS


class TrajectoryAhead:
    """Computes trajectories of a fixed duration; the next one is due after half of it.

    A trajectory starts at or just before its stamp, so that a controller can follow it as soon as
    it arrives. Each tick computes only the new points within the horizon. The first tick, and the
    first one after a change of the motion, compute all points; so does the first trajectory due
    after a change of the forces, which may come at any rate.

    Attributes:
        topic: Topic of the trajectories.
    """

    def __init__(self, simulator: Simulator) -> None:
        """Prepares the trajectories.

        Args:
            simulator: Simulator of the run, whose drive gives the topic and the duration.
        """
        drive = simulator.configuration.drive
        self.topic = TRAJECTORY_COMMANDS._replace(name=drive.trajectory_command_topic)
        self._names = simulator.crank_joint, simulator.configuration.session.frame_id
        self._joint = simulator.machine.joint
        self._simulator, self._solver = simulator, simulator.solver
        self._horizon = round(drive.trajectory_horizon * NS_PER_S)
        self._motion: Motion | None = None
        self._forces = NO_FORCES  # those of the points
        self._points: deque[tuple[int, tuple[float, ...]]] = deque()
        self._next = self._due = 0

    def message_at(
        self, motion: Motion, stamp: int, forces: Mapping[str, Sequence[float]] = NO_FORCES
    ) -> bytes | None:
        """Returns the trajectory to send at a stamp, if one is due.

        Args:
            motion: Motion in the segment that contains the stamp. If it differs from the motion in
                the last call, the previous trajectory is invalid, and a new one is due.
            stamp: Stamp of the current tick, ns.
            forces: Force [x, y], N, of each load whose force is set by messages, by name. Each
                trajectory holds the forces at its stamp.

        Returns:
            The CDR bytes of the message; None if no message is due.
        """
        has_other_forces = stamp >= self._due and forces != self._forces
        if motion is not self._motion or has_other_forces or stamp >= self._next:
            self._points.clear()
            self._forces = forces
            self._motion, self._next, self._due = motion, stamp, stamp
            self._solver = self._simulator.under(motion.segment.gravity).solver
        with suppress(MotionError):  # a law may end within the horizon
            while self._next < stamp + self._horizon + _STEP:
                (q,), (u,), (a,), unwrapped, *_ = motion.at(self._next)
                torque = float(self._solver.state(q, u, a, forces=self._forces).torque)
                joint = self._joint
                position, effort = joint.value(unwrapped), torque / joint.ratio
                values = position, joint.ratio * u, joint.ratio * a, effort
                self._points.append((self._next, values))
                self._next += _STEP
        while len(self._points) > 1 and self._points[1][0] <= stamp:
            self._points.popleft()
        if stamp < self._due:
            return None
        self._due = stamp + self._horizon // 2
        return crank_trajectory(*self._names, self._points)
