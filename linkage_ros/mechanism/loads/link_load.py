# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Load on one link: a constant force or torque, viscous damping, and a spring."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from linkage_ros.errors import ConfigurationError
from linkage_ros.formulas import ZERO
from linkage_ros.mechanism.kinematics import LinkPose
from linkage_ros.mechanism.loads.base import AppliedLoad, LoadedMechanism, continuous
from linkage_ros.mechanism.wrenches import Wrench
from linkage_ros.numeric import Real
from linkage_ros.quantities import quantity, refuse_angles

_NOT_NEGATIVE = (0.0, 1e12)


@dataclass(frozen=True)
class LinkLoad(AppliedLoad):
    """A constant force or torque, viscous damping, and a spring between a link and the frame.

    Attributes:
        link: Loaded link: 'crank', 'rocker', 'slider', the rod of a cylinder, or a dyad's
            slider or rod.
        force: Torque, N m, positive counter-clockwise; on a slider, force along the guide, N.
        damping: Damping coefficient, N m s or N s/m.
        stiffness: Stiffness of the spring, N m/rad or N/m; not on a link that turns fully.
        rest: Position at which the spring exerts no force, rad or m.
    """

    link: str = quantity(
        'text', 'link that the load acts on: the crank, the output link, or a slider'
    )
    force: float = quantity(
        'number', 'force or torque', 'N or N m', span=(-1e12, 1e12), default=0.0
    )
    damping: float = quantity(
        'number', 'resistance per rate', 'N s/m or N m s', span=_NOT_NEGATIVE, default=0.0
    )
    stiffness: float = quantity(
        'number', 'stiffness of a spring to the frame', 'N/m or N m/rad', span=_NOT_NEGATIVE,
        default=0.0,
    )  # fmt: skip
    rest: float = quantity(
        'number', 'position at which the spring is at rest', 'rad or m', span=(-1e9, 1e9),
        default=0.0,
    )  # fmt: skip

    def on(self, mechanism: LoadedMechanism) -> 'LinkForce | None':
        """See `AppliedLoad.on`.

        Raises:
            ConfigurationError: The mechanism has no such link, the link with the spring turns
                fully, or slides and `rest` is in degrees.
        """
        link = mechanism.loaded_link(self.link, f'{self.label}.link')
        slides, rest = mechanism.structure().links[link].slides, float(self.rest)
        if slides:
            refuse_angles(f'{self.label}.rest', self.rest, f'the {self.link}')
        if not (self.force or self.damping or self.stiffness):
            return None
        values = self.force, self.damping, self.stiffness
        if slides:
            return LinkForce(link, *values, rest)
        if link == 0:
            if self.stiffness:
                raise ConfigurationError(
                    f'{self.label}.stiffness = {self.stiffness:g}: the swing of a crank has no '
                    'middle; use a load of kind spring between two points'
                )
            return LinkForce(link, *values, may_turn_fully=True)
        side = mechanism.swing_side()
        if not self.stiffness:
            return LinkForce(link, *values, rest, side, may_turn_fully=side is None)
        middle = mechanism.swing_middle(f'{self.label}.stiffness', rest)
        if middle is None:
            raise ConfigurationError(
                f'{self.label}.stiffness: the swing of the {self.link} is unknown; use a load of '
                'kind spring between two points'
            )
        turns = round((rest - middle) / (2 * math.pi))
        rest_near_middle = rest - turns * 2 * math.pi
        return LinkForce(link, *values, rest_near_middle, middle, may_turn_fully=side is None)


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
        may_turn_fully: Whether the link may turn fully, so that a constant torque on it has no
            potential.
    """

    link: int
    force: Real = 0.0
    damping: Real = 0.0
    stiffness: Real = 0.0
    rest: Real = 0.0
    middle: Real = None
    may_turn_fully: bool = False

    def wrenches(self, links: Sequence[LinkPose], rates: Sequence[Real]) -> list[Wrench]:
        """See `Load`; the frame exerts the force of damper and spring."""
        by_frame = -(self.damping * rates[self.link] + self.stiffness * self._stretch(links))
        return [Wrench(self.link, self.force + by_frame, by_frame)]

    def potential(self, links: Sequence[LinkPose]) -> Real:
        """Returns the energy of the spring and of the constant force, J; see `Load`."""
        stretch = self._stretch(links)
        spring = 0.5 * (self.stiffness * (stretch * stretch))
        if self.may_turn_fully:
            return spring
        return spring - self.force * continuous(links[self.link].position, self.middle)

    def _stretch(self, links: Sequence[LinkPose]) -> Real:
        if self.stiffness is ZERO:
            return ZERO
        return continuous(links[self.link].position, self.middle) - self.rest
