# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Test linkages, most of them random, in situations where some methods fail."""

import cmath
import math
from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

from linkage_lab.methods.linkage_cases import LinkageCase
from linkage_lab.methods.measure import Situation
from linkage_lab.reference.states import Linkage, other_assembly
from linkage_ros import (
    CROSSED,
    OPEN,
    Body,
    Coupler,
    FourBar,
    Frame,
    Guide,
    Rocker,
    Slider,
    SliderCrank,
    Solver,
)

Random: TypeAlias = np.random.Generator
# Lengths for which a change point is intended.
_DECIMALS = (
    (0.1, 0.3, 0.4, 0.2), (0.1, 0.7, 0.8, 0.2), (0.3, 0.6, 0.7, 0.4), (0.1, 0.2, 0.3, 0.2),
    (0.7, 0.9, 1.1, 0.9),
)  # fmt: skip


def four_bar(lengths: Sequence[float], assembly: str = OPEN, angle: float = 0.0) -> FourBar:
    """Makes a four-bar of uniform rods; lengths of crank, coupler, rocker and frame, m."""
    r, b, c, d = lengths
    return FourBar(Frame(d, angle), Body(*_rod(r)), Coupler(*_rod(b)), Rocker(*_rod(c)), assembly)


def slider_crank(
    r: float, b: float, offset: float, assembly: str = OPEN, angle: float = 0.0
) -> SliderCrank:
    """Makes a slider-crank of uniform rods, r and b m long, and a slider of 1 kg."""
    slider = Slider(offset, 1.0)
    return SliderCrank(Body(*_rod(r)), Coupler(*_rod(b)), slider, Guide(angle), assembly)


def _rod(length: float) -> tuple[float, float, float, tuple[float, float]]:
    """Returns length, mass, inertia and centre of a uniform rod of 2 kg."""
    return length, 2.0, length * length / 6, (length / 2, 0.0)


def any_assembly(random: Random) -> str:
    """Chooses one of the two assemblies at random."""
    return OPEN if random.random() < 0.5 else CROSSED


def turning(random: Random) -> Linkage:
    """Makes a random linkage whose crank turns fully, far from change points."""
    while True:
        angle = float(random.uniform(-math.pi, math.pi))
        if random.random() < 0.3:
            r, b = float(random.uniform(0.1, 0.3)), float(random.uniform(0.5, 1.0))
            offset = float(random.uniform(-0.3, 0.3)) * (b - r)
            return slider_crank(r, b, offset, any_assembly(random), angle)
        r, b, c, d = lengths = random.uniform(0.1, 1.0, 4).tolist()
        reaches_far = b + c - d - r > 0.05  # coupler and rocker span d + r
        reaches_near = (d - r - b + c) * (d - r + b - c) > 0.0025  # and |d - r|
        if reaches_far and reaches_near:
            return four_bar(lengths, any_assembly(random), angle)


def with_change_point(random: Random) -> FourBar:
    """Makes a random four-bar with a change point at crank angle 0; lengths in steps of 1/64 m."""
    r = int(random.integers(8, 24))
    d, b = r + int(random.integers(4, 24)), r + int(random.integers(4, 24))
    return four_bar([x / 64 for x in (r, b, d - r + b, d)], any_assembly(random))


def limited(random: Random) -> FourBar:
    """Makes a random four-bar whose crank cannot turn fully."""
    while True:
        r, b, c, d = lengths = random.uniform(0.2, 1.0, 4).tolist()
        closes = b + c - abs(d - r) > 0.05 and abs(b - c) - (d + r) < -0.05
        # Coupler and rocker are too short for the pin at d + r, or too different for |d - r|.
        stretches = b + c - d - r < -0.05
        folds = (d - r - b + c) * (d - r + b - c) < -0.01
        if closes and stretches != folds:  # one arc
            return four_bar(lengths, any_assembly(random), float(random.uniform(-3, 3)))


# ---------------------------------------------------------------- situations


def _turn(steps: int = 48, turns: int = 1) -> tuple[float, ...]:
    """Returns evenly spaced angles, rad, the first half a step after 0."""
    return tuple((i + 0.5) * 2 * math.pi / steps for i in range(steps * turns))


def _passing(*extra: float) -> tuple[float, ...]:
    """Merges evenly spaced angles over two turns from -pi/2 on with the given angles, rad."""
    even = (-math.pi / 2 + angle for angle in _turn(turns=2))
    return tuple(sorted((*even, *extra)))


def _near(random: Random, i: int) -> LinkageCase:
    """Makes a near miss of a change point, in turn of a kite's and of another linkage's."""
    angle, gap = float(random.uniform(-3, 3)), 10.0 ** -float(random.uniform(11, 13))
    r, b = random.uniform((0.2, 0.5), (0.4, 0.9)).tolist()
    is_kite = i % 2 == 1
    d = r + gap if is_kite else r + float(random.uniform(0.1, 0.4))
    c = b if is_kite else d - r + b - gap
    mechanism = four_bar((r, b, c, d), any_assembly(random), angle)
    aside = [sign * 10.0**power for power in range(-14, 0) for sign in (-1, 1)]
    return LinkageCase(mechanism, sorted(angle + x for x in (*aside, 0.0)))


def _dead_centre(random: Random, _: int) -> LinkageCase:
    """Makes crank angles that approach one end of an arc from its middle, as in a motion."""
    mechanism = limited(random)
    start, end = Solver(mechanism).reach.arcs[0]
    goal, inward = (start, 1.0) if random.random() < 0.5 else (end, -1.0)
    approach = np.linspace((start + end) / 2, goal + inward * 1e-2, 40, endpoint=False)
    near = [goal + inward * 10.0**-k for k in range(2, 7)]
    return LinkageCase(mechanism, [*approach, *near])


def _no_assembly(random: Random, _: int) -> LinkageCase:
    """Makes crank angles beyond an arc, with a first guess inside it."""
    mechanism = limited(random)
    start, end = Solver(mechanism).reach.arcs[0]
    beyond = end + random.uniform(0.01, 0.9, 8) * 0.1
    position = Solver(mechanism).state((start + end) / 2).position
    return LinkageCase(mechanism, beyond, position[1:])


def _denominator(random: Random, i: int) -> LinkageCase:
    """Makes a linkage at crank angles where one assembly's rocker is antiparallel to the frame.

    There, the tangent of half the rocker's angle is infinite. The quadratic term vanishes, and the
    formula for the other assembly is 0/0.
    """
    if i == 0:
        return LinkageCase(slider_crank(0.1, 0.3, 0.0), (0.0, math.pi))
    r, c, d = random.uniform((0.5, 0.6, 0.1), (0.7, 0.8, 0.2)).tolist()
    crank = float(random.uniform(0.9, 2.2)) * (1 if i % 2 else -1)
    # B lies on the line of the frame, to the right of the line from A to B0 if crank > 0.
    b = abs(d - c - cmath.rect(r, crank))
    return LinkageCase(four_bar((r, b, c, d), OPEN if crank > 0 else CROSSED), (crank,))


def _wrong_guess(random: Random, _: int) -> LinkageCase:
    """Makes a turn with the first guess in the other assembly."""
    mechanism, cranks = turning(random), _turn()
    position = Solver(other_assembly(mechanism)).state(cranks[0]).position
    return LinkageCase(mechanism, cranks, position[1:])


def _few_steps(random: Random, _: int) -> LinkageCase:
    d = float(random.uniform(0.1, 0.15))
    r, b = random.uniform((0.5, 0.35), (0.6, 0.45)).tolist()
    return LinkageCase(four_bar((r, b, 0.55, d), any_assembly(random)), _turn(steps=5, turns=2))


def _equal(random: Random, i: int) -> LinkageCase:
    x, y = (float(k) / 64 for k in random.integers((8, 33), (32, 64)))
    lengths = ((x, x, x, x), (x, y, y, x), (x, y, x, y))[i % 3]
    return LinkageCase(four_bar(lengths, any_assembly(random)), _passing(0.0, 1e-9))


def _decimals(random: Random, i: int) -> LinkageCase:
    mechanism = four_bar(_DECIMALS[i % len(_DECIMALS)], any_assembly(random))
    return LinkageCase(mechanism, _passing(1e-9, 1e-6, 1e-3), decimal=True)


SITUATIONS = (
    Situation(
        'ordinary', 'random linkages that turn fully, far from change points',
        lambda random, _: LinkageCase(turning(random), _turn()),
    ),
    Situation(
        'change point hit', 'all links are exactly in one line',
        lambda random, _: LinkageCase(
            with_change_point(random), (-0.3, -0.2, -0.1, 0.0, -0.0, 1e-300)
        ),
    ),
    Situation(
        'change point passed', 'two turns through it, from either assembly',
        lambda random, _: LinkageCase(with_change_point(random), _passing()),
    ),
    Situation(
        'near a change point', 'missed by 1e-11 to 1e-13 m; angles as close as 1e-14 rad', _near,
    ),
    Situation('dead centre', 'a limited crank approaches it to 1e-6 rad', _dead_centre),
    Situation(
        'no assembly', 'a crank turned beyond its reach: no state exists', _no_assembly,
        exists=False,
    ),
    Situation(
        'half-angle denominator', 'the coefficient of the quadratic term is 0 to rounding',
        _denominator,
    ),
    Situation('wrong first guess', "it is the other assembly's position", _wrong_guess),
    Situation('few steps', 'a double-crank, solved at five angles a turn', _few_steps),
    Situation('equal lengths', 'rhombi, kites, parallelograms pass both change points', _equal),
    Situation(
        'lengths in decimals',
        'a change point is intended, but 0.2 + 0.3 - 0.1 - 0.4 is not 0', _decimals,
    ),
    Situation(
        'long run', 'after 1e9 turns',
        lambda random, _: LinkageCase(
            turning(random), np.array(_turn()) + 2 * math.pi * 1e9
        ),
    ),
)  # fmt: skip
