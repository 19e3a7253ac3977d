# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Loads on the links of a mechanism: each gives a generalised force for every link it acts on.

The power of a load is the sum of its forces times the links' rates, so that a link that turns gets
a torque about its own axis, and a link that slides a force along its guide. Loads are named tuples
of floats; ZERO marks a term that is not there.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

from linkage_ros.formulas import ZERO, Vector, dot
from linkage_ros.model.pose import LinkPose
from linkage_ros.numeric import Real


class Load(Protocol):
    """What acts on links."""

    def forces(self, links: Sequence[LinkPose], rates: Sequence[Real]) -> dict[int, Real]:
        """The generalised forces.

        Joint forces take that of a link that turns for a couple.

        Args:
            links: Where the links are.
            rates: Their velocities, rad/s or m/s.

        Returns:
            By the index of the link, N m counter-clockwise, or N along the guide.
        """

    def resistance(self, rates: Sequence[Real]) -> dict[int, Real]:
        """The part of the forces that dissipates power; the frame exerts it. As `forces`."""

    def potential(self, links: Sequence[LinkPose]) -> Real:
        """The potential energy but for a constant, J; ZERO: there is none."""


class LinkLoad(NamedTuple):
    """A constant force or torque on one link, and a resistance to its motion.

    Attributes:
        link: Index of the link.
        force: N m counter-clockwise, or N along the guide.
        damping: Resistance per rate of the link, N m s or N s/m.
    """

    link: int
    force: Real = ZERO
    damping: Real = ZERO

    def forces(self, links: Sequence[LinkPose], rates: Sequence[Real]) -> dict[int, Real]:
        """See `Load`."""
        del links
        return {self.link: self.force - self.damping * rates[self.link]}

    def resistance(self, rates: Sequence[Real]) -> dict[int, Real]:
        """See `Load`."""
        return {self.link: -(self.damping * rates[self.link])}

    def potential(self, links: Sequence[LinkPose]) -> Real:
        """See `Load`: there is none."""
        del links
        return ZERO


class Weight(NamedTuple):
    """The weights of all bodies, summed for each link j as W_j = sum_bodies m rho_j.

    Attributes:
        moments: For each link, conj(W_j) g as x and y, N m; of a link that slides, m g turned by
            90 degrees, N. ZERO where there is none.
        slides: Whether the link slides.
    """

    moments: tuple[Vector, ...]
    slides: tuple[bool, ...]

    def forces(self, links: Sequence[LinkPose], rates: Sequence[Real]) -> dict[int, Real]:
        """See `Load`: Re(conj(i W_j e^(i phi_j)) g)."""
        del rates
        return {
            j: moment.y * link.direction.x - moment.x * link.direction.y
            for j, (moment, link) in enumerate(zip(self.moments, links, strict=True))
        }

    def resistance(self, rates: Sequence[Real]) -> dict[int, Real]:
        """See `Load`: there is none."""
        del rates
        return {}

    def potential(self, links: Sequence[LinkPose]) -> Real:
        """See `Load`."""
        forces, energy = self.forces(links, ()), ZERO
        for j, (moment, slides, link) in enumerate(
            zip(self.moments, self.slides, links, strict=True)
        ):
            energy = energy - (
                forces[j] * link.position if slides else dot(moment, link.direction)
            )
        return energy
