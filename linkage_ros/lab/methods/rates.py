# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Rates and accelerations from positions.

Each maker returns two functions of the crank angle, the position work included: the coupler's
and the output's velocities at unit crank speed, and these velocities with the accelerations that
remain where the crank's speed stays.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from linkage_ros.dynamics.program import Program
from linkage_ros.lab.methods.functions import SCALAR, Functions
from linkage_ros.lab.methods.loop import Linkage, Loop, Pair, solve_2x2
from linkage_ros.lab.methods.positions import Locate
from linkage_ros.model.pose import Loop as LoopConstants
from linkage_ros.numeric import Real, wrap


class Rates(NamedTuple):
    """Position, first and second derivatives by the crank angle, one call for each depth.

    Attributes:
        first: From the crank angle to (position, first).
        second: From the crank angle to (position, first, second).
    """

    first: Callable[[Real], tuple[Pair, Pair]]
    second: Callable[[Real], tuple[Pair, Pair, Pair]]


def analytic(mechanism: Linkage, f: Functions) -> Rates:
    """The package's own: the factored form differentiated, no division by sin(gamma - beta)."""
    programs = [Program(formula, mechanism.loop(), ('crank',)) for formula in (_first, _second)]
    return Rates(*(p.compile() if f is SCALAR else p.arrays for p in programs))


def _first(loop: LoopConstants, crank: Real) -> tuple[tuple[Real, ...], ...]:
    return _second(loop, crank)[:2]


def _second(loop: LoopConstants, crank: Real) -> tuple[tuple[Real, ...], ...]:
    _, *links = loop.pose((crank,)).links
    return (
        tuple(link.position for link in links),
        tuple(link.jacobian[0] for link in links),
        tuple(link.curvature[0] for link in links),
    )


def two_by_two(mechanism: Linkage, locate: Locate, f: Functions) -> Rates:
    """The differentiated loop, solved for both unknowns.

    Document 1, eq. 13 to 18; of a slider-crank document 4, eq. 5 to 8.
    """
    loop = Loop(mechanism)

    def first(crank: Real) -> tuple[Pair, Pair]:
        coupler, output = position = locate(crank)
        x, y = loop.crank_column(crank, f)
        return position, solve_2x2(loop.columns(coupler, output, f), (-x, -y))

    def second(crank: Real) -> tuple[Pair, Pair, Pair]:
        coupler, output = position = locate(crank)
        columns = loop.columns(coupler, output, f)
        x, y = loop.crank_column(crank, f)
        rates = solve_2x2(columns, (-x, -y))
        x, y = loop.bias((crank, coupler, output), (1.0, *rates), f)
        return position, rates, solve_2x2(columns, (-x, -y))

    return Rates(first, second)


def sine_formula(mechanism: Linkage, locate: Locate, f: Functions) -> Rates:
    """Each rate by eliminating the other link (document 2, eq. 27 to 33).

    The document leaves accelerations out; here they are eliminated in the same way.
    """
    r, b, sin, cos = mechanism.crank.length, mechanism.coupler.length, f.sin, f.cos
    rocker = Loop(mechanism).rocker
    guide = mechanism.frame.angle

    def turning(crank: Real, coupler: Real, output: Real) -> tuple[Pair, Real]:
        sine = sin(output - coupler)
        return (
            r * sin(crank - output) / (b * sine),
            r * sin(crank - coupler) / (rocker * sine),
        ), sine

    def sliding(crank: Real, coupler: Real) -> tuple[Pair, Real]:
        cosine = cos(coupler - guide)
        turn = -r * cos(crank - guide) / (b * cosine)
        return (turn, r * sin(coupler - crank) / cosine), cosine

    def first(crank: Real) -> tuple[Pair, Pair]:
        coupler, output = position = locate(crank)
        if rocker is None:
            return position, sliding(crank, coupler)[0]
        return position, turning(crank, coupler, output)[0]

    def second(crank: Real) -> tuple[Pair, Pair, Pair]:
        coupler, output = position = locate(crank)
        if rocker is None:
            rates, cosine = sliding(crank, coupler)
            square = rates[0] * rates[0]
            turn = (r * sin(crank - guide) + b * square * sin(coupler - guide)) / (b * cosine)
            move = -(r * cos(crank - coupler) + b * square) / cosine
            return position, rates, (turn, move)
        rates, sine = turning(crank, coupler, output)
        u, v = b * (rates[0] * rates[0]), rocker * (rates[1] * rates[1])
        turn = (v - r * cos(crank - output) - u * cos(coupler - output)) / -(b * sine)
        move = (v * cos(output - coupler) - r * cos(crank - coupler) - u) / -(rocker * sine)
        return position, rates, (turn, move)

    return Rates(first, second)


def central_differences(mechanism: Linkage, locate: Locate, step: float, f: Functions) -> Rates:
    """Positions a step before and after (for instance Dahlquist and Bjorck, sec. 3.3)."""
    turns = Loop(mechanism).rocker is not None
    over, over_square = 1 / (2 * step), 1 / (step * step)

    def first(crank: Real) -> tuple[Pair, Pair]:
        (c0, o0), (c2, o2) = locate(crank - step), locate(crank + step)
        move = wrap(o2 - o0, f.round) if turns else o2 - o0
        return locate(crank), (wrap(c2 - c0, f.round) * over, move * over)

    def second(crank: Real) -> tuple[Pair, Pair, Pair]:
        before, here, after = locate(crank - step), locate(crank), locate(crank + step)
        changes = [
            (wrap(z - y, f.round), wrap(y - x, f.round)) if turning else (z - y, y - x)
            for x, y, z, turning in zip(before, here, after, (True, turns), strict=True)
        ]
        (a, b), (c, d) = changes
        rates = ((a + b) * over, (c + d) * over)
        return here, rates, ((a - b) * over_square, (c - d) * over_square)

    return Rates(first, second)
