# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Loads of a mechanism: what a load is, the loads of the output link, and dry friction.

A load gives wrenches on bodies, from which torque, joint forces, arrows and exports follow; see
`wrenches`. In formulas, loads are named tuples of floats, in which ZERO replaces absent terms.
"""

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, NamedTuple, Protocol

from linkage_ros.errors import ConfigurationError
from linkage_ros.formulas import ZERO, where
from linkage_ros.mechanism.kinematics import LinkPose
from linkage_ros.mechanism.wrenches import Wrench
from linkage_ros.numeric import Real
from linkage_ros.quantities import Checked, quantity, shown, unlisted

_POSITIVE = (0.0, 1e12)


class Load(Protocol):
    """Interface of a load: wrenches on bodies, computed from their motion.

    Two methods are optional. `potential(links)` returns the potential energy up to a constant, J.
    `piece(links, rates)` returns the number of the smooth piece of the force, for arrays; between
    two pieces, the force has a corner or a jump.
    """

    def wrenches(self, links: Sequence[LinkPose], rates: Sequence[Real]) -> list[Wrench]:
        """Computes the wrenches.

        Args:
            links: Poses of the links; only `position` and `direction` are set.
            rates: Velocities of the links, rad/s or m/s.

        Returns:
            The wrenches, in an order independent of the motion.
        """


class Contact(NamedTuple):
    """A load caused by the force in a joint.

    Attributes:
        joint: Name of the pin or, for a guide, of its sliding link.
        levers: Load divided by joint force, by link index: m, or dimensionless for a sliding
            link. With two links, the load acts between them; with one, between that link and the
            frame.
    """

    joint: str
    levers: dict[int, Real]


class JointLoad(Protocol):
    """Interface of a load caused by joint forces, such as friction.

    These loads and the joint forces depend on each other and are solved together. The method
    `piece(pins, links, rates)` is optional; see `Load`.
    """

    def contacts(
        self, pins: Sequence[Any], links: Sequence[Any], rates: Sequence[Real]
    ) -> list[Contact]:
        """Returns the loads per joint force.

        Args:
            pins: `Structure.pins` of the mechanism.
            links: `Structure.links` of the mechanism.
            rates: Velocities of the links, rad/s or m/s.

        Returns:
            A contact for each joint that causes a load, in an order independent of the rates.
        """


@dataclass(frozen=True, kw_only=True)
class AppliedLoad(Checked):
    """Base class of the loads of a mechanism: frozen dataclasses of quantities.

    `linkage_ros.mechanism.parts.LOADS` lists the kinds in parameter files.

    Attributes:
        group: Parameter group of a load that a mechanism has once; empty for other loads.
        has_corners: Whether the force, as a function of the motion, may have a corner or a jump.
        turns: Number of crank turns after which the load repeats.
        name: Name under `loads` in parameter files. The mechanism gives a name to a load that has
            neither a name nor a free group.
    """

    group: ClassVar[str] = ''
    has_corners: ClassVar[bool] = False
    turns: ClassVar[int] = 1

    name: str = unlisted('')

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.name and not re.fullmatch('[A-Za-z_][A-Za-z0-9_]*', self.name):
            raise ConfigurationError(
                f'load {shown(self.name)}: its name must be letters, digits and underscores, and '
                'not begin with a digit'
            )

    @property
    def label(self) -> str:
        """Start of the load's parameter names, without a dot, for error messages."""
        return f'loads.{self.name}' if self.name else self.group or type(self).__name__

    def join(self, _mechanism: Any) -> 'tuple[AppliedLoad, ...]':
        """Adds the load to a mechanism that is being created.

        Returns:
            The loads to keep in `Mechanism.loads`: this load, or another if the mechanism
            completes it, or none if a part of the mechanism now holds its values.

        Raises:
            ConfigurationError: The load does not fit the mechanism.
        """
        return (self,)

    def on(self, _mechanism: Any) -> Load | None:
        """Returns the load in the form used by formulas; None if joint forces cause all of it.

        Raises:
            ConfigurationError: The load does not fit the mechanism.
        """
        return None

    def in_joints(self, _mechanism: Any) -> JointLoad | None:
        """Returns the portion of the load caused by joint forces; None if there is none.

        Raises:
            ConfigurationError: The load does not fit the mechanism.
        """
        return None


@dataclass(frozen=True)
class LinkLoad(AppliedLoad):
    """A load on the output link; the mechanism moves its values into that link.

    `FourBar(..., loads=(LinkLoad('rocker', -5.0),))` applies a torque of -5 N m to the rocker.

    Attributes:
        link: Loaded link: 'rocker', 'slider', or the rod of a cylinder.
        force: Torque, N m, positive counter-clockwise; on a slider, force along the guide, N.
        damping: Damping coefficient, N m s or N s/m.
        stiffness: Stiffness of a spring to the frame, N m/rad or N/m.
        rest: Position at which the spring exerts no force, rad or m.
    """

    link: str = quantity(
        'choice', 'link that the load acts on', choices=('rocker', 'slider', 'rod')
    )
    force: float = quantity(
        'number', 'force or torque', 'N or N m', span=(-1e12, 1e12), default=0.0
    )
    damping: float = quantity('number', 'resistance per rate', span=_POSITIVE, default=0.0)
    stiffness: float = quantity('number', 'stiffness of a spring', span=_POSITIVE, default=0.0)
    rest: float = quantity('number', 'rest position', 'rad or m', span=(-1e9, 1e9), default=0.0)

    def join(self, mechanism: Any) -> tuple[()]:
        """Moves the load's values into the link; see `AppliedLoad.join`.

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
    """The load on one link: a force or torque, viscous damping, and a spring to the frame.

    Attributes:
        link: Index of the loaded link.
        force: Torque, N m, positive counter-clockwise, or force along the guide, N.
        damping: Damping coefficient, N m s or N s/m.
        stiffness: Stiffness of the spring, N m/rad or N/m.
        rest: Position at which the spring exerts no force, rad or m.
        middle: Middle of the link's swing, rad; None for a sliding link, or for a link that turns
            fully. See `continuous`.
        turns: Whether the link turns fully, so that the constant torque has no potential.
    """

    link: int
    force: Real = 0.0
    damping: Real = 0.0
    stiffness: Real = 0.0
    rest: Real = 0.0
    middle: Real = None
    turns: bool = False

    def wrenches(self, links: Sequence[LinkPose], rates: Sequence[Real]) -> list[Wrench]:
        """See `Load`; the frame exerts the force of damper and spring."""
        held = -(self.damping * rates[self.link] + self.stiffness * self._stretch(links))
        return [Wrench(self.link, self.force + held, held)]

    def potential(self, links: Sequence[LinkPose]) -> Real:
        """Returns the energy of the spring and of the constant force, J; see `Load`."""
        stretch = self._stretch(links)
        spring = 0.5 * (self.stiffness * (stretch * stretch))
        if self.turns:
            return spring
        return spring - self.force * continuous(links[self.link].position, self.middle)

    def _stretch(self, links: Sequence[LinkPose]) -> Real:
        if self.stiffness is ZERO:
            return ZERO
        return continuous(links[self.link].position, self.middle) - self.rest


def continuous(position: Real, middle: Real) -> Real:
    """Removes the jump from pi to -pi from the position of a link over its swing.

    Args:
        position: Direction in [-pi, pi], rad; for a sliding link, its position, m.
        middle: Middle of the link's swing, rad in [-pi, pi]; None for a sliding link.

    Returns:
        The direction within pi of the middle, rad; for a sliding link, its unchanged position, m.
    """
    if middle is None:
        return position
    apart, turn = position - middle, 2 * math.pi
    return position + where(apart > math.pi, -turn, where(apart < -math.pi, turn, 0.0))


@dataclass(frozen=True)
class Friction(AppliedLoad):
    """Dry friction: one coefficient and radius for all pins, and one coefficient for the guide.

    The friction torque in a pin is coefficient x radius x pin force. It opposes the relative
    rotation of the two links. The friction force in the guide is coefficient x normal force. It
    opposes sliding. Both are 0 at rest.

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
        """See `AppliedLoad.in_joints`.

        Raises:
            ConfigurationError: The mechanism has no guide, but guide friction is given.
        """
        if self.guide and not any(link.slides for link in mechanism.structure().links):
            raise ConfigurationError(
                f'friction.guide = {self.guide:g}: this mechanism has no guide; leave it out'
            )
        friction = DryFriction(self.pin * self.pin_radius, self.guide)
        return friction if any(friction) else None


class DryFriction(NamedTuple):
    """Dry friction, in the form used by formulas.

    Attributes:
        arm: Friction coefficient times radius of the pins, m; ZERO for frictionless pins.
        guide: Friction coefficient of the guide; ZERO for a frictionless guide.
    """

    arm: Real
    guide: Real

    def contacts(
        self, pins: Sequence[Any], links: Sequence[Any], rates: Sequence[Real]
    ) -> list[Contact]:
        """Returns the contacts of the joints with friction, pins first; see `JointLoad`."""
        contacts = []
        for joint, first, others, rate in self._rubbing(pins, links, rates):
            lever = (self.guide if joint == links[first].name else self.arm) * _sign(rate)
            levers = {first: -lever, **dict.fromkeys(others, lever)}
            contacts.append(Contact(joint, levers))
        return contacts

    def piece(self, pins: Sequence[Any], links: Sequence[Any], rates: Sequence[Real]) -> Real:
        """Returns a number for each combination of directions in the joints; see `Load`."""
        joints = self._rubbing(pins, links, rates)
        return sum((rate >= 0) * 2**i for i, (*_, rate) in enumerate(joints))

    def _rubbing(
        self, pins: Sequence[Any], links: Sequence[Any], rates: Sequence[Real]
    ) -> Iterator[tuple[str, int, list[int], Real]]:
        """Yields each joint with friction: its name, link, other link if it moves, and rate."""
        for pin in pins if self.arm is not ZERO else ():
            moving = [j for j in (pin.second, pin.first) if j is not None]
            # A guided link does not turn.
            first, *others = sorted(moving, key=lambda j: links[j].is_guided)
            spins = [links[j].spin(j) for j in (first, *others)]
            rate, *other = (ZERO if j is None else rates[j] for j in spins)
            yield pin.name, first, others, rate - (other[0] if other else ZERO)
        for j, link in enumerate(links):
            if link.slides and self.guide is not ZERO:
                yield link.name, j, [], rates[j]


def _sign(rate: Real) -> Real:
    return where(rate > 0, 1.0, where(rate < 0, -1.0, 0.0))
