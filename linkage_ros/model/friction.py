# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Dry friction in the pins and on the guide (Coulomb)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

from linkage_ros.errors import ConfigurationError
from linkage_ros.formulas import ZERO, where
from linkage_ros.model.loads import AppliedLoad, Contact
from linkage_ros.model.structure import Link, Mechanism, Pin
from linkage_ros.numeric import Real
from linkage_ros.quantities import quantity


@dataclass(frozen=True)
class Friction(AppliedLoad):
    """Dry friction: one coefficient and radius for all pins, and one coefficient for the guide.

    A pin resists the rotation of its two links with coefficient x radius x force, the guide the
    sliding with coefficient x normal force; both are 0 at rest.

    Attributes:
        pin: Coefficient of friction of the pins.
        pin_radius: Radius of the pins, m.
        guide: Coefficient of friction of the guide.
    """

    group: ClassVar[str] = 'friction'

    pin: float = quantity(
        'number', 'friction coefficient of the pins', span=(0.0, 100.0), default=0.0
    )
    pin_radius: float = quantity('number', 'radius of the pins', 'm', span=(0.0, 1e9), default=0.0)
    guide: float = quantity(
        'number', 'friction coefficient of the guide', span=(0.0, 100.0), default=0.0
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if bool(self.pin) != bool(self.pin_radius):
            raise ConfigurationError(
                f'friction.pin = {self.pin:g} with friction.pin_radius = {self.pin_radius:g}: '
                'give both above 0, or leave both out'
            )

    def in_joints(self, mechanism: Mechanism) -> 'Rubbing | None':
        """See `AppliedLoad`.

        Raises:
            ConfigurationError: Friction in a guide is given for a mechanism without a guide.
        """
        if self.guide and not any(link.slides for link in mechanism.structure().links):
            raise ConfigurationError(
                f'friction.guide = {self.guide:g}: this mechanism has no guide; leave it out'
            )
        rubbing = Rubbing(self.pin * self.pin_radius, self.guide)
        return rubbing if any(rubbing) else None


class Rubbing(NamedTuple):
    """Dry friction for formulas.

    Attributes:
        arm: Coefficient times radius of the pins, m; ZERO: no friction there.
        guide: Coefficient of the guide; ZERO: no friction there.
    """

    arm: Real
    guide: Real

    def contacts(
        self, pins: Sequence[Pin], links: Sequence[Link], rates: Sequence[Real]
    ) -> list[Contact]:
        """See `JointLoad`; the joints with friction, pins first."""
        contacts = []
        for pin in pins if self.arm is not ZERO else ():
            # A sliding link does not turn: its guide transmits the couple to the frame.
            first, *others = (
                j for j in (pin.second, pin.first) if j is not None and not links[j].slides
            )
            apart = rates[first] - (rates[others[0]] if others else ZERO)
            lever = self.arm * _sign(apart)
            levers = {first: -lever, **dict.fromkeys(others, lever)}
            contacts.append(Contact(pin.name, levers))
        for j, link in enumerate(links):
            if link.slides and self.guide is not ZERO:
                contacts.append(Contact(link.name, {j: -(self.guide * _sign(rates[j]))}))
        return contacts


def _sign(rate: Real) -> Real:
    return where(rate > 0, 1.0, where(rate < 0, -1.0, 0.0))
