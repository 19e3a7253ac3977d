# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Trajectories of the crank with its torque, ahead of time, for a controller."""

from collections import deque
from contextlib import suppress

from linkage_ros.errors import MotionError
from linkage_ros.mechanism.conditions import OWN_CONDITIONS
from linkage_ros.messages.templates import crank_trajectory, holding_trajectory
from linkage_ros.messages.topics import TRAJECTORY_COMMANDS
from linkage_ros.motion.segments import Motion, Segment
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
        self._solver = simulator.solver
        self._horizon = round(drive.trajectory_horizon * NS_PER_S)
        self._segment: Segment | None = None
        self._under = OWN_CONDITIONS  # those of the points
        self._points: deque[tuple[int, tuple[float, ...]]] = deque()
        self._next = self._due = 0

    def message_at(self, motion: Motion, stamp: int) -> bytes | None:
        """Returns the trajectory to send at a stamp, if one is due.

        Args:
            motion: Motion in the segment that contains the stamp. If it is another segment than in
                the last call, the previous trajectory is invalid, and a new one is due. Each
                trajectory holds the conditions at its stamp.
            stamp: Stamp of the current tick, ns.

        Returns:
            The CDR bytes of the message; None if no message is due.
        """
        is_new = motion.segment is not self._segment
        has_others = stamp >= self._due and motion.conditions != self._under
        if is_new or has_others or stamp >= self._next:
            self._points.clear()
            self._segment, self._under = motion.segment, motion.conditions
            self._next = self._due = stamp
        with suppress(MotionError):  # a law may end within the horizon
            while self._next < stamp + self._horizon + _STEP:
                (q,), (u,), (a,), unwrapped, *_ = motion.at(self._next)
                torque = float(self._solver.state(q, u, a, under=self._under).torque)
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

    def zero(self, unwrapped: float) -> bytes:
        """Returns a trajectory that ends the torque: it holds a place with an effort of 0.

        Args:
            unwrapped: The place: crank angle including all turns, rad, or position of a slide, m.
        """
        return holding_trajectory(*self._names, self._joint.value(unwrapped))
