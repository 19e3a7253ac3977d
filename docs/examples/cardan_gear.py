# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Defines a mechanism of your own: a Cardan gear.

A pinion on the crank rolls inside a fixed ring of twice its diameter. It rotates backwards at the
crank's speed, so that a pin on its rim moves along a diameter of the ring, the guide of direction
delta:

    beta = 2 delta - alpha        x = 2 r cos(alpha - delta)

Importing this file registers `mechanism: cardan_gear` in every program of the package.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

from linkage_ros import (
    OPEN,
    Body,
    Dyad,
    Guide,
    Mechanism,
    MechanismError,
    Reach,
    Slider,
    TracedPoint,
)
from linkage_ros.extensions import (
    MECHANISMS,
    AppliedLoad,
    Link,
    LinkPose,
    Point,
    Pose,
    Structure,
    dyads_field,
    gravity_quantity,
    loads_field,
    points_field,
    two_sum,
)
from linkage_ros.formulas import ZERO, Real, Vector, atan2, cos, sin
from linkage_ros.quantities import quantity


class CardanLoop(NamedTuple):
    """Constants of the kinematics.

    Attributes:
        radius: Length r of crank and coupler, m.
        angle: Direction delta of the guide, rad.
        guide: Unit vector of the guide.
    """

    radius: float
    angle: float
    guide: Vector

    def pose(self, q: tuple[Real, ...]) -> Pose:
        """Computes the link positions at a crank angle, with their first two derivatives."""
        (crank,) = q
        angle, error = two_sum(crank, -self.angle)
        sine, cosine = sin(angle), cos(angle)
        # Near a quarter turn, the cosine is as small as the rounding error of `angle`.
        sine, cosine = sine + error * cosine, cosine - error * sine
        x, y = 2 * self.radius * cosine, 2 * self.radius * sine
        along, across = self.guide * cosine, self.guide.left() * sine
        forth, back = along + across, along - across
        return Pose(
            (
                LinkPose(crank, forth, (1.0,), (ZERO,)),
                LinkPose(atan2(back.y, back.x), back, (-1.0,), (ZERO,)),
                LinkPose(x, self.guide, (-y,), (-x,)),
            ),
            (),
        )


@dataclass(frozen=True, repr=False)
class CardanGear(Mechanism):
    """Crank A0-A; coupler A-B, fixed to the pinion and as long as the crank; slider at B.

    Attributes:
        crank: Driven link, from the origin A0 to A.
        coupler: Link from the crank pin A to B, which includes the pinion.
        slider: Slider at B; its position is measured along the guide from A0.
        frame: Direction of the guide.
        assembly: Assembly; there is only one.
        gravity: Acceleration of gravity [x, y], m/s^2.
        loads: Loads of the kinds that every mechanism accepts.
        dyads: Dyads that the gear carries.
        points: Traced points of its links.
    """

    crank: Body
    coupler: Body
    slider: Slider = field(default_factory=Slider)
    frame: Guide = field(default_factory=Guide)
    assembly: str = quantity('choice', 'the only assembly', choices=(OPEN,), default=OPEN)
    gravity: tuple[float, float] = gravity_quantity()
    loads: tuple[AppliedLoad, ...] = loads_field()
    dyads: tuple[Dyad, ...] = dyads_field()
    points: tuple[TracedPoint, ...] = points_field()

    def __post_init__(self) -> None:
        super().__post_init__()
        r, b, e = self.crank.length, self.coupler.length, self.slider.offset
        if b != r or e:
            raise MechanismError(
                f'coupler.length = {b:g} and slider.offset = {e:g}: in a Cardan gear they must be '
                f'crank.length = {r:g} and 0'
            )

    def loop(self) -> CardanLoop:
        """Returns the constants of the kinematics."""
        angle = self.frame.angle
        return CardanLoop(self.crank.length, angle, Vector(math.cos(angle), math.sin(angle)))

    def reach(self) -> Reach:
        """Returns the reach: the crank turns fully, and no crank angle has a fast motion."""
        return Reach('crank-slider')

    def loop_structure(self) -> Structure:
        """Returns the open tree of links; the loop is cut at B."""
        crank, coupler, slider = self.crank, self.coupler, self.slider
        A0 = Point.at(0j, 3)
        A = A0.along(0, crank.length)
        B = A.along(1, coupler.length)
        return Structure(
            (
                Link.turning('crank', crank, 0, A0),
                Link.turning('coupler', coupler, 1, A),
                Link('slider', slider.mass, 0.0, B, angle=self.frame.angle, slides=True),
            ),
            {'A0': A0, 'A': A, 'B': B},
            # There are no pins: the sharing of forces between the teeth of ring and pinion is not
            # modelled, so joint forces are refused.
            closure=B,
        )


MECHANISMS['cardan_gear'] = CardanGear
