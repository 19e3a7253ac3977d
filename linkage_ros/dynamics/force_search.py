# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The search for forces in joints that make loads, such as friction, which change these forces.

For a given motion, the forces are linear in the loads: F_k = F0_k + sum_m R_km s_m, where s_m is
the magnitude of the force in joint m, and R_km holds the coefficient of friction. Newton's method
solves s_k = |F_k|. Its matrix, 1_km - F_k . R_km / |F_k|, has the determinant 1 without friction.
Several solutions may exist; the right one is that which develops from the forces without friction
while the coefficients grow, and on the way to it the determinant stays positive. Where the
determinant reaches 0, forces pass all bounds or stop to exist: the mechanism locks itself.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from typing import NamedTuple

from linkage_ros.dynamics.equations import determinant, solved
from linkage_ros.formulas import ZERO, Vector, dot, number, sqrt, where
from linkage_ros.numeric import Real

_PART = 1e-12  # of the largest force, by which a state that is solved still changes
_ROUNDING = 1e-6  # the same where rounding errors no longer let the change shrink
_SINGULAR = 1e-12  # a determinant whose digits are all wrong
_STEP = 1e-9  # the smallest step of the coefficients, as a share of them


class Search(NamedTuple):
    """How far the search for the forces of a state has come.

    Attributes:
        share: Share of the coefficients for which they are sought, from 0 to 1.
        solved: Share for which they are known.
        change: Their change in the last round, N; inf before the first round of a share.
        sizes: Magnitudes of the forces in the joints that make loads, as far as they are found, N.
        known: The same at the share that is solved.
    """

    share: Real
    solved: Real
    change: Real
    sizes: tuple[Real, ...]
    known: tuple[Real, ...]


def advanced(
    search: Search, forces: Sequence[Vector], slopes: Sequence[Sequence[Vector]]
) -> tuple[Search, Real]:
    """The search after a step of Newton's method.

    Args:
        search: The search before it.
        forces: F_k.
        slopes: R_km in the order [m][k].

    Returns:
        The search, and `Round.left`.
    """
    sizes = [sqrt(dot(force, force)) for force in forces]
    matrix = [
        [
            (1.0 if k == m else ZERO) - dot(forces[k], row[k]) / where(sizes[k] > 0, sizes[k], 1.0)
            for m, row in enumerate(slopes)
        ]
        for k in range(len(forces))
    ]
    lacking = [found - size for found, size in zip(sizes, search.sizes, strict=True)]
    whole = number(determinant(matrix))
    steps = solved(matrix, lacking, where(whole > _SINGULAR, whole, 1.0))
    return _next(search, steps, whole, _largest(sizes))


def _next(
    search: Search, steps: Sequence[Real], whole: Real, largest: Real
) -> tuple[Search, Real]:
    """The search with which the next round begins, and `Round.left`.

    Args:
        search: What this round began with.
        steps: Newton's steps, N.
        whole: The determinant.
        largest: The largest force, N.
    """
    share, change = search.share, _largest([abs(step) for step in steps])
    shrinks = change < 0.5 * search.change
    close = change <= where(shrinks, _PART, _ROUNDING) * largest

    def case(is_close: Real, shrinks_only: Real, fails: Real) -> Real:
        otherwise = where(shrinks, shrinks_only, fails)
        return where(whole > _SINGULAR, where(close, is_close, otherwise), fails)

    grown = share - search.solved
    further, nearer = share + 2.0 * grown, share - 0.5 * grown
    further = where(further < 1, further, 1.0)
    sizes = [size + step for size, step in zip(search.sizes, steps, strict=True)]
    ahead = Search(
        case(further, share, nearer),
        case(share, search.solved, search.solved),
        case(where(share < 1, math.inf, search.change), change, math.inf),
        tuple(
            case(where(share < 1, size, before), size, known)
            for size, before, known in zip(sizes, search.sizes, search.known, strict=True)
        ),
        tuple(case(size, known, known) for size, known in zip(sizes, search.known, strict=True)),
    )
    left = case(where(share < 1, 1.0, 0.0), 1.0, where(grown > _STEP, 1.0, -1.0))
    return ahead, left


def _largest(values: Sequence[Real]) -> Real:
    return functools.reduce(lambda x, y: where(x > y, x, y), values)
