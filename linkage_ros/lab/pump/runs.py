# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Motions from single starts over time."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from linkage_ros.dynamics.solver import Solver
from linkage_ros.errors import MotionError
from linkage_ros.motion.driven_mechanism import DrivenMechanism
from linkage_ros.motion.drives import Motor
from linkage_ros.motion.fixed_step_integrator import FixedSteps
from linkage_ros.quantities import Quantity

# Crank speeds with which a run may start.
START_SPEED = Quantity('number', 'crank speed to start from', 'rad/s', 1e-6, 1e6)

_TOLERANCE = 1e-7  # of a step: for pictures, a hundred times that of a live run


class Run(NamedTuple):
    """A motion from a start at crank angle 0.

    Attributes:
        name: Name of the start.
        start: Slider position, m, its velocity, m/s, and crank speed, rad/s.
        times: s.
        speeds: Speeds of the crank at these times, rad/s.
        phase: At the end: crank angle, rad, slider position, crank speed, slider velocity.
        ended: Why it could not be followed as long as was asked for; empty: it could.
    """

    name: str
    start: tuple[float, float, float]
    times: list[float]
    speeds: list[float]
    phase: tuple[float, ...]
    ended: str

    def record(self) -> dict[str, Any]:
        """For JSON."""
        duration = self.times[-1]
        return {'start': self.name, 'ended': self.ended or None, 'duration': duration}


def follow_run(
    solver: Solver,
    motor: Motor,
    start: tuple[float, float, float],
    duration: float,
    name: str,
) -> Run:
    """Follows a motion from crank angle 0.

    Args:
        solver: Solver of the pump.
        motor: Motor of the pump.
        start: Slider position, m, its velocity, m/s, and crank speed, rad/s.
        duration: s.
        name: Name of the start.

    Returns:
        The motion, up to where it ends if it cannot be followed so long.

    Raises:
        LinkageError: It cannot even begin.
    """
    x, v, w = start
    # A fiftieth of a turn at most, at the start and as fast as the motor can.
    fastest = motor.torque / motor.damping if motor.damping else 0.0
    step = 2 * math.pi / 50 / max(w, fastest)
    driven = DrivenMechanism(solver, lambda _, speed: motor.at(speed))
    steps = FixedSteps(driven, (0.0, x, w, v), longest=step, tolerance=_TOLERANCE)
    times, speeds, ended = [0.0], [w], ''
    try:
        while steps.time < duration:
            steps.advance(steps.time + step)
            times.append(steps.time)
            speeds.append(steps.phase[2])
    except MotionError as error:
        ended = str(error)
    return Run(name, start, times, speeds, steps.phase, ended)
