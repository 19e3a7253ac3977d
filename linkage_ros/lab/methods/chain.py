# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A method from the crank angle to position, velocity, acceleration and torque.

A method does one stage. The stages before it are the package's own; a position is followed by
the 2x2 solve of documents 1 and 4, because rates that belong to it have to come from it; and the
torque is by virtual power. So every method has a point in each chart that its stage reaches.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np

from linkage_ros.dynamics.solver import Solver
from linkage_ros.lab.methods.functions import ARRAY, SCALAR, Functions
from linkage_ros.lab.methods.loop import Linkage, Pair
from linkage_ros.lab.methods.positions import Locate, factored
from linkage_ros.lab.methods.rates import Rates, analytic, two_by_two
from linkage_ros.lab.methods.torques import Torque, virtual_power
from linkage_ros.numeric import Real

QUANTITIES = ('position', 'rate', 'acceleration', 'torque')
STATE, POSITION, RATES, TORQUE = 'state', 'position', 'rates', 'torque'
ONE, BATCH = 'one at a time', 'batch'
FUNCTIONS = {ONE: SCALAR, BATCH: ARRAY}
# What a method of a stage itself computes.
OWN = {STATE: QUANTITIES, POSITION: QUANTITIES[:1], RATES: QUANTITIES[1:3], TORQUE: QUANTITIES[3:]}

Function: TypeAlias = Callable[[Real], tuple[Real, ...]]


@dataclass(frozen=True)
class Task:
    """A linkage and the motion of its crank.

    Attributes:
        mechanism: The linkage.
        guess: Coupler's direction and output from which an iteration begins.
        speed: Crank speed, rad/s; by default 150 rpm.
        acceleration: Crank acceleration, rad/s^2.
    """

    mechanism: Linkage
    guess: tuple[float, float]
    speed: float = 5 * math.pi
    acceleration: float = 20.0


def make_task(mechanism: Linkage, crank: float) -> Task:
    """A task whose first guess is a position as read off a drawing, to 0.1 rad or m.

    Args:
        mechanism: The linkage.
        crank: Where that is, crank angle, rad.

    Returns:
        The task.
    """
    position = Solver(mechanism).state(crank).position
    return Task(mechanism, (round(position[1], 1), round(position[2], 1)))


class Chain(NamedTuple):
    """Functions of the crank angle, each with all the work before it.

    Attributes:
        position: The coupler's direction, rad, and the output, rad or m.
        rate: Their velocities.
        acceleration: Their accelerations.
        torque: The driving torque, N m, in a tuple of one.
    """

    position: Function
    rate: Function
    acceleration: Function
    torque: Function


def of_state(task: Task, f: Functions) -> Chain:
    """The package's own in every stage: the torque as `Solver.state` gives it."""
    solver, speed, acceleration = Solver(task.mechanism), task.speed, task.acceleration
    state = solver.state
    return of_stages(task, f)._replace(
        torque=lambda crank: (state(crank, speed, acceleration).torque,)
    )


def in_single_precision(task: Task, f: Functions) -> Chain:
    """The package's own formulas in float32, crank angle and results included."""

    def narrowed(function: Function) -> Function:
        return lambda crank: function(np.asarray(crank, np.float32))

    return Chain(*map(narrowed, of_stages(task, f)))


def of_position(task: Task, locate: Locate, f: Functions) -> Chain:
    """A way to find positions, and what follows from it."""
    return of_stages(task, f, locate, two_by_two(task.mechanism, locate, f))


def of_stages(
    task: Task,
    f: Functions,
    locate: Locate | None = None,
    rates: Rates | None = None,
    torque: Torque | None = None,
) -> Chain:
    """Puts stages together, the package's own where none is given.

    Args:
        task: What is to be solved.
        f: SCALAR or ARRAY.
        locate: Positions.
        rates: First and second derivatives by the crank angle.
        torque: From the motion.

    Returns:
        The chain.
    """
    locate, rates = locate or factored(task.mechanism, f), rates or analytic(task.mechanism, f)
    speed, change = task.speed, task.acceleration
    square = speed * speed
    balance = torque or virtual_power(task.mechanism, f)

    def rate(crank: Real) -> tuple[Real, ...]:
        _, (k2, k3) = rates.first(crank)
        return k2 * speed, k3 * speed

    def accelerate(first: Pair, second: Pair) -> tuple[Real, Real]:
        (k2, k3), (c2, c3) = first, second
        return c2 * square + k2 * change, c3 * square + k3 * change

    def acceleration(crank: Real) -> tuple[Real, ...]:
        _, first, second = rates.second(crank)
        return accelerate(first, second)

    def drive(crank: Real) -> tuple[Real, ...]:
        (coupler, output), first, second = rates.second(crank)
        k2, k3 = first
        velocities = (speed, k2 * speed, k3 * speed)
        accelerations = (change, *accelerate(first, second))
        return (balance((crank, coupler, output), (1.0, k2, k3), velocities, accelerations),)

    return Chain(locate, rate, acceleration, drive)
