# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""From the crank to the transmission angle: one map behind four-bar and slider-crank.

Let h be half the crank angle, counted from the line of the fixed pivots, and m half the angle
at which coupler and rocker meet. By the factored closed form (docs/mechanisms.md)

    cos^2 m = p + kappa^2 cos^2 h        sin^2 m = q + kappa^2 sin^2 h        p + q + kappa^2 = 1

with constants of the lengths alone. The crank turns fully exactly where p >= 0 and q >= 0: then
these are sums of terms that are never negative, and nothing cancels. Where p = 0 or q = 0, at
change points, the root is taken with its sign, kappa cos h or kappa sin h, and motion runs
smoothly through the point. With u = kappa cos h / cos m and v = kappa sin h / sin m

    d(2m)/d(2h) = u v        d^2(2m)/d(2h)^2 = [u^2 (1 - v^2) cot m - v^2 (1 - u^2) tan m] / 2

and no division by the sine of the transmission angle is left. The formulas are this project's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np

from linkage_ros.numeric import Array, Functions, Real, two_sum

Arc: TypeAlias = tuple[float, float]

_PER_DECADE = 24  # of the steps that become finer
_EPSILON = 2.0**-52


@dataclass(frozen=True)
class TransmissionMap:
    """The constants of the map.

    Attributes:
        reference: Direction of the reference line, rad, in two parts whose sum is exact to
            twice the digits of a double.
        kappa: Coupling, signed: negative where the reference is an odd number of turns away,
            so that the branch named at crank angles 0 to pi from it is the one asked for.
        p: cos^2 m at h = pi/2; negative: the crank cannot reach the far side.
        q: sin^2 m at h = 0; negative: the crank cannot reach the near side.
        far: cos^2 m at h = 0: 1 - q without its rounding.
        near: sin^2 m at h = pi/2: 1 - p without its rounding.
        pass_by: Half angle within which the crank pin passes the rocker pivot, rad; infinite
            where there is no such pivot.
        turns_fully: Whether a state exists at every crank angle.
    """

    reference: tuple[float, float]
    kappa: float
    p: float
    q: float
    far: float
    near: float
    pass_by: float = math.inf
    turns_fully: bool = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, 'turns_fully', self.p >= 0 and self.q >= 0)

    @property
    def period_turns(self) -> int:
        """Turns after which the motion repeats: 2 where one change point is passed, else 1."""
        return 2 if (self.p == 0) != (self.q == 0) else 1

    def arcs(self) -> tuple[Arc, ...]:
        """Where the crank can be, in closed form: cos^2 m and sin^2 m must not be negative.

        Returns:
            (from, to) with from in [0, 2 pi), rad; one turn where it turns fully.
        """
        if self.turns_fully:
            return ((0.0, 2 * math.pi),)
        middle = self.reference[0]
        nearest = 2 * math.atan2(math.sqrt(-self.q), math.sqrt(self.near)) if self.q < 0 else 0.0
        farthest = 2 * math.atan2(math.sqrt(self.far), math.sqrt(-self.p)) if self.p < 0 else 0.0
        if self.q >= 0:
            return (_turned(middle - farthest, middle + farthest),)
        if self.p >= 0:
            return (_turned(middle + nearest, middle + 2 * math.pi - nearest),)
        return (
            _turned(middle + nearest, middle + farthest),
            _turned(middle - farthest, middle - nearest),
        )

    def extremes(self) -> tuple[float, float]:
        """The smallest and the largest transmission angle 2m, in [0, pi], rad.

        They are at h = 0 and h = pi/2; a crank that cannot get there stops where the angle is 0
        (folded) or pi (stretched).
        """
        near, far = max(self.q, 0.0) + 0.0, max(self.p, 0.0) + 0.0
        smallest = 2 * math.atan2(math.sqrt(near), math.sqrt(self.far if near else 1.0))
        return smallest, 2 * math.atan2(math.sqrt(self.near if far else 1.0), math.sqrt(far))

    def samples(self, steps_per_turn: int = 720) -> Array:
        """Crank angles over one period that miss nothing of the motion.

        Whatever happens fast happens at h = 0 and h = pi/2, next to a change point: within half
        angles of sqrt(q) / kappa, sqrt(p) / kappa and `pass_by`. There the steps become finer
        towards these angles, to far below the narrowest.

        Args:
            steps_per_turn: Of the even steps.

        Returns:
            Angles from 0 to 2 pi or 4 pi, rad, in rising order.
        """
        turns = self.period_turns
        steps = turns * steps_per_turn
        even: Array = np.linspace(0, turns * 2 * math.pi, steps + 1, dtype=np.float64)
        scales = (math.sqrt(self.p), math.sqrt(self.q))
        widths = [scale / abs(self.kappa) for scale in scales if scale]
        narrowest = min([*widths, *([self.pass_by] if self.pass_by else [])], default=math.inf)
        step = math.pi / steps_per_turn
        if narrowest > 20 * step:
            return even
        decades = math.log10(step * 40 / narrowest) + 2
        fine = np.geomspace(narrowest * 0.01, step * 40, math.ceil(decades * _PER_DECADE))
        around = np.concatenate([-fine[::-1], [0.0], fine])
        first = self.reference[0] % math.pi
        places = [first + math.pi * i for i in range(-1, 2 * turns + 1)]
        angles = np.concatenate([even, *(place + around for place in places)])
        all_angles: Array = np.unique(angles[(angles >= 0) & (angles <= even[-1])])
        return all_angles

    def _half_angle(self, crank: Real, functions: Functions) -> tuple[Real, Real]:
        """Half of crank - reference, with the rounding error of that difference carried along.

        Args:
            crank: Crank angle, rad; float or array.
            functions: SCALAR or ARRAY.

        Returns:
            sin h and cos h, right to an ulp even next to a change point.
        """
        high, low = self.reference
        angle, error = two_sum(crank, -high)
        half_error = 0.5 * (error - low)
        half = 0.5 * angle
        sin, cos = functions.sin(half), functions.cos(half)
        return sin + half_error * cos, cos - half_error * sin

    def margins(self, crank: Real, functions: Functions) -> list[Real]:
        """Those of cos^2 m and sin^2 m, in this order, that limit the crank.

        Args:
            crank: Crank angle, rad; float or array.
            functions: SCALAR or ARRAY.

        Returns:
            Positive inside the reach, 0 at its ends, negative where the loop cannot close;
            empty where the crank turns fully.
        """
        sin_h, cos_h = self._half_angle(crank, functions)
        sine, cosine = self.kappa * sin_h, self.kappa * cos_h
        return [
            square
            for limit, square in zip((self.p, self.q), self._squares(sine, cosine), strict=True)
            if limit < 0
        ]

    def _squares(self, sine: Real, cosine: Real) -> tuple[Real, Real]:
        """cos^2 m and sin^2 m from kappa sin h and kappa cos h.

        Where p or q is negative something has to cancel; the form with the smaller terms then
        loses less, by far for a long crank that swings a little.
        """
        p, q, far, near = self.p, self.q, self.far, self.near
        cos_square = far - sine * sine if p < 0.0 and far < -p else p + cosine * cosine
        sin_square = near - cosine * cosine if q < 0.0 and near < -q else q + sine * sine
        return cos_square, sin_square

    def sine(self, crank: Real, functions: Functions) -> Real:
        """The sine of the transmission angle, sin 2m, right to a few ulp where it vanishes too.

        Args:
            crank: Crank angle, rad; float or array.
            functions: SCALAR or ARRAY.

        Returns:
            The sine.
        """
        _, _, sin_m, cos_m = self.place(crank, functions)
        return 2 * (sin_m * cos_m)

    def at_change_point(self, crank: Real, functions: Functions) -> Real:
        """Whether the crank is at a change point, to within the rounding of its angle.

        No double is a multiple of pi. An angle that is computed to be one, such as
        frame.angle + k * math.pi, misses it by up to two units in its last place.

        Args:
            crank: Crank angle, rad; float or array.
            functions: SCALAR or ARRAY.

        Returns:
            A truth value, or an array of them.
        """
        _, _, sin_m, cos_m = self.place(crank, functions)
        # Of half an angle, hence one unit; next to a change point the root is kappa times that.
        nothing = _EPSILON * abs(self.kappa) * (1.0 + abs(crank) + abs(self.reference[0]))
        stretched = (abs(cos_m) <= nothing) & (self.p == 0)
        return stretched | (abs(sin_m) <= nothing) & (self.q == 0)

    def place(self, crank: Real, functions: Functions) -> tuple[Real, Real, Real, Real]:
        """Half the crank angle and half the transmission angle, where the loop closes.

        Args:
            crank: Crank angle, rad; float or array.
            functions: SCALAR or ARRAY.

        Returns:
            sin h, cos h, sin m and cos m.
        """
        kappa, p, q = self.kappa, self.p, self.q
        if not self.turns_fully:
            sin_h, cos_h = self._half_angle(crank, functions)
            cos_square, sin_square = self._squares(kappa * sin_h, kappa * cos_h)
            return (
                sin_h,
                cos_h,
                functions.sqrt(sin_square) if q else kappa * sin_h,
                functions.sqrt(cos_square) if p else kappa * cos_h,
            )
        # `_half_angle` and `two_sum` written out: two calls less are a fifth of a position.
        high, low = self.reference
        angle = crank - high
        part = angle - crank
        half_error = 0.5 * ((crank - (angle - part)) - (high + part) - low)
        half = 0.5 * angle
        sin, cos = functions.sin(half), functions.cos(half)
        sin_h, cos_h = sin + half_error * cos, cos - half_error * sin
        sine, cosine = kappa * sin_h, kappa * cos_h
        return (
            sin_h,
            cos_h,
            functions.sqrt(q + sine * sine) if q else sine,
            functions.sqrt(p + cosine * cosine) if p else cosine,
        )

    def slopes(self, sin_h: Real, cos_h: Real, sin_m: Real, cos_m: Real) -> tuple[Real, Real]:
        """How the transmission angle changes with the crank.

        Args:
            sin_h: From `place`.
            cos_h: From `place`.
            sin_m: From `place`.
            cos_m: From `place`.

        Returns:
            d(2m)/d(2h) and d^2(2m)/d(2h)^2.
        """
        kappa, p, q = self.kappa, self.p, self.q
        # 1 - u^2 = p / cos^2 m and 1 - v^2 = q / sin^2 m, without cancellation.
        u, v = (kappa * cos_h / cos_m if p else 1.0), (kappa * sin_h / sin_m if q else 1.0)
        second = 0.0
        if q:
            second = (0.5 * q) * (u * u * cos_m / (sin_m * sin_m * sin_m))
        if p:
            second = second - (0.5 * p) * (v * v * sin_m / (cos_m * cos_m * cos_m))
        return u * v, second


def _turned(start: float, end: float) -> Arc:
    whole = 2 * math.pi * math.floor(start / (2 * math.pi))
    return start - whole, end - whole
