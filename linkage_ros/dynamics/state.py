# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The state of a mechanism, and the motion of its points that follows from it."""

from __future__ import annotations

import cmath
from collections.abc import Sequence
from typing import NamedTuple

from linkage_ros.formulas import ZERO, Vector, number
from linkage_ros.model.structure import Point, Structure
from linkage_ros.numeric import Real


class State(NamedTuple):
    """The motion of a mechanism at one crank angle, or at an array of them.

    The links are in the order of the joints: crank, coupler, and rocker or slider; of a wind
    pump crank, coupler, rod and slider.

    Attributes:
        position: Directions of the links from first to second pin, rad; in [-pi, pi], except the
            crank's, which is the angle that was asked for. A slider's place on its guide, m.
        velocity: Their angular velocities, rad/s; a slider's velocity, m/s.
        acceleration: Their angular accelerations, rad/s^2; a slider's acceleration, m/s^2.
        torque: Driving torque on the crank, N m, counter-clockwise positive.
    """

    position: tuple[Real, ...]
    velocity: tuple[Real, ...]
    acceleration: tuple[Real, ...]
    torque: Real


class PointMotion(NamedTuple):
    """The motion of a point, in the axes of base_link.

    Attributes:
        position: (x, y), m.
        velocity: m/s.
        acceleration: m/s^2.
    """

    position: Vector
    velocity: Vector
    acceleration: Vector


class Track(NamedTuple):
    """A point for formulas: the weights of `Point` in parts, ZERO where they are 0.

    Attributes:
        weights: For each link (along, across) of its direction, m.
        fixed: m.
    """

    weights: tuple[Vector, ...]
    fixed: Vector

    @classmethod
    def of(cls, point: Point) -> Track:
        """The track of a point."""
        return cls(tuple(map(Vector.of, point.weights)), Vector.of(point.fixed))

    def follow(
        self, directions: Sequence[Vector], rates: Sequence[Real], changes: Sequence[Real]
    ) -> PointMotion:
        """Follows the point (document 2, eq. a2, a3, 34, 35; their derivative).

        Args:
            directions: Unit vector of each link.
            rates: Velocity of each link, rad/s.
            changes: Acceleration of each link, rad/s^2.

        Returns:
            The motion.
        """
        position, velocity, acceleration = self.fixed, Vector(ZERO, ZERO), Vector(ZERO, ZERO)
        for weight, direction, rate, change in zip(
            self.weights, directions, rates, changes, strict=True
        ):
            arm = Vector(
                direction.x * weight.x - direction.y * weight.y,
                direction.y * weight.x + direction.x * weight.y,
            )
            position += arm
            velocity += arm.left() * rate
            acceleration += arm.left() * change - arm * (rate * rate)
        return PointMotion(position, velocity, acceleration)


def follow(point: Point, state: State) -> PointMotion:
    """The motion of a point in a state.

    Args:
        point: The point, as a combination of link directions.
        state: Floats or arrays.

    Returns:
        Its position, velocity and acceleration in the axes of base_link.
    """
    angles, rates, changes, _ = state
    motion = Track.of(point).follow([Vector.at(angle) for angle in angles], rates, changes)
    return PointMotion(*(Vector(number(x), number(y)) for x, y in motion))


def loop_residual(structure: Structure, state: State) -> float:
    """How far apart the two ways around the loop end.

    Args:
        structure: Structure of the mechanism.
        state: Floats.

    Returns:
        The distance, m.
    """
    closure, last = structure.closure, structure.links[-1]
    reached = closure.fixed + sum(
        weight * cmath.rect(1.0, angle)
        for weight, angle in zip(closure.weights, state.position, strict=False)
        if weight
    )
    if last.slides:
        reached -= last.origin + cmath.rect(state.position[-1], last.angle)
    return abs(reached)
