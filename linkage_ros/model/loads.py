# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What acts on the links of a mechanism: a load gives a generalised force for each link.

The power of a load is the sum of its forces times the links' rates, so that a link that turns gets
a torque about its own axis, and a link that slides a force along its guide. Loads are named tuples
of floats; None marks a term that is not there.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

from linkage_ros.formulas import difference, times, total
from linkage_ros.model.pose import LinkPose
from linkage_ros.numeric import Real


class Load(Protocol):
    """What acts on links."""

    def forces(self, links: Sequence[LinkPose], rates: Sequence[Real | None]) -> dict[int, Real]:
        """The generalised forces.

        Args:
            links: Where the links are.
            rates: Their velocities, rad/s or m/s.

        Returns:
            By the index of the link, N m counter-clockwise, or N along the guide.
        """

    def resistance(self, rates: Sequence[Real | None]) -> dict[int, Real]:
        """The part of the forces that dissipates power; the frame exerts it. As `forces`."""

    def potential(self, links: Sequence[LinkPose]) -> Real | None:
        """The potential energy but for a constant, J; None: there is none."""


class LinkLoad(NamedTuple):
    """A constant force or torque on one link, and a resistance to its motion.

    Attributes:
        link: Index of the link.
        force: N m counter-clockwise, or N along the guide.
        damping: Resistance per rate of the link, N m s or N s/m.
    """

    link: int
    force: float | None = None
    damping: float | None = None

    def forces(self, links: Sequence[LinkPose], rates: Sequence[Real | None]) -> dict[int, Real]:
        """See `Load`."""
        del links
        push = difference(self.force, times(self.damping, rates[self.link]))
        return {} if push is None else {self.link: push}

    def resistance(self, rates: Sequence[Real | None]) -> dict[int, Real]:
        """See `Load`."""
        drag = difference(None, times(self.damping, rates[self.link]))
        return {} if drag is None else {self.link: drag}

    def potential(self, links: Sequence[LinkPose]) -> Real | None:
        """See `Load`: there is none."""
        del links
        return None


class Weight(NamedTuple):
    """The weights of all bodies, summed for each link j as W_j = sum_bodies m rho_j.

    Attributes:
        moments: For each link, conj(W_j) g as x and y, in N m, each None where it is 0; None:
            the link carries no weight. Of a link that slides, m g turned by 90 degrees, in N.
        slides: Whether the link slides.
    """

    moments: tuple[tuple[float | None, float | None] | None, ...]
    slides: tuple[bool, ...]

    def forces(self, links: Sequence[LinkPose], rates: Sequence[Real | None]) -> dict[int, Real]:
        """See `Load`: Re(conj(i W_j e^(i phi_j)) g)."""
        del rates
        found = {
            j: difference(times(moment[1], link.cos), times(moment[0], link.sin))
            for j, (moment, link) in enumerate(zip(self.moments, links, strict=True))
            if moment
        }
        return {j: force for j, force in found.items() if force is not None}

    def resistance(self, rates: Sequence[Real | None]) -> dict[int, Real]:
        """See `Load`: there is none."""
        del rates
        return {}

    def potential(self, links: Sequence[LinkPose]) -> Real:
        """See `Load`: from the height of the origin."""
        energy: Real = 0.0
        for moment, slides, link in zip(self.moments, self.slides, links, strict=True):
            if moment:
                x, y = moment
                if slides:
                    along = difference(times(y, link.cos), times(x, link.sin))
                    energy = difference(energy, times(along, link.position))
                else:
                    energy = energy - total(times(x, link.cos), times(y, link.sin))
        return energy
