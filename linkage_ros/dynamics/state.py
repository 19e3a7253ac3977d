# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The state of a mechanism, and the motion of its points that follows from it."""

from __future__ import annotations

import cmath
from collections.abc import Sequence
from typing import NamedTuple

from linkage_ros.formulas import Vector, difference, times, total
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
    """A point for formulas: the weights of `Point` in parts, None where they are 0.

    Attributes:
        weights: For each link (along, across) of its direction, m; None: the point does not
            follow the link.
        fixed: (x, y), m.
    """

    weights: tuple[tuple[float | None, float | None] | None, ...]
    fixed: tuple[float, float]

    @classmethod
    def of(cls, point: Point) -> Track:
        """The track of a point."""
        weights = tuple((w.real or None, w.imag or None) if w else None for w in point.weights)
        return cls(weights, (point.fixed.real, point.fixed.imag))

    def follow(
        self, angles: Sequence[Real], rates: Sequence[Real], accelerations: Sequence[Real]
    ) -> PointMotion:
        """Follows the point, from the angles of the links; see `motion`."""
        directions = [
            Vector.at(angle) if weight else None
            for angle, weight in zip(angles, self.weights, strict=True)
        ]
        return self.motion(directions, rates, accelerations)

    def motion(
        self,
        directions: Sequence[Vector | None],
        rates: Sequence[Real | None],
        accelerations: Sequence[Real | None],
    ) -> PointMotion:
        """Follows the point (document 2, eq. a2, a3, 34, 35; their derivative).

        Args:
            directions: Unit vector of each link; None where the point does not follow it.
            rates: Velocity of each link, rad/s.
            accelerations: Acceleration of each link, rad/s^2.

        Returns:
            The motion.
        """
        position = Vector(*self.fixed)
        vx = vy = ax = ay = None
        for j, weight in enumerate(self.weights):
            if weight:
                (along, across), (c, s) = weight, directions[j] or Vector(1.0, 0.0)
                px = difference(times(along, c), times(across, s))
                py = total(times(along, s), times(across, c))
                rate, change = rates[j], accelerations[j]
                square = times(rate, rate)
                position = position + Vector(px, py)
                vx, vy = difference(vx, times(rate, py)), total(vy, times(rate, px))
                ax = difference(ax, total(times(change, py), times(square, px)))
                ay = total(ay, difference(times(change, px), times(square, py)))
        vx, vy, ax, ay = (0.0 if value is None else value for value in (vx, vy, ax, ay))
        return PointMotion(position, Vector(vx, vy), Vector(ax, ay))


def follow(point: Point, state: State) -> PointMotion:
    """The motion of a point in a state.

    Args:
        point: The point, as a combination of link directions.
        state: Floats or arrays.

    Returns:
        Its position, velocity and acceleration in the axes of base_link.
    """
    return Track.of(point).follow(*state[:3])


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
