# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Position methods by iteration or from a table; each returns a function of the crank angle."""

from __future__ import annotations

import cmath
import math
from functools import lru_cache
from typing import Any

import numpy as np

from linkage_ros.dynamics.program import Program
from linkage_ros.dynamics.solver import Solver
from linkage_ros.dynamics.tape import Constants
from linkage_ros.errors import ConfigurationError
from linkage_ros.lab.methods.linkage_cases import LinkageCase
from linkage_ros.lab.methods.measure import Setting
from linkage_ros.lab.methods.stages import Links, Locate, Pair, newton_step
from linkage_ros.lab.reference.states import Linkage, lengths
from linkage_ros.model.four_bar import FourBar
from linkage_ros.numeric import Real, wrap

CAP = 50
_ENDLESS = 200  # limit of iterations of a loop without its own


def newton_raphson(case: LinkageCase, setting: Setting) -> Locate:
    """Newton-Raphson on the loop equation, as in document 1 (eq. 8 to 12).

    Each angle starts from the solution of the previous one. The document does not limit the
    iterations; here the limit is 50, and the last iterate is returned.

    Args:
        case: The linkage and the initial guess.
        setting: 'tolerance' of step (rad, of a slider m) and residual (m).

    Returns:
        The function.
    """
    names = 'crank', 'coupler', 'output'
    step = Program(newton_step, Constants(Links.of(case.mechanism)), names).scalar
    place, tolerance = case.guess, setting['tolerance']

    def locate(crank: float) -> Pair:
        nonlocal place
        for _ in range(CAP):
            turn, move, x, y = step(crank, *place)
            place = place[0] + turn, place[1] + move
            if max(abs(turn), abs(move), abs(x), abs(y)) <= tolerance:
                break
        return place

    return locate


def listing(case: LinkageCase, setting: Setting) -> Locate:
    """Document 1's listing as printed: see the errata in docs/mechanisms.md.

    The second column of its Jacobian has the coupler's length instead of the rocker's, and a
    complex number instead of its real part. So angles become complex; it plots their real parts.

    Args:
        case: The linkage, a four-bar, and the initial guess.
        setting: Unused.

    Returns:
        The function.
    """
    del setting
    mechanism, x = case.mechanism, np.array(case.guess)

    def locate(crank: float) -> Pair:
        nonlocal x
        if not isinstance(mechanism, FourBar):
            raise ConfigurationError("document 1's listing is for a four-bar")
        r, b, c, d = lengths(mechanism)
        fixed = cmath.rect(r, crank) - cmath.rect(d, mechanism.frame.angle)
        for _ in range(_ENDLESS):
            coupler, rocker = np.exp(1j * x)
            f = fixed + b * coupler - c * rocker
            one, other = 1j * b * coupler, -1j * b * rocker
            jacobian = np.array([[one.real, other], [one.imag, other.imag]])
            residual = np.array([f.real, f.imag])
            step = np.dot(-np.linalg.inv(jacobian), residual)
            x = x + step
            if not np.any(np.abs([*step, *residual]) > 1e-3):
                return float(x[0].real), float(x[1].real)
        raise ArithmeticError('the iteration does not end')

    return locate


def hermite(case: LinkageCase, setting: Setting) -> Locate:
    """A table of exact positions and rates over one period, of a crank that turns fully.

    It is read by cubic Hermite interpolation (de Boor, A Practical Guide to Splines, ch. IV).

    Args:
        case: The linkage.
        setting: Number of 'nodes' per period.

    Returns:
        The function.
    """
    return _hermite(case.mechanism, setting['nodes'])


# A chart requests each table several times in a row.
@lru_cache(maxsize=2)
def _hermite(mechanism: Linkage, nodes: int) -> Locate:
    solver = Solver(mechanism)
    solver.reach.require_full_turn()
    length = solver.reach.period_turns * math.tau
    state = solver.state(np.arange(nodes + 1) * (length / nodes), 1.0)
    at, slope = np.stack(state.position[1:]), np.stack(state.velocity[1:]) * (length / nodes)
    change = np.diff(at)
    turning = 1 if solver.structure.links[-1].slides else 2
    change[:turning] = wrap(change[:turning], np.rint)
    square = 3 * change - 2 * slope[:, :-1] - slope[:, 1:]
    cube = slope[:, :-1] + slope[:, 1:] - 2 * change
    table = np.concatenate([at[:, :-1], slope[:, :-1], square, cube])
    rows, per_step = table.T.tolist(), nodes / length

    def look_up(crank: Real) -> Pair:
        place = (crank % length) * per_step
        if isinstance(place, float):
            index: Any = min(int(place), nodes - 1)
            a1, a2, b1, b2, c1, c2, d1, d2 = rows[index]
        else:
            index = np.minimum(place.astype(np.intp), nodes - 1)
            a1, a2, b1, b2, c1, c2, d1, d2 = table[:, index]
        t = place - index
        return a1 + t * (b1 + t * (c1 + t * d1)), a2 + t * (b2 + t * (c2 + t * d2))

    return look_up
