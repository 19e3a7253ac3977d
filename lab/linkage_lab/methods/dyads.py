# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Methods for six-bars, and situations in which some of them fail.

A dyad of two links hangs between the crank pin of a four-bar and the frame. The answer is the rate
of its second link per crank rate. The reference is the intersection of two circles with 60 digits,
and the rate at which it moves.
"""

import cmath
import math
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from mpmath import mp

from linkage_lab.methods.loads import NumberCase
from linkage_lab.methods.measure import Method, Situation
from linkage_lab.methods.situations import Random, any_assembly, four_bar
from linkage_ros import OPEN, Body, Dyad, FourBar, Solver

_STEP, _ROUNDS = 1e-4, 50


def _plain(mechanism: FourBar, crank: float) -> float:
    return float(Solver(mechanism).state(crank, 1.0).velocity[-1])


def _differences(mechanism: FourBar, crank: float) -> float:
    solver = Solver(mechanism)
    before, after = (solver.state(crank + x).position[-1] for x in (-_STEP, _STEP))
    return math.remainder(after - before, math.tau) / (2 * _STEP)


def _newton(mechanism: FourBar, crank: float) -> float:
    """Solves the loop equations of the dyad from a fixed first guess, then for the rates."""
    dyad: Any = mechanism.dyads[0]
    b, c = dyad.first.length, dyad.second.length
    pin = mechanism.crank.length * np.array([math.cos(crank), math.sin(crank)])
    angles = np.array([0.5, 1.0])  # of both links, rad
    for _ in range(_ROUNDS):
        first_x, second_x = map(math.cos, angles)
        first_y, second_y = map(math.sin, angles)
        joint = pin + b * np.array([first_x, first_y])
        gap = joint - np.array(dyad.to_at) - c * np.array([second_x, second_y])
        jacobian = np.array([[-b * first_y, c * second_y], [b * first_x, -c * second_x]])
        angles = angles - np.linalg.solve(jacobian, gap)
    pin_velocity = np.array([-pin[1], pin[0]])
    return float(np.linalg.solve(jacobian, -pin_velocity)[1])


DYAD = 'dyad formula'
DYAD_METHODS = [
    Method(DYAD, 'dyad', 'nothing', 'this package: mechanism/dyads.py', _plain),
    Method('Newton, two links', 'dyad', 'a first guess', 'loop equations, 50 rounds', _newton),
    Method('differences of dyads', 'dyad', 'positions', f'steps of {_STEP:g} rad', _differences),
]


def _exact(mechanism: FourBar, crank: float) -> float:
    """Computes the rate of the second link per crank rate."""
    dyad: Any = mechanism.dyads[0]
    with mp.workdps(60):
        crank_pin = mp.mpf(mechanism.crank.length) * mp.expj(mp.mpf(crank))
        b, c = mp.mpf(dyad.first.length), mp.mpf(dyad.second.length)
        apart = mp.mpc(*map(mp.mpf, dyad.to_at)) - crank_pin
        distance = abs(apart)
        # The joint is on two circles: from the first end, along and to the left of `apart`.
        along = (distance**2 + b**2 - c**2) / (2 * distance)
        left = mp.sqrt(b**2 - along**2) * (1 if dyad.assembly == OPEN else -1)
        first = mp.mpc(along, left) * apart / distance
        second = first - apart
        # With the velocity v of the joint, (v - i crank_pin).first = v.second = 0.
        moved = (mp.conj(1j * crank_pin) * first).real
        rate = moved / (mp.conj(1j * second) * first).real
        return float(rate)


def _six_bar(random: Random, _: int, *, sine: float = 0.0, jams: bool = False) -> NumberCase:
    """Makes a six-bar and a crank angle.

    Args:
        random: Random numbers.
        sine: Sine of the obtuse angle between the links of the dyad at this crank angle.
        jams: Whether the dyad, in line there, is too short by a thousandth.
    """
    base = four_bar((1.0, 3.0, 2.5, 2.2), any_assembly(random))
    crank = float(random.uniform(-3, 3))
    end = complex(*random.uniform((1.5, 1.0), (2.5, 3.0)).tolist())
    crank_pin = complex(math.cos(crank), math.sin(crank))
    distance = abs(end - crank_pin) * (0.999 if jams else 1.0)
    ratio = float(random.uniform(0.7, 1.4))  # of the lengths, second to first
    between = math.pi - math.asin(sine)
    # With the joint at 0 and the first end at 1, the second end is at ratio e^(i between).
    first = distance / abs(1 - cmath.rect(ratio, between))
    dyad = Dyad(
        name='ram', from_='crank', from_at=(1.0, 0.0), to='frame', to_at=(end.real, end.imag),
        first=Body(first), second=Body(first * ratio), assembly=any_assembly(random),
    )  # fmt: skip
    mechanism = replace(base, dyads=(dyad,))
    exact = math.inf if jams else _exact(mechanism, crank)
    return NumberCase((mechanism, crank), exact, abs(exact))


DYAD_SITUATIONS = (
    Situation('dyad', 'its links enclose an angle of 45 deg', partial(_six_bar, sine=0.7)),
    Situation(
        'dyad near its toggle', 'the sine of the angle between its links is 1e-3',
        partial(_six_bar, sine=1e-3),
    ),
    Situation(
        'six-bar that jams', 'the dyad is too short by a thousandth', partial(_six_bar, jams=True),
        exists=False,
    ),
)  # fmt: skip
