# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The state of a mechanism, and the motion of its points that follows from it."""

import cmath
from typing import NamedTuple

from linkage_ros.formulas import Vector
from linkage_ros.model.structure import Structure
from linkage_ros.numeric import Real


class State(NamedTuple):
    """The motion of a mechanism at one crank angle, or at an array of them.

    The links are in the order of the joints: crank, coupler, and rocker or slider; of a wind
    pump crank, coupler, rod and slider.

    Attributes:
        position: Directions of the links from first to second pin, rad; in [-pi, pi], except the
            crank's, which is the given angle. For a slider, its position on the guide, m.
        velocity: Angular velocities of the links, rad/s; for a slider, its velocity, m/s.
        acceleration: Angular accelerations, rad/s^2; for a slider, its acceleration, m/s^2.
        torque: Driving torque on the crank, N m, counter-clockwise positive.
    """

    position: tuple[Real, ...]
    velocity: tuple[Real, ...]
    acceleration: tuple[Real, ...]
    torque: Real


class PointMotion(NamedTuple):
    """The motion of a point, in the axes of base_link.

    Attributes:
        position: Position (x, y), m.
        velocity: Velocity, m/s.
        acceleration: Acceleration, m/s^2.
    """

    position: Vector
    velocity: Vector
    acceleration: Vector


def loop_residual(structure: Structure, state: State) -> float:
    """Distance between the ends of the two paths around the loop.

    Args:
        structure: Structure of the mechanism.
        state: State of floats.

    Returns:
        The distance, m.
    """
    closure, last = structure.closure, structure.links[-1]
    reached: complex = closure.fixed + sum(
        weight * cmath.rect(1.0, angle)
        for weight, angle in zip(closure.weights, state.position, strict=False)
        if weight
    )
    if last.slides:
        reached -= last.origin + cmath.rect(state.position[-1], last.angle)
    return abs(reached)
