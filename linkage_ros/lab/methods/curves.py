# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Methods of interpolating a load curve, and situations in which they fail.

The curve acts on the crank of a linkage at rest, without gravity, so that the driving torque is
its negative value. The reference is computed in exact fractions.
"""

from __future__ import annotations

import bisect
import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from fractions import Fraction

import numpy as np
from scipy.interpolate import CubicSpline

from linkage_ros.dynamics.solver import Solver
from linkage_ros.lab.methods.chain import Method
from linkage_ros.lab.methods.linkages import Random, slider_crank
from linkage_ros.lab.methods.outcomes import Outcome, Situation, judged
from linkage_ros.model.load_curve import LoadCurve
from linkage_ros.numeric import TURN

_SEED = 20_261_124
_POINTS, _LARGEST = 8, 10.0  # N m
_NODES, _HARMONICS = 256, 20
_BESIDE, _STEEP = 1e-3, 1e-4  # rad


class CurveBench:
    """A periodic load curve at one crank angle.

    Attributes:
        at: Angles of its points, rising within a turn, rad.
        value: Torques there, N m.
        crank: Crank angle, rad.
    """

    def __init__(self, at: list[float], value: list[float], crank: float) -> None:
        self.at, self.value, self.crank = at, value, crank

    def exact(self, crank: float | Fraction) -> float:
        """The value on the straight lines between the points, N m."""
        first = Fraction(self.at[0])
        place = first + (Fraction(crank) - first) % TURN
        at, value = [*map(Fraction, self.at), first + TURN], [*self.value, self.value[0]]
        i = bisect.bisect_right(at, place) - 1
        low, high = Fraction(value[i]), Fraction(value[i + 1])
        return float(low + (high - low) * (place - at[i]) / (at[i + 1] - at[i]))

    def judge(self, method: Method, situation: Situation) -> Iterator[Outcome]:
        """The outcome of a method."""
        exact = self.exact(self.crank)
        yield judged(lambda: method.solve(self), exact, _LARGEST, exists=situation.exists)


def _own(bench: CurveBench) -> float:
    curve = LoadCurve('crank', at=tuple(bench.at), value=tuple(bench.value))
    resting = replace(slider_crank(0.1, 0.3, 0.0), gravity=(0.0, 0.0), loads=(curve,))
    return -float(Solver(resting).state(bench.crank).torque)


def _spline(bench: CurveBench) -> float:
    at, value = [*bench.at, bench.at[0] + math.tau], [*bench.value, bench.value[0]]
    return float(CubicSpline(at, value, bc_type='periodic')(bench.crank))


def _nodes(bench: CurveBench) -> float:
    nodes = np.arange(_NODES + 1) * (math.tau / _NODES)
    values = [bench.exact(node) for node in nodes.tolist()]
    return float(np.interp(bench.crank % math.tau, nodes, values))


def _series(bench: CurveBench) -> float:
    nodes = np.arange(_NODES) * (math.tau / _NODES)
    spectrum = np.fft.rfft([bench.exact(node) for node in nodes.tolist()], norm='forward')
    waves = np.exp(1j * np.arange(1, _HARMONICS + 1) * bench.crank)
    return float(spectrum[0].real + 2 * (spectrum[1 : _HARMONICS + 1] * waves).real.sum())


STRAIGHT = 'straight lines'
CURVE_METHODS = [
    Method(STRAIGHT, 'load', 'nothing', 'this package: model/load_curve.py', _own),
    Method('cubic spline', 'load', 'a smooth curve', 'SciPy, CubicSpline, periodic', _spline),
    Method('even nodes', 'load', 'points on the nodes', f'{_NODES} nodes, linear between', _nodes),
    Method('harmonics', 'load', 'a smooth curve', f'Fourier series, {_HARMONICS} terms', _series),
]


def _situation(
    name: str, words: str, place: Callable[[Random, list[float]], tuple[list[float], float]]
) -> Situation:
    """Makes a situation of random curves; a function picks the points and a crank angle."""

    def cases(count: int) -> list[CurveBench]:
        random = np.random.default_rng([_SEED, *name.encode()])
        found = []
        for _ in range(count):
            even = np.arange(_POINTS) + random.uniform(-0.4, 0.4, _POINTS) + 0.5
            at, crank = place(random, (even * (math.tau / _POINTS)).tolist())
            value = random.uniform(-_LARGEST, _LARGEST, len(at)).tolist()
            found.append(CurveBench(at, value, crank))
        return found

    return Situation(name, words, cases)


def _one(random: Random, at: list[float]) -> float:
    return at[int(random.integers(len(at)))]


def _steep(random: Random, at: list[float]) -> tuple[list[float], float]:
    edge = at[3] + _STEEP
    return sorted([*at, edge]), at[3] + _STEEP * float(random.uniform(0.2, 0.8))


CURVE_SITUATIONS = (
    _situation(
        'corner of a load curve', f'{_BESIDE:g} rad beside one of its points',
        lambda random, at: (at, _one(random, at) - _BESIDE),
    ),
    _situation(
        'steep edge', f'between two points that are {_STEEP:g} rad apart', _steep,
    ),
    _situation(
        'corner after many turns', 'at the point after 1000 turns',
        lambda random, at: (at, float(Fraction(_one(random, at)) + 1000 * TURN)),
    ),
)  # fmt: skip
