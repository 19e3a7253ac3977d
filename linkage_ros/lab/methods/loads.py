# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Methods for loads, which compute one number each, and the situations in which they fail.

A load curve is read between its points. It is on the crank of a linkage that rests, without
gravity: the driving torque is its value with the other sign. The right answer follows its straight
lines in exact fractions.

Friction depends on the force that it changes. A slider-crank's guide alone rubs: its normal force
is N = |b + k N|, where b is the force without friction. The right answer is b / (1 - k) or
-b / (1 + k), whichever grows out of |b| with the coefficient. Without one the mechanism locks.
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
from linkage_ros.errors import LinkageError
from linkage_ros.lab.methods.chain import Method, Task
from linkage_ros.lab.methods.linkages import Random, slider_crank
from linkage_ros.lab.methods.outcomes import (
    DIVERGED,
    LIMIT,
    REFUSED,
    RIGHT,
    Outcome,
    Situation,
    one_by_one,
)
from linkage_ros.model.friction import Friction
from linkage_ros.model.load_curve import LoadCurve
from linkage_ros.model.slider_crank import SliderCrank
from linkage_ros.numeric import TURN

_POINTS, _LARGEST = 8, 10.0  # N m
_NODES = 256
_BESIDE, _STEEP = 1e-3, 1e-4  # rad
_ROUNDS = 100
_PROBE = 10.0  # N, along the guide


class NumberBench:
    """A number that methods compute.

    Attributes:
        exact: The right answer.
        size: Errors are relative to this.
    """

    exact: float
    size: float

    def judge(self, method: Method, situation: Situation) -> Iterator[Outcome]:
        """The outcome of a method, with the relative error."""
        try:
            error = abs(method.solve(self) - self.exact) / self.size
        except LinkageError:
            yield REFUSED, None
        else:
            yield (RIGHT if situation.exists and error <= LIMIT else DIVERGED), error


# ---------------------------------------------------------------- load curves


class CurveBench(NumberBench):
    """A periodic load curve at one crank angle.

    Attributes:
        at: Where its points are, rising within a turn, rad.
        value: There, N m.
        crank: Crank angle, rad.
    """

    def __init__(self, random: Random, at: list[float], crank: float) -> None:
        self.at, self.value = at, random.uniform(-_LARGEST, _LARGEST, len(at)).tolist()
        self.crank, self.size = crank, _LARGEST
        self.exact = self.line(crank)

    def line(self, crank: float) -> float:
        """The value on the straight lines between the points, N m."""
        first = Fraction(self.at[0])
        place = first + (Fraction(crank) - first) % TURN
        at, value = [*map(Fraction, self.at), first + TURN], [*self.value, self.value[0]]
        i = bisect.bisect_right(at, place) - 1
        low, high = Fraction(value[i]), Fraction(value[i + 1])
        return float(low + (high - low) * (place - at[i]) / (at[i + 1] - at[i]))


def _own_curve(bench: CurveBench) -> float:
    curve = LoadCurve('crank', at=tuple(bench.at), value=tuple(bench.value))
    resting = replace(slider_crank(0.1, 0.3, 0.0), gravity=(0.0, 0.0), loads=(curve,))
    return -float(Solver(resting).state(bench.crank).torque)


def _spline(bench: CurveBench) -> float:
    at, value = [*bench.at, bench.at[0] + math.tau], [*bench.value, bench.value[0]]
    return float(CubicSpline(at, value, bc_type='periodic')(bench.crank))


def _nodes(bench: CurveBench) -> float:
    nodes = np.arange(_NODES + 1) * (math.tau / _NODES)
    return float(np.interp(bench.crank % math.tau, nodes, [*map(bench.line, nodes.tolist())]))


STRAIGHT = 'straight lines'
CURVE_METHODS = [
    Method(STRAIGHT, 'load', 'nothing', 'this package: model/load_curve.py', _own_curve),
    Method('cubic spline', 'load', 'a smooth curve', 'SciPy, CubicSpline, periodic', _spline),
    Method('even nodes', 'load', 'points on the nodes', f'{_NODES} nodes, linear between', _nodes),
]


def _points(random: Random) -> list[float]:
    even = np.arange(_POINTS) + random.uniform(-0.4, 0.4, _POINTS) + 0.5
    points: list[float] = (even * (math.tau / _POINTS)).tolist()
    return points


def _corner(random: Random, i: int) -> CurveBench:
    at = _points(random)
    return CurveBench(random, at, at[i % _POINTS] - _BESIDE)


def _steep(random: Random, _: int) -> CurveBench:
    at = _points(random)
    crank = at[3] + _STEEP * float(random.uniform(0.2, 0.8))
    return CurveBench(random, sorted([*at, at[3] + _STEEP]), crank)


CURVE_SITUATIONS = (
    one_by_one('corner of a load curve', f'{_BESIDE:g} rad beside one of its points', _corner),
    one_by_one('steep edge', f'between two points that are {_STEEP:g} rad apart', _steep),
)


# ---------------------------------------------------------------- friction


class FrictionBench(NumberBench):
    """The normal force of the guide of one slider-crank at one crank angle, N.

    Attributes:
        push: The force without friction, to the guide's left: b, N.
        gain: k: what friction by 1 N of normal force adds to it.
        locks: Gain in the direction of that force: 1 or more locks the mechanism.
    """

    def __init__(self, mechanism: SliderCrank, crank: float, share: float) -> None:
        """Prepares it.

        Args:
            mechanism: The linkage, without friction.
            crank: Crank angle, rad.
            share: Coefficient of friction over the one at which |k| is 1.
        """
        self._mechanism, self._crank = mechanism, crank
        self.push, velocity = self._force(mechanism)
        pushed = replace(mechanism, slider=replace(mechanism.slider, force=_PROBE))
        slope = -math.copysign(1.0, velocity) * (self._force(pushed)[0] - self.push) / _PROBE
        self._friction = Friction(guide=share / abs(slope))
        self.gain = self._friction.guide * slope
        self.locks = self.gain * math.copysign(1.0, self.push)
        self.exact = abs(self.push) / (1 - self.locks)
        self.size = abs(self.exact)

    def _force(self, mechanism: SliderCrank) -> tuple[float, float]:
        solver, task = Solver(mechanism), Task.at(mechanism, self._crank)
        state = solver.state(self._crank, task.speed, task.acceleration)
        return float(solver.reactions(state).guide_force or 0.0), float(state.velocity[-1])

    def own(self) -> float:
        """The normal force by the package."""
        return abs(self._force(replace(self._mechanism, loads=(self._friction,)))[0])


def _fixed_point(bench: FrictionBench) -> float:
    force = 0.0
    for _ in range(_ROUNDS):
        force = abs(bench.push + bench.gain * force)
    return force


def _newton(bench: FrictionBench) -> float:
    force = 10.0 * abs(bench.push)  # as from a state before, in which more was pressed
    for _ in range(_ROUNDS):
        sign = math.copysign(1.0, bench.push + bench.gain * force)
        force = sign * bench.push / (1 - sign * bench.gain)
    return force


GROWN = 'Newton, growing'
FRICTION_METHODS = [
    Method(
        GROWN, 'friction', 'nothing', 'this package: dynamics/friction.py', FrictionBench.own,
    ),
    Method(
        'Newton, at once', 'friction', 'a first guess', 'Newton on N = abs(b + k N)', _newton,
    ),
    Method(
        'fixed point', 'friction', 'a gain below 1', 'friction and forces in turn', _fixed_point,
    ),
]  # fmt: skip


def _rubbing(
    name: str, words: str, share: float, wanted: Callable[[float], bool], *, exists: bool = True
) -> Situation:
    """Random slider-cranks with a share of the coefficient at which |k| is 1."""

    def make(random: Random, _: int) -> FrictionBench:
        while True:
            r, b, offset = random.uniform((0.1, 0.5, -0.02), (0.3, 1.0, 0.02)).tolist()
            crank = float(random.uniform(0.5, 2.6)) * (1 if random.random() < 0.5 else -1)
            bench = FrictionBench(slider_crank(r, b, offset), crank, share)
            if wanted(bench.locks):
                return bench

    return one_by_one(name, words, make, exists=exists)


FRICTION_SITUATIONS = (
    _rubbing('friction', 'the normal force grows by a tenth', 0.1, lambda k: k > 0),
    _rubbing(
        'nearly self-locking', 'the coefficient is 0.999 of the one that locks', 0.999,
        lambda k: k > 0,
    ),
    _rubbing(
        'friction that relieves', 'friction takes off three times what presses on the guide', 3.0,
        lambda k: k < 0,
    ),
    _rubbing(
        'self-locking', 'the coefficient is 1.001 of the one that locks', 1.001, lambda k: k > 0,
        exists=False,
    ),
)  # fmt: skip
