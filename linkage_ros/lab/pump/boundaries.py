# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where settled motions lose their stability as the speed changes: folds and others."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np

from linkage_ros.lab.pump.periodic import PeriodicMotion, Wanted, find_motions
from linkage_ros.lab.pump.poincare import PoincareMap
from linkage_ros.numeric import Array

FOLD = 'fold'
PERIOD_DOUBLING = 'period doubling'
TORUS = 'torus'
_NODES = 8  # of the polynomial in which a boundary is sought


def _product(factors: Iterable[complex]) -> float:
    return math.prod(factors, start=1 + 0j).real


# Each changes its sign, smoothly, where stability is lost in its way: the test functions of
# Y. A. Kuznetsov, Elements of Applied Bifurcation Theory, chapter 10.
_TESTS: dict[str, Callable[[tuple[complex, ...]], float]] = {
    FOLD: lambda found: _product(1 - one for one in found),
    PERIOD_DOUBLING: lambda found: _product(1 + one for one in found),
    TORUS: lambda found: _product(
        1 - one * other for one, other in itertools.combinations(found, 2)
    ),
}


class Boundary(NamedTuple):
    """Where the settled motions become unstable.

    Attributes:
        kind: FOLD (a multiplier is 1: two states merge), PERIOD_DOUBLING (-1) or TORUS (a pair).
        motion: The one in between.
    """

    kind: str
    motion: PeriodicMotion


def find_boundary(
    poincare: PoincareMap, pair: tuple[PeriodicMotion, PeriodicMotion]
) -> Boundary | None:
    """Where neighbours differ in stability, by a polynomial through a test function there.

    Args:
        poincare: The Poincare map.
        pair: The neighbours, by growing speed.

    Returns:
        The boundary; None: none is found.
    """
    shares = (1 - np.cos(np.pi * np.arange(1, _NODES) / _NODES)) / 2
    known = [pair[0], *filter(None, _between(poincare, pair, shares)), pair[1]]
    places = [
        (motion.speed - known[0].speed) / (pair[1].speed - known[0].speed) for motion in known
    ]
    for kind, test in _TESTS.items():
        values = [test(motion.multipliers) for motion in known]
        if values[0] * values[-1] < 0:
            roots = np.polynomial.Polynomial.fit(places, values, len(known) - 1).roots()
            real = roots.real[(abs(roots.imag) < 1e-9) & (abs(roots.real - 0.5) <= 0.5)]
            (motion,) = _between(poincare, pair, real[:1])
            return Boundary(kind, motion) if motion else None
    return None


def _between(
    poincare: PoincareMap, pair: tuple[PeriodicMotion, PeriodicMotion], shares: Array
) -> list[PeriodicMotion | None]:
    """The motions at speeds between those of two others, from one (0) to the other (1)."""
    low, high = pair
    guesses = low.unknowns[:, None] + shares * (high.unknowns - low.unknowns)[:, None]
    speeds = low.speed + shares * (high.speed - low.speed)
    return find_motions(poincare, guesses, Wanted(speeds, is_speed=True))
