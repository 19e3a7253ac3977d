# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Methods for positions by iteration or from a table.

The table is made from exact states of one period, and needs a crank that turns fully. The
textbook: de Boor, A Practical Guide to Splines, ch. IV (cubic Hermite interpolation).
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any, TypeAlias

import numpy as np

from linkage_ros.dynamics.solver import Solver
from linkage_ros.errors import ConfigurationError
from linkage_ros.lab.methods.linkages import Linkage
from linkage_ros.lab.methods.stages import Pair
from linkage_ros.model.four_bar import FourBar
from linkage_ros.numeric import Real, wrap

Locator: TypeAlias = Callable[[Any], Pair]  # from a crank angle

CAP = 50
_ENDLESS = 200  # iterations after which a loop without a cap counts as stuck


def newton_raphson(step: Callable[..., Any], guess: Pair, tolerance: float) -> Locator:
    """Newton-Raphson on the loop equation, as in document 1 (eq. 8 to 12).

    Each angle begins from the solution of the one before. The document has no cap; here 50
    iterations are one, and the last iterate stands.

    Args:
        step: `stages.newton_step` of the linkage.
        guess: The coupler's direction and the output from which to begin.
        tolerance: Tolerance of step (rad, of a slider m) and residual (m).
    """
    place = guess

    def locate(crank: float) -> Pair:
        nonlocal place
        for _ in range(CAP):
            turn, move, x, y = step(crank, *place)
            place = place[0] + turn, place[1] + move
            if max(abs(turn), abs(move), abs(x), abs(y)) <= tolerance:
                break
        return place

    return locate


def listing(mechanism: Linkage, guess: Pair) -> Locator:
    """Document 1's listing as printed: see the errata in docs/mechanisms.md.

    The second column of its Jacobian has the coupler's length for the rocker's, and a complex
    number for its real part, so that angles become complex. What it plots are their real parts.

    Args:
        mechanism: The linkage; the listing knows a four-bar alone.
        guess: The coupler's direction and the rocker's from which to begin, rad.
    """
    x: Any = np.array(guess)

    def locate(crank: float) -> Pair:
        nonlocal x
        if not isinstance(mechanism, FourBar):
            raise ConfigurationError("document 1's listing is for a four-bar")
        b = mechanism.coupler.length
        fixed = cmath.rect(mechanism.crank.length, crank)
        fixed -= cmath.rect(mechanism.frame.length, mechanism.frame.angle)
        for _ in range(_ENDLESS):
            coupler, rocker = np.exp(1j * x)
            f = fixed + b * coupler - mechanism.rocker.length * rocker
            one, other = 1j * b * coupler, -1j * b * rocker
            jacobian = np.array([[one.real, other], [one.imag, other.imag]])
            residual = np.array([f.real, f.imag])
            step = np.dot(-np.linalg.inv(jacobian), residual)
            x = x + step
            if not np.any(np.abs([*step, *residual]) > 1e-3):
                return float(x[0].real), float(x[1].real)
        raise ArithmeticError('the iteration does not end')

    return locate


# A chart asks for each table several times in a row.
@lru_cache(maxsize=2)
def hermite(mechanism: Linkage, nodes: int) -> Locator:
    """A table of positions and rates, read by cubic interpolation; `nodes` per period."""
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
