# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Loads on the links of a mechanism: each gives a generalised force on every loaded link.

The power of a load is the sum of its forces times the links' rates, so that a turning link gets a
torque about its own axis, and a sliding link a force along its guide. Viscous friction in a pin
would be such a load, too: it acts on one link with -c times the relative rate of the two links,
and on the other link with the opposite torque. Loads are named tuples of floats; in formulas an
absent term is ZERO.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, NamedTuple, Protocol

from linkage_ros.errors import ConfigurationError
from linkage_ros.formulas import ZERO, where
from linkage_ros.model.kinematics import LinkPose
from linkage_ros.numeric import Real
from linkage_ros.quantities import Checked, quantity

_POSITIVE = (0.0, 1e12)


class Load(Protocol):
    """Interface of a load: generalised forces on links, computed from their motion.

    A load on a single link may have an attribute `link`, the index of that link: the MJCF export
    then makes it a motor on the link's joint. Two methods are optional: `resistance(links, rates)`
    gives the part of the forces that the frame exerts, such as those of dampers and springs;
    `potential(links)` gives the potential energy up to a constant, J.
    """

    def forces(self, links: Sequence[LinkPose], rates: Sequence[Real]) -> dict[int, Real]:
        """Computes the generalised forces.

        A torque on a turning link acts as a couple, which matters for the joint forces.

        Args:
            links: Poses of the links.
            rates: Velocities of the links, rad/s or m/s.

        Returns:
            Forces by the index of the link: N m, counter-clockwise, or N along the guide.
        """


class Contact(NamedTuple):
    """A load caused by the force in a joint.

    Attributes:
        joint: Name of the pin or, for a guide, of the link that slides on it.
        levers: The load per force in the joint, by the index of the link: m; for a sliding link,
            dimensionless. A load with two links acts between them; a load with one link acts
            between that link and the frame.
    """

    joint: str
    levers: dict[int, Real]


class JointLoad(Protocol):
    """Interface of a load that joint forces cause, such as friction.

    Such loads and the joint forces are solved together.
    """

    def contacts(
        self, pins: Sequence[Any], links: Sequence[Any], rates: Sequence[Real]
    ) -> list[Contact]:
        """The joints whose forces cause the loads.

        Args:
            pins: `Structure.pins` of the mechanism.
            links: `Structure.links` of the mechanism.
            rates: Velocities of the links, rad/s or m/s.

        Returns:
            A contact for each joint; their order does not depend on the rates.
        """


class AppliedLoad(Checked):
    """Base class of the loads in a mechanism's description: frozen dataclasses of quantities.

    `linkage_ros.model.parts.LOADS` lists the classes of loads.

    Attributes:
        group: Name of the parameter group of the load; empty: the load has no such group.
        has_corners: Whether the force may have a corner or a jump while the links move.
    """

    group: ClassVar[str] = ''
    has_corners: ClassVar[bool] = False

    def join(self, _mechanism: Any) -> 'tuple[AppliedLoad, ...]':
        """Adds the load to a mechanism during its creation.

        Returns:
            The load itself; empty if a part of the mechanism takes over the load's values.

        Raises:
            ConfigurationError: The mechanism cannot have this load.
        """
        return (self,)

    def on(self, _mechanism: Any) -> Load | None:
        """Returns the load as formulas use it; None: joint forces cause all of the load.

        Raises:
            ConfigurationError: The load does not fit the mechanism.
        """
        return None

    def in_joints(self, _mechanism: Any) -> JointLoad | None:
        """Returns the part of the load that joint forces cause; None: there is no such part.

        Raises:
            ConfigurationError: The load does not fit the mechanism.
        """
        return None


@dataclass(frozen=True)
class LinkLoad(AppliedLoad):
    """The load on the output link; the mechanism stores it in the values of that link.

    `FourBar(..., loads=(LinkLoad('rocker', -5.0),))` puts a torque of -5 N m on its rocker.

    Attributes:
        link: 'rocker' or 'slider'.
        force: Load on the link: torque, N m, counter-clockwise; on a slider, force along the
            guide, N.
        damping: Resistance per rate of the link, N m s or N s/m.
        stiffness: Stiffness of a spring to the frame, N m/rad or N/m.
        rest: Position at which the spring is at rest, rad or m.
    """

    link: str = quantity('choice', 'link that the load acts on', choices=('rocker', 'slider'))
    force: float = quantity(
        'number', 'force or torque', 'N or N m', span=(-1e12, 1e12), default=0.0
    )
    damping: float = quantity('number', 'resistance per rate', span=_POSITIVE, default=0.0)
    stiffness: float = quantity('number', 'stiffness of a spring', span=_POSITIVE, default=0.0)
    rest: float = quantity('number', 'rest position', 'rad or m', span=(-1e9, 1e9), default=0.0)

    def join(self, mechanism: Any) -> tuple[()]:
        """See `AppliedLoad`; the load's values become values of the link.

        Raises:
            ConfigurationError: The mechanism has no such link, or the link already has a load.
        """
        mechanism.output(self.link, 'load.link')
        part = getattr(mechanism, self.link)
        if any(getattr(part, name) for name in part.load_fields):
            raise ConfigurationError(
                f'the load on the {self.link} is given twice: in {self.link} and in loads'
            )
        values = self.force, self.damping, self.stiffness, self.rest
        taken = replace(part, **dict(zip(part.load_fields, values, strict=True)))
        object.__setattr__(mechanism, self.link, taken)
        return ()


class LinkForce(NamedTuple):
    """The load on one link: a force or torque, a resistance, and a spring to the frame.

    Attributes:
        link: Index of the link.
        force: Torque, N m, counter-clockwise; or force along the guide, N.
        damping: Resistance per rate of the link, N m s or N s/m.
        stiffness: Stiffness of the spring, N m/rad or N/m.
        rest: Position at which the spring is at rest, rad or m.
        middle: Middle of the swing of a link that turns, rad; see `continuous`.
    """

    link: int
    force: Real = 0.0
    damping: Real = 0.0
    stiffness: Real = 0.0
    rest: Real = 0.0
    middle: Real = None

    def forces(self, links: Sequence[LinkPose], rates: Sequence[Real]) -> dict[int, Real]:
        """See `Load`."""
        return {self.link: self.force + self.resistance(links, rates)[self.link]}

    def resistance(self, links: Sequence[LinkPose], rates: Sequence[Real]) -> dict[int, Real]:
        """See `Load`."""
        lost = self.damping * rates[self.link] + self.stiffness * self._stretch(links)
        return {self.link: -lost}

    def potential(self, links: Sequence[LinkPose]) -> Real:
        """See `Load`; this is the energy of the spring."""
        stretch = self._stretch(links)
        return 0.5 * (self.stiffness * (stretch * stretch))

    def _stretch(self, links: Sequence[LinkPose]) -> Real:
        if self.stiffness is ZERO:
            return ZERO
        return continuous(links[self.link].position, self.middle) - self.rest


def continuous(position: Real, middle: Real) -> Real:
    """Makes the position of a link continuous over its swing, without a jump from pi to -pi.

    Args:
        position: Direction in [-pi, pi], rad; for a sliding link, its position, m.
        middle: Middle of the link's swing, in [-pi, pi], rad; None: the link slides.

    Returns:
        The direction within pi of the middle, rad; for a sliding link, its position, m.
    """
    if middle is None:
        return position
    apart, turn = position - middle, 2 * math.pi
    return position + where(apart > math.pi, -turn, where(apart < -math.pi, turn, 0.0))


@dataclass(frozen=True)
class Friction(AppliedLoad):
    """Dry friction: one coefficient and radius for all pins, and one coefficient for the guide.

    A pin resists the relative rotation of its two links with a torque, coefficient x radius x
    force. The guide resists sliding with a force, coefficient x normal force. Both are 0 at rest.

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

    def in_joints(self, mechanism: Any) -> 'DryFriction | None':
        """See `AppliedLoad`.

        Raises:
            ConfigurationError: Friction in a guide is given for a mechanism without a guide.
        """
        if self.guide and not any(link.slides for link in mechanism.structure().links):
            raise ConfigurationError(
                f'friction.guide = {self.guide:g}: this mechanism has no guide; leave it out'
            )
        friction = DryFriction(self.pin * self.pin_radius, self.guide)
        return friction if any(friction) else None


class DryFriction(NamedTuple):
    """Dry friction as formulas use it.

    Attributes:
        arm: Coefficient times radius of the pins, m; ZERO: the pins have no friction.
        guide: Coefficient of the guide; ZERO: the guide has no friction.
    """

    arm: Real
    guide: Real

    def contacts(
        self, pins: Sequence[Any], links: Sequence[Any], rates: Sequence[Real]
    ) -> list[Contact]:
        """See `JointLoad`; the contacts are the joints with friction, pins first."""
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
