# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Positions from a table and from a Fourier series, both made from exact states of one period.

Both need a crank that turns fully. The textbooks: de Boor, A Practical Guide to Splines, ch. IV
(cubic Hermite interpolation); Freudenstein, Harmonic Analysis of Crank-and-Rocker Mechanisms,
J. Appl. Mech. 26 (1959).
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from linkage_ros.dynamics.solver import Solver
from linkage_ros.lab.methods.loop import Linkage
from linkage_ros.lab.methods.positions import Locate
from linkage_ros.numeric import SCALAR, Array, Functions, Real

# A series is fitted to so many states per harmonic: with more than two, what aliases is small.
_OVERSAMPLED = 4


class _PeriodSamples:
    """Even samples of one period of coupler and output, as smooth curves.

    A link that turns with the crank gains turns; what is left without them is periodic.
    """

    def __init__(self, mechanism: Linkage, count: int) -> None:
        solver = Solver(mechanism)
        solver.reach.require_full_turn()
        turns = solver.reach.period_turns
        self.length = turns * 2 * math.pi
        self.step = self.length / count
        # Finer than the samples, so that no link turns by half a turn between two.
        fine = max(1, math.ceil(720 * turns / count))
        cranks = np.arange(count * fine + 1) * (self.step / fine)
        state = solver.state(cranks, 1.0)
        curves = np.unwrap(np.stack(state.position[1:]), axis=1)
        if solver.structure.links[-1].slides:
            curves[1] = state.position[2]
        self.gain = (curves[:, -1] - curves[:, 0]) / self.length
        self.gain = np.round(self.gain * turns) / turns  # whole turns per period, or none
        periodic = curves - self.gain[:, None] * cranks
        self.values: Array = periodic[:, ::fine]
        self.slopes: Array = np.stack(state.velocity[1:])[:, ::fine] - self.gain[:, None]


# A chart asks for each table several times in a row.
@lru_cache(maxsize=2)
def hermite(mechanism: Linkage, nodes: int, f: Functions) -> Locate:
    """A table of positions and rates, read by cubic interpolation; `nodes` per period."""
    period = _PeriodSamples(mechanism, nodes)
    length, step, gain = period.length, period.step, period.gain
    at, slope = period.values, period.slopes * step
    change = at[:, 1:] - at[:, :-1]
    square = 3 * change - 2 * slope[:, :-1] - slope[:, 1:]
    cube = slope[:, :-1] + slope[:, 1:] - 2 * change
    table = np.stack([at[:, :-1], slope[:, :-1], square, cube])
    (g1, g2), per_step = gain, 1 / step
    if f is SCALAR:
        rows = [tuple(map(float, column)) for column in table.reshape(8, -1).T]
        g1, g2 = float(g1), float(g2)

        def look_up(crank: float) -> tuple[float, float]:
            place = (crank % length) * per_step
            index = min(int(place), nodes - 1)
            t = place - index
            a1, a2, b1, b2, c1, c2, d1, d2 = rows[index]
            return (
                a1 + t * (b1 + t * (c1 + t * d1)) + g1 * crank,
                a2 + t * (b2 + t * (c2 + t * d2)) + g2 * crank,
            )

        return look_up

    def look_up_all(crank: Real) -> tuple[Real, Real]:
        place = np.mod(crank, length) * per_step
        index = np.minimum(place.astype(np.intp), nodes - 1)
        t = place - index
        a, b, c, d = table[:, :, index]
        first, second = a + t * (b + t * (c + t * d))
        return first + g1 * crank, second + g2 * crank

    return look_up_all


@lru_cache(maxsize=2)
def fourier(mechanism: Linkage, harmonics: int, f: Functions) -> Locate:
    """A truncated Fourier series of the period, its coefficients by the fast transform."""
    period = _PeriodSamples(mechanism, max(64, _OVERSAMPLED * harmonics))
    samples = period.values[:, :-1]
    spectrum = np.fft.rfft(samples, axis=1)[:, : harmonics + 1] / samples.shape[1]
    spectrum[:, 1:] *= 2
    rate = 2 * math.pi / period.length
    (g1, g2) = map(float, period.gain)
    if f is SCALAR:
        pairs = [tuple(map(complex, pair)) for pair in spectrum.T[::-1]]

        def add_up(crank: float) -> tuple[float, float]:
            z = complex(math.cos(rate * crank), math.sin(rate * crank))
            first = second = 0j
            for one, other in pairs:  # Horner
                first, second = first * z + one, second * z + other
            return first.real + g1 * crank, second.real + g2 * crank

        return add_up

    def add_up_all(crank: Real) -> tuple[Real, Real]:
        z = np.exp(1j * rate * crank)
        first = second = 0j
        for one, other in spectrum.T[::-1]:
            first, second = first * z + one, second * z + other
        return first.real + g1 * crank, second.real + g2 * crank

    return add_up_all
