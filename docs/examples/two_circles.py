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
from linkage_ros.lab.methods import chain
from linkage_ros.lab.methods.loop import Linkage
from linkage_ros.lab.methods.positions import Locate
from linkage_ros.lab.methods.registry import METHODS, Method
from linkage_ros.model.four_bar import FourBar
from linkage_ros.model.parts import OPEN
from linkage_ros.numeric import Real


def two_circles(mechanism: Linkage) -> Locate:
    """From the crank angle to the coupler's direction and the output, floats or arrays.

    Args:
        mechanism: A four-bar or a slider-crank.

    Returns:
        The function.
    """
    side = 1.0 if mechanism.assembly == OPEN else -1.0
    r, b, direction = mechanism.crank.length, mechanism.coupler.length, mechanism.frame.angle
    if isinstance(mechanism, FourBar):
        c, pivot = mechanism.rocker.length, Vector.at(direction) * mechanism.frame.length

        def locate(crank: Real) -> tuple[Real, Real]:
            x, y = pivot - Vector(r * cos(crank), r * sin(crank))
            square = x * x + y * y
            foot = 0.5 + (b - c) * (b + c) / (2 * square)
            half_chord = side * sqrt(b * b / square - foot * foot)
            bx, by = x * foot - y * half_chord, y * foot + x * half_chord
            return atan2(by, bx), atan2(by - y, bx - x)

        return locate
    offset = mechanism.slider.offset

    def slide(crank: Real) -> tuple[Real, Real]:
        angle = crank - direction
        by = offset - r * sin(angle)
        bx = side * sqrt(b * b - by * by)
        return atan2(by, bx) + direction, r * cos(angle) + bx

    return slide


METHODS.append(
    Method(
        'two circles', chain.POSITION, 'nothing', 'P. Bourke, Intersection of two circles, 1997',
        lambda task, _, f: chain.of_position(task, two_circles(task.mechanism), f),
    )
)  # fmt: skip
