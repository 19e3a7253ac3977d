# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where settled motions lose their stability as the speed changes: folds and others."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np

from linkage_ros.lab.pump.periodic import PeriodicMotion, Wanted, find_motions
from linkage_ros.lab.pump.poincare import PoincareMap

Pair: TypeAlias = tuple[PeriodicMotion, PeriodicMotion]
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


def find_boundaries(poincare: PoincareMap, pairs: Sequence[Pair]) -> list[Boundary]:
    """Where neighbours differ in stability, by a polynomial through a test function there.

    Args:
        poincare: The Poincare map.
        pairs: The neighbours, each by growing speed.

    Returns:
        The boundaries that are found.
    """
    shares = ((1 - np.cos(np.pi * np.arange(1, _NODES) / _NODES)) / 2).tolist()
    found = _between(poincare, [(pair, share) for pair in pairs for share in shares])
    losses = []
    for number, pair in enumerate(pairs):
        inner = found[number * len(shares) : (number + 1) * len(shares)]
        losses += _losses(pair, [pair[0], *filter(None, inner), pair[1]])
    motions = _between(poincare, [(pair, share) for _, pair, share in losses])
    return [
        Boundary(kind, motion)
        for (kind, _, _), motion in zip(losses, motions, strict=True)
        if motion
    ]


def _losses(pair: Pair, known: Sequence[PeriodicMotion]) -> list[tuple[str, Pair, float]]:
    """The way in which stability is lost, and at which share of the way between two motions."""
    low, high = pair
    places = [(motion.speed - low.speed) / (high.speed - low.speed) for motion in known]
    for kind, test in _TESTS.items():
        values = [test(motion.multipliers) for motion in known]
        if values[0] * values[-1] < 0:
            roots = np.polynomial.Polynomial.fit(places, values, len(known) - 1).roots()
            real = roots.real[(abs(roots.imag) < 1e-9) & (abs(roots.real - 0.5) <= 0.5)]
            return [(kind, pair, float(share)) for share in real[:1]]
    return []


def _between(
    poincare: PoincareMap, places: Sequence[tuple[Pair, float]]
) -> list[PeriodicMotion | None]:
    """The motions at speeds between those of two others, from one (0) to the other (1)."""
    if not places:
        return []
    guesses = [
        low.unknowns + share * (high.unknowns - low.unknowns) for (low, high), share in places
    ]
    speeds = [low.speed + share * (high.speed - low.speed) for (low, high), share in places]
    return find_motions(poincare, np.array(guesses).T, Wanted(np.array(speeds), is_speed=True))
