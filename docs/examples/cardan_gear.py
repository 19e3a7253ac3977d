# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The Cardan gear: a pinion on the crank rolls in a fixed ring of twice its size.

It turns back as fast as the crank turns, and a pin on its rim runs along a diameter, the guide of
direction delta: beta = 2 delta - alpha, and the slider is at x = 2 r cos(alpha - delta).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import ClassVar

from linkage_ros.errors import MechanismError
from linkage_ros.mechanisms.links import Links
from linkage_ros.mechanisms.parts import Body, Coupler, Guide, Slider, gravity_quantity
from linkage_ros.mechanisms.structure import Joint, Point, SlidingBody, Structure, TurningBody
from linkage_ros.mechanisms.transmission import TransmissionMap
from linkage_ros.numeric import HALF_PI, Functions, Real, two_sum
from linkage_ros.quantities import Checked, quantity


@dataclass(frozen=True)
class CardanGear(Checked):
    """Crank A0-A, coupler A-B on the pinion and as long as the crank, slider at B."""

    crank: Body
    coupler: Coupler
    slider: Slider = field(default_factory=Slider)
    frame: Guide = field(default_factory=Guide)
    assembly: str = quantity(
        'choice', 'side of the crank pin on which the slider is', choices=('open',), default='open'
    )
    gravity: tuple[float, float] = gravity_quantity()
    grashof: ClassVar[str] = 'crank-slider'
    sums: ClassVar[dict[str, tuple[float, ...]]] = {}  # whose vanishing were a change point

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.coupler.length != self.crank.length or self.slider.offset:
            raise MechanismError('coupler.length must be crank.length, and slider.offset 0')

    @property
    def longest(self) -> float:
        """The longest link, m."""
        return self.crank.length

    def limits(self, **_: bool) -> tuple[str, ...]:
        """What stops the crank, and what would free it: nothing."""
        return ()

    cures = limits


class CardanGearKinematics:
    """The constants of one Cardan gear, and its position at a crank angle."""

    side = 1.0

    def __init__(self, mechanism: CardanGear) -> None:
        self.structure = structure(mechanism)
        self._radius, self._angle = mechanism.crank.length, mechanism.frame.angle
        self._guide = math.cos(self._angle), math.sin(self._angle)
        # The angle between the coupler and the guide's normal grows as the crank's.
        high, low = two_sum(self._angle, -HALF_PI[0])
        self.map = TransmissionMap((high, low - HALF_PI[1]), 1.0, p=0.0, q=0.0, far=1.0, near=1.0)

    def locate(self, crank: Real, functions: Functions) -> tuple[Real, Real]:
        """The position alone, to the bits of `solve`."""
        (_, coupler, place), *_ = self.solve(crank, functions)
        return coupler, place

    def solve(self, crank: Real, functions: Functions) -> Links:
        """The position and its derivatives."""
        angle, error = two_sum(crank, -self._angle)
        sin, cos = functions.sin(angle), functions.cos(angle)
        # Near a quarter turn the rounding of the difference is as large as the cosine's digits.
        sin, cos = sin + error * cos, cos - error * sin
        (gx, gy), x, y = self._guide, 2 * self._radius * cos, 2 * self._radius * sin
        bx, by = gx * cos + gy * sin, gy * cos - gx * sin
        return (
            (crank, functions.atan2(by, bx), x),
            (gx * cos - gy * sin, bx, gx),
            (gx * sin + gy * cos, by, gy),
            ((1.0, -1.0, -y),),
            ((0.0, 0.0, -x),),
        )


def structure(mechanism: CardanGear) -> Structure:
    """How the links hang together: the loop is cut at B."""
    crank, coupler, slider = mechanism.crank, mechanism.coupler, mechanism.slider
    r = complex(crank.length)
    points = {'A0': Point((0j, 0j, 0j)), 'A': Point((r, 0j, 0j)), 'B': Point((r, r, 0j))}
    if coupler.point is not None:
        points['C'] = Point((r, complex(*coupler.point), 0j))
    centers = Point((complex(*crank.center), 0j, 0j)), Point((r, complex(*coupler.center), 0j))
    guided = Joint('slider', 2, None, 0j, mechanism.frame.angle, slides=True)
    return Structure(
        (Joint('crank', 0, None, 0j), Joint('coupler', 1, 0, r), guided),
        points,
        (
            TurningBody(0, crank.mass, crank.inertia, centers[0]),
            TurningBody(1, coupler.mass, coupler.inertia, centers[1]),
        ),
        points['B'],
        SlidingBody(2, slider.mass, slider.force, slider.damping),
    )
