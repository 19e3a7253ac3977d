# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A force or torque, a resistance and a spring on the output link."""

from __future__ import annotations

from dataclasses import dataclass

from linkage_ros.model.loads import AppliedLoad
from linkage_ros.model.structure import Mechanism
from linkage_ros.quantities import quantity

_POSITIVE = (0.0, 1e12)


@dataclass(frozen=True)
class LinkLoad(AppliedLoad):
    """What the output link works against: the mechanism takes it into the link's own values.

    `FourBar(..., loads=(LinkLoad('rocker', -5.0),))` is a four-bar whose rocker has torque -5 N m.

    Attributes:
        link: 'rocker' or 'slider'.
        force: On the link: torque, counter-clockwise positive, N m; of a slider force, N.
        damping: Resistance per rate of the link, N m s or N s/m.
        stiffness: Of a spring to the frame, N m/rad or N/m.
        rest: Position at which the spring is at rest, rad or m.
    """

    link: str = quantity('choice', 'link that it acts on', choices=('rocker', 'slider'))
    force: float = quantity(
        'number', 'force or torque', 'N or N m', span=(-1e12, 1e12), default=0.0
    )
    damping: float = quantity('number', 'resistance per rate', span=_POSITIVE, default=0.0)
    stiffness: float = quantity('number', 'of a spring', span=_POSITIVE, default=0.0)
    rest: float = quantity('number', 'rest position', 'rad or m', span=(-1e9, 1e9), default=0.0)

    def join(self, mechanism: Mechanism) -> tuple[()]:
        """See `AppliedLoad`: the link takes it into its own values."""
        mechanism.take_in(self.link, self.force, self.damping, self.stiffness, self.rest)
        return ()
