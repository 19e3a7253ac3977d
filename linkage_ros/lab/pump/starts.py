# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Starts of a wind pump at crank angle 0."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from linkage_ros.dynamics.solver import Solver
from linkage_ros.lab.pump.periodic_motion import PeriodicMotion
from linkage_ros.model.wind_pump import WindPump
from linkage_ros.motion.drives import Motor
from linkage_ros.numeric import Array
from linkage_ros.quantities import Quantity

# Crank speeds with which a motion may start.
START_SPEED = Quantity('number', 'crank speed to start from', 'rad/s', 1e-6, 1e6)

_FORWARDS = Quantity('number', 'motor torque at rest that turns the crank', 'N m', 1e-9, 1e12)
_ASIDE = 0.02  # of the speed of an unstable state: how far from it motions start


def require_forwards(mechanism: WindPump, motor: Motor, speeds: Sequence[float]) -> None:
    """Passes if a motor and starts turn the crank forwards.

    Args:
        mechanism: The pump.
        motor: Motor of the pump.
        speeds: Speeds of the crank at the starts, rad/s.

    Raises:
        ConfigurationError: They do not.
        UnreachableError: The pump cannot start from where its slider is.
    """
    _FORWARDS.clean('motor.torque', motor.torque)
    slider = mechanism.slider
    solver = Solver(mechanism)
    for speed in speeds:
        START_SPEED.clean('start speed', speed)
        solver.accelerations((0.0, slider.position), (speed, slider.velocity), motor.torque)


def named_starts(
    mechanism: WindPump, speeds: Sequence[float], states: Sequence[PeriodicMotion]
) -> tuple[list[str], Array]:
    """The starts that are drawn: those that are asked for, and next to unstable states.

    Args:
        mechanism: The pump, with the start of its slider.
        speeds: Speeds of the crank at angle 0, rad/s.
        states: Steady states.

    Returns:
        Their names, and crank angles, rad, slider positions, m, and rates, of shape (4, n).
    """
    slider = mechanism.slider
    names = [f'{speed:g} rad/s' for speed in speeds]
    starts = [(0.0, slider.position, speed, slider.velocity) for speed in speeds]
    for state in states:
        x, w, v = state.at(np.zeros(1))[:, 0].tolist()
        for sign, word in ((-1, 'below'), (1, 'above')) if not state.stable else ():
            names.append(f'{_ASIDE:.0%} {word} {state.speed:.4g} rad/s')
            starts.append((0.0, x, w * (1 + sign * _ASIDE), v))
    return names, np.array(starts).T
