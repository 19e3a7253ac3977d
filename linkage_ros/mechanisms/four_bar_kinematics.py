# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Exact kinematics of the four-bar linkage.

The loop is documents 1 and 2's, r e^(i alpha) + b e^(i beta) = c e^(i gamma) + d e^(i delta)
(eq. 7 of the first, eq. 1 of the second); its solution here is this project's. Both halves of
the quadrilateral, cut by the diagonal B0 - A of length L, are triangles of the same form:

    d - r e^(i theta) = e^(i theta/2) [(d-r) cos(theta/2) - i (d+r) sin(theta/2)]
    b - c e^(i mu)    = e^(i mu/2)    [(b-c) cos(mu/2)    - i (b+c) sin(mu/2)]

with theta = alpha - delta and the signed transmission angle mu = gamma - beta, and their
quotient is e^(i (beta - delta)). Differentiated, with nu = [(d-r)(d+r) - (b-c)(b+c) mu'] / L^2:

    beta' = (1 - nu - mu') / 2        gamma' = (1 - nu + mu') / 2
"""

from __future__ import annotations

import cmath
import math

from linkage_ros.mechanisms.four_bar import FourBar
from linkage_ros.mechanisms.links import Links
from linkage_ros.mechanisms.parts import OPEN
from linkage_ros.mechanisms.structure import Joint, Point, Structure, TurningBody
from linkage_ros.mechanisms.transmission import TransmissionMap
from linkage_ros.numeric import Functions, Real, nearest_turns, short_sum

# Where |d - r| is below this part of d + r, the rates need the careful form: the plain one has an
# error of about an ulp over the square of this.
_CLOSE = 1 / 64


class FourBarKinematics:
    """The constants of one four-bar linkage, and its position at a crank angle.

    Attributes:
        map: From the crank to the transmission angle.
        structure: How the links hang together.
        side: 1 for the open assembly, -1 for the crossed one.
    """

    def __init__(self, mechanism: FourBar) -> None:
        r, b = mechanism.crank.length, mechanism.coupler.length
        c, d = mechanism.rocker.length, mechanism.frame.length
        side = 1.0 if mechanism.assembly == OPEN else -1.0
        far, near, cross = (
            short_sum(mechanism.longest, *terms) for terms in mechanism.sums.values()
        )
        sum_dr, sum_bc = math.fsum((d, r)), math.fsum((b, c))
        diff_dr, diff_bc = math.fsum((d, -r)), math.fsum((b, -c))
        # Where a short sum counts as zero, the lengths obey that equality from here on.
        if near == 0 and cross == 0:
            diff_dr = diff_bc = 0.0
        elif near == 0 or cross == 0:
            diff_bc = diff_dr if near == 0 else -diff_dr
        if far == 0:
            sum_bc = sum_dr

        delta = mechanism.frame.angle
        four_bc = 4 * b * c
        self.structure = structure(mechanism)
        self.map = TransmissionMap(
            reference=(delta, 0.0),
            kappa=math.sqrt(r * d / (b * c)) * (-1 if nearest_turns(delta) % 2 else 1),
            p=far * (sum_bc + sum_dr) / four_bc,
            q=near * cross / four_bc,
            # Of a loop that just closes, rounding could make them negative.
            far=max(math.fsum((b, c, -d, r)) * math.fsum((b, c, d, -r)) / four_bc, 0.0),
            near=max(math.fsum((d, r, -b, c)) * math.fsum((d, r, b, -c)) / four_bc, 0.0),
            pass_by=abs(diff_dr) / (2 * math.sqrt(r * d)),
        )
        self.side = side
        self._axis = (math.cos(delta), math.sin(delta))
        self._brackets = (diff_dr, sum_dr, diff_bc, side * sum_bc)
        self._square = (diff_dr * diff_dr, 4 * r * d)
        self._moment = side * diff_bc * sum_bc
        self._arm = (-r * diff_dr, 2 * r * d)
        # Rhombus and kite, r = d and b = c: L vanishes with sin(theta/2), and the quotient of
        # the two triangles' brackets is +1 or -1 throughout.
        self._concentric = diff_dr == 0 and diff_bc == 0
        self._quotient = math.copysign(side, side * self.map.kappa)
        # Where q < 0 the crank never comes near theta = 0, where L would be short.
        self._nearly_concentric = self.map.q >= 0 and abs(diff_dr) < _CLOSE * sum_dr

    def locate(self, crank: Real, functions: Functions) -> tuple[Real, Real]:
        """The position alone, to the bits of `solve`.

        Args:
            crank: Crank angle, rad; float or array. The loop must close there.
            functions: SCALAR or ARRAY.

        Returns:
            The directions of coupler and rocker, rad.
        """
        _, _, _, _, _, _, _, _, bx, by, cx, cy = self._place(crank, functions)
        return functions.atan2(by, bx), functions.atan2(cy, cx)

    def _place(self, crank: Real, functions: Functions) -> tuple[Real, ...]:
        """Half angles, L^2 and its inverse, w, and the unit vectors of coupler and rocker."""
        S, C, sin_m, cos_m = self.map.place(crank, functions)
        # Unit vectors: w = e^(i (delta + theta/2)), crank e^(i alpha) = w e^(i theta/2).
        ax, ay = self._axis
        wx, wy = ax * C - ay * S, ax * S + ay * C
        if self._concentric:
            fx, fy = self._quotient * wx, self._quotient * wy
            square = scale = 0.0
        else:
            diff_dr, sum_dr, diff_bc, sum_bc = self._brackets
            nearest, growth = self._square
            x1, y1, x2, y2 = diff_dr * C, sum_dr * S, diff_bc * cos_m, sum_bc * sin_m
            square = nearest + growth * (S * S)
            scale = 1.0 / square
            dot, cross = scale * (x1 * x2 + y1 * y2), scale * (x1 * y2 - y1 * x2)
            fx, fy = wx * dot - wy * cross, wx * cross + wy * dot
        signed = self.side * sin_m
        xc, ys, yc, xs = fx * cos_m, fy * signed, fy * cos_m, fx * signed
        bx, by, cx, cy = xc + ys, yc - xs, xc - ys, yc + xs
        return S, C, sin_m, cos_m, square, scale, wx, wy, bx, by, cx, cy

    def solve(self, crank: Real, functions: Functions) -> Links:
        """The position and its derivatives.

        Args:
            crank: Crank angle, rad; float or array. The loop must close there.
            functions: SCALAR or ARRAY.

        Returns:
            The links; rates and curvatures per crank speed.
        """
        place = self._place(crank, functions)
        S, C, sin_m, cos_m, square, scale, wx, wy, bx, by, cx, cy = place
        first, second = self.map.slopes(S, C, sin_m, cos_m)
        if self._concentric:
            mean, mean_slope = 0.5, 0.0
        elif self._nearly_concentric:
            halves = S, C, sin_m, cos_m
            mean, mean_slope = self._careful_mean(halves, (first, second), square, functions)
        else:
            # (1 - nu) / 2 = [r (r - d cos theta) + (b-c)(b+c) mu'/2] / L^2
            half_moment, (arm, arm_growth) = 0.5 * self._moment, self._arm
            growth = self._square[1]
            mean = scale * (arm + arm_growth * (S * S) + half_moment * first)
            mean_slope = scale * ((arm_growth - mean * growth) * (S * C) + half_moment * second)
        half_side = 0.5 * self.side
        first, second = half_side * first, half_side * second
        return (
            (crank, functions.atan2(by, bx), functions.atan2(cy, cx)),
            (wx * C - wy * S, bx, cx),
            (wx * S + wy * C, by, cy),
            ((1.0, mean - first, mean + first),),
            ((0.0, mean_slope - second, mean_slope + second),),
        )

    def _careful_mean(
        self,
        halves: tuple[Real, Real, Real, Real],
        slopes: tuple[Real, Real],
        square: Real,
        functions: Functions,
    ) -> tuple[Real, Real]:
        """(1 - nu) / 2 and its derivative where A passes B0 closely, L much shorter than d.

        There nu = (a - e) / L^2 loses its digits where a and e = (b-c)(b+c) mu' are alike. But
        (a - e) (a + e) = L^2 g with a g that is a sum of non-negative terms, so nu = g / (a + e).
        """
        (S, C, sin_m, cos_m), (first, second) = halves, slopes
        p, q, kappa = self.map.p, self.map.q, self.map.kappa
        diff_dr, sum_dr, diff_bc, _ = self._brackets
        u, v = (kappa * C / cos_m if p else 1.0), (kappa * S / sin_m if q else 1.0)
        # 1 - u^2 and 1 - v^2, and half the derivatives of u^2 and v^2.
        lack_u = p / (cos_m * cos_m) if p else 0.0
        lack_v = q / (sin_m * sin_m) if q else 0.0
        half_u = -0.5 * u * lack_u * kappa * S / cos_m if p else 0.0
        half_v = 0.5 * v * lack_v * kappa * C / sin_m if q else 0.0
        dr, bc = sum_dr * sum_dr, diff_bc * diff_bc
        g = dr * lack_v + bc * lack_u * (v * v)
        g_slope = 2 * (bc * (lack_u * half_v - v * v * half_u) - dr * half_v)
        a, e = diff_dr * sum_dr, self._moment * first
        e_slope, square_slope = self._moment * second, self._square[1] * (S * C)
        alike = a * e > 0
        choose = functions.where
        top, bottom = choose(alike, g, a - e), choose(alike, a + e, square)
        top_slope = choose(alike, g_slope, -e_slope)
        nu = top / bottom
        nu_slope = (top_slope - nu * choose(alike, e_slope, square_slope)) / bottom
        return 0.5 * (1.0 - nu), -0.5 * nu_slope


def structure(mechanism: FourBar) -> Structure:
    """How the links of a four-bar linkage hang together: the loop is cut at B.

    Args:
        mechanism: The linkage.

    Returns:
        Crank and rocker on the frame, the coupler on the crank.
    """
    crank, coupler, rocker = mechanism.crank, mechanism.coupler, mechanism.rocker
    pivot = mechanism.frame.length * cmath.exp(1j * mechanism.frame.angle)
    points = {
        'A0': Point((0j, 0j, 0j)),
        'A': Point((complex(crank.length), 0j, 0j)),
        'B': Point((0j, 0j, complex(rocker.length)), pivot),
        'B0': Point((0j, 0j, 0j), pivot),
    }
    if coupler.point is not None:
        points['C'] = Point((complex(crank.length), complex(*coupler.point), 0j))
    centers = (
        Point((complex(*crank.center), 0j, 0j)),
        Point((complex(crank.length), complex(*coupler.center), 0j)),
        Point((0j, 0j, complex(*rocker.center)), pivot),
    )
    return Structure(
        (
            Joint('crank', 0, None, 0j),
            Joint('coupler', 1, 0, complex(crank.length)),
            Joint('rocker', 2, None, pivot),
        ),
        points,
        tuple(
            TurningBody(link, body.mass, body.inertia, center)
            for link, (body, center) in enumerate(
                zip((crank, coupler, rocker), centers, strict=True)
            )
        ),
        Point(tuple(map(complex, (crank.length, coupler.length, -rocker.length))), -pivot),
    )
