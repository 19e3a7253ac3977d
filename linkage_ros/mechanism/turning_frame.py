# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Inertia of the links if base_link turns about a pivot that is fixed in the world.

In the axes of base_link, whose rate is W and acceleration e, the centre r of a body accelerates by

    e x (r - pivot) - W^2 (r - pivot) + 2 W x v

in addition to its acceleration relative to base_link, and its spin by e. By d'Alembert's
principle, this is a load.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

from linkage_ros.formulas import ZERO, Vector
from linkage_ros.mechanism.kinematics import LinkPose
from linkage_ros.mechanism.wrenches import Wrench, place, velocity
from linkage_ros.numeric import Real


class TurningFrame(NamedTuple):
    """The motion of base_link, as a `Load`.

    Attributes:
        bodies: The moving links, `structure.Link`s.
        pivot: The point of base_link that is fixed in the world, m.
        rate: Angular velocity, rad/s.
        change: Angular acceleration, rad/s^2.
    """

    bodies: tuple[Any, ...]
    pivot: Vector
    rate: Real
    change: Real

    def wrenches(self, links: Sequence[LinkPose], rates: Sequence[Real]) -> list[Wrench]:
        """See `Load`."""
        inertial_wrenches = []
        for j, body in enumerate(self.bodies):
            arm = place(body.center, links) - self.pivot
            relative = velocity(body.center, links, rates)
            euler_and_centripetal = arm.left() * self.change - arm * (self.rate * self.rate)
            coriolis = relative.left() * (2.0 * self.rate)
            force = (euler_and_centripetal + coriolis) * -body.mass
            couple = -(body.inertia * self.change)
            inertial_wrenches.append(Wrench(j, force=force, point=body.center, couple=couple))
        return inertial_wrenches

    def potential(self, _links: Sequence[LinkPose]) -> Real:
        """Returns ZERO; see `Load`."""
        return ZERO
