# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Exact kinematics of the wind pump: two coordinates, the crank angle and the slider's position.

The loop is document 3's, l1 e^(i phi1) + l2 e^(i phi2) + l3 e^(i phi3) = xD. Given the crank pin A
and the slider's pin D, coupler and rod are one two-link dyad. With L = |D - A| and, for xD >= 0,
h = phi1 / 2 (for xD < 0, h = (phi1 - pi) / 2 and |xD|), it closes as the factored closed form of
the four-bar does (docs/mechanisms.md):

    P = (l2+l3)^2 - L^2 = (l2+l3-xD-l1)(l2+l3+xD+l1) + 4 l1 xD cos^2 h
    Q = L^2 - (l2-l3)^2 = (xD-l1-l2+l3)(xD-l1+l2-l3) + 4 l1 xD sin^2 h
    B - A = (D-A) [(l2-l3)(l2+l3) + L^2 + i side sqrt(PQ)] / (2 L^2)

and sin(phi2 - phi3) = side sqrt(PQ) / (2 l2 l3): no digits are lost next to a stretched dyad.
The rates have document 3's form, phi2' = a11 phi1' + a12 xD' (its coefficients are damaged in
print); the squared-rate terms of the accelerations, which it lacks, follow by differentiating the
loop twice.
"""

from __future__ import annotations

import math
from typing import NoReturn

import numpy as np

from linkage_ros.errors import UnreachableError
from linkage_ros.mechanisms.links import Links, PerCoordinate
from linkage_ros.mechanisms.parts import OPEN
from linkage_ros.mechanisms.structure import Joint, Point, SlidingBody, Structure, TurningBody
from linkage_ros.mechanisms.wind_pump import WindPump
from linkage_ros.numeric import SCALAR, Functions, Real

_EPSILON = 2.0**-52


class WindPumpKinematics:
    """The constants of one wind pump, and its position at a crank angle and a slider's place.

    Attributes:
        structure: How the links hang together.
        has_edge: True: coupler and rod may become one line, where the motion goes on in another
            assembly.
    """

    def __init__(self, mechanism: WindPump) -> None:
        self.structure, self.has_edge = structure(mechanism), True
        self._lengths = mechanism.crank.length, mechanism.coupler.length, mechanism.rod.length
        self._side = 1.0 if mechanism.assembly == OPEN else -1.0

    def margins(self, crank: Real, slide: Real, functions: Functions) -> tuple[Real, Real, Real]:
        """How far the dyad is from its limits.

        Args:
            crank: Crank angle, rad; float or array.
            slide: The slider's position, m; likewise.
            functions: SCALAR or ARRAY.

        Returns:
            P, 0 where coupler and rod are stretched or do not reach; Q, 0 where they are folded
            or do not fit in; L^2; all m^2. P and Q count as 0 within the rounding of their terms.
        """
        r, b, c = self._lengths
        half = 0.5 * crank
        sin, cos = functions.sin(half), functions.cos(half)
        ahead, where = slide >= 0, functions.where
        d = abs(slide)
        growth = 4 * r * d
        near = growth * where(ahead, sin * sin, cos * cos)
        far = growth * where(ahead, cos * cos, sin * sin)
        total = b + c + d + r
        one, other = d - r - b + c, d - r + b - c
        stretch, fold = (b + c - d - r) * total + far, one * other + near
        # A sum of lengths is off by about an ulp of their total. Where the short sums are small,
        # so is the rounding of their product: a slider that passes the crank pin is not refused.
        ulp = _EPSILON * total
        return (
            where(stretch > ulp * total, stretch, 0.0),
            where(fold > ulp * (abs(one) + abs(other)) + _EPSILON * near, fold, 0.0),
            (d - r) * (d - r) + near,
        )

    def links(self, q: PerCoordinate, functions: Functions) -> Links:
        """The position and its derivatives.

        Args:
            q: Crank angle, rad, and the slider's position, m; floats or arrays.
            functions: SCALAR or ARRAY.

        Returns:
            The links; rates and curvatures per crank speed and slider velocity.

        Raises:
            UnreachableError: Coupler and rod do not reach there, or are in one line.
        """
        (crank, slide), (r, b, c) = q, self._lengths
        stretch, fold, square = self.margins(crank, slide, functions)
        if not (functions.lowest(stretch) > 0 and functions.lowest(fold) > 0):
            self._refuse(crank, slide, stretch, fold)
        root = self._side * (functions.sqrt(stretch) * functions.sqrt(fold))
        c1, s1 = functions.cos(crank), functions.sin(crank)
        # D - A, and the coupler's and the rod's shares of it.
        ux, uy = slide - r * c1, -r * s1
        moment, scale = (b - c) * (b + c), 0.5 / square
        part = scale * (square + moment) / b
        rest = scale * (square - moment) / c
        turn_b, turn_c = scale * root / b, scale * root / c
        c2, s2 = ux * part - uy * turn_b, ux * turn_b + uy * part
        c3, s3 = ux * rest + uy * turn_c, uy * rest - ux * turn_c
        # 1 / [l2 sin(phi2 - phi3)] and 1 / [l3 sin(phi2 - phi3)]; the cosines between links.
        over_b, over_c = 2 * c / root, 2 * b / root
        cos12, cos13, cos23 = c1 * c2 + s1 * s2, c1 * c3 + s1 * s3, c2 * c3 + s2 * s3
        a11, a12 = r * (s3 * c1 - c3 * s1) * over_b, -c3 * over_b
        a21, a22 = r * (s1 * c2 - c1 * s2) * over_c, c2 * over_c
        pairs = (a11 * a11, a21 * a21), (2 * a11 * a12, 2 * a21 * a22), (a12 * a12, a22 * a22)
        arms = (r * cos13, r * cos12), (0.0, 0.0), (0.0, 0.0)
        return (
            (crank, functions.atan2(s2, c2), functions.atan2(s3, c3), slide),
            (c1, c2, c3),
            (s1, s2, s3),
            ((1.0, a11, a21), (0.0, a12, a22)),
            tuple(
                (
                    0.0,
                    -over_b * (arm2 + b * cos23 * two + c * three),
                    over_c * (arm3 + b * two + c * cos23 * three),
                )
                for (arm2, arm3), (two, three) in zip(arms, pairs, strict=True)
            ),
        )

    def dyad(self, q: PerCoordinate) -> tuple[float, str]:
        """How near coupler and rod are to one line.

        Args:
            q: Crank angle, rad, and the slider's position, m; floats.

        Returns:
            The sine of the angle at which they meet, and whether they are nearer to being
            stretched or folded, in words.
        """
        (crank, slide), (_, b, c) = q, self._lengths
        stretch, fold, _ = self.margins(crank, slide, SCALAR)
        sine = math.sqrt(max(stretch, 0.0)) * math.sqrt(max(fold, 0.0)) / (2 * b * c)
        return sine, f'coupler and rod are {"stretched" if stretch < fold else "folded"}'

    def _refuse(self, crank: Real, slide: Real, stretch: Real, fold: Real) -> NoReturn:
        lowest = np.minimum(stretch, fold)
        worst = int(np.argmax(~(lowest > 0)))
        angle, place, far = (
            float(np.broadcast_to(value, lowest.shape).flat[worst])
            for value in (crank, slide, stretch)
        )
        words = 'do not reach or are stretched' if not far > 0 else 'do not fit in or are folded'
        raise UnreachableError(
            f'coupler and rod {words} at crank angle {math.degrees(angle):.9g} deg and slider '
            f'position {place:.9g} m; {self._reach(angle)}',
            crank_angle=angle,
            arcs=(),
        )

    def _reach(self, crank: float) -> str:
        """Where the slider can be at a crank angle, in words.

        Args:
            crank: Crank angle, rad.

        Returns:
            Its range or ranges, m, or that there is none.
        """
        r, b, c = self._lengths
        ax, ay = r * math.cos(crank), r * math.sin(crank)
        far = (b + c) ** 2 - ay * ay
        if far <= 0:
            return 'the loop closes nowhere at this crank angle: lengthen coupler or rod'
        outer, inner = math.sqrt(far), math.sqrt(max((b - c) ** 2 - ay * ay, 0.0))
        spans = [(ax - outer, ax - inner), (ax + inner, ax + outer)]
        words = ' or '.join(f'{low:.6g} to {high:.6g}' for low, high in spans)
        return f'there the slider can be within {words} m'


def structure(mechanism: WindPump) -> Structure:
    """How the links of a wind pump hang together: the loop is cut at D.

    Args:
        mechanism: The pump.

    Returns:
        Crank and slider on the frame, the coupler on the crank, the rod on the coupler.
    """
    crank, coupler, rod = mechanism.crank, mechanism.coupler, mechanism.rod
    r, b, c = complex(crank.length), complex(coupler.length), complex(rod.length)
    points = {
        'A0': Point((0j, 0j, 0j, 0j)),
        'A': Point((r, 0j, 0j, 0j)),
        'B': Point((r, b, 0j, 0j)),
        'D': Point((r, b, c, 0j)),
    }
    if coupler.point is not None:
        points['C'] = Point((r, complex(*coupler.point), 0j, 0j))
    centers = (
        Point((complex(*crank.center), 0j, 0j, 0j)),
        Point((r, complex(*coupler.center), 0j, 0j)),
        Point((r, b, complex(*rod.center), 0j)),
    )
    slider = mechanism.slider
    return Structure(
        (
            Joint('crank', 0, None, 0j),
            Joint('coupler', 1, 0, r),
            Joint('rod', 2, 1, b),
            Joint('slider', 3, None, 0j, slides=True),
        ),
        points,
        tuple(
            TurningBody(link, body.mass, body.inertia, center)
            for link, (body, center) in enumerate(zip((crank, coupler, rod), centers, strict=True))
        ),
        points['D'],
        SlidingBody(3, slider.mass, 0.0, slider.damping, (slider.position, slider.velocity)),
    )
