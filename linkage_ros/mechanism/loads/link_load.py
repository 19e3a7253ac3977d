# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Load on the output link: a constant force or torque, viscous damping, and a spring."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from linkage_ros.errors import ConfigurationError
from linkage_ros.formulas import ZERO
from linkage_ros.mechanism.kinematics import LinkPose
from linkage_ros.mechanism.loads.base import AppliedLoad, continuous
from linkage_ros.mechanism.wrenches import Wrench
from linkage_ros.numeric import Real
from linkage_ros.quantities import quantity

_NOT_NEGATIVE = (0.0, 1e12)


@dataclass(frozen=True)
class LinkLoad(AppliedLoad):
    """Shorthand for the load on the output link; the mechanism moves it into that link's part.

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
    damping: float = quantity('number', 'resistance per rate', span=_NOT_NEGATIVE, default=0.0)
    stiffness: float = quantity('number', 'stiffness of a spring', span=_NOT_NEGATIVE, default=0.0)
    rest: float = quantity('number', 'rest position', 'rad or m', span=(-1e9, 1e9), default=0.0)

    def added_to(self, mechanism: Any) -> Any:
        """Returns the part of the loaded link with the values of this load.

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
        return replace(part, **dict(zip(part.load_fields, values, strict=True)))


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
