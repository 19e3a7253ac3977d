# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Exact numbers of a drawing: the decimals that print its coordinates."""

import decimal
import math
from collections.abc import Sequence
from fractions import Fraction
from typing import NamedTuple

UNITS = {'m': Fraction(1), 'cm': Fraction(1, 100), 'mm': Fraction(1, 1000),
         'in': Fraction(254, 10000)}  # fmt: skip
_DIGITS = decimal.Context(prec=60)


class Exact(NamedTuple):
    """A place or a vector, m, as the decimals that print its coordinates."""

    x: Fraction
    y: Fraction

    @classmethod
    def of(cls, pair: Sequence[float], unit: Fraction = Fraction(1)) -> 'Exact':
        """Returns a place, given its coordinates and their unit, m."""
        x, y = (Fraction(repr(float(value))) * unit for value in pair)
        return cls(x, y)

    def minus(self, other: 'Exact') -> 'Exact':
        """Returns the vector from another place to this one."""
        return Exact(self.x - other.x, self.y - other.y)

    def plus(self, other: 'Exact', times: Fraction = Fraction(1)) -> 'Exact':
        """Returns this place, moved by a multiple of a vector."""
        return Exact(self.x + other.x * times, self.y + other.y * times)

    def dot(self, other: 'Exact') -> Fraction:
        """Returns the scalar product."""
        return self.x * other.x + self.y * other.y

    def cross(self, other: 'Exact') -> Fraction:
        """Returns the cross product, positive if the other vector is to the left."""
        return self.x * other.y - self.y * other.x

    def foot(self, start: 'Exact', way: 'Exact') -> 'Exact':
        """Returns the foot of the perpendicular from this place to a line."""
        return start.plus(way, self.minus(start).dot(way) / way.dot(way))

    @property
    def angle(self) -> float:
        """Direction of the vector, rad in (-pi, pi]."""
        return math.atan2(float(self.y), float(self.x))

    @property
    def length(self) -> float:
        """Length of the vector, rounded once."""
        return over_root(self.dot(self), self.dot(self))

    @property
    def rounded(self) -> tuple[float, float]:
        """The coordinates as floats."""
        return float(self.x), float(self.y)


def over_root(value: Fraction, square: Fraction) -> float:
    """Divides a value by the root of a square, and rounds once."""
    quotient = value * value / square
    with decimal.localcontext(_DIGITS):
        root = (decimal.Decimal(quotient.numerator) / quotient.denominator).sqrt()
    return math.copysign(float(root), value)
