# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The loop equation as textbooks differentiate it, for the methods that start from it.

Documents 1 and 4: the way over crank and coupler ends where the output link is,

    gap = r e^(i alpha) + b e^(i beta) - B(y) = 0

with B(gamma) = d e^(i delta) + c e^(i gamma) of a rocker (document 1, eq. 7 and 8), and with
B(x) = (x + i e) e^(i guide) of a slider (document 4, eq. 2, where e = 0).
"""

from __future__ import annotations

import cmath
from typing import TypeAlias

from linkage_ros.lab.methods.functions import Functions
from linkage_ros.model.four_bar import FourBar
from linkage_ros.model.slider_crank import SliderCrank
from linkage_ros.numeric import Real

Pair: TypeAlias = tuple[Real, Real]
# The mechanisms whose loop textbooks solve in closed form.
Linkage: TypeAlias = FourBar | SliderCrank


class Loop:
    """The loop of one mechanism; unknowns are the coupler's direction and the output.

    Attributes:
        crank: Length, m.
        coupler: Length, m.
        rocker: Length, m; None: the output link slides.
        origin: Where the output counts from: B0, or the foot of the perpendicular from A0, m.
        guide: Direction of a slider's guide as a unit vector; of a rocker nothing that counts.
    """

    def __init__(self, mechanism: Linkage) -> None:
        self.crank, self.coupler = mechanism.crank.length, mechanism.coupler.length
        direction = cmath.rect(1.0, mechanism.frame.angle)
        self.guide = direction.real, direction.imag
        self.rocker: float | None = None
        if isinstance(mechanism, FourBar):
            self.rocker = mechanism.rocker.length
            self.origin = mechanism.frame.length * direction
        else:
            self.origin = 1j * mechanism.slider.offset * direction

    def gap(self, crank: Real, coupler: Real, output: Real, f: Functions) -> Pair:
        """By how much the loop does not close, m."""
        r, b, x0, y0 = self.crank, self.coupler, self.origin.real, self.origin.imag
        x = r * f.cos(crank) + b * f.cos(coupler) - x0
        y = r * f.sin(crank) + b * f.sin(coupler) - y0
        if self.rocker is None:
            return x - output * self.guide[0], y - output * self.guide[1]
        return x - self.rocker * f.cos(output), y - self.rocker * f.sin(output)

    def columns(self, coupler: Real, output: Real, f: Functions) -> tuple[Pair, Pair]:
        """Derivatives of the gap by the coupler's direction, m/rad, and by the output."""
        b = self.coupler
        by_coupler = -b * f.sin(coupler), b * f.cos(coupler)
        if self.rocker is None:
            return by_coupler, (-self.guide[0], -self.guide[1])
        return by_coupler, (self.rocker * f.sin(output), -self.rocker * f.cos(output))

    def crank_column(self, crank: Real, f: Functions) -> Pair:
        """Derivative of the gap by the crank angle."""
        return -self.crank * f.sin(crank), self.crank * f.cos(crank)

    def bias(self, position: tuple[Real, ...], rates: tuple[Real, ...], f: Functions) -> Pair:
        """The second derivative of the gap while no link accelerates.

        Args:
            position: Crank angle, coupler's direction and output.
            rates: Their derivatives by time, or by whatever counts.
            f: SCALAR or ARRAY.

        Returns:
            x and y.
        """
        (alpha, beta, gamma), (w1, w2, w3) = position, rates
        u, v = self.crank * (w1 * w1), self.coupler * (w2 * w2)
        x = -u * f.cos(alpha) - v * f.cos(beta)
        y = -u * f.sin(alpha) - v * f.sin(beta)
        if self.rocker is None:
            return x, y
        w = self.rocker * (w3 * w3)
        return x + w * f.cos(gamma), y + w * f.sin(gamma)


def solve_2x2(columns: tuple[Pair, Pair], right: Pair) -> Pair:
    """Cramer's rule; a singular matrix is a division by zero."""
    (a, c), (b, d) = columns
    x, y = right
    determinant = a * d - b * c
    return (x * d - b * y) / determinant, (a * y - x * c) / determinant
