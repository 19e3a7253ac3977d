# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Motions under a torque, for integrators to follow: a mechanism, its start and its motor."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

from linkage_ros.core.equations import EquationsOfMotion
from linkage_ros.core.mechanism import FourBar, WindPump
from linkage_ros.core.simulation import Motion, Phase


@dataclass(frozen=True)
class MotionTask:
    """A motion to follow, in the crank angle and, of a wind pump, the slider's position.

    Attributes:
        mechanism: What moves.
        start: Coordinates at t = 0, then their rates; rad and m, rad/s and m/s.
        torque: Of the motor on the crank at rest, N m.
        damping: What the motor loses of it per crank speed, N m s.
    """

    mechanism: FourBar | WindPump
    start: Phase
    torque: float = 0.0
    damping: float = 0.0

    @cached_property
    def motion(self) -> Motion:
        """It as a system of first order, with the package's own equations of motion."""
        torque, damping = self.torque, self.damping
        return Motion(EquationsOfMotion(self.mechanism), lambda _, speed: torque - damping * speed)

    @property
    def count(self) -> int:
        """Of coordinates."""
        return len(self.start) // 2

    def energy(self, phase: Phase) -> tuple[float, float]:
        """Kinetic energy and that of the weights, J.

        Args:
            phase: Coordinates, then their rates.

        Returns:
            Both; the latter but for a constant.
        """
        return self.motion.equations.energy(phase[: self.count], phase[self.count :])


class Machines(NamedTuple):
    """What moves in the charts.

    Attributes:
        quadrilateral: The four-bar of document 1.
        pump: The wind pump of document 3.
        torque: Of the pump's motor at rest, N m.
        damping: What it loses per crank speed, N m s.
    """

    quadrilateral: FourBar
    pump: WindPump
    torque: float
    damping: float

    def driven(self, speed: float, velocity: float = 0.0) -> MotionTask:
        """The pump with its motor and its water.

        Args:
            speed: Of the crank at t = 0, rad/s.
            velocity: Of the slider at t = 0, m/s.

        Returns:
            The motion.
        """
        start = 0.0, self.pump.slider.position, speed, velocity
        return MotionTask(self.pump, start, self.torque, self.damping)

    def freed(self, speed: float) -> MotionTask:
        """The pump without motor and water, which keeps its energy.

        Args:
            speed: Of the crank at t = 0, rad/s.

        Returns:
            The motion.
        """
        pump = replace(self.pump, slider=replace(self.pump.slider, damping=0.0))
        return MotionTask(pump, (0.0, pump.slider.position, speed, 0.0))

    def coasting(self, speed: float) -> MotionTask:
        """The quadrilateral without a motor, which keeps its energy.

        Args:
            speed: Of the crank at t = 0, rad/s.

        Returns:
            The motion.
        """
        return MotionTask(self.quadrilateral, (0.0, speed))
