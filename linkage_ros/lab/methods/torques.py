# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Formulas of the driving torque: virtual power, power balance, and Newton-Euler.

Each takes positions, velocities per unit crank speed, velocities and accelerations of crank,
coupler and output, and returns the torque on the crank, N m.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np

from linkage_ros.dynamics.equations import balance
from linkage_ros.formulas import ZERO, Vector, dot, number
from linkage_ros.lab.methods.stages import Links
from linkage_ros.numeric import Real

PerLink: TypeAlias = tuple[Real, ...]


def own_balance(
    links: Links, position: PerLink, _: PerLink, rates: PerLink, changes: PerLink
) -> Real:
    """The package's own: M q'' + h - Q with sums over all bodies (dynamics.equations)."""
    return balance(links.model, links.model.loop.pose(position[:1]), rates, changes)[0]


def virtual_power(
    links: Links, position: PerLink, slopes: PerLink, rates: PerLink, changes: PerLink
) -> Real:
    """The power of inertia, weights and loads through velocities per unit crank speed."""
    directions = [Vector.at(angle) for angle in position]
    power = ZERO
    for body, slope, change in zip(links.model.links, slopes, changes, strict=True):
        _, _, acceleration = body.center.follow(directions, rates, changes)
        _, velocity, _ = body.center.follow(directions, slopes, changes)
        push = acceleration - links.model.gravity
        power = power + body.mass * dot(push, velocity) + body.inertia * (change * slope)
    for load in links.model.loads:
        for j, force in load.forces((), rates).items():
            power = power - force * slopes[j]
    return power


def power_balance(
    links: Links, position: PerLink, _: PerLink, rates: PerLink, changes: PerLink
) -> Real:
    """Power of inertia, weights and loads over the crank's speed (document 1, eq. 1 to 6)."""
    speed = rates[0]
    if speed is ZERO:
        speed = position[0] - position[0]  # it must not drop out: at rest this is 0 / 0
    return number(virtual_power(links, position, rates, rates, changes)) / speed


def newton_euler(
    links: Links, position: PerLink, _: PerLink, rates: PerLink, changes: PerLink
) -> Real:
    """Three equations for each body, solved for all pin forces and the torque together.

    A slider has no equation of moments, and an unknown guide force. This is the textbook form, for
    instance Norton, Design of Machinery, sec. 11.4 and 11.5.
    """
    directions = [Vector.at(angle) for angle in position]
    axis, model = Vector.at(links.angle), links.model
    forces = {j: f for load in model.loads for j, f in load.forces((), rates).items()}
    at = [place.follow(directions, rates, changes)[0] for place in model.places]
    rows = []
    for i, body in enumerate(model.links):
        center, _, acceleration = body.center.follow(directions, rates, changes)
        push = (acceleration - model.gravity) * body.mass
        if body.slides:
            push -= axis * forces.get(i, ZERO)
        x, y, turn = [], [], []
        for pin, place in zip(model.pins, at, strict=True):
            sign = float((pin.second == i) - (pin.first == i))
            arm = (place - center) * sign
            x += [sign, 0.0]
            y += [0.0, sign]
            turn += [-arm.y, arm.x]
        if links.c is None:
            x.append(-axis.y if body.slides else 0.0)
            y.append(axis.x if body.slides else 0.0)
            turn.append(0.0)
        rows += [*x, 0.0, push.x, *y, 0.0, push.y]
        if not body.slides:
            rows += [*turn, float(i == 0), body.inertia * changes[i] - forces.get(i, ZERO)]
    return links.tool(*rows)


def last_unknown(*entries: Real) -> Real:
    """The last unknown of a system of n equations, from its n rows of n + 1 numbers."""
    table = np.stack(np.broadcast_arrays(*entries), axis=-1)
    size = math.isqrt(len(entries))
    table = table.reshape(*table.shape[:-1], size, size + 1)
    found = np.linalg.solve(table[..., :-1], table[..., -1:])[..., -1, 0]
    return found if found.ndim else float(found)
