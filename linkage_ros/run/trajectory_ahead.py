# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Trajectories of the cranks with their torques, ahead of time, for a controller."""

from collections import deque
from collections.abc import Mapping

from linkage_ros.errors import MotionError
from linkage_ros.mechanism.conditions import OWN_CONDITIONS
from linkage_ros.messages.templates import crank_trajectory, holding_trajectory
from linkage_ros.messages.topics import TRAJECTORY_COMMANDS
from linkage_ros.motion.segments import Motion, Segment
from linkage_ros.run.robot import Robot
from linkage_ros.run.states import Simulator
from linkage_ros.units import NS_PER_MS, NS_PER_S

# Time between points, ns; short, because the controller interpolates the effort linearly.
_STEP = NS_PER_MS


class TrajectoryAhead:
    """Computes trajectories of a fixed duration; the next one is due after half of it.

    A trajectory starts at or just before its stamp, so that a controller can follow it as soon as
    it arrives. Each tick computes only the new points within the horizon. The first tick, and the
    first one after a change of a motion, compute all points; so does the first trajectory due
    after a change of the forces, which may come at any rate.

    Each trajectory names the cranks of all linkages, because controllers refuse others. A crank
    whose motion ends stays at its last place with an effort of 0, while another one moves.

    Attributes:
        topic: Topic of the trajectories.
    """

    def __init__(self, robot: Robot) -> None:
        """Prepares the trajectories, whose topic and duration the drive gives."""
        drive = robot.drive
        self.topic = TRAJECTORY_COMMANDS._replace(name=drive.trajectory_command_topic)
        self._frame_id = robot.configuration.session.frame_id
        self._cranks = {name: _Crank(x) for name, x in robot.simulators.items()}
        self._horizon = round(drive.trajectory_horizon * NS_PER_S)
        self._points: deque[tuple[int, list[tuple[float, ...]]]] = deque()
        self._next = self._due = 0

    def message_at(self, motions: Mapping[str, Motion], stamp: int) -> bytes | None:
        """Returns the trajectory to send at the stamp of a tick, ns, as CDR bytes, if one is due.

        Args:
            motions: Motion of each linkage in the segment that contains the stamp; without those
                that have ended. If a segment is another one than in the last call, the previous
                trajectory is invalid, and a new one is due. Each trajectory holds the conditions
                at its stamp.
            stamp: The stamp.
        """
        if self._is_invalid(motions, stamp):
            self._restart(motions, stamp)
        self._extend(motions, stamp + self._horizon)
        while len(self._points) > 1 and self._points[1][0] <= stamp:
            self._points.popleft()
        if stamp < self._due:
            return None
        self._due = stamp + self._horizon // 2
        names = [crank.name for crank in self._cranks.values()]
        return crank_trajectory(names, self._frame_id, self._points)

    def _is_invalid(self, motions: Mapping[str, Motion], stamp: int) -> bool:
        """Returns whether the points belong to other motions, or all of them are in the past."""
        cranks = self._cranks.items()
        if stamp >= self._next or any(crank.differs(motions.get(name)) for name, crank in cranks):
            return True
        return stamp >= self._due and any(
            crank.has_other_conditions(motions.get(name)) for name, crank in cranks
        )

    def _restart(self, motions: Mapping[str, Motion], stamp: int) -> None:
        """Discards all points, and begins at a stamp."""
        self._points.clear()
        for name, crank in self._cranks.items():
            crank.take(motions.get(name))
        self._next = self._due = stamp

    def _extend(self, motions: Mapping[str, Motion], end: int) -> None:
        """Adds points up to one after the end of the horizon, or until all motions end."""
        while self._next < end + _STEP:
            values = [
                crank.values(motions.get(name), self._next) for name, crank in self._cranks.items()
            ]
            if not any(crank.moves for crank in self._cranks.values()):
                break  # the last law ends within the horizon
            self._points.append((self._next, [*zip(*values, strict=True)]))
            self._next += _STEP

    def zero(self, places: Mapping[str, float]) -> bytes:
        """Returns a trajectory that ends the torques: it holds places with efforts of 0.

        The place of a linkage is its crank angle including all turns, rad, or its slide's
        position, m.
        """
        positions = {x.name: x.joint.value(places[name]) for name, x in self._cranks.items()}
        return holding_trajectory(positions, self._frame_id)


class _Crank:
    """The driven joint of a linkage in trajectories.

    Attributes:
        name: Name of the joint.
        joint: The joint.
        moves: Whether the motion has not ended at the stamp of the last values.
    """

    def __init__(self, simulator: Simulator) -> None:
        self.name, self.joint = simulator.crank_joint, simulator.machine.joint
        self._solver = simulator.solver
        self._segment: Segment | None = None
        self._under = OWN_CONDITIONS  # those of the points
        self._place = 0.0  # the last one in a point
        self.moves = False

    def differs(self, motion: Motion | None) -> bool:
        """Returns whether the points belong to another segment."""
        return self._segment is not (motion.segment if motion else None)

    def has_other_conditions(self, motion: Motion | None) -> bool:
        """Returns whether the points were computed under other conditions."""
        return motion is not None and motion.conditions != self._under

    def take(self, motion: Motion | None) -> None:
        """Takes the segment and the conditions of further points."""
        self._segment = motion.segment if motion else None
        self._under = motion.conditions if motion else OWN_CONDITIONS
        self.moves = motion is not None

    def values(self, motion: Motion | None, stamp: int) -> tuple[float, float, float, float]:
        """Returns position, velocity, acceleration and effort at a stamp, ns."""
        at_rest = self._place, 0.0, 0.0, 0.0
        if not (motion and self.moves):
            return at_rest
        try:
            (q,), (u,), (a,), unwrapped, *_ = motion.at(stamp)
        except MotionError:
            self.moves = False
            return at_rest
        torque = float(self._solver.state(q, u, a, under=self._under).torque)
        joint = self.joint
        self._place = joint.value(unwrapped)
        return self._place, joint.ratio * u, joint.ratio * a, torque / joint.ratio
