# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where the links of a mechanism are, for given coordinates: what all formulas read."""

from __future__ import annotations

from typing import NamedTuple, Protocol

from linkage_ros.formulas import Vector
from linkage_ros.numeric import Real


class LinkPose(NamedTuple):
    """Where a link is, and how it follows the coordinates.

    Attributes:
        position: Direction from first to second pin, in [-pi, pi] except the crank's, rad; of a
            sliding link its place along its guide, m.
        direction: Unit vector of the link; of a sliding link, of its guide.
        jacobian: Velocity of the link per rate of each coordinate; ZERO: the coordinate does not
            move it.
        curvature: Acceleration of the link per product of two rates (1 1; 1 2; 2 2), while none
            of the rates changes; ZERO: there is none.
    """

    position: Real
    direction: Vector
    jacobian: tuple[Real, ...]
    curvature: tuple[Real, ...]


class Pose(NamedTuple):
    """Where all links are, for given coordinates.

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
        """The pose at the coordinates, exact; guards refuse coordinates that cannot be reached."""
