# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The positions of a mechanism's links at given coordinates, the input of all formulas."""

from __future__ import annotations

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
        sines: For each dyad, the sine of the angle from its first to its second link, right to a
            few ulp where it vanishes too; from the first link to the normal of a guide.
    """

    links: tuple[LinkPose, ...]
    sines: tuple[Real, ...]


class Loop(Protocol):
    """The constants of a mechanism's kinematics: a named tuple of floats and `Opaque`s."""

    def pose(self, q: tuple[Real, ...]) -> Pose:
        """The exact pose at the coordinates; guards refuse unreachable coordinates."""
