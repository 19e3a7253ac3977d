# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Motions from single starts: over time, and turn by turn."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from linkage_ros.dynamics.solver import Solver
from linkage_ros.errors import MotionError
from linkage_ros.motion.driven_mechanism import DrivenMechanism
from linkage_ros.motion.drives import Motor
from linkage_ros.motion.fixed_step_integrator import FixedSteps
from linkage_ros.numeric import Array
from linkage_ros.quantities import Quantity

# What a run may start with.
START_SPEED = Quantity('number', 'crank speed to start from', 'rad/s', 1e-6, 1e6)

_TOLERANCE = 1e-7  # of a step: for pictures, a hundred times that of a live run
_ANGLE = 1e-9  # rad: how near to angle 0 is a passage; what is missing is made up for linearly


class Run(NamedTuple):
    """A motion from a start at crank angle 0.

    Attributes:
        name: What the start is.
        times: s.
        speeds: Of the crank at these times, rad/s.
        passages: Through crank angle 0, the start among them: rows time, s, slider position, m,
            slider velocity, m/s, crank speed, rad/s.
        phase: At the end: crank angle, rad, slider position, crank speed, slider velocity.
        ended: Why it could not be followed as long as was asked for; empty: it could.
    """

    name: str
    times: Array
    speeds: Array
    passages: Array
    phase: tuple[float, ...]
    ended: str

    @property
    def last_speed(self) -> float | None:
        """Mean speed over the last whole turn, rad/s; None: there was none."""
        times = self.passages[:, 0]
        return 2 * math.pi / float(times[-1] - times[-2]) if len(times) > 1 else None

    def record(self) -> dict[str, Any]:
        """For JSON."""
        return {
            'start': self.name,
            'ended': self.ended or None,
            'duration': float(self.times[-1]),
            'speed_of_last_turn': self.last_speed,
            'passages': {
                name: column.tolist()
                for name, column in zip(
                    ('time', 'slider_position', 'slider_velocity', 'crank_speed'),
                    self.passages.T,
                    strict=True,
                )
            },
        }


def follow_run(
    solver: Solver,
    motor: Motor,
    point: tuple[float, float, float],
    duration: float,
    name: str,
) -> Run:
    """Follows a motion from crank angle 0.

    Args:
        solver: Solver of the pump.
        motor: Of the pump.
        point: Slider position, m, its velocity, m/s, and crank speed, rad/s, at the start.
        duration: s.
        name: What the start is.

    Returns:
        The motion, up to where it ends if it cannot be followed so long.

    Raises:
        LinkageError: It cannot even begin.
    """
    x, v, w = point
    driven = DrivenMechanism(solver, lambda _, speed: motor.at(speed))
    # A fiftieth of a turn at most, at the start and as fast as the motor can.
    fastest = motor.torque / motor.damping if motor.damping else 0.0
    step = 2 * math.pi / 50 / max(w, fastest)
    steps = FixedSteps(driven, (0.0, x, w, v), longest=step, tolerance=_TOLERANCE)
    samples, passages, ended = [(0.0, w)], [(0.0, x, v, w)], ''
    try:
        while steps.time < duration:
            left = _left(steps, len(passages))
            ahead = left / steps.phase[2] if steps.phase[2] > 0 else math.inf
            if abs(left) < _ANGLE or left < 0 < steps.phase[2]:
                passages.append(_passage(steps, ahead))
            else:
                steps.advance(steps.time + min(step, ahead))
                samples.append((steps.time, steps.phase[2]))
    except MotionError as error:
        ended = str(error)
    times, speeds = np.array(samples).T
    return Run(name, times, speeds, np.array(passages), steps.phase, ended)


def _left(steps: FixedSteps, turns: int) -> float:
    """The angle up to a whole number of turns, rad."""
    return 2 * math.pi * (turns - 2 * steps.pairs) - steps.phase[0]


def _passage(steps: FixedSteps, ahead: float) -> tuple[float, float, float, float]:
    """The passage that is a moment away."""
    slopes = steps.driven.slope(steps.time, steps.phase)
    _, x, w, v = (value + ahead * slope for value, slope in zip(steps.phase, slopes, strict=True))
    return steps.time + ahead, x, v, w
