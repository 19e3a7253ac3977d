# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Formulas of all methods for positions and rates of linkages; `torques` has the others.

Each is traced (dynamics/program.py), like the package's own formulas, so that all are compared on
equal terms. The loop equation is that of documents 1 (eq. 7 and 8) and 4 (eq. 2):

    gap = r e^(i alpha) + b e^(i beta) - B(y) = 0

with B(gamma) = d e^(i delta) + c e^(i gamma) of a rocker, and B(x) = (x + i e) e^(i guide) of a
slider.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias

from linkage_ros.dynamics.equations import Model
from linkage_ros.formulas import Vector, atan2, cos, cross, sin, sqrt
from linkage_ros.numeric import Real

Pair: TypeAlias = tuple[Real, Real]
# From the crank angle to the coupler's direction and the output, rad or m.
Locate: TypeAlias = Callable[[Real], Pair]


class Links(NamedTuple):
    """The constants of a four-bar or a slider-crank, and the motion of its crank.

    Attributes:
        r: Length of the crank, m.
        b: Length of the coupler, m.
        c: Length of the rocker, m; None: the output slides.
        d: Length of the frame, or offset of a slider, m.
        angle: Angle of frame or guide, rad.
        side: 1.0 for the open assembly, -1.0 for the crossed one.
        speed: Crank speed, rad/s.
        change: Crank acceleration, rad/s^2.
        model: The package's own constants.
        acos: Inverse cosine, for floats or for arrays.
        tool: Further input of a method's formula: a number or functions.
    """

    r: Real
    b: Real
    c: Real | None
    d: Real
    angle: Real
    side: Real
    speed: Real
    change: Real
    model: Model
    acos: Callable[[Real], Real]
    tool: Any


# ---------------------------------------------------------------- positions


def factored(links: Links, crank: Real) -> Pair:
    """The package's own: sums of terms that are never negative (model.transmission)."""
    _, coupler, output = links.model.loop.pose((crank,)).links
    return coupler.position, output.position


def inverse_cosine(links: Links, crank: Real) -> Pair:
    """The triangle of coupler, rocker and the diagonal A-B0, by the law of cosines.

    For a slider-crank, the angle between the coupler and the normal of the guide.
    """
    r, b, c, d, angle, side, *_ = links
    if c is None:
        theta = crank - angle
        along = math.pi / 2 - side * links.acos((d - r * sin(theta)) / b)
        return along + angle, r * cos(theta) + b * cos(along)
    x, y = Vector.at(angle) * d - Vector.at(crank) * r
    square = x * x + y * y
    diagonal, toward = sqrt(square), atan2(y, x)
    coupler = toward + side * links.acos((b * b + square - c * c) / (2 * b * diagonal))
    rocker = math.pi - side * links.acos((c * c + square - b * b) / (2 * c * diagonal))
    return coupler, toward + rocker


def half_angle(links: Links, crank: Real) -> Pair:
    """Tangents of half angles solve quadratic equations (document 2, eq. 16 to 26)."""
    r, b, c, d, angle, side, *_ = links
    theta = crank - angle
    if c is None:
        height = d - r * sin(theta)
        along = _half_angle_root(height, -2 * b, height, -side)
        return along + angle, r * cos(theta) + b * cos(along)
    h1, h2, h3 = d / r, d / b, d / c
    squares = d * d + r * r
    h4 = (c * c - b * b - squares) / (2 * r * b)
    h5 = (squares - b * b + c * c) / (2 * r * c)
    cosine, middle = cos(theta), -2 * sin(theta)
    coupler = _half_angle_root(
        h4 - h1 + (1 + h2) * cosine, middle, h4 + h1 - (1 - h2) * cosine, -side
    )
    rocker = _half_angle_root(
        h5 - h1 + (1 - h3) * cosine, middle, h5 + h1 - (1 + h3) * cosine, -side
    )
    return coupler + angle, rocker + angle


def _half_angle_root(a: Real, b: Real, c: Real, sign: Real) -> Real:
    return 2 * atan2((-b + sign * sqrt(b * b - 4 * a * c)) / (2 * a), 1.0)


def looked_up(links: Links, crank: Real) -> Pair:
    """Positions from opaque functions: the tool, and both parts of its result."""
    locate, first, second = links.tool
    found = locate(crank)
    return first(found), second(found)


# ---------------------------------------------------------------- the loop


class Arms(NamedTuple):
    """The vectors of a loop, m.

    Attributes:
        crank: From A0 to A.
        coupler: From A to B.
        output: From B0 to B, or along the guide.
        slope: Derivative of B by the output.
        gap: Gap of the loop.
    """

    crank: Vector
    coupler: Vector
    output: Vector
    slope: Vector
    gap: Vector

    @classmethod
    def at(cls, links: Links, crank: Real, coupler: Real, output: Real) -> Arms:
        """The vectors at a position."""
        first, second = Vector.at(crank) * links.r, Vector.at(coupler) * links.b
        frame = Vector.at(links.angle)
        if links.c is None:
            start, third, slope = frame.left() * links.d, frame * output, frame
        else:
            start, third = frame * links.d, Vector.at(output) * links.c
            slope = third.left()
        return cls(first, second, third, slope, first + second - start - third)

    def solve(self, right: Vector) -> Pair:
        """The changes of coupler and output that move the gap by a vector: Cramer's rule."""
        one, other = self.coupler.left(), -self.slope
        determinant = cross(one, other)
        return cross(right, other) / determinant, cross(one, right) / determinant


def newton_step(links: Links, crank: Real, coupler: Real, output: Real) -> tuple[Real, ...]:
    """Changes of coupler and output that close the loop to first order; and its present gap."""
    arms = Arms.at(links, crank, coupler, output)
    return (*arms.solve(-arms.gap), *arms.gap)


# ---------------------------------------------------------------- rates

# Position, and its first and second derivatives by the crank angle.
Rates: TypeAlias = tuple[Pair, Pair, Pair]


def analytic(links: Links, crank: Real, _: Locate) -> Rates:
    """The package's own derivative of the factored form, without division by a small sine."""
    second, third = links.model.loop.pose((crank,)).links[1:]
    return (
        (second.position, third.position),
        (second.jacobian[0], third.jacobian[0]),
        (second.curvature[0], third.curvature[0]),
    )


def two_by_two(links: Links, crank: Real, locate: Locate) -> Rates:
    """The differentiated loop, solved for both unknowns.

    Document 1, eq. 13 to 18; for a slider-crank, document 4, eq. 5 to 8.
    """
    position = locate(crank)
    arms = Arms.at(links, crank, *position)
    turn, move = first = arms.solve(-arms.crank.left())
    right = arms.crank + arms.coupler * (turn * turn)
    if links.c is not None:
        right -= arms.output * (move * move)
    return position, first, arms.solve(right)


def sine_formula(links: Links, crank: Real, locate: Locate) -> Rates:
    """Each rate by eliminating the other link (document 2, eq. 27 to 33).

    The document omits accelerations; they are derived in the same way.
    """
    r, b, c, guide = links.r, links.b, links.c, links.angle
    coupler, output = position = locate(crank)
    if c is None:
        cosine = cos(coupler - guide)
        turn = -r * cos(crank - guide) / (b * cosine)
        square = turn * turn
        change = (r * sin(crank - guide) + b * square * sin(coupler - guide)) / (b * cosine)
        slide = -(r * cos(crank - coupler) + b * square) / cosine
        return position, (turn, r * sin(coupler - crank) / cosine), (change, slide)
    sine = sin(output - coupler)
    turn, swing = r * sin(crank - output) / (b * sine), r * sin(crank - coupler) / (c * sine)
    u, v = b * (turn * turn), c * (swing * swing)
    change = (v - r * cos(crank - output) - u * cos(coupler - output)) / -(b * sine)
    second = (v * cos(output - coupler) - r * cos(crank - coupler) - u) / -(c * sine)
    return position, (turn, swing), (change, second)


def central_differences(links: Links, crank: Real, locate: Locate) -> Rates:
    """Positions a step before and after (for instance Dahlquist and Bjorck, sec. 3.3)."""
    step = links.tool
    before, here, after = locate(crank - step), locate(crank), locate(crank + step)
    (a, b), (c, d) = (
        (_wrapped(z - y), _wrapped(y - x)) if turns else (z - y, y - x)
        for x, y, z, turns in zip(before, here, after, (True, links.c is not None), strict=True)
    )
    over, square = 1 / (2 * step), 1 / (step * step)
    return here, ((a + b) * over, (c + d) * over), ((a - b) * square, (c - d) * square)


def _wrapped(angle: Real) -> Real:
    return atan2(sin(angle), cos(angle))
