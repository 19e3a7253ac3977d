# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Transmission angle of four-bar and slider-crank as a function of crank angle; rocker swing.

Let h be half the crank angle, measured from the line of the fixed pivots. Let m be half the
transmission angle, between coupler and rocker. The factored closed form (docs/mechanisms.md) is

    cos^2 m = p + kappa^2 cos^2 h        sin^2 m = q + kappa^2 sin^2 h        p + q + kappa^2 = 1

where the constants depend only on the lengths. The crank turns fully if and only if p >= 0 and
q >= 0. All terms of these sums are then non-negative, so there is no cancellation. If p = 0 or
q = 0, the linkage has change points. The root is then kappa cos h or kappa sin h, with its sign,
so that the motion is smooth there. With u = kappa cos h / cos m and v = kappa sin h / sin m, the
derivatives

    d(2m)/d(2h) = u v        d^2(2m)/d(2h)^2 = [u^2 (1 - v^2) cot m - v^2 (1 - u^2) tan m] / 2

require no division by the sine of the transmission angle. These formulas were derived for this
project.
"""

import math
from collections.abc import Iterable, Mapping
from typing import NamedTuple

from linkage_ros.formulas import ZERO, Opaque, cos, require, sin, sqrt
from linkage_ros.mechanism.kinematics import FULL_TURN, Arc, Reach
from linkage_ros.numeric import Real, is_rounding, short_sum, two_sum, wrap

_NEAR = 1e-4  # of the longest length; a smaller sum is nearly a change point


def half_angle(crank: Real, reference: tuple[float, float]) -> tuple[Real, Real]:
    """Computes sine and cosine of h, half the crank angle from a direction, to an ulp.

    Args:
        crank: Crank angle, rad.
        reference: The direction, rad, as a sum of two doubles. The rounding error of the
            difference is compensated.
    """
    high, low = reference
    half, error = two_sum(0.5 * crank, -0.5 * high)
    half_error = error - 0.5 * low
    sine, cosine = sin(half), cos(half)
    return sine + half_error * cosine, cosine - half_error * sine


class Square(NamedTuple):
    """A function of h: cos^2 m = p + (kappa cos h)^2 or sin^2 m = q + (kappa sin h)^2.

    Attributes:
        least: Smallest value, p or q; ZERO if it is treated as 0, so that the root is signed.
        most: Largest value, 1 - q or 1 - p, without the rounding error of this difference.
        limits: Whether the function is negative at some crank angles, which are unreachable.
        from_most: Whether to compute the function as `most` minus the square of the other
            product, which then loses fewer digits.
    """

    least: Real
    most: float
    limits: bool
    from_most: bool

    @classmethod
    def of(cls, least: float, most: float) -> 'Square':
        """Creates the function from its smallest and largest values."""
        # In a loop that can only just close, rounding could make the largest value negative.
        most = max(most, 0.0)
        limits = least < 0
        return cls(least or ZERO, most, limits, limits and most < -least)

    def root(self, x: Real, other: Real, refuse: Opaque, crank: Real) -> Real:
        """Computes cos m or sin m.

        Args:
            x: kappa cos h, or kappa sin h.
            other: The other of these two products.
            refuse: Function that rejects a crank angle.
            crank: Crank angle, rad.

        Returns:
            The square root of the function, signed if `least` is ZERO.
        """
        if self.least is ZERO:
            return x
        square = self.most - other * other if self.from_most else self.least + x * x
        if self.limits:
            require(square > 0, refuse, crank)
        return sqrt(square)


class HalfAngles(NamedTuple):
    """Functions of half the crank angle, h, and half the transmission angle, m.

    They are accurate to an ulp even near change points. See the module for u and v.
    """

    sin_h: Real
    cos_h: Real
    sin_m: Real
    cos_m: Real
    u: Real
    v: Real


class Transmission(NamedTuple):
    """The constants of the map from crank angle to transmission angle.

    Attributes:
        reference: Direction from which crank angles are measured, rad, as a sum of two doubles
            that has twice the digits of one.
        kappa: Square root of kappa^2 in the formulas above, negative if the angle of the frame or
            guide, rounded to whole turns, is an odd number of turns. With this sign, `assembly`
            refers to the branch in the half turn after the reference.
        cos_squared: cos^2 m as a function of h; limits a crank that cannot reach h = pi/2.
        sin_squared: sin^2 m as a function of h; limits a crank that cannot reach h = 0.
        refuse: Function that rejects a crank angle.
    """

    reference: tuple[float, float]
    kappa: float
    cos_squared: Square
    sin_squared: Square
    refuse: Opaque

    def half_angles(self, crank: Real) -> HalfAngles:
        """Computes sines and cosines of half the crank angle, rad, and transmission angle."""
        sin_h, cos_h = half_angle(crank, self.reference)
        kappa_sin, kappa_cos = self.kappa * sin_h, self.kappa * cos_h
        cos_m = self.cos_squared.root(kappa_cos, kappa_sin, self.refuse, crank)
        sin_m = self.sin_squared.root(kappa_sin, kappa_cos, self.refuse, crank)
        u = 1.0 if self.cos_squared.least is ZERO else kappa_cos / cos_m
        v = 1.0 if self.sin_squared.least is ZERO else kappa_sin / sin_m
        return HalfAngles(sin_h, cos_h, sin_m, cos_m, u, v)

    def slopes(self, halves: HalfAngles, factor: float = 1.0) -> tuple[Real, Real]:
        """Computes d(2m)/d(2h) and d^2(2m)/d(2h)^2 from `half_angles`, times a factor."""
        _, _, sin_m, cos_m, u, v = halves
        p, q = self.cos_squared.least, self.sin_squared.least
        # 1 - u^2 = p / cos^2 m and 1 - v^2 = q / sin^2 m, without cancellation.
        second: Real = ZERO
        if q is not ZERO:
            second = (0.5 * factor * q) * (u * u * cos_m / (sin_m * sin_m * sin_m))
        if p is not ZERO:
            second = second - (0.5 * factor * p) * (v * v * sin_m / (cos_m * cos_m * cos_m))
        return factor * (u * v), second

    @property
    def turns_fully(self) -> bool:
        """Whether a state exists at every crank angle."""
        return not (self.cos_squared.limits or self.sin_squared.limits)

    def arcs(self) -> tuple[Arc, ...]:
        """Computes the arcs of crank angles where neither cos^2 m nor sin^2 m is negative.

        Returns:
            Arcs (start, end) with start in [0, 2 pi), rad; one turn if the crank turns fully.
        """
        if self.turns_fully:
            return FULL_TURN
        # An arc ends where sin^2 m = 0, at tan^2 h = -q / (q + kappa^2), or where cos^2 m = 0, at
        # tan^2 h = (p + kappa^2) / -p. The sums are largest values; the crank angle is 2h.
        minus_p = max(-float(self.cos_squared.least), 0.0)
        minus_q = max(-float(self.sin_squared.least), 0.0)
        nearest = 2 * math.atan2(math.sqrt(minus_q), math.sqrt(self.sin_squared.most))
        farthest = 2 * math.atan2(math.sqrt(self.cos_squared.most), math.sqrt(minus_p))
        middle, _ = self.reference
        if not self.sin_squared.limits:
            return (normalized(middle - farthest, middle + farthest),)
        if not self.cos_squared.limits:
            return (normalized(middle + nearest, middle + 2 * math.pi - nearest),)
        return (
            normalized(middle + nearest, middle + farthest),
            normalized(middle - farthest, middle - nearest),
        )

    def extremes(self) -> Arc:
        """Computes the smallest and the largest transmission angle 2m, rad in [0, pi].

        They occur at h = 0 and h = pi/2. If the crank cannot reach one of these positions, its
        reach ends where the transmission angle is 0 (folded) or pi (stretched), respectively.
        """
        least_sin, least_cos = (
            max(float(square.least), 0.0) for square in (self.sin_squared, self.cos_squared)
        )
        most_cos = self.cos_squared.most if least_sin > 0 else 1.0
        most_sin = self.sin_squared.most if least_cos > 0 else 1.0
        low = 2 * math.atan2(math.sqrt(least_sin), math.sqrt(most_cos))
        high = 2 * math.atan2(math.sqrt(most_sin), math.sqrt(least_cos))
        return low, high

    def reach(
        self,
        grashof: str,
        sums: Mapping[str, tuple[float, ...]],
        cures: Iterable[str],
        pass_by: float = 0.0,
    ) -> Reach:
        """Collects the properties of the crank's reach.

        Args:
            grashof: Grashof class of the linkage.
            sums: Terms of the length sums that vanish at change points, keyed by formula. If the
                first sum is negative, cos m limits the crank; if another sum is negative, sin m
                does.
            cures: Changes that would let the crank turn fully; used only if it is limited.
            pass_by: Largest h at which the crank pin is close to the rocker pivot, rad; 0 if there
                is no rocker pivot, or if the pin passes through it.
        """
        limits, equalities, near_equalities = list[str](), list[str](), list[str]()
        longest = max(abs(length) for terms in sums.values() for length in terms)
        may_limit = [self.cos_squared.limits, *[self.sin_squared.limits] * (len(sums) - 1)]
        for (formula, terms), limits_crank in zip(sums.items(), may_limit, strict=True):
            total = math.fsum(terms)
            if is_rounding(longest, total):
                if total:
                    equalities.append(f'{formula} = {total:.2g} m counts as 0')
                continue
            if limits_crank and total < 0:
                limits.append(f'{formula} = {total:.6g} m is negative')
            if abs(total) < _NEAR * longest:
                near_equalities.append(f'{formula} = {total:.2g} m')
        least_cos, least_sin = float(self.cos_squared.least), float(self.sin_squared.least)
        has_one_change_point = (least_cos == 0) != (least_sin == 0)
        # The output moves fast where h is within these widths of 0 or pi/2.
        widths = [math.sqrt(x) / abs(self.kappa) for x in (least_cos, least_sin) if x > 0]
        if pass_by:
            widths.append(pass_by)
        return Reach(
            grashof,
            arcs=self.arcs(),
            period_turns=2 if has_one_change_point else 1,
            transmission=self.extremes(),
            limits=tuple(limits),
            cures=tuple(cures) if limits else (),
            equalities=tuple(equalities),
            near_equalities=tuple(near_equalities),
            fast=self.reference[0],
            width=min(widths, default=math.inf),
        )


def normalized(start: float, end: float) -> Arc:
    """Shifts an arc by whole turns, so that its start is in [0, 2 pi), rad."""
    whole = 2 * math.pi * math.floor(start / (2 * math.pi))
    return start - whole, end - whole


def swing_middle(
    lengths: tuple[float, ...], frame: float, rocker: float, near: float | None
) -> float | None:
    """Computes the middle of the swing of a four-bar's rocker.

    The distance from the crank pivot to the rocker's end is between |coupler - crank| and
    coupler + crank. By the law of cosines, this bounds the angle between the rocker and the
    direction from B0 to A0.

    Args:
        lengths: Lengths of crank, coupler, rocker and frame, m.
        frame: Direction of the frame, rad.
        rocker: A direction of the rocker during its swing, rad.
        near: See `Mechanism.swing_middle` if there are two circuits, one on each side of the line
            of the fixed pivots; otherwise None.

    Returns:
        The middle direction, rad in [-pi, pi]; None if the rocker turns fully.
    """
    r, b, c, d = lengths
    longest = max(lengths)
    nearest, farthest = abs(short_sum(longest, b, -r)), b + r  # distances of A0 and B
    smallest, largest = 0.0, math.pi  # of the bounded angle
    if abs(short_sum(longest, c, -d)) < nearest:
        smallest = _opposite(c, d, nearest)
    if short_sum(longest, b, r, -c, -d) < 0:
        largest = _opposite(c, d, farthest)
    passes_crank_pivot, passes_away_from_it = smallest == 0, largest == math.pi
    if passes_crank_pivot and passes_away_from_it:
        return None
    middle = 0.5 * (smallest + largest)
    back: float = wrap(frame + math.pi)  # from B0 to A0
    if near is not None:
        is_about_back = abs(wrap(near - back)) <= math.pi - middle
        return back if is_about_back else float(wrap(frame))
    if passes_crank_pivot:
        middle = 0.0
    elif passes_away_from_it:
        middle = math.pi
    side = wrap(rocker - back)
    return float(wrap(back + math.copysign(middle, side)))


def _opposite(rocker: float, frame: float, opposite: float) -> float:
    """Returns the angle between the sides `rocker` and `frame` of a triangle, rad."""
    cosine = (rocker * rocker + frame * frame - opposite * opposite) / (2 * rocker * frame)
    return math.acos(max(-1.0, min(1.0, cosine)))
