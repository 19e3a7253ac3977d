# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The coordinates of a mechanism at one moment: what every drive gives, and every reader takes."""

from __future__ import annotations

from typing import NamedTuple


class Coordinates(NamedTuple):
    """Coordinates, rates and accelerations, each in the order of `Solver.coordinates`.

    Attributes:
        q: Crank angle, less than two turns, rad: a state repeats after at most two turns. Of a
            wind pump also the slider's position, m.
        u: Their rates, rad/s and m/s.
        a: Their accelerations, rad/s^2 and m/s^2.
        unwrapped: The whole crank angle, correctly rounded, rad.
    """

    q: tuple[float, ...]
    u: tuple[float, ...]
    a: tuple[float, ...]
    unwrapped: float
