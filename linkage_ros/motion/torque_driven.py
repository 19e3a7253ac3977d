# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The motion of a mechanism under its motor and under commands, integrated from stamp to stamp."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np

from linkage_ros.dynamics.solver import Solver
from linkage_ros.errors import LinkageError
from linkage_ros.model.structure import Mechanism
from linkage_ros.motion.coordinates import Coordinates
from linkage_ros.motion.driven_mechanism import DrivenMechanism
from linkage_ros.motion.drives import TorqueDrive
from linkage_ros.motion.fixed_step_integrator import Integrate, Values
from linkage_ros.motion.integrators import live_steps
from linkage_ros.motion.segments import TorqueSegment
from linkage_ros.motion.speed_driven import SpeedMotion
from linkage_ros.numeric import Real, with_turns, within_two_turns
from linkage_ros.units import NS_PER_S, radians_per_second

# What a late run makes up for beyond a tick, ns. More would only hold it up further.
CATCH_UP = NS_PER_S // 4


class TorqueMotion:
    """A motion under a torque; its stamps must not go back.

    Attributes:
        segment: What a log keeps of the motion since the last change.
    """

    def __init__(
        self,
        solver: Solver,
        drive: TorqueDrive,
        stamp: int,
        period: int,
        integrate: Integrate = live_steps,
    ) -> None:
        """Starts a motion.

        Args:
            solver: Solver of the mechanism.
            drive: Motor and start.
            stamp: Stamp of t = 0, ns.
            period: Between states, ns.
            integrate: Makes the integrator.

        Raises:
            LinkageError: It cannot start from there.
        """
        self.segment = TorqueSegment(stamp, drive.motor.torque)
        self._solver, self._motor, self._command = solver, drive.motor, 0.0
        self._period, self._last = period, stamp
        begin = start(solver.mechanism, drive)
        y = begin.unwrapped, *begin.q[1:], *begin.u
        self._steps = integrate(DrivenMechanism(solver, self._torque), y)
        self._end: LinkageError | None = None
        self._begun = 0.0  # time of the integrator at the start of the segment, s

    def at(self, stamp: int) -> Coordinates:
        """The coordinates at a stamp.

        Args:
            stamp: Not before the last one, ns.

        Returns:
            The coordinates. The angle within two turns is that of the rounded unwrapped one, so
            that a log holds the exact state.

        Raises:
            MotionError: The motion cannot be followed that far.
        """
        if self._end:
            raise self._end
        self._advance(stamp)
        y, count = self._steps.phase, len(self._solver.coordinates)
        unwrapped = with_turns(y[0], self._steps.pairs)
        angle, _ = within_two_turns(unwrapped)
        q, u = (angle, *y[1:count]), y[count:]
        torque = self._torque(u[0])
        return Coordinates(q, u, self._solver.forward((*q, *u), torque), unwrapped)

    def at_all(self, stamps: Sequence[int]) -> Coordinates:
        """The coordinates at many stamps, bit for bit as `at` has them.

        Args:
            stamps: Not before the last one, rising, ns.

        Returns:
            Arrays; shorter than the stamps where the motion cannot be followed to all of them.

        Raises:
            MotionError: It cannot be followed to the first one.
        """
        if self._end:
            raise self._end
        times = [self._time(stamp) for stamp in stamps]
        found: list[tuple[Values, int]] = []
        try:
            found.extend(self._steps.phases(times))
        except LinkageError as error:
            self._end = error
        if self._end and not found:
            raise self._end
        self._last, count = stamps[len(found) - 1], len(self._solver.coordinates)
        crank = [with_turns(phase[0], pairs) for phase, pairs in found]
        angles = [within_two_turns(angle)[0] for angle in crank]
        _, *y = np.array([phase for phase, _ in found]).T
        q, u = (np.array(angles), *y[: count - 1]), tuple(y[count - 1 :])
        torque = self._torque(u[0])
        a = self._solver.accelerations(q, u, torque, by_math=True)
        return Coordinates(q, u, a, np.array(crank))

    def command(self, stamp: int, torque: float) -> None:
        """Sets the torque that is added to the motor's from a stamp on.

        Args:
            stamp: Not before the last one, ns.
            torque: N m.

        Raises:
            MotionError: The motion cannot be followed that far.
        """
        self._advance(stamp)
        if torque != self._command:
            self._command = torque
            self._steps.changed()

    def follow(self, stamp: int, drive: Any) -> TorqueMotion:
        """Goes on under a drive; a new segment begins where its motor was set.

        Another begins where the run is late by more than 0.25 s: for that time the plant stood
        still.

        Args:
            stamp: Not before the last one, ns.
            drive: The TorqueDrive in force.

        Returns:
            This motion.

        Raises:
            MotionError: The motion cannot be followed that far.
        """
        is_late = stamp - self._last > self._period + CATCH_UP
        if is_late or drive.motor != self._motor:
            if not is_late:
                self._advance(stamp)
            self._begin(TorqueSegment(stamp, drive.motor.torque))
            self._motor = drive.motor
            self._steps.changed()
        return self

    def restamp(self, old: int, new: int) -> TorqueMotion:
        """Goes on after a step of the clock.

        Args:
            old: The moment on the clock before the step, ns.
            new: The same moment on the clock after it, ns.

        Returns:
            This motion.

        Raises:
            MotionError: The motion cannot be followed that far.
        """
        self._advance(old)
        self._begin(TorqueSegment(new, self._motor.torque, old))
        return self

    def _begin(self, segment: TorqueSegment) -> None:
        self.segment, self._last, self._begun = segment, segment.stamp, self._steps.time

    def _advance(self, stamp: int) -> None:
        self._last = stamp
        self._steps.advance(self._time(stamp))

    def _time(self, stamp: int) -> float:
        """The integrator's time at a stamp, s."""
        return self._begun + (stamp - self.segment.stamp) / NS_PER_S

    def _torque(self, speed: float) -> Real:
        return self._motor.at(speed) + self._command


# The motion of a run, whatever drives it.
Motion: TypeAlias = SpeedMotion | TorqueMotion


def start(mechanism: Mechanism, drive: TorqueDrive) -> Coordinates:
    """The coordinates at t = 0, where the accelerations are still to be solved."""
    positions, rates = mechanism.start()
    angle, _ = within_two_turns(drive.crank_angle)
    u = radians_per_second(drive.start_rpm), *rates
    return Coordinates((angle, *positions), u, (0.0,) * len(u), drive.crank_angle)
