# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Positions in closed form: ours, and two that textbooks print.

Each maker returns a function from the crank angle to the coupler's direction and the output.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from linkage_ros.dynamics.program import Program
from linkage_ros.lab.methods.functions import SCALAR, Functions
from linkage_ros.lab.methods.loop import Linkage
from linkage_ros.model.four_bar import FourBar
from linkage_ros.model.parts import OPEN
from linkage_ros.model.pose import Loop
from linkage_ros.numeric import Real

Locate: TypeAlias = Callable[[Real], tuple[Real, Real]]


def factored(mechanism: Linkage, f: Functions) -> Locate:
    """The package's own: sums of terms that are never negative (model.transmission)."""
    program = Program(_positions, mechanism.loop(), ('crank',))
    return program.compile() if f is SCALAR else program.arrays


def _positions(loop: Loop, crank: Real) -> tuple[Real, ...]:
    return tuple(link.position for link in loop.pose((crank,)).links[1:])


def inverse_cosine(mechanism: Linkage, f: Functions) -> Locate:
    """The triangle of coupler, rocker and the diagonal A-B0, by the law of cosines.

    Of a slider-crank, the angle between the coupler and the normal of the guide.
    """
    acos = math.acos if f is SCALAR else np.arccos
    sin, cos = f.sin, f.cos
    side = 1.0 if mechanism.assembly == OPEN else -1.0
    r, b, direction = mechanism.crank.length, mechanism.coupler.length, mechanism.frame.angle
    if isinstance(mechanism, FourBar):
        c, d = mechanism.rocker.length, mechanism.frame.length
        dx, dy = d * math.cos(direction), d * math.sin(direction)
        bb, cc, b2, c2 = b * b, c * c, 2 * b, 2 * c
        sqrt, atan2, pi = f.sqrt, f.atan2, math.pi

        def locate(crank: Real) -> tuple[Real, Real]:
            x, y = dx - r * cos(crank), dy - r * sin(crank)
            square = x * x + y * y
            diagonal, toward = sqrt(square), atan2(y, x)
            coupler = toward + side * acos((bb + square - cc) / (b2 * diagonal))
            return coupler, toward + pi - side * acos((cc + square - bb) / (c2 * diagonal))

        return locate
    offset, half = mechanism.slider.offset, math.pi / 2

    def slide(crank: Real) -> tuple[Real, Real]:
        angle = crank - direction
        along = half - side * acos((offset - r * sin(angle)) / b)
        return along + direction, r * cos(angle) + b * cos(along)

    return slide


def half_angle(mechanism: Linkage, f: Functions) -> Locate:
    """Tangents of half angles solve quadratic equations (document 2, eq. 16 to 26)."""
    atan = math.atan if f is SCALAR else np.arctan
    sin, cos, sqrt = f.sin, f.cos, f.sqrt
    side = 1.0 if mechanism.assembly == OPEN else -1.0
    r2, r3, direction = mechanism.crank.length, mechanism.coupler.length, mechanism.frame.angle

    def root(a: Real, b: Real, c: Real, sign: float) -> Real:
        return 2 * atan((-b + sign * sqrt(b * b - 4 * a * c)) / (2 * a))

    if isinstance(mechanism, FourBar):
        r1, r4 = mechanism.frame.length, mechanism.rocker.length
        h1, h2, h3 = r1 / r2, r1 / r3, r1 / r4
        squares = r1 * r1 + r2 * r2
        h4 = (r4 * r4 - r3 * r3 - squares) / (2 * r2 * r3)
        h5 = (squares - r3 * r3 + r4 * r4) / (2 * r2 * r4)

        def locate(crank: Real) -> tuple[Real, Real]:
            angle = crank - direction
            c2, b = cos(angle), -2 * sin(angle)
            coupler = root(h4 - h1 + (1 + h2) * c2, b, h4 + h1 - (1 - h2) * c2, -side)
            rocker = root(h5 - h1 + (1 - h3) * c2, b, h5 + h1 - (1 + h3) * c2, -side)
            return coupler + direction, rocker + direction

        return locate
    offset = mechanism.slider.offset

    def slide(crank: Real) -> tuple[Real, Real]:
        angle = crank - direction
        height = offset - r2 * sin(angle)
        along = root(height, -2 * r3, height, -side)
        return along + direction, r2 * cos(angle) + r3 * cos(along)

    return slide
