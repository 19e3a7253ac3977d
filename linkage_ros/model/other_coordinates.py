# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The poses of mechanisms in their other coordinates, for motions past a dead centre.

A crank that cannot turn fully comes to rest at its dead centres, where coupler and rocker are in
line. There its angle no longer determines the motion, but the rocker's angle or the slider's
position does. For a wind pump, the angles of crank and coupler do so where coupler and rod are in
line. Each of these coordinates fails at another place.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from linkage_ros.formulas import ZERO, Opaque, Vector, atan2, cos, dot, require, sin, sqrt, turned
from linkage_ros.model.pose import LinkPose, Loop, Pose
from linkage_ros.numeric import HALF_PI, Real, two_sum


class ByRocker(NamedTuple):
    """The constants of a four-bar linkage whose coordinate is the rocker's angle.

    Attributes:
        reversed: Those of the same linkage read from its other end: the rocker is its crank, and
            its coupler goes from B to A.
    """

    reversed: Loop

    def pose(self, q: tuple[Real, ...]) -> Pose:
        """The pose at a rocker angle, rad."""
        (rocker, coupler, crank), sines = self.reversed.pose(q)
        back = -coupler.direction
        angle = atan2(back.y, back.x)
        return Pose((crank, coupler._replace(position=angle, direction=back), rocker), sines)


def half_turn_on(angle: float) -> tuple[float, float]:
    """Adds half a turn to an angle, towards 0; returns the nearest float and its error, rad."""
    way = math.copysign(2.0, -angle)
    high, error = two_sum(angle, way * HALF_PI[0])
    return high, error + way * HALF_PI[1]


class BySlider(NamedTuple):
    """The constants of a slider-crank whose coordinate is the slider's position.

    Attributes:
        side: 1: the crank pin lies left of the line from A0 to B, -1: right of it.
        guide: Cosine and sine of the guide's direction.
        crank: Length r, m.
        coupler: Length b, m.
        offset: Offset e of the guide, m.
        refuse: Function that rejects a position.
    """

    side: int
    guide: Vector
    crank: float
    coupler: float
    offset: float
    refuse: Opaque

    def pose(self, q: tuple[Real, ...]) -> Pose:
        """The pose at a position of the slider, m."""
        (slide,) = q
        r, b, e, guide = self.crank, self.coupler, self.offset, self.guide
        square = slide * slide + e * e
        stretch, fold = (r + b) * (r + b) - square, square - (r - b) * (r - b)
        require(stretch > 0, self.refuse, slide)
        require(fold > 0, self.refuse, slide)
        root = self.side * (sqrt(stretch) * sqrt(fold))
        # In the guide's axes.
        crank, coupler = directions(Vector(slide, e), square, root, r, b)
        over_r, over_b, cosine = 2 * b / root, 2 * r / root, dot(crank, coupler)
        one, other = -coupler.x * over_r, crank.x * over_b
        bend = -over_r * (r * cosine * (one * one) + b * (other * other))
        other_bend = over_b * (r * (one * one) + b * cosine * (other * other))
        links = []
        for link, rate, change in ((crank, one, bend), (coupler, other, other_bend)):
            way = turned(link, guide.x, guide.y)
            links.append(LinkPose(atan2(way.y, way.x), way, (rate,), (change,)))
        return Pose((*links, LinkPose(slide, guide, (1.0,), (ZERO,))), (root / (-2 * r * b),))


class ByCoupler(NamedTuple):
    """The constants of a wind pump whose coordinates are the crank's and the coupler's angle.

    Attributes:
        crank: Length r of the crank, m.
        coupler: Length b of the coupler, m.
        rod: Length c of the rod, m.
        side: 1: the rod points along the guide; -1: against it.
        refuse: Function that rejects coordinates.
    """

    crank: float
    coupler: float
    rod: float
    side: int
    refuse: Opaque

    def pose(self, q: tuple[Real, ...]) -> Pose:
        """The pose at a crank angle and a coupler angle, rad."""
        r, b, c = self.crank, self.coupler, self.rod
        crank, coupler = (Vector(cos(angle), sin(angle)) for angle in q)
        rise = -(r * crank.y + b * coupler.y)
        square = (c - rise) * (c + rise)
        require(square > 0, self.refuse, *q)
        run = self.side * sqrt(square)
        # How the rod turns: run phi3' = -r cos(phi1) phi1' - b cos(phi2) phi2'.
        one, two = -r * crank.x / run, -b * coupler.x / run
        rod_bends = (
            (r * crank.y + rise * (one * one)) / run,
            2 * rise * (one * two) / run,
            (b * coupler.y + rise * (two * two)) / run,
        )
        slide_bends = (
            -r * crank.x - run * (one * one) - rise * rod_bends[0],
            -2 * run * (one * two) - rise * rod_bends[1],
            -b * coupler.x - run * (two * two) - rise * rod_bends[2],
        )
        slopes = -r * crank.y - rise * one, -b * coupler.y - rise * two
        rod, still = Vector(run / c, rise / c), (ZERO, ZERO, ZERO)
        slide = r * crank.x + b * coupler.x + run
        return Pose(
            (
                LinkPose(q[0], crank, (1.0, ZERO), still),
                LinkPose(q[1], coupler, (ZERO, 1.0), still),
                LinkPose(atan2(rod.y, rod.x), rod, (one, two), rod_bends),
                LinkPose(slide, Vector(1.0, ZERO), slopes, slide_bends),
            ),
            (rod.x,),
        )


def directions(
    apart: Vector, square: Real, root: Real, first: float, second: float
) -> tuple[Vector, Vector]:
    """The directions of both links, each along the way from the first outer pin to the second.

    Args:
        apart: From the first link's outer pin to the second's, m.
        square: Its length squared, m^2.
        root: Square root of (stretched length^2 - square) (square - folded length^2), m^2, with
            the sign of the assembly: positive where the pin lies left of the line.
        first: Length of the first link, m.
        second: Length of the second link, m.

    Returns:
        Unit vectors; the sine of the angle from the first to the second is -root over twice the
        product of the lengths.
    """
    moment, scale = (first - second) * (first + second), 0.5 / square
    part, rest = scale * (square + moment) / first, scale * (square - moment) / second
    turn_first, turn_second = scale * root / first, scale * root / second
    one = Vector(apart.x * part - apart.y * turn_first, apart.x * turn_first + apart.y * part)
    other = Vector(apart.x * rest + apart.y * turn_second, apart.y * rest - apart.x * turn_second)
    return one, other
