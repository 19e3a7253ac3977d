# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Dry friction in pins and guides."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

from linkage_ros.errors import ConfigurationError
from linkage_ros.formulas import ZERO, where
from linkage_ros.mechanism.axes import carriers_of, spin_of
from linkage_ros.mechanism.loads.base import AppliedLoad, Contact, LoadedMechanism
from linkage_ros.mechanism.structure import Link, Pin
from linkage_ros.numeric import Real
from linkage_ros.quantities import quantity


@dataclass(frozen=True)
class Friction(AppliedLoad):
    """Dry friction: one coefficient and radius for all pins, and one coefficient for the guide.

    The friction torque in a pin is coefficient x radius x pin force. It opposes the relative
    rotation of the two links. The friction force in the guide is coefficient x normal force. It
    opposes sliding. Both are 0 at rest, and in the joints of links that are rigid with each other.

    Attributes:
        pin: Coefficient of friction of the pins.
        pin_radius: Radius of the pins, m.
        guide: Coefficient of friction of the guide.
    """

    has_corners: ClassVar[bool] = True

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
                f'{self.label}.pin = {self.pin:g} with {self.label}.pin_radius = '
                f'{self.pin_radius:g}: give both above 0, or leave both out'
            )

    def in_joints(self, mechanism: LoadedMechanism) -> 'DryFriction | None':
        """See `AppliedLoad.in_joints`.

        Raises:
            ConfigurationError: The mechanism has no guide, but guide friction is given.
        """
        if self.guide and not any(link.slides for link in mechanism.structure().links):
            raise ConfigurationError(
                f'{self.label}.guide = {self.guide:g}: this mechanism has no guide; leave it out'
            )
        friction = DryFriction(self.pin * self.pin_radius, self.guide)
        return friction if any(friction) else None


class _Joint(NamedTuple):
    """A joint with friction.

    Attributes:
        name: Name of the pin or of the sliding link.
        link: Index of a link of the joint; of a guide, the sliding link.
        other: Index of the other link of a pin; None if it does not move, and for a guide.
        rate: Rate of the link relative to the other, rad/s, or in its guide, m/s.
    """

    name: str
    link: int
    other: int | None
    rate: Real


class DryFriction(NamedTuple):
    """Dry friction, in the form used by formulas.

    Attributes:
        arm: Friction coefficient times radius of the pins, m; ZERO for frictionless pins.
        guide: Friction coefficient of the guide; ZERO for a frictionless guide.
    """

    arm: Real
    guide: Real

    def contacts(
        self, pins: Sequence[Pin], links: Sequence[Link], rates: Sequence[Real]
    ) -> list[Contact]:
        """Returns the contacts of the joints with friction, pins first; see `JointLoad`."""
        contacts = []
        for joint in self._joints(pins, links, rates):
            coefficient = self.guide if joint.name == links[joint.link].name else self.arm
            lever = coefficient * _sign(joint.rate)
            levers = {joint.link: -lever}
            if joint.other is not None:
                levers[joint.other] = lever
            contacts.append(Contact(joint.name, levers))
        return contacts

    def piece(self, pins: Sequence[Pin], links: Sequence[Link], rates: Sequence[Real]) -> Real:
        """Returns a number for each combination of directions in the joints; see `Load`.

        A joint at rest has a number of its own, because it has no friction.
        """
        joints = self._joints(pins, links, rates)
        return sum((_sign(joint.rate) + 1.0) * 3**i for i, joint in enumerate(joints))

    def _joints(
        self, pins: Sequence[Pin], links: Sequence[Link], rates: Sequence[Real]
    ) -> Iterator[_Joint]:
        """Yields each joint with friction.

        Joints between rigid links are left out: rounding errors would give them a rate.
        """
        carriers: dict[int | None, int | None] = {None: None}
        carriers |= enumerate(carriers_of(pins, links))
        for pin in pins if self.arm is not ZERO else ():
            if carriers[pin.first] == carriers[pin.second]:
                continue
            moving = [j for j in (pin.second, pin.first) if j is not None]
            link, *others = sorted(moving, key=lambda j: spin_of(links, j) is None)
            rate, *other_rates = (_spin_rate(links, rates, j) for j in (link, *others))
            yield _Joint(
                pin.name,
                link,
                other=others[0] if others else None,
                rate=rate - (other_rates[0] if other_rates else ZERO),
            )
        for j, link_of_guide in enumerate(links if self.guide is not ZERO else ()):
            if link_of_guide.slides and carriers[j] != carriers[link_of_guide.parent]:
                yield _Joint(link_of_guide.name, j, other=None, rate=rates[j])


def _spin_rate(links: Sequence[Link], rates: Sequence[Real], j: int) -> Real:
    """Returns the angular velocity of link j, rad/s; ZERO if it does not turn."""
    spin = spin_of(links, j)
    return ZERO if spin is None else rates[spin]


def _sign(rate: Real) -> Real:
    return where(rate > 0, 1.0, where(rate < 0, -1.0, 0.0))
