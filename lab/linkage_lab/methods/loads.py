# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Methods for load curves and friction, and situations in which some of them fail.

A load curve acts on the crank of a linkage at rest, without gravity, so that the driving torque is
the negative value of the curve. The reference is linear interpolation in exact fractions.

Friction depends on the normal force, which in turn depends on friction. Here, only the guide of a
slider-crank has friction. The normal force of the guide is N = |b + k N|, where b is the force
without friction and k is proportional to the coefficient of friction. The solutions are
b / (1 - k) and -b / (1 + k). The reference is the solution that continuously extends |b| as the
coefficient increases from 0. Where no such solution exists, the mechanism locks.
"""

import bisect
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import partial
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from linkage_lab.methods.measure import Case, Method, Row, Situation, attempt
from linkage_lab.methods.situations import Random, slider_crank
from linkage_lab.methods.stages import ACCELERATION, SPEED
from linkage_ros import Friction, LinkLoad, LoadCurve, SliderCrank, Solver

TURN = Fraction(math.tau) + Fraction(2.4492935982947064e-16)  # 2 pi in 32 digits
_POINTS, _NODES, _ROUNDS = 8, 256, 100
_LARGEST = 10.0  # N m
_BESIDE, _STEEP = 1e-3, 1e-4  # rad


class NumberCase(Case):
    """A case whose answer is a single number.

    Attributes:
        arguments: Input of the methods. For a load curve: its points, rad and N m, and the crank
            angle, rad. For friction: the linkage, the crank angle, rad, b, N, and k.
        exact: Reference value.
        size: Scale of the relative errors.
    """

    def __init__(self, arguments: tuple[Any, ...], exact: float, size: float) -> None:
        self.arguments, self.exact, self.size = arguments, exact, size

    def rows(self, method: Method, *_: Any) -> Sequence[Row]:
        """See `Case`."""
        return [attempt(lambda: (method.solve(*self.arguments),))]

    def error(self, _quantity: str, _place: int, row: Sequence[float]) -> float:
        """See `Case`."""
        return abs(row[0] - self.exact) / self.size


# ---------------------------------------------------------------- load curves


def _lines(at: list[float], value: list[float], crank: float) -> float:
    """Interpolates a torque linearly, N m, between points at increasing angles of a turn, rad."""
    places = [*map(Fraction, at), Fraction(at[0]) + TURN]
    values = [*map(Fraction, value), Fraction(value[0])]
    place = places[0] + (Fraction(crank) - places[0]) % TURN
    i = bisect.bisect_right(places, place) - 1
    share = (place - places[i]) / (places[i + 1] - places[i])
    return float(values[i] + (values[i + 1] - values[i]) * share)


def _own_curve(at: list[float], value: list[float], crank: float) -> float:
    curve = LoadCurve('crank', at=tuple(at), value=tuple(value))
    resting = replace(slider_crank(0.1, 0.3, 0.0), gravity=(0.0, 0.0), loads=(curve,))
    return -float(Solver(resting).state(crank).torque)


def _spline(at: list[float], value: list[float], crank: float) -> float:
    places, values = [*at, at[0] + math.tau], [*value, value[0]]
    return float(CubicSpline(places, values, bc_type='periodic')(crank))


def _nodes(at: list[float], value: list[float], crank: float) -> float:
    nodes = np.arange(_NODES) * (math.tau / _NODES)
    values = np.interp(nodes, at, value, period=math.tau)
    return float(np.interp(crank, nodes, values, period=math.tau))


STRAIGHT = 'straight lines'
CURVE_METHODS = [
    Method(STRAIGHT, 'load', 'nothing', 'this package: mechanism/loads/curve.py', _own_curve),
    Method('cubic spline', 'load', 'a smooth curve', 'SciPy, CubicSpline, periodic', _spline),
    Method('even nodes', 'load', 'load points that are nodes', f'{_NODES} nodes, linear', _nodes),
]


def _curve(
    random: Random, crank_at: Callable[[list[float]], float], edge: float = 0.0
) -> NumberCase:
    """Makes a random curve, with points 45 deg apart on average.

    Args:
        random: Random numbers.
        crank_at: Function from the angles of the points to the crank angle, rad.
        edge: Distance of a further point after the fourth one, rad; 0 for none.
    """
    places = np.arange(_POINTS) + random.uniform(-0.4, 0.4, _POINTS) + 0.5
    at = (places * (math.tau / _POINTS)).tolist()
    crank = crank_at(at)
    if edge:
        at.insert(4, at[3] + edge)
    values = random.uniform(-_LARGEST, _LARGEST, len(at)).tolist()
    return NumberCase((at, values, crank), _lines(at, values, crank), _LARGEST)


CURVE_SITUATIONS = (
    Situation(
        'corner of a load curve', f'{_BESIDE:g} rad beside a point of the curve',
        lambda random, i: _curve(random, lambda at: at[i % _POINTS] - _BESIDE),
    ),
    Situation(
        'steep edge', f'between two points that are {_STEEP:g} rad apart',
        lambda random, _: _curve(
            random, lambda at: at[3] + _STEEP * float(random.uniform(0.2, 0.8)), _STEEP
        ),
    ),
)  # fmt: skip


# ---------------------------------------------------------------- friction


def _guide(mechanism: SliderCrank, crank: float) -> tuple[float, float]:
    """Returns the guide force on the slider, positive to the left, N, and its velocity, m/s."""
    solver = Solver(mechanism)
    state = solver.state(crank, SPEED, ACCELERATION)
    force, _ = solver.reactions(state).guides['slider']
    return float(force), float(state.velocity[-1])


def _grown(mechanism: SliderCrank, crank: float, *_: float) -> float:
    return abs(_guide(mechanism, crank)[0])


def _fixed_point(_: SliderCrank, __: float, push: float, gain: float) -> float:
    force = 0.0
    for _round in range(_ROUNDS):
        force = abs(push + gain * force)
    return force


def _newton(_: SliderCrank, __: float, push: float, gain: float) -> float:
    force = 10.0 * abs(push)  # a first guess, as from a state with a larger normal force
    for _round in range(_ROUNDS):
        sign = math.copysign(1.0, push + gain * force)
        force = sign * push / (1 - sign * gain)
    return force


GROWN = 'Newton, growing'
FRICTION_METHODS = [
    Method(
        GROWN, 'friction', 'nothing', 'this package: mechanism/joint_forces.py',
        _grown,
    ),
    Method(
        'Newton, at once', 'friction', 'a first guess', 'Newton: N = abs(b + k N)', _newton,
    ),
    Method(
        'fixed point', 'friction', 'abs(k) below 1', 'friction and forces alternate', _fixed_point,
    ),
]  # fmt: skip


def _rubbing(random: Random, _: int, *, share: float, relieves: bool = False) -> NumberCase:
    """Makes a random slider-crank whose coefficient of friction gives |k| = `share`.

    With `relieves`, friction reduces the normal force; otherwise it adds to it.
    """
    while True:
        lengths = random.uniform((0.1, 0.5, -0.02), (0.3, 1.0, 0.02)).tolist()
        crank = float(random.uniform(0.5, 2.6)) * (1 if random.random() < 0.5 else -1)
        smooth = slider_crank(*lengths)
        force, velocity = _guide(smooth, crank)
        # What 1 N along the slide adds to the guide force, measured with 10 N. Friction is such a
        # force, against the velocity.
        pushed = replace(smooth, loads=(LinkLoad('slider', force=10.0),))
        per_newton = (_guide(pushed, crank)[0] - force) / 10.0
        per_friction = -math.copysign(1.0, velocity) * per_newton
        if (per_friction * force < 0) == relieves:
            break
    mechanism = replace(smooth, loads=(Friction(guide=share / abs(per_friction)),))
    exact = abs(force) / (1 + share if relieves else 1 - share)
    gain = share * math.copysign(1.0, per_friction)  # the k of the methods
    return NumberCase((mechanism, crank, force, gain), exact, abs(exact))


FRICTION_SITUATIONS = (
    Situation(
        'friction', 'friction adds about a tenth to the normal force', partial(_rubbing, share=0.1)
    ),
    Situation(
        'nearly self-locking', 'the coefficient is 0.999 of the value that locks',
        partial(_rubbing, share=0.999),
    ),
    Situation(
        'friction that relieves', 'friction reduces the normal force to a quarter',
        partial(_rubbing, share=3.0, relieves=True),
    ),
    Situation(
        'self-locking', 'the coefficient is 1.001 of the value that locks',
        partial(_rubbing, share=1.001), exists=False,
    ),
)  # fmt: skip
