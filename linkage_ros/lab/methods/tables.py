# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Methods for positions by iteration, from a table, or from a series.

Table and series are made from exact states of one period, and need a crank that turns fully.
Sources: de Boor, A Practical Guide to Splines, ch. IV (cubic Hermite interpolation);
Freudenstein, Harmonic Analysis of Crank-and-Rocker Mechanisms, J. Appl. Mech. 26 (1959).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from linkage_ros.dynamics.solver import Solver
from linkage_ros.formulas import cos, sin
from linkage_ros.lab.methods.linkages import Linkage
from linkage_ros.lab.methods.stages import Locate, Pair
from linkage_ros.numeric import Array, Real

CAP = 50
# A series is fitted to so many states per harmonic: with more than two, what aliases is small.
_OVERSAMPLED = 4


class NewtonRaphson:
    """Newton-Raphson on the loop equation, as in document 1 (eq. 8 to 12).

    The document's listing iterates until step and residual are below a tolerance, without a limit;
    here the limit is 50 iterations, and the last iterate is returned.

    Attributes:
        iterations: Number of iterations in all calls so far.
    """

    def __init__(
        self, step: Callable[..., tuple[float, ...]], guess: Pair, tolerance: float, *, warm: bool
    ) -> None:
        """Prepares the iteration.

        Args:
            step: `stages.newton_step` of the linkage.
            guess: The coupler's direction and the output from which to begin.
            tolerance: Tolerance of step (rad, of a slider m) and residual (m).
            warm: Whether each angle begins from the solution of the one before; otherwise all
                begin from the first guess.
        """
        self._step, self._guess = step, guess
        self._tolerance, self._warm = tolerance, warm
        self.iterations = 0

    def __call__(self, crank: float) -> Pair:
        """The position at a crank angle: the last iterate, converged or not."""
        coupler, output = self._guess
        for _ in range(CAP):
            turn, move, x, y = self._step(crank, coupler, output)
            coupler, output = coupler + turn, output + move
            self.iterations += 1
            if max(abs(turn), abs(move), abs(x), abs(y)) <= self._tolerance:
                break
        if self._warm:
            self._guess = coupler, output
        return coupler, output


class _Samples(NamedTuple):
    """Even samples of one period of coupler and output, as smooth curves.

    A link that turns with the crank adds turns; the rest is periodic.

    Attributes:
        length: Length of the period, rad.
        gain: Turns of coupler and output per turn of the crank.
        values: Periodic part of both; the last sample repeats the first.
        slopes: Derivatives of these by the crank angle.
    """

    length: float
    gain: Array
    values: Array
    slopes: Array


def _sample(mechanism: Linkage, count: int) -> _Samples:
    solver = Solver(mechanism)
    solver.reach.require_full_turn()
    turns = solver.reach.period_turns
    # Finer than the samples, so that no link turns by half a turn between two.
    fine = max(1, math.ceil(720 * turns / count))
    cranks = np.arange(count * fine + 1) * (turns * 2 * math.pi / (count * fine))
    state = solver.state(cranks, 1.0)
    curves = np.unwrap(np.stack(state.position[1:]), axis=1)
    if solver.structure.links[-1].slides:
        curves[1] = state.position[2]
    # Whole turns per period, or none.
    gain = np.round((curves[:, -1] - curves[:, 0]) / (2 * math.pi)) / turns
    slopes = np.stack(state.velocity[1:]) - gain[:, None]
    values = curves - gain[:, None] * cranks
    return _Samples(turns * 2 * math.pi, gain, values[:, ::fine], slopes[:, ::fine])


# A chart asks for each table several times in a row.
@lru_cache(maxsize=2)
def hermite(mechanism: Linkage, nodes: int) -> Locate:
    """A table of positions and rates, read by cubic interpolation; `nodes` per period."""
    length, gain, at, slopes = _sample(mechanism, nodes)
    slope, change = slopes * (length / nodes), np.diff(at)
    square = 3 * change - 2 * slope[:, :-1] - slope[:, 1:]
    cube = slope[:, :-1] + slope[:, 1:] - 2 * change
    table = np.concatenate([at[:, :-1], slope[:, :-1], square, cube])
    (g1, g2), per_step = gain.tolist(), nodes / length
    rows = table.T.tolist()

    def look_up(crank: Real) -> Pair:
        place = (crank % length) * per_step
        if isinstance(place, float):
            index: Any = min(int(place), nodes - 1)
            a1, a2, b1, b2, c1, c2, d1, d2 = rows[index]
        else:
            index = np.minimum(place.astype(np.intp), nodes - 1)
            a1, a2, b1, b2, c1, c2, d1, d2 = table[:, index]
        t = place - index
        return (
            a1 + t * (b1 + t * (c1 + t * d1)) + g1 * crank,
            a2 + t * (b2 + t * (c2 + t * d2)) + g2 * crank,
        )

    return look_up


@lru_cache(maxsize=2)
def fourier(mechanism: Linkage, harmonics: int) -> Locate:
    """A truncated Fourier series of the period, by the fast Fourier transform."""
    length, gain, values, _ = _sample(mechanism, max(64, _OVERSAMPLED * harmonics))
    spectrum = np.fft.rfft(values[:, :-1], axis=1, norm='forward')[:, : harmonics + 1]
    spectrum[:, 1:] *= 2
    rate, (g1, g2) = 2 * math.pi / length, gain.tolist()
    pairs = spectrum.T[::-1].tolist()

    def add_up(crank: Real) -> Pair:
        z = cos(rate * crank) + 1j * sin(rate * crank)
        first = second = 0j
        for one, other in pairs:  # Horner
            first, second = first * z + one, second * z + other
        return first.real + g1 * crank, second.real + g2 * crank

    return add_up
