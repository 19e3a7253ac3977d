# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Shared code of mechanisms whose sliding link may be driven instead of the crank.

Two links of lengths a and b and a line of length L form a triangle. The line leads to a sliding
link at the position x of its guide, at a distance e from the guide's zero, so that
L^2 = x^2 + e^2. With twice the angle h between the two links,

    4ab cos^2 h = x^2 - [(a-b)^2 - e^2]        4ab sin^2 h = [(a+b)^2 - e^2] - x^2

Both are factored, so that nothing cancels. If (a-b)^2 = e^2, the linkage has a change point at
x = 0; the first root is then x, with its sign, so that the motion is smooth there.
"""

import math
from collections.abc import Mapping
from fractions import Fraction
from typing import ClassVar, NamedTuple

from linkage_ros.formulas import ZERO, Opaque, require, sqrt
from linkage_ros.mechanism.base import Description, Mechanism
from linkage_ros.mechanism.kinematics import Loop, Reach
from linkage_ros.numeric import Real, short_sum

CRANK = 'crank'  # value of `input` if the crank is driven


class Triangle(NamedTuple):
    """The triangle of two links and a slide, as a function of the slide's position x.

    Attributes:
        least: (a-b)^2 - e^2, m^2; ZERO at a change point.
        folds: Whether the links are in line, folded, at positions other than 0.
        short: The distance |x| there, m, as a sum of two doubles; 0 if they never are.
        long: The distance |x| where they are in line, stretched, m, as a sum of two doubles.
    """

    least: Real
    folds: bool
    short: tuple[float, float]
    long: tuple[float, float]

    @classmethod
    def of(cls, lengths: tuple[float, float], offset: float) -> 'Triangle':
        """Creates the triangle from a and b, and e.

        Sums of lengths that are only rounding errors count as 0.
        """
        (a, b), e = lengths, abs(offset)
        long, short, longest = max(a, b), min(a, b), max(a, b, e)
        least = short_sum(longest, long, -short, -e) * short_sum(longest, long, -short, e)
        square, folded_square = Fraction(e) ** 2, (Fraction(a) - Fraction(b)) ** 2
        folds = least > 0
        return cls(
            least or ZERO,
            folds,
            short=_root(folded_square - square) if folds else (0.0, 0.0),
            long=_root((Fraction(a) + Fraction(b)) ** 2 - square),
        )

    def arcs(self) -> tuple[tuple[float, float], ...]:
        """Computes the positions at which the triangle closes, m; the first are positive."""
        (short, _), (long, _) = self.short, self.long
        return ((short, long), (-long, -short)) if self.folds else ((-long, long),)

    def roots(self, slide: Real, refuse: Opaque) -> tuple[Real, Real]:
        """Computes 2 sqrt(ab) cos h and 2 sqrt(ab) |sin h|, m, at a position, m.

        Args:
            slide: The position.
            refuse: Function that rejects a position.
        """
        distance = abs(slide)
        # Both squares are differences of squares, factored; `long` and `short` have two doubles.
        long, long_error = self.long
        sine_square = ((long - distance) + long_error) * (long + distance)
        require(sine_square > 0, refuse, slide)
        if self.least is ZERO:
            return slide, sqrt(sine_square)
        if self.folds:
            short, short_error = self.short
            cosine_square = ((distance - short) - short_error) * (distance + short)
        else:
            cosine_square = slide * slide - self.least
        require(cosine_square > 0, refuse, slide)
        return sqrt(cosine_square), sqrt(sine_square)


def _root(square: Fraction) -> tuple[float, float]:
    """Computes a square root as a sum of two doubles."""
    high = math.sqrt(square)
    return high, float(square - Fraction(high) ** 2) / (2 * high) if high else 0.0


class SlideDriven(Mechanism):
    """A mechanism whose crank or sliding link is driven.

    Attributes:
        slide: Name of the sliding link.
        slide_input: Value of `input` if this link is driven.
        input: Driven joint, 'crank' or the value `slide_input`.
    """

    slide: ClassVar[str]
    slide_input: ClassVar[str]
    input: str

    @property
    def drives_slide(self) -> bool:
        """Whether the sliding link is driven."""
        return self.input == self.slide_input

    @property
    def coordinates(self) -> tuple[str, ...]:  # type: ignore[override]
        """See `Mechanism`."""
        return (self.slide,) if self.drives_slide else (CRANK,)

    @property
    def other_coordinates(self) -> tuple[str, ...]:  # type: ignore[override]
        """See `Mechanism`."""
        return (CRANK,) if self.drives_slide else (self.slide,)

    @classmethod
    def drives(cls, values: Mapping[str, object]) -> tuple[tuple[str, ...], str]:
        """See `Mechanism.drives`."""
        word = cls.slide_input
        if values.get('input') != word:
            return (), ''
        return ('torque', 'motion', 'follow'), (
            f'because with input: {word} the {word} is driven, which has no rpm; leave rpm out'
        )

    def loop_of(self, description: Description) -> Loop:
        """Returns the kinematic constants in a description."""
        raise NotImplementedError

    def loop(self) -> Loop:
        """Returns the kinematic constants in the mechanism's own coordinates."""
        return self.loop_of(self.description)

    def reach(self) -> Reach:
        """Computes the reach of the crank or of the driven sliding link."""
        return self.reach_of_slide() if self.drives_slide else self.reach_of_crank()

    def reach_of_crank(self) -> Reach:
        """Computes the reach of the crank."""
        raise NotImplementedError

    def reach_of_slide(self) -> Reach:
        """Computes the reach of the sliding link."""
        raise NotImplementedError
