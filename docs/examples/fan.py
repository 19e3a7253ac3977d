# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Defines a kind of load of your own: a fan, whose torque grows with the speed squared.

Importing this file registers `kind: fan` for the loads of every mechanism and program:

    loads:
      blower: {kind: fan, link: rocker, coefficient: 0.4}
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from linkage_ros.extensions import LOADS, AppliedLoad, LinkPose, LoadedMechanism, Wrench
from linkage_ros.formulas import ZERO, Real
from linkage_ros.quantities import quantity


@dataclass(frozen=True)
class Fan(AppliedLoad):
    """A torque on a turning link against its rotation: coefficient x speed^2.

    Attributes:
        link: Name of the link.
        coefficient: Torque per squared angular velocity, N m s^2.
    """

    link: str = quantity('text', 'link that carries the fan')
    coefficient: float = quantity(
        'number', 'torque per squared angular velocity', 'N m s^2', span=(0.0, 1e12)
    )

    def on(self, mechanism: LoadedMechanism) -> FanTorque:
        """Returns the load in the form used by formulas."""
        link = mechanism.structure().link_index(self.link, f'{self.label}.link')
        return FanTorque(link, self.coefficient)


class FanTorque(NamedTuple):
    """The fan in the form used by formulas.

    Attributes:
        link: Index of the link.
        coefficient: Torque per squared angular velocity, N m s^2.
    """

    link: int
    coefficient: Real

    def wrenches(self, _links: Sequence[LinkPose], rates: Sequence[Real]) -> list[Wrench]:
        """Returns the torque on the link, which the air exerts."""
        rate = rates[self.link]
        return [Wrench(self.link, -(self.coefficient * (rate * abs(rate))))]

    def potential(self, _links: Sequence[LinkPose]) -> Real:
        """Returns ZERO: a fan stores no energy."""
        return ZERO


LOADS['fan'] = Fan
