# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The driving torque from a motion: by virtual power, by power balance, by all forces at once.

Each maker returns a function of the three links' positions, velocities at unit crank speed,
velocities and accelerations: the torque on the crank, N m.
"""

from __future__ import annotations

import cmath
from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from linkage_ros.dynamics.driving_torque import MassDistribution
from linkage_ros.dynamics.state import State, Vector, point_motion
from linkage_ros.mechanisms.kinematics import kinematics_of
from linkage_ros.mechanisms.links import PerLink
from linkage_ros.mechanisms.registry import Linkage
from linkage_ros.mechanisms.slider_crank import SliderCrank
from linkage_ros.numeric import Functions, Real

Torque: TypeAlias = Callable[[PerLink, PerLink, PerLink, PerLink], Real]


def virtual_power(mechanism: Linkage, f: Functions) -> Torque:
    """The package's own: M q'' + h - Q with partial velocities (dynamics.driving_torque)."""
    masses = MassDistribution(kinematics_of(mechanism).structure, mechanism.gravity)
    direction = mechanism.frame.angle
    slides = isinstance(mechanism, SliderCrank)

    def torque(position: PerLink, partial: PerLink, rates: PerLink, changes: PerLink) -> Real:
        alpha, beta, gamma = position
        if slides:
            gamma = direction
        cosines = f.cos(alpha), f.cos(beta), f.cos(gamma)
        sines = f.sin(alpha), f.sin(beta), f.sin(gamma)
        links = position, cosines, sines, (partial,), (partial,)
        (result,) = masses.balance(links, rates, changes)
        return result

    return torque


def power_balance(mechanism: Linkage, f: Functions) -> Torque:
    """Power of inertia and weights over the crank's speed (document 1, eq. 1 to 6)."""
    structure = kinematics_of(mechanism).structure
    gravity = complex(*mechanism.gravity)
    slider, axis = structure.slider, cmath.rect(1.0, structure.joints[2].angle)
    along = (gravity * axis.conjugate()).real
    turning = range(2 if slider else 3)
    arms = [
        (body, [(j, weight) for j, weight in enumerate(body.center.weights) if weight])
        for body in structure.bodies
        if body.mass or body.inertia
    ]

    def torque(position: PerLink, _: PerLink, rates: PerLink, changes: PerLink) -> Real:
        directions = [f.cos(position[j]) + 1j * f.sin(position[j]) for j in turning]
        speeds = [1j * rates[j] * directions[j] for j in turning]
        gains = [(1j * changes[j] - rates[j] * rates[j]) * directions[j] for j in turning]
        power = 0.0
        for body, terms in arms:
            velocity = acceleration = 0j
            for j, weight in terms:
                velocity = velocity + weight * speeds[j]
                acceleration = acceleration + weight * gains[j]
            push = acceleration - gravity
            power = power + body.mass * (push.real * velocity.real + push.imag * velocity.imag)
            power = power + body.inertia * changes[body.link] * rates[body.link]
        if slider:
            push = slider.mass * (changes[2] - along) + slider.damping * rates[2] - slider.force
            power = power + push * rates[2]
        return power / rates[0]

    return torque


def newton_euler(mechanism: Linkage, _: Functions) -> Torque:
    """Three equations for each body, solved for all pin forces and the torque together.

    The textbook form, for instance Norton, Design of Machinery, sec. 11.4 and 11.5.
    """
    structure = kinematics_of(mechanism).structure
    gx, gy = mechanism.gravity

    def torque(position: PerLink, _: PerLink, rates: PerLink, changes: PerLink) -> Real:
        state = State(position, rates, changes, 0.0 * position[0])
        points = {
            name: point_motion(point, state).position for name, point in structure.points.items()
        }
        shape = np.shape(position[0])
        size = 8 if structure.slider else 9
        matrix, right = np.zeros((*shape, size, size)), np.zeros((*shape, size))

        def load(row: int, column: int, force_sign: float, arm: Vector | None) -> None:
            """A pin's force (x, y) on a body, with its moment about the body's centre."""
            matrix[..., row, column] = matrix[..., row + 1, column + 1] = force_sign
            if arm is not None:
                matrix[..., row + 2, column] = -force_sign * arm[1]
                matrix[..., row + 2, column + 1] = force_sign * arm[0]

        for body in structure.bodies:
            row = 3 * body.link
            motion = point_motion(body.center, state)
            (x, y), (ax, ay) = motion.position, motion.acceleration
            right[..., row] = body.mass * (ax - gx)
            right[..., row + 1] = body.mass * (ay - gy)
            right[..., row + 2] = body.inertia * changes[body.link]
            first, second = (('A0', 'A'), ('A', 'B'), ('B0', 'B'))[body.link]
            own, other = ((0, 2), (2, 4), (6, 4))[body.link]
            for name, column, sign in (
                (first, own, 1.0), (second, other, 1.0 if body.link == 2 else -1.0)
            ):  # fmt: skip
                px, py = points[name]
                load(row, column, sign, (px - x, py - y))
        if slider := structure.slider:
            angle = structure.joints[2].angle
            cos, sin = np.cos(angle), np.sin(angle)
            load(6, 4, 1.0, None)
            matrix[..., 6, 6], matrix[..., 7, 6] = -sin, cos
            pushed = slider.mass * changes[2] + slider.damping * rates[2] - slider.force
            right[..., 6] = pushed * cos - slider.mass * gx
            right[..., 7] = pushed * sin - slider.mass * gy
        matrix[..., 2, size - 1] = 1.0
        forces = np.linalg.solve(matrix, right[..., None])
        result = forces[..., size - 1, 0]
        return result if shape else float(result)

    return torque
