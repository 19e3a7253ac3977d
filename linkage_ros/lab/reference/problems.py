# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Initial value problems for integrators: mechanism, start and motor."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from typing import Any, TypeAlias

from linkage_ros.dynamics.solver import Solver
from linkage_ros.model.four_bar import FourBar
from linkage_ros.model.wind_pump import WindPump
from linkage_ros.motion.driven_mechanism import DrivenMechanism
from linkage_ros.motion.drives import Motor
from linkage_ros.parameters.configuration import load

# Coordinates, then their rates.
Phase: TypeAlias = tuple[float, ...]


@dataclass(frozen=True)
class InitialValueProblem:
    """A motion from its start, in the crank angle and, of a wind pump, the slider's position.

    Attributes:
        mechanism: The mechanism.
        start: Coordinates at t = 0, then their rates; rad and m, rad/s and m/s.
        motor: Motor of the crank.
    """

    mechanism: FourBar | WindPump
    start: Phase
    motor: Motor = field(default_factory=Motor)

    @cached_property
    def driven(self) -> DrivenMechanism:
        """The first-order system, with the package's own equations of motion."""
        return DrivenMechanism(Solver(self.mechanism), lambda speed: self.motor.at(speed))

    @property
    def count(self) -> int:
        """Number of coordinates."""
        return len(self.start) // 2

    def energy(self, phase: Phase) -> tuple[float, float]:
        """Kinetic energy plus the potential energy of weights, up to a constant, J."""
        return self.driven.solver.energy(phase[: self.count], phase[self.count :])


@cache
def preset(name: str) -> Any:
    """The configuration of a preset."""
    return load(name)


def driven_pump(speed: float, velocity: float = 0.0) -> InitialValueProblem:
    """The wind pump of document 3 with its motor and load.

    Args:
        speed: Speed of the crank at t = 0, rad/s.
        velocity: Velocity of the slider at t = 0, m/s.

    Returns:
        The problem.
    """
    pump = preset('wind_pump')
    start = 0.0, pump.mechanism.slider.position, speed, velocity
    return InitialValueProblem(pump.mechanism, start, pump.drive.motor)


def free_pump(speed: float) -> InitialValueProblem:
    """The pump without motor and load, which conserves energy, from a crank speed, rad/s."""
    pump = preset('wind_pump').mechanism
    pump = replace(pump, slider=replace(pump.slider, damping=0.0))
    return InitialValueProblem(pump, (0.0, pump.slider.position, speed, 0.0))


def coasting() -> InitialValueProblem:
    """The quadrilateral of document 1 from 150 rpm without a motor, which conserves energy."""
    return InitialValueProblem(preset('quadrilateral').mechanism, (0.0, 5 * math.pi))
