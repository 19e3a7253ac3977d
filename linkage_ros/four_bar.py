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

import math

from linkage_ros.links import Links
from linkage_ros.mechanism import OPEN, FourBar
from linkage_ros.numeric import Functions, Real, short_sum
from linkage_ros.transmission import TransmissionMap


class FourBarKinematics:
    """The constants of one four-bar linkage, and its position at a crank angle.

    Attributes:
        map: From the crank to the transmission angle.
        links: Names of the links, in the order of all tuples.
    """

    links = ('crank', 'coupler', 'rocker')

    def __init__(self, mechanism: FourBar) -> None:
        r, b = mechanism.crank.length, mechanism.coupler.length
        c, d = mechanism.rocker.length, mechanism.frame.length
        side = 1.0 if mechanism.assembly == OPEN else -1.0
        longest = max(r, b, c, d)
        far = short_sum(longest, b, c, -d, -r)
        near = short_sum(longest, d, -r, -b, c)
        cross = short_sum(longest, d, -r, b, -c)
        sum_dr, sum_bc = math.fsum((d, r)), math.fsum((b, c))
        difference_dr, difference_bc = math.fsum((d, -r)), math.fsum((b, -c))
        # Where a short sum counts as zero, the lengths obey that equality from here on.
        if near == 0 and cross == 0:
            difference_dr = difference_bc = 0.0
        elif near == 0 or cross == 0:
            difference_bc = difference_dr if near == 0 else -difference_dr
        if far == 0:
            sum_bc = sum_dr

        delta = mechanism.frame.angle
        turns_away = round(delta / (2 * math.pi))
        four_bc = 4 * b * c
        self.map = TransmissionMap(
            reference=(delta, 0.0),
            kappa=math.sqrt(r * d / (b * c)) * (-1 if turns_away % 2 else 1),
            p=far * (sum_bc + sum_dr) / four_bc,
            q=near * cross / four_bc,
        )
        self._side = side
        self._axis = (math.cos(delta), math.sin(delta))
        # Rhombus and kite, r = d and b = c: L vanishes with sin(theta/2), and the quotient of
        # the two triangles' brackets is +1 or -1 throughout.
        self._concentric = difference_dr == 0 and difference_bc == 0
        self._constants = (
            *(difference_dr, sum_dr, difference_bc, side * sum_bc),
            *(difference_dr * difference_dr, 4 * r * d),
            *(difference_dr * sum_dr, side * difference_bc * sum_bc),
        )

    def solve(self, crank: Real, functions: Functions) -> Links:
        """The position and its derivatives.

        Args:
            crank: Crank angle, rad; float or array. The loop must close there.
            functions: SCALAR or ARRAY.

        Returns:
            The links; rates and curvatures per crank speed.
        """
        S, C = self.map.half_angle(crank, functions)
        sin_m, cos_m, first, second = self.map.solve(S, C, functions)
        # Unit vectors: w = e^(i (delta + theta/2)), crank e^(i alpha) = w e^(i theta/2).
        ax, ay = self._axis
        wx, wy = ax * C - ay * S, ax * S + ay * C
        crank_cos, crank_sin = wx * C - wy * S, wx * S + wy * C
        if self._concentric:
            fx, fy = self._side * wx, self._side * wy
            nu = nu_slope = 0.0
        else:
            diff_dr, sum_dr, diff_bc, sum_bc, nearest, growth, dr, bc = self._constants
            x1, y1, x2, y2 = diff_dr * C, sum_dr * S, diff_bc * cos_m, sum_bc * sin_m
            scale = 1.0 / (nearest + growth * (S * S))
            dot, cross = scale * (x1 * x2 + y1 * y2), scale * (x1 * y2 - y1 * x2)
            fx, fy = wx * dot - wy * cross, wx * cross + wy * dot
            nu = scale * (dr - bc * first)
            nu_slope = -scale * (bc * second + nu * (growth * (S * C)))
        side = self._side
        xc, ys, yc, xs = fx * cos_m, fy * sin_m * side, fy * cos_m, fx * sin_m * side
        coupler_cos, coupler_sin = xc + ys, yc - xs
        rocker_cos, rocker_sin = xc - ys, yc + xs
        half_side = 0.5 * side
        first, second = half_side * first, half_side * second
        mean, mean_slope = 0.5 * (1.0 - nu), -0.5 * nu_slope
        return (
            (
                crank,
                functions.atan2(coupler_sin, coupler_cos),
                functions.atan2(rocker_sin, rocker_cos),
            ),
            (crank_cos, coupler_cos, rocker_cos),
            (crank_sin, coupler_sin, rocker_sin),
            ((1.0, mean - first, mean + first),),
            (0.0, mean_slope - second, mean_slope + second),
        )

    @staticmethod
    def centers(mechanism: FourBar) -> tuple[tuple[complex, complex, complex], ...]:
        """Centres of mass of crank, coupler and rocker as combinations of the link directions.

        Args:
            mechanism: The linkage.

        Returns:
            A row for each body: its centre is the sum of row[j] e^(i phi_j), plus a constant, m.
        """
        crank, coupler, rocker = (
            complex(*body.center)
            for body in (mechanism.crank, mechanism.coupler, mechanism.rocker)
        )
        return (crank, 0j, 0j), (mechanism.crank.length, coupler, 0j), (0j, 0j, rocker)
