# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Crank angles that resolve a period, with all corners and jumps of its loads, and integrals."""

import itertools
from collections.abc import Callable
from dataclasses import replace
from typing import Any, cast

import numpy as np
from scipy.interpolate import CubicSpline

from linkage_ros import Solver, State
from linkage_ros.formulas import Array
from linkage_ros.internals import period_turns, poses

_BISECTIONS = 64  # halvings of a step, after which its ends differ only by rounding
SAME = 1e-9  # rad; closer crank angles are the two sides of a corner or jump
_PARTS = 8  # least number of steps between two corners or jumps


def samples(solver: Solver, steps_per_turn: int = 720) -> Array:
    """Returns crank angles over one period; see `Reach.samples` and `with_breaks`."""
    mechanism, crank = solver.mechanism, solver.reach.samples(steps_per_turn)
    if not any(load.has_corners for load in mechanism.applied_loads()):
        return crank
    # At a given speed, friction and load curves do not change the motion.
    moving = Solver(replace(cast('Any', mechanism), loads=()))
    return with_breaks(crank, solver, lambda angles: moving.state(angles, 1.0))


def law_duration(solver: Solver, law: Any) -> int:
    """Computes the duration of a law or, if it repeats, of the period of motion, loads and law.

    Args:
        solver: Solver of the mechanism.
        law: The law of its crank or cylinder.

    Returns:
        The duration, ns.
    """
    turns = abs(law.turns or 0)
    rounds = period_turns(solver.reach, law_turns=turns) // turns if turns else 1
    return int(law.duration * rounds)


def with_breaks(crank: Array, solver: Solver, states: Callable[[Array], State]) -> Array:
    """Adds crank angles on both sides of each corner or jump of a load, and some in between.

    Args:
        crank: Crank angles in increasing order, rad.
        solver: Solver of the mechanism, with its loads.
        states: Function that computes the motion at crank angles.

    Returns:
        All crank angles in increasing order, rad.
    """
    found, breaks, pieces = crank, np.empty(0), _pieces(solver, states)
    while True:
        now = pieces(found)
        changes = (now[:, 1:] != now[:, :-1]).any(axis=0) & (np.diff(found) > SAME)
        (at,) = np.nonzero(changes)
        if not at.size:
            break
        low, high = found[at], found[at + 1]
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            is_low = (pieces(middle) == now[:, at]).all(axis=0)
            low, high = np.where(is_low, middle, low), np.where(is_low, high, middle)
        breaks = np.unique([*breaks, *low, *high])
        found = np.unique([*found, *breaks])
    if not breaks.size:
        return crank
    is_near = np.abs(crank[:, None] - breaks).min(axis=1) < SAME
    is_near[[0, -1]] = False
    ends = itertools.pairwise([crank[0], *breaks, crank[-1]])
    between = [np.linspace(*pair, _PARTS + 1) for pair in ends if pair[1] - pair[0] > SAME]
    return np.unique(np.concatenate([crank[~is_near], breaks, *between]))


def _pieces(solver: Solver, states: Callable[[Array], State]) -> Callable[[Array], Array]:
    """Returns a function of crank angles that numbers the smooth pieces of each load."""
    model, mechanism = solver.model, solver.mechanism
    cornered = [load for load in mechanism.applied_loads() if load.has_corners]
    loads: list[Any] = [found for load in cornered if (found := load.on(mechanism))]
    in_joints: list[Any] = [rub for load in cornered if (rub := load.in_joints(mechanism))]

    def pieces(angles: Array) -> Array:
        rows = np.zeros((len(loads) + len(in_joints), len(angles)))
        if len(rows):
            state = states(angles)
            links = poses(model.links, state.position)
            rows[:] = [load.piece(links, state.velocity) for load in loads] + [
                load.piece(model.pins, model.links, state.velocity) for load in in_joints
            ]
        return rows

    return pieces


def derivative(crank: Array, values: Array) -> Array:
    """Differentiates values by the crank angle, separately between corners and jumps."""
    found = np.zeros_like(values)
    for part, spline in _smooth_parts(crank, values):
        found[part] = spline(crank[part], 1)
    return found


def integral(crank: Array, values: Array) -> Array:
    """Integrates values over the crank angle, from the first angle to each angle."""
    steps = 0.5 * np.diff(crank) * (values[1:] + values[:-1])
    for part, spline in _smooth_parts(crank, values):
        steps[part.start : part.stop - 1] = np.diff(spline.antiderivative()(crank[part]))
    return np.concatenate([[0.0], np.cumsum(steps)])


def _smooth_parts(crank: Array, values: Array) -> list[tuple[slice, Any]]:
    """Interpolates values between corners and jumps, which have a crank angle on either side."""
    cuts = [0, *(np.flatnonzero(np.diff(crank) < SAME) + 1).tolist(), len(crank)]
    parts = [slice(*pair) for pair in itertools.pairwise(cuts) if pair[1] - pair[0] > 1]
    return [(part, CubicSpline(crank[part], values[part])) for part in parts]
