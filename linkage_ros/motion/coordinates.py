# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The coordinates of a mechanism at one moment: what every drive gives, and every reader takes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from linkage_ros.numeric import Real


class Coordinates(NamedTuple):
    """Coordinates, rates and accelerations, each in the order of `Solver.coordinates`.

    Floats, or arrays for many moments.

    Attributes:
        q: Crank angle, less than two turns, rad: a state repeats after at most two turns. Of a
            wind pump also the slider's position, m.
        u: Their rates, rad/s and m/s.
        a: Their accelerations, rad/s^2 and m/s^2.
        unwrapped: The whole crank angle, correctly rounded, rad.
    """

    q: tuple[Real, ...]
    u: tuple[Real, ...]
    a: tuple[Real, ...]
    unwrapped: Real


def stacked(moments: Sequence[Coordinates]) -> Coordinates:
    """Coordinates of arrays, from those of many moments."""
    q, u, a = (
        tuple(np.array(row) for row in zip(*(m[i] for m in moments), strict=True))
        for i in range(3)
    )
    return Coordinates(q, u, a, np.array([m.unwrapped for m in moments]))
