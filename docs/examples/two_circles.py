# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A method of solving of your own: how many programs place a pin.

B is where circles about A and B0 meet, or a circle about A and the path of the slider's pin: no
angle is needed. Half the chord is the root of a difference, which loses its digits where links
come into line; `linkage_chart accuracy` and `linkage_chart stability` show what that costs.

Importing this file adds the method to these charts.
"""

from __future__ import annotations

from linkage_ros.formulas import Vector, atan2, cos, sin, sqrt
from linkage_ros.lab.methods.chain import POSITION, Method
from linkage_ros.lab.methods.registry import METHODS
from linkage_ros.lab.methods.stages import Links
from linkage_ros.numeric import Real


def two_circles(links: Links, crank: Real) -> tuple[Real, Real]:
    """From the crank angle to the coupler's direction and the output.

    Args:
        links: The constants of a four-bar, or of a slider-crank, where c is None.
        crank: rad.

    Returns:
        Coupler, rad, and rocker, rad, or slider, m.
    """
    r, b, c, d, angle, side, *_ = links
    if c is None:
        by = d - r * sin(crank - angle)
        bx = side * sqrt(b * b - by * by)
        return atan2(by, bx) + angle, r * cos(crank - angle) + bx
    x, y = Vector.at(angle) * d - Vector.at(crank) * r
    square = x * x + y * y
    foot = 0.5 + (b - c) * (b + c) / (2 * square)
    half_chord = side * sqrt(b * b / square - foot * foot)
    bx, by = x * foot - y * half_chord, y * foot + x * half_chord
    return atan2(by, bx), atan2(by - y, bx - x)


METHODS.append(
    Method(
        'two circles', POSITION, 'nothing', 'P. Bourke, Intersection of two circles, 1997',
        two_circles,
    )
)  # fmt: skip
