# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Exact kinematics of the slider-crank, with an offset, along a guide in any direction.

The loop is document 4's (eq. 2, where e = 0), with an offset e and in the guide's axes:

    r e^(i alpha) + b e^(i beta) = x + i e

Let mu be the transmission angle, which the coupler makes with the normal of the guide. From the
imaginary parts, cos mu = sin beta = (e - r sin alpha) / b: with theta = alpha + pi/2 this is the
map that a four-bar has too (`transmission`),

    cos^2(mu/2) = (b+e-r)/2b + (r/b) cos^2(theta/2)
    sin^2(mu/2) = (b-e-r)/2b + (r/b) sin^2(theta/2)

and beta = pi/2 -+ mu, x = r cos alpha + b cos beta follow without any division.
"""

from __future__ import annotations

import cmath
import math

from linkage_ros.mechanisms.links import Links
from linkage_ros.mechanisms.parts import OPEN
from linkage_ros.mechanisms.slider_crank import SliderCrank
from linkage_ros.mechanisms.structure import Joint, Point, SlidingBody, Structure, TurningBody
from linkage_ros.mechanisms.transmission import TransmissionMap
from linkage_ros.numeric import HALF_PI, Functions, Real, nearest_turns, short_sum, two_sum


class SliderCrankKinematics:
    """The constants of one slider-crank, and its position at a crank angle.

    Attributes:
        map: From the crank to the transmission angle.
        structure: How the links hang together.
        side: 1 for the open assembly, -1 for the crossed one.
    """

    def __init__(self, mechanism: SliderCrank) -> None:
        r, b, e = mechanism.crank.length, mechanism.coupler.length, mechanism.slider.offset
        guide = mechanism.frame.angle
        far, near = (short_sum(mechanism.longest, *terms) for terms in mechanism.sums.values())
        high, low = two_sum(guide, -HALF_PI[0])
        self.structure = structure(mechanism)
        self.map = TransmissionMap(
            reference=(high, low - HALF_PI[1]),
            kappa=math.sqrt(r / b) * (-1 if nearest_turns(guide) % 2 else 1),
            p=far / (2 * b),
            q=near / (2 * b),
            far=short_sum(mechanism.longest, b, e, r) / (2 * b),
            near=short_sum(mechanism.longest, b, -e, r) / (2 * b),
        )
        gx, gy = math.cos(guide), math.sin(guide)
        self._guide, self._guide_over_r, self._over_b = (gx, gy), (gx / r, gy / r), 1 / b
        self.side = 1.0 if mechanism.assembly == OPEN else -1.0
        self._lengths, self._two_r, self._two_b = (r, b), 2 * r, 2 * self.side * b
        self._coupler = gx * self._two_b, gy * self._two_b, gx * b, gy * b

    def locate(self, crank: Real, functions: Functions) -> tuple[Real, Real]:
        """The position alone, to the bits of `solve`.

        Args:
            crank: Crank angle, rad; float or array. The loop must close there.
            functions: SCALAR or ARRAY.

        Returns:
            The coupler's direction, rad, and the slider's place, m.
        """
        S, C, sin_m, cos_m = self.map.place(crank, functions)
        # Half of sin mu, and cos mu; b e^(i beta) is the coupler.
        sine, cosine = sin_m * cos_m, (cos_m - sin_m) * (cos_m + sin_m)
        across_x, across_y, along_x, along_y = self._coupler
        x, y = across_x * sine - along_y * cosine, along_x * cosine + across_y * sine
        return functions.atan2(y, x), self._two_r * (S * C) + self._two_b * sine

    def solve(self, crank: Real, functions: Functions) -> Links:
        """The position and its derivatives.

        Args:
            crank: Crank angle, rad; float or array. The loop must close there.
            functions: SCALAR or ARRAY.

        Returns:
            The links; rates and curvatures per crank speed.
        """
        S, C, sin_m, cos_m = self.map.place(crank, functions)
        sine, cosine = sin_m * cos_m, (cos_m - sin_m) * (cos_m + sin_m)
        across_x, across_y, along_x, along_y = self._coupler
        x, y = across_x * sine - along_y * cosine, along_x * cosine + across_y * sine
        # In the guide's axes: r e^(i alpha) and b e^(i beta).
        rx, ry = self._two_r * (S * C), self._lengths[0] * ((S - C) * (S + C))
        bx, by = self._two_b * sine, self._lengths[1] * cosine
        (gx, gy), (gx_r, gy_r), over_b = self._guide, self._guide_over_r, self._over_b
        first, second = self.map.slopes(S, C, sin_m, cos_m)
        turn, bend = -self.side * first, -self.side * second
        slope = -(ry + by * turn)
        curvature = -(rx + bx * (turn * turn) + by * bend)
        return (
            (crank, functions.atan2(y, x), rx + bx),
            (gx_r * rx - gy_r * ry, over_b * x, gx),
            (gx_r * ry + gy_r * rx, over_b * y, gy),
            ((1.0, turn, slope),),
            ((0.0, bend, curvature),),
        )


def structure(mechanism: SliderCrank) -> Structure:
    """How the links of a slider-crank hang together: the loop is cut at B.

    Args:
        mechanism: The slider-crank.

    Returns:
        Crank and slider on the frame, the coupler on the crank.
    """
    crank, coupler, slider = mechanism.crank, mechanism.coupler, mechanism.slider
    foot = 1j * slider.offset * cmath.exp(1j * mechanism.frame.angle)
    r = complex(crank.length)
    points = {
        'A0': Point((0j, 0j, 0j)),
        'A': Point((r, 0j, 0j)),
        'B': Point((r, complex(coupler.length), 0j)),
    }
    if coupler.point is not None:
        points['C'] = Point((r, complex(*coupler.point), 0j))
    return Structure(
        (
            Joint('crank', 0, None, 0j),
            Joint('coupler', 1, 0, r),
            Joint('slider', 2, None, foot, mechanism.frame.angle, slides=True),
        ),
        points,
        (
            TurningBody(0, crank.mass, crank.inertia, Point((complex(*crank.center), 0j, 0j))),
            TurningBody(
                1, coupler.mass, coupler.inertia, Point((r, complex(*coupler.center), 0j))
            ),
        ),
        Point((r, complex(coupler.length), 0j)),
        SlidingBody(2, slider.mass, slider.force, slider.damping),
    )
