# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Poses by plain formulas, which cost less and are as accurate far from change points.

The common pin of the two links is an intersection of two circles, or of a circle and a line
(P. Bourke, Intersection of two circles, 1997). The derivatives follow from components of the
differentiated loop equation across each link, and divide by the sine of the transmission angle.
Errors of the plain formulas grow as the inverse square of this sine, and of the distance between
crank pin and rocker pivot.
"""

import math
from typing import NamedTuple

from linkage_ros.formulas import ZERO, Vector, atan2, cross, dot, sqrt, turned
from linkage_ros.mechanism.kinematics import Arc, LinkPose, Pose
from linkage_ros.numeric import Real

_SINE = 0.5  # smallest sine of a transmission angle that counts as far from a change point


def is_far(transmission: Arc) -> bool:
    """Returns whether all transmission angles from the first to the second, rad, are large."""
    return min(map(math.sin, transmission)) >= _SINE


class PlainFourBar(NamedTuple):
    """The constants of the plain formula of a four-bar linkage; lengths in m.

    Attributes:
        crank: Length r of the crank.
        coupler: Length b of the coupler.
        rocker: Length c of the rocker.
        frame: Vector from A0 to B0.
        side: 1.0 for the open assembly, -1.0 for the crossed one.
    """

    crank: float
    coupler: float
    rocker: float
    frame: Vector
    side: float

    def pose(self, q: tuple[Real, ...]) -> Pose:
        """Computes the pose at a crank angle, rad."""
        (angle,) = q
        r, b, c = self.crank, self.coupler, self.rocker
        crank = Vector.at(angle)
        x, y = apart = self.frame - crank * r
        square = dot(apart, apart)
        over = 1.0 / square
        # The foot of B on the line from A to B0, and its distance from B, both divided by b L.
        root = sqrt(((b + c) * (b + c) - square) * (square - (b - c) * (b - c)))
        foot = 0.5 / b + (0.5 * (b - c) * (b + c) / b) * over
        height = (0.5 * self.side / b) * root * over
        coupler = Vector(x * foot - y * height, y * foot + x * height)
        rocker = (coupler * b - apart) * (1.0 / c)
        over_sine = (2 * self.side * b * c) / root
        one = cross(rocker, crank) * over_sine * (r / b)
        other = cross(coupler, crank) * over_sine * (r / c)
        pull, other_pull, cosine = b * (one * one), c * (other * other), dot(coupler, rocker)
        bend = (r * dot(crank, rocker) + pull * cosine - other_pull) * over_sine * (1.0 / b)
        other_bend = (r * dot(crank, coupler) + pull - other_pull * cosine) * over_sine
        return Pose(
            (
                LinkPose(angle, crank, (1.0,), (ZERO,)),
                LinkPose(atan2(coupler.y, coupler.x), coupler, (one,), (bend,)),
                LinkPose(atan2(rocker.y, rocker.x), rocker, (other,), (other_bend * (1.0 / c),)),
            ),
            (),
        )


class PlainSliderCrank(NamedTuple):
    """The constants of the plain formula of a slider-crank; lengths in m.

    Attributes:
        crank: Length r of the crank.
        coupler: Length b of the coupler.
        offset: Offset e of the guide.
        guide: Unit vector of the guide.
        side: 1.0 for the open assembly, -1.0 for the crossed one.
    """

    crank: float
    coupler: float
    offset: float
    guide: Vector
    side: float

    def pose(self, q: tuple[Real, ...]) -> Pose:
        """Computes the pose at a crank angle, rad."""
        (angle,) = q
        b, guide, crank = self.coupler, self.guide, Vector.at(angle)
        # In the guide's axes: the crank pin, and the vector from there to the slider's pin.
        pin = turned(crank * self.crank, guide.x, -guide.y)
        y = self.offset - pin.y
        x = self.side * sqrt(b * b - y * y)
        over = 1.0 / x
        turn = -(pin.x * over)
        square = turn * turn
        bend = (pin.y + y * square) * over
        coupler = turned(Vector(x, y), guide.x * (1.0 / b), guide.y * (1.0 / b))
        slope, curvature = -(pin.y + y * turn), -(pin.x + x * square + y * bend)
        return Pose(
            (
                LinkPose(angle, crank, (1.0,), (ZERO,)),
                LinkPose(atan2(coupler.y, coupler.x), coupler, (turn,), (bend,)),
                LinkPose(pin.x + x, guide, (slope,), (curvature,)),
            ),
            (),
        )
