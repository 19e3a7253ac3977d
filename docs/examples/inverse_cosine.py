# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Defines a method of your own: the law of cosines, with which many textbooks solve a linkage.

The angles of the triangle of coupler, rocker and the diagonal from A to B0 have cosines of nearly
1 where links come into line. Half of the angle's digits are lost there; `linkage_chart accuracy`
and `linkage_chart stability` show the effect.

Importing this file adds the method to these charts.
"""

from __future__ import annotations

import math

from linkage_lab.methods.measure import Method
from linkage_lab.methods.registry import METHODS
from linkage_lab.methods.stages import POSITION, Links
from linkage_ros.formulas import Real, Vector, atan2, cos, sin, sqrt


def inverse_cosine(links: Links, crank: Real) -> tuple[Real, Real]:
    """Computes the coupler's direction and the output position from the crank angle.

    Args:
        links: The constants of a four-bar, or of a slider-crank, for which c is None.
        crank: Crank angle, rad.

    Returns:
        Direction of the coupler, rad, and position of the rocker, rad, or of the slider, m.
    """
    r, b, c, d, angle, side, *_ = links
    if c is None:
        theta = crank - angle
        along = math.pi / 2 - side * _acos((d - r * sin(theta)) / b)
        return along + angle, r * cos(theta) + b * cos(along)
    x, y = Vector.at(angle) * d - Vector.at(crank) * r
    square = x * x + y * y
    diagonal, toward = sqrt(square), atan2(y, x)
    coupler = toward + side * _acos((b * b + square - c * c) / (2 * b * diagonal))
    rocker = math.pi - side * _acos((c * c + square - b * b) / (2 * c * diagonal))
    return coupler, toward + rocker


def _acos(cosine: Real) -> Real:
    return atan2(sqrt(1 - cosine * cosine), cosine)


METHODS.append(
    Method(
        'inverse cosine', POSITION, 'nothing',
        'law of cosines (Norton, Design of Machinery, 4.5)', inverse_cosine,
    )
)  # fmt: skip
