# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The state of a mechanism, and the motion of its points that follows from it."""

from __future__ import annotations

import cmath
from typing import NamedTuple, TypeAlias

from linkage_ros.mechanisms.links import PerLink
from linkage_ros.mechanisms.structure import Point, Structure
from linkage_ros.numeric import Real, functions_of

Vector: TypeAlias = tuple[Real, Real]


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

    position: PerLink
    velocity: PerLink
    acceleration: PerLink
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


def point_motion(point: Point, state: State) -> PointMotion:
    """Follows a point (document 2, eq. a2, a3, 34, 35; the acceleration is their derivative).

    Args:
        point: Of the mechanism.
        state: Floats or arrays.

    Returns:
        Its motion; floats or arrays, as in the state.
    """
    functions = functions_of(state.torque)
    zero = 0.0 * state.torque
    x, y = point.fixed.real + zero, point.fixed.imag + zero
    vx, vy, ax, ay = zero, zero, zero, zero
    for weight, angle, rate, acceleration in zip(point.weights, *state[:3], strict=True):
        if weight:
            cos, sin = functions.cos(angle), functions.sin(angle)
            px = weight.real * cos - weight.imag * sin
            py = weight.real * sin + weight.imag * cos
            square = rate * rate
            x, y = x + px, y + py
            vx, vy = vx - rate * py, vy + rate * px
            ax = ax - (acceleration * py + square * px)
            ay = ay + (acceleration * px - square * py)
    return PointMotion((x, y), (vx, vy), (ax, ay))


def loop_residual(structure: Structure, state: State) -> float:
    """How far apart the two ways around the loop end.

    Args:
        structure: Of the mechanism.
        state: Floats.

    Returns:
        The distance, m.
    """
    reached = complex(*point_motion(structure.closure, state).position)
    last = structure.joints[-1]
    if last.slides:
        reached -= last.origin + cmath.rect(state.position[last.link], last.angle)
    return abs(reached)
