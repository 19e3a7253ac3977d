# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where the links of a mechanism can be: what pictures and plots must have room for."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from linkage_ros.dynamics.period import SpeedDrivenPeriod
from linkage_ros.dynamics.solver import Solver
from linkage_ros.model.reach import Arc
from linkage_ros.model.structure import Mechanism
from linkage_ros.model.wind_pump import WindPump
from linkage_ros.numeric import Array

_STEPS_PER_TURN = 360
_BEFORE_END = 1e-9  # of half an arc
# Of a wind pump, whose positions fill a plane: crank angles a turn, places of the slider.
_ANGLES, _PLACES = 120, 60
_LEAST = 1e-9  # of the dyad's margins, in squared crank lengths


class Reach(NamedTuple):
    """Positions of the links.

    Attributes:
        positions: rad and m, shape (n, 3 or 4).
        is_path: Whether the links pass through them one after the other, because the crank
            tells where all of them are.
    """

    positions: Array
    is_path: bool


def reach(mechanism: Mechanism, crank_angle: float) -> Reach:
    """Finds where the links can be.

    Args:
        mechanism: The mechanism.
        crank_angle: From which it starts, rad: of the two arcs that a crank may have, it never
            leaves the one with that angle.

    Returns:
        Positions that leave out nothing which a picture could show.
    """
    if isinstance(mechanism, WindPump):
        return Reach(_positions_of_pump(mechanism), is_path=False)
    return Reach(_path(Solver(mechanism), crank_angle), is_path=True)


def going_round(mechanism: Mechanism) -> set[str]:
    """Finds the links that turn on and on: in a plot beside them the others would be flat.

    Args:
        mechanism: The mechanism.

    Returns:
        Their names; the crank is one of them.
    """
    reach = mechanism.reach()
    if not reach or not reach.turns_fully:
        return {'crank'}
    period = SpeedDrivenPeriod(mechanism, 0.0)
    joints = period.solver.structure.links
    turned = {j.name: np.ptp(period.columns[f'{j.name}.position'].values[[0, -1]]) for j in joints}
    return {joint.name for joint in joints if not joint.slides and turned[joint.name] > math.pi}


def _path(solver: Solver, crank_angle: float) -> Array:
    if solver.reach.turns_fully:
        crank = solver.reach.samples(_STEPS_PER_TURN)
    else:
        start, end = _own_arc(solver.reach.arcs, crank_angle)
        # Next to an end the links move as the root of the way to it: even steps of the crank would
        # cut their paths short. At the end itself no rates exist.
        even = np.linspace(-1, 1, _STEPS_PER_TURN + 1)
        way = (1 - _BEFORE_END) * np.sin(0.5 * math.pi * even)
        crank = 0.5 * (start + end) + 0.5 * (end - start) * way
    return np.stack(solver.state(crank).position, axis=-1)


def _own_arc(arcs: tuple[Arc, ...], crank_angle: float) -> Arc:
    def beyond(arc: Arc) -> float:
        return (crank_angle - arc[0]) % (2 * math.pi) - (arc[1] - arc[0])

    return min(arcs, key=beyond)


def _positions_of_pump(mechanism: WindPump) -> Array:
    """All crank angles, with every place that the slider can have at each of them.

    A slider that starts from somewhere else gets all places where the loop closes at any angle.
    """
    solver, margins = Solver(mechanism), mechanism.loop().margins
    r, b, c = mechanism.crank.length, mechanism.coupler.length, mechanism.rod.length
    start = mechanism.slider.position
    near, far = abs(b - c) + r, b + c - r
    if not near < abs(start) < far:
        near, far = abs(b - c) - r, b + c + r
        if near <= 0:  # it can pass the crank's pivot
            near = -far
    angles = np.linspace(0, 2 * math.pi, _ANGLES + 1)
    places = math.copysign(1.0, start) * np.linspace(near, far, _PLACES + 1)
    crank, slide = (grid.ravel() for grid in np.meshgrid(angles, places))
    closes = np.min(margins((crank, slide)), axis=0) > _LEAST * mechanism.crank.length**2
    position = solver.state((crank[closes], slide[closes])).position
    return np.stack(position, axis=-1)
