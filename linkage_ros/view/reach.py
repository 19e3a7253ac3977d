# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Samples the positions that the links of a mechanism can reach, to size its drawing."""

from __future__ import annotations

import math

import numpy as np

from linkage_ros.dynamics.solver import Solver
from linkage_ros.errors import UnreachableError
from linkage_ros.model.structure import Mechanism
from linkage_ros.numeric import Array

_STEPS_PER_TURN = 360
_BEFORE_END = 1e-9  # distance of first and last sample from the ends, as a fraction of half an arc
# Grid of crank angles and slider positions of a mechanism with a free slider.
_ANGLES, _POSITIONS = 72, 121


def reach(mechanism: Mechanism, crank_angle: float) -> Array:
    """Samples the positions that the links can reach.

    Args:
        mechanism: Mechanism whose positions are sampled.
        crank_angle: Crank angle at the start, rad. A crank that cannot turn fully stays on the
            arc that contains this angle.

    Returns:
        Positions of the links, rad and m, shape (n, links); in the order of the motion if the
        crank angle determines them.
    """
    solver = Solver(mechanism)
    if solver.mobility is None:
        (place,), _ = mechanism.start()
        return _area(solver, place)
    if solver.reach.turns_fully:
        crank = solver.reach.samples(_STEPS_PER_TURN)
    else:
        arcs = solver.reach.arcs
        beyond = [(crank_angle - low) % (2 * math.pi) - (high - low) for low, high in arcs]
        start, end = arcs[int(np.argmin(beyond))]
        # Near an end, the links move with the square root of the distance to it, so even steps of
        # the crank would truncate the paths. At the end itself, the rates are infinite.
        even = np.linspace(-1, 1, _STEPS_PER_TURN + 1)
        way = (1 - _BEFORE_END) * np.sin(0.5 * math.pi * even)
        crank = 0.5 * (start + end) + 0.5 * (end - start) * way
    return np.stack(solver.state(crank).position, axis=-1)


def _area(solver: Solver, start: float) -> Array:
    """Samples all crank angles with a range of slider positions around the start.

    In this range, the loop closes at every crank angle, or at some crank angle if the start does
    not allow every one.
    """
    longest = sum(abs(weight) for weight in solver.structure.closure.weights)
    places = np.linspace(-longest, longest, _POSITIONS)
    angles = np.linspace(0, 2 * math.pi, _ANGLES, endpoint=False).tolist()
    rows = [[_position(solver, angle, place) for angle in angles] for place in places.tolist()]
    closes = np.array([[bool(position) for position in row] for row in rows])
    middle = int(abs(places - start).argmin())
    possible = closes.all(axis=1) if closes[middle].all() else closes.any(axis=1)
    gaps = np.flatnonzero(~possible)
    first, last = gaps[gaps < middle].max(initial=-1), gaps[gaps > middle].min(initial=_POSITIONS)
    return np.array([place for row in rows[first + 1 : last] for place in row if place])


def _position(solver: Solver, angle: float, place: float) -> tuple[float, ...]:
    """Computes the positions of the links; empty if the loop does not close."""
    try:
        return solver.state((angle, place)).position
    except UnreachableError:
        return ()
