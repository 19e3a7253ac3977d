# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The positions of a mechanism's links at given coordinates, the input of all formulas."""

from typing import NamedTuple, Protocol

from linkage_ros.formulas import Vector
from linkage_ros.numeric import Real


class LinkPose(NamedTuple):
    """The position of a link, and its derivatives by the coordinates.

    Attributes:
        position: Direction from first to second pin, in [-pi, pi] except the crank's, rad; of a
            sliding link its place along its guide, m.
        direction: Unit vector of the link; of a sliding link, of its guide.
        jacobian: Velocity of the link per rate of each coordinate; ZERO: the coordinate does not
            move the link.
        curvature: Acceleration of the link per product of two rates (1 1; 1 2; 2 2) at constant
            rates; ZERO: none.
    """

    position: Real
    direction: Vector
    jacobian: tuple[Real, ...]
    curvature: tuple[Real, ...]


class Pose(NamedTuple):
    """The positions of all links at given coordinates.

    Attributes:
        links: One for each moving link.
        sines: For each dyad, the sine of the angle from its first to its second link or, for a
            slider, to the normal of its guide; right to a few ulp even near 0.
    """

    links: tuple[LinkPose, ...]
    sines: tuple[Real, ...]


class Loop(Protocol):
    """The constants of a mechanism's kinematics: a named tuple of floats and `Opaque`s."""

    def pose(self, q: tuple[Real, ...]) -> Pose:
        """The exact pose at the coordinates; guards refuse unreachable coordinates."""


def directions(
    apart: Vector, square: Real, root: Real, first: float, second: float
) -> tuple[Vector, Vector]:
    """The directions of a dyad's links, along the path from the first to the second outer pin.

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
