# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Situations in which methods for linkages fail, generated from a seed."""

from __future__ import annotations

import cmath
import math

import numpy as np

from linkage_ros.dynamics.solver import Solver
from linkage_ros.lab.methods.bench import LinkageBench
from linkage_ros.lab.methods.chain import Task
from linkage_ros.lab.methods.linkages import (
    Linkage,
    Random,
    any_assembly,
    four_bar,
    limited,
    other_assembly,
    slider_crank,
    turning,
    with_change_point,
)
from linkage_ros.lab.methods.outcomes import one_by_one
from linkage_ros.model.parts import CROSSED, OPEN


def _case(mechanism: Linkage, cranks: tuple[float, ...], *, decimal: bool = False) -> LinkageBench:
    """Makes a case, with the first guess at the first angle."""
    return LinkageBench(Task.at(mechanism, cranks[0]), cranks, decimal=decimal)


def _turn(steps: int = 48, turns: int = 1) -> tuple[float, ...]:
    """Even angles, the first half a step after 0."""
    return tuple((i + 0.5) * 2 * math.pi / steps for i in range(steps * turns))


def _passing(*extra: float) -> tuple[float, ...]:
    """Two turns in even steps from a quarter turn before 0, and further angles."""
    even = (-math.pi / 2 + angle for angle in _turn(turns=2))
    return tuple(sorted((*even, *extra)))


def _ordinary(random: Random, _: int) -> LinkageBench:
    return _case(turning(random), _turn())


def _hit(random: Random, _: int) -> LinkageBench:
    return _case(with_change_point(random), (-0.3, -0.2, -0.1, 0.0, -0.0, 1e-300))


def _passed(random: Random, _: int) -> LinkageBench:
    return _case(with_change_point(random), _passing())


def _near(random: Random, i: int) -> LinkageBench:
    angle, gap = float(random.uniform(-3, 3)), 10.0 ** -float(random.uniform(11, 13))
    r, b = (float(x) for x in random.uniform((0.2, 0.5), (0.4, 0.9)))
    d = r + gap if i % 2 else r + float(random.uniform(0.1, 0.4))
    c = b if i % 2 else d - r + b - gap
    mechanism = four_bar((r, b, c, d), any_assembly(random), angle)
    aside = [sign * 10.0**power for power in range(-14, 0) for sign in (-1, 1)]
    return _case(mechanism, tuple(sorted(angle + x for x in (*aside, 0.0))))


def _dead_centre(random: Random, _: int) -> LinkageBench:
    mechanism = limited(random)
    start, end = Solver(mechanism).reach.arcs[0]
    goal, inward = (start, 1.0) if random.random() < 0.5 else (end, -1.0)
    # In steps from the middle of the arc, as a motion would come there.
    walk = np.linspace((start + end) / 2, goal + inward * 1e-2, 40, endpoint=False)
    near = [goal + inward * 10.0**-k for k in range(2, 7)]
    return _case(mechanism, (*map(float, walk), *near))


def _no_assembly(random: Random, _: int) -> LinkageBench:
    mechanism = limited(random)
    start, end = Solver(mechanism).reach.arcs[0]
    beyond = end + random.uniform(0.01, 0.9, 8) * 0.1
    position = Solver(mechanism).state((start + end) / 2).position
    return LinkageBench(Task(mechanism, (position[1], position[2])), beyond)


def _denominator(random: Random, i: int) -> LinkageBench:
    """Crank angles where the rocker of one assembly points against the frame.

    The tangent of its half angle is infinite there: the quadratic term vanishes, and the formula
    for the other assembly is 0/0.
    """
    if i == 0:
        return _case(slider_crank(0.1, 0.3, 0.0), (0.0, math.pi))
    r, c, d = (float(x) for x in random.uniform((0.5, 0.6, 0.1), (0.7, 0.8, 0.2)))
    crank = float(random.uniform(0.9, 2.2)) * (1 if i % 2 else -1)
    # B is on the line of the frame, right of the line from A to B0 where A is left of the frame.
    b = abs(d - c - cmath.rect(r, crank))
    return _case(four_bar((r, b, c, d), OPEN if crank > 0 else CROSSED), (crank,))


def _wrong_guess(random: Random, _: int) -> LinkageBench:
    mechanism, cranks = turning(random), _turn()
    position = Solver(other_assembly(mechanism)).state(cranks[0]).position
    return LinkageBench(Task(mechanism, (position[1], position[2])), cranks)


def _few_steps(random: Random, _: int) -> LinkageBench:
    d = float(random.uniform(0.1, 0.15))
    lengths = (float(random.uniform(0.5, 0.6)), float(random.uniform(0.35, 0.45)), 0.55, d)
    return _case(four_bar(lengths, any_assembly(random)), _turn(steps=5, turns=2))


def _equal(random: Random, i: int) -> LinkageBench:
    x, y = (float(k) / 64 for k in random.integers((8, 33), (32, 64)))
    lengths = ((x, x, x, x), (x, y, y, x), (x, y, x, y))[i % 3]
    return _case(four_bar(lengths, any_assembly(random)), _passing(0.0, 1e-9))


_DECIMALS = (
    (0.1, 0.3, 0.4, 0.2), (0.1, 0.7, 0.8, 0.2), (0.3, 0.6, 0.7, 0.4), (0.1, 0.2, 0.3, 0.2),
    (0.7, 0.9, 1.1, 0.9),
)  # fmt: skip


def _decimals(random: Random, i: int) -> LinkageBench:
    mechanism = four_bar(_DECIMALS[i % len(_DECIMALS)], any_assembly(random))
    return _case(mechanism, _passing(1e-9, 1e-6, 1e-3), decimal=True)


def _long_run(random: Random, _: int) -> LinkageBench:
    turns = 2 * math.pi * 1e9
    return _case(turning(random), tuple(turns + x for x in _turn()))


SITUATIONS = (
    one_by_one('ordinary', 'random linkages that turn fully, far from change points', _ordinary),
    one_by_one('change point hit', 'all links in one line, to the last bit', _hit),
    one_by_one('change point passed', 'two turns through it, in both assemblies', _passed),
    one_by_one(
        'near a change point', 'missed by 1e-11 to 1e-13 m; angles to 1e-14 rad from it', _near
    ),
    one_by_one('dead centre', 'a limited crank comes up to it, to 1e-6 rad', _dead_centre),
    one_by_one(
        'no assembly',
        'a crank turned beyond its reach: no state exists',
        _no_assembly,
        exists=False,
    ),
    one_by_one(
        'half-angle denominator',
        'the coefficient of the quadratic term is 0 but for rounding',
        _denominator,
    ),
    one_by_one('wrong first guess', "the other assembly's position", _wrong_guess),
    one_by_one('few steps', 'links that turn, asked five times a turn', _few_steps),
    one_by_one('equal lengths', 'rhombi, kites, parallelograms, with both change points', _equal),
    one_by_one(
        'lengths in decimals',
        'a change point is meant, but 0.2 + 0.3 - 0.1 - 0.4 is not 0',
        _decimals,
    ),
    one_by_one('long run', 'after 1e9 turns', _long_run),
)
