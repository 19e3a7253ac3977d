# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Coordinates of a torque-driven motion, in the form published by runs and stored in logs."""

import functools
import math
from collections.abc import Callable

import numpy as np

from linkage_ros.dynamics.solver import Solver
from linkage_ros.model.kinematics import State
from linkage_ros.motion.coordinates import Coordinates, stacked
from linkage_ros.motion.driven_mechanism import DrivenMechanism
from linkage_ros.numeric import Real, with_turns, within_two_turns, wrap

_ROUNDINGS = 8


def published(driven: DrivenMechanism, y: tuple[float, ...], pairs: int) -> Coordinates:
    """Returns the coordinates to publish.

    Args:
        driven: The driven mechanism in its current coordinates.
        y: Coordinates, then their rates.
        pairs: Pairs of whole turns removed from the crank angle in y.

    Returns:
        The coordinates. They can be recomputed from messages bit for bit, because the reduced
        crank angle is derived from the rounded unwrapped angle.

    Raises:
        LinkageError: As for `Solver.accelerations`.
    """
    solver, half = driven.solver, len(y) // 2
    unwrapped = 0.0
    if driven.has_crank:
        unwrapped = with_turns(y[0], pairs)
        y = within_two_turns(unwrapped)[0], *y[1:]
    if driven.is_own:
        q, u = y[:half], y[half:]
        a, state = driven.accelerations(*y), None
        if not driven.is_usual:
            state = solver.state(q, u, a)
        return Coordinates(q, u, a, unwrapped, state)
    y = legible(driven, y)
    if not driven.has_crank:
        unwrapped = driven.crank(y, pairs)
    state = solver.driven_state(y[:half], y[half:], driven.torque(driven.speed(y)))
    return own_coordinates(solver, state, unwrapped)


def all_published(
    driven: DrivenMechanism, moments: list[tuple[tuple[float, ...], int]]
) -> Coordinates:
    """Returns the coordinates to publish at many times, as arrays; see `published`."""
    solver = driven.solver
    if not driven.is_own:
        return stacked([published(driven, *moment) for moment in moments])
    crank = [with_turns(y[0], pairs) for y, pairs in moments]
    angles = [within_two_turns(angle)[0] for angle in crank]
    (_, *y), count = np.array([y for y, _ in moments]).T, len(solver.coordinates)
    q, u = (np.array(angles), *y[: count - 1]), tuple(y[count - 1 :])
    a = solver.accelerations(q, u, driven.torque(u[0]), by_math=True)
    state = None
    if not driven.is_usual:
        state = solver.state(q, u, a, by_math=True)
    return Coordinates(q, u, a, np.array(crank), state)


def legible(driven: DrivenMechanism, y: tuple[float, ...]) -> tuple[float, ...]:
    """Rounds y so that a conversion to joint angles and rates of messages and back is exact."""
    crank, half = driven.solver.links[0], len(y) // 2
    values = list(y)
    for i, link in enumerate(driven.links):
        if link.slides or link.name == crank:
            continue
        # The angle of a joint on the crank is relative to the crank.
        base, speed = (y[0], y[half]) if link.parent is not None else (0.0, 0.0)
        values[i] = _settled(functools.partial(_of_joint, base), y[i])
        values[half + i] = _settled(functools.partial(_of_rate, speed), y[half + i])
    return tuple(values)


def own_coordinates(solver: Solver, state: State, unwrapped: Real) -> Coordinates:
    """Converts a state to own coordinates; the state is kept, because these leave it open.

    Args:
        solver: Solver of the mechanism.
        state: A state of floats or arrays.
        unwrapped: Crank angle including all turns, rad.

    Returns:
        The mechanism's own coordinates with the state.
    """
    own = [solver.links.index(name) for name in solver.mechanism.coordinates]
    q, u, a = (tuple(row[i] for i in own) for row in state[:3])
    return Coordinates(q, u, a, unwrapped, state)


def joint_angle(angle: float) -> float:
    """Wraps the angle of a joint to (-pi, pi], rad, as in messages."""
    found: float = wrap(angle)
    return found if found > -math.pi else math.pi


def _of_joint(base: float, value: float) -> float:
    return base + joint_angle(value - base)


def _of_rate(base: float, value: float) -> float:
    return base + (value - base)


def _settled(function: Callable[[float], float], value: float) -> float:
    """Applies a function to a value repeatedly until the value no longer changes."""
    for _ in range(_ROUNDINGS):
        before, value = value, function(value)
        if value == before:
            break
    return value
