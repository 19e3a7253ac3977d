# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The driving torque from a motion: by virtual power, by power balance, by all forces at once.

Each maker returns a function of the three links' positions, velocities at unit crank speed,
velocities and accelerations: the torque on the crank, N m.
"""

from __future__ import annotations

import cmath
from collections.abc import Callable, Sequence
from typing import TypeAlias

import numpy as np

from linkage_ros.dynamics.equations import Model, balance, model_of
from linkage_ros.dynamics.program import Program
from linkage_ros.dynamics.solver import Solver
from linkage_ros.dynamics.state import State, follow
from linkage_ros.formulas import ZERO, Opaque, Vector, cos, sin
from linkage_ros.lab.methods.functions import SCALAR, Functions
from linkage_ros.lab.methods.loop import Linkage
from linkage_ros.model.pose import LinkPose, Pose
from linkage_ros.numeric import Real, require_finite

PerLink: TypeAlias = Sequence[Real]
Torque: TypeAlias = Callable[[PerLink, PerLink, PerLink, PerLink], Real]


def virtual_power(mechanism: Linkage, f: Functions) -> Torque:
    """The package's own: M q'' + h - Q with the jacobian of the links (dynamics.equations)."""
    structure = mechanism.structure()
    refuse = Opaque(require_finite)
    model = model_of(mechanism, structure, refuse, refuse, refuse)
    guide = Vector.at(mechanism.frame.angle) if structure.links[-1].slides else None
    program = Program(
        _balance,
        (model, guide),
        (_names('position'), _names('jacobian'), _names('rate'), _names('change')),
    )
    run = program.compile() if f is SCALAR else program.arrays

    def torque(position: PerLink, partial: PerLink, rates: PerLink, changes: PerLink) -> Real:
        return run(*position, *partial, *rates, *changes)[0]

    return torque


def _names(quantity: str) -> tuple[str, ...]:
    return tuple(f'{quantity}{i}' for i in range(3))


def _balance(
    constants: tuple[Model, Vector | None],
    position: PerLink,
    jacobian: PerLink,
    rates: PerLink,
    changes: PerLink,
) -> tuple[Real, ...]:
    model, guide = constants
    directions = [Vector(cos(angle), sin(angle)) for angle in position[:2]]
    directions.append(guide or Vector(cos(position[2]), sin(position[2])))
    links = (
        LinkPose(place, direction, (slope,), (ZERO,))
        for place, direction, slope in zip(position, directions, jacobian, strict=True)
    )
    return tuple(balance(model, Pose(tuple(links), ()), rates, changes))


def power_balance(mechanism: Linkage, f: Functions) -> Torque:
    """Power of inertia and weights over the crank's speed (document 1, eq. 1 to 6)."""
    links, gravity = mechanism.structure().links, complex(*mechanism.gravity)
    slider = links[-1] if links[-1].slides else None
    loads, axis = mechanism.link_loads(), cmath.rect(1.0, links[-1].angle)
    along = (gravity * axis.conjugate()).real
    turning = range(2 if slider else 3)
    arms = [
        (i, body, [(j, weight) for j, weight in enumerate(body.center.weights) if weight])
        for i, body in enumerate(links)
        if not body.slides and (body.mass or body.inertia)
    ]

    def torque(position: PerLink, _: PerLink, rates: PerLink, changes: PerLink) -> Real:
        directions = [f.cos(position[j]) + 1j * f.sin(position[j]) for j in turning]
        speeds = [1j * rates[j] * directions[j] for j in turning]
        gains = [(1j * changes[j] - rates[j] * rates[j]) * directions[j] for j in turning]
        power = 0.0
        for i, body, terms in arms:
            velocity = acceleration = 0j
            for j, weight in terms:
                velocity = velocity + weight * speeds[j]
                acceleration = acceleration + weight * gains[j]
            push = acceleration - gravity
            power = power + body.mass * (push.real * velocity.real + push.imag * velocity.imag)
            power = power + body.inertia * changes[i] * rates[i]
        if slider:
            power = power + slider.mass * (changes[2] - along) * rates[2]
        for load in loads:
            for i, force in load.forces((), rates).items():
                power = power - force * rates[i]
        return power / rates[0]

    return torque


def newton_euler(mechanism: Linkage, _: Functions) -> Torque:
    """Three equations for each body, solved for all pin forces and the torque together.

    The textbook form, for instance Norton, Design of Machinery, sec. 11.4 and 11.5.
    """
    structure, (gx, gy) = mechanism.structure(), mechanism.gravity
    links, loads = structure.links, mechanism.link_loads()
    slider = links[-1] if links[-1].slides else None
    solver = Solver(mechanism)

    def torque(position: PerLink, _: PerLink, rates: PerLink, changes: PerLink) -> Real:
        state = State(tuple(position), tuple(rates), tuple(changes), 0.0 * position[0])
        points = {name: solver.point(state, name).position for name in structure.points}
        shape = np.shape(position[0])
        size = 8 if slider else 9
        matrix, right = np.zeros((*shape, size, size)), np.zeros((*shape, size))

        def load(row: int, column: int, force_sign: float, arm: tuple[Real, Real] | None) -> None:
            """A pin's force (x, y) on a body, with its moment about the body's centre."""
            matrix[..., row, column] = matrix[..., row + 1, column + 1] = force_sign
            if arm is not None:
                matrix[..., row + 2, column] = -force_sign * arm[1]
                matrix[..., row + 2, column + 1] = force_sign * arm[0]

        for i, body in enumerate(links):
            if body.slides:
                continue
            row = 3 * i
            motion = follow(body.center, state)
            (x, y), (ax, ay) = motion.position, motion.acceleration
            right[..., row] = body.mass * (ax - gx)
            right[..., row + 1] = body.mass * (ay - gy)
            right[..., row + 2] = body.inertia * changes[i]
            first, second = (('A0', 'A'), ('A', 'B'), ('B0', 'B'))[i]
            own, other = ((0, 2), (2, 4), (6, 4))[i]
            for name, column, sign in (
                (first, own, 1.0), (second, other, 1.0 if i == 2 else -1.0)
            ):  # fmt: skip
                px, py = points[name]
                load(row, column, sign, (px - x, py - y))
        if slider:
            along, across = np.cos(slider.angle), np.sin(slider.angle)
            load(6, 4, 1.0, None)
            matrix[..., 6, 6], matrix[..., 7, 6] = -across, along
            pushed = slider.mass * changes[2]
            for acting in loads:
                pushed = pushed - acting.forces((), rates).get(2, 0.0)
            right[..., 6] = pushed * along - slider.mass * gx
            right[..., 7] = pushed * across - slider.mass * gy
        matrix[..., 2, size - 1] = 1.0
        forces = np.linalg.solve(matrix, right[..., None])
        result = forces[..., size - 1, 0]
        return result if shape else float(result)

    return torque
