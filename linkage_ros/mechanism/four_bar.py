# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The four-bar linkage: parameters, mobility and exact pose.

The loop equation is r e^(i alpha) + b e^(i beta) = c e^(i gamma) + d e^(i delta) (Ghalbi 2019,
eq. 7; Mottola 2017, eq. 1). The solution below was derived for this project. The diagonal B0 - A,
of length L, divides the quadrilateral into two triangles of the same form:

    d - r e^(i theta) = e^(i theta/2) [(d-r) cos(theta/2) - i (d+r) sin(theta/2)]
    b - c e^(i mu)    = e^(i mu/2)    [(b-c) cos(mu/2)    - i (b+c) sin(mu/2)]

with theta = alpha - delta and the signed transmission angle mu = gamma - beta. The quotient of
the first and the second is e^(i (beta - delta)). Differentiating it with respect to the crank
angle gives, with nu = [(d-r)(d+r) - (b-c)(b+c) mu'] / L^2,

    beta' = (1 - nu - mu') / 2        gamma' = (1 - nu + mu') / 2

`short_sum` computes all sums of lengths that determine the mobility, so that equalities hold for
lengths entered as decimals.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

from linkage_ros.errors import ConfigurationError, MechanismError
from linkage_ros.formulas import (
    ZERO,
    Opaque,
    Vector,
    atan2,
    cross,
    dot,
    sqrt,
    turned,
    where,
)
from linkage_ros.mechanism.base import Mechanism
from linkage_ros.mechanism.dyads import Dyad, dyads_field
from linkage_ros.mechanism.kinematics import LinkPose, Loop, Pose, Reach
from linkage_ros.mechanism.loads import loads_field
from linkage_ros.mechanism.loads.base import AppliedLoad
from linkage_ros.mechanism.parts import (
    CROSSED,
    OPEN,
    Body,
    Frame,
    gravity_quantity,
)
from linkage_ros.mechanism.points import TracedPoint, points_field
from linkage_ros.mechanism.structure import Link, Pin, Point, Structure, direction
from linkage_ros.mechanism.transmission import Square, Transmission, swing_middle
from linkage_ros.numeric import (
    HALF_PI,
    Real,
    exact_sum,
    nearest_turns,
    rounded,
    short_sum,
    two_sum,
    wrap,
)
from linkage_ros.quantities import quantity

# If |d - r| is below this fraction of d + r, `_mean_near_pivot` computes the rates. Above, the
# error of the other formula is at most about an ulp divided by the square of this fraction.
_CLOSE = 1 / 64


class FourBarLoop(NamedTuple):
    """The kinematic constants of a four-bar linkage.

    Attributes:
        transmission: Map from crank angle to transmission angle.
        side: 1 for the open assembly, -1 for the crossed one.
        axis: Unit vector of the frame, of direction delta.
        ground: d - r and d + r, m.
        dyad: b - c and side (b + c), m.
        length: L^2 at theta = 0 and its increase from there to theta = pi, m^2; None if crank pin
            and rocker pivot coincide at theta = 0 (rhombus and kite, r = d and b = c).
        moment: (b - c)(b + c), m^2.
        arm: r (r - d cos theta) at theta = 0 and its increase from there to theta = pi, m^2.
        quotient: Quotient of the two brackets above, +1 or -1; used only if `length` is None.
        close: Whether the crank pin passes so close to the rocker pivot that L becomes much
            shorter than d.
    """

    transmission: Transmission
    side: int
    axis: Vector
    ground: tuple[float, float]
    dyad: tuple[float, float]
    length: tuple[float, float] | None
    moment: float
    arm: tuple[float, float]
    quotient: int
    close: bool

    def pose(self, q: tuple[Real, ...]) -> Pose:
        """Computes the pose at a crank angle.

        Args:
            q: Crank angle, rad, as the only element.

        Returns:
            The pose of crank, coupler and rocker.
        """
        (crank,) = q
        halves = self.transmission.half_angles(crank)
        S, C, sin_m, cos_m, *_ = halves
        # Unit vectors: half_way = e^(i (delta + theta/2)), the crank is half_way e^(i theta/2).
        half_way = turned(self.axis, C, S)
        # Half of mu' and of its derivative.
        turn, bend = self.transmission.slopes(halves, 0.5)
        if self.side < 0:
            turn, bend = -turn, -bend
        if self.length is None:
            base, mean, mean_slope = half_way * self.quotient, 0.5, ZERO
        else:
            diff_dr, sum_dr = self.ground
            diff_bc, sum_bc = self.dyad
            nearest, growth = self.length
            ground = Vector(diff_dr * C, sum_dr * S)
            dyad = Vector(diff_bc * cos_m, sum_bc * sin_m)
            square = nearest + growth * (S * S)
            scale = 1.0 / square
            base = turned(half_way, scale * dot(ground, dyad), scale * cross(ground, dyad))
            if self.close:
                mean, mean_slope = self._mean_near_pivot(halves, (turn, bend), square)
            else:
                # (1 - nu) / 2 = [r (r - d cos theta) + (b-c)(b+c) mu'/2] / L^2
                arm, arm_growth = self.arm
                mean = scale * (arm + arm_growth * (S * S) + self.moment * turn)
                mean_slope = scale * ((arm_growth - mean * growth) * (S * C) + self.moment * bend)
        signed = self.side * sin_m
        coupler = Vector(base.x * cos_m + base.y * signed, base.y * cos_m - base.x * signed)
        rocker = Vector(base.x * cos_m - base.y * signed, base.y * cos_m + base.x * signed)
        return Pose(
            (
                LinkPose(crank, turned(half_way, C, S), (1.0,), (ZERO,)),
                LinkPose(
                    atan2(coupler.y, coupler.x), coupler, (mean - turn,), (mean_slope - bend,)
                ),
                LinkPose(atan2(rocker.y, rocker.x), rocker, (mean + turn,), (mean_slope + bend,)),
            ),
            (2 * (signed * cos_m),),
        )

    def _mean_near_pivot(
        self, halves: tuple[Real, ...], slopes: tuple[Real, Real], square: Real
    ) -> tuple[Real, Real]:
        """Computes (1 - nu) / 2 and its derivative where A is close to B0, so that L << d.

        With a = (d-r)(d+r) and e = (b-c)(b+c) mu', nu = (a - e) / L^2 loses digits if a and e are
        nearly equal. The identity (a - e)(a + e) = L^2 g, where g is a sum of non-negative terms,
        avoids this cancellation: nu = g / (a + e).

        Args:
            halves: Result of `Transmission.half_angles`.
            slopes: mu' / 2 and mu'' / 2.
            square: L^2, m^2.

        Returns:
            (1 - nu) / 2, and its derivative with respect to the crank angle.
        """
        (S, C, sin_m, cos_m, u, v), (turn, bend) = halves, slopes
        kappa = self.transmission.kappa
        p, q = self.transmission.cos_squared.least, self.transmission.sin_squared.least
        (diff_dr, sum_dr), (diff_bc, _) = self.ground, self.dyad
        # 1 - u^2 and 1 - v^2, and half the derivatives of u^2 and v^2.
        lack_u, lack_v = p / (cos_m * cos_m), q / (sin_m * sin_m)
        half_u, half_v = (
            -0.5 * u * lack_u * kappa * S / cos_m,
            0.5 * v * lack_v * kappa * C / sin_m,
        )
        dr, bc = sum_dr * sum_dr, diff_bc * diff_bc
        g = dr * lack_v + bc * lack_u * (v * v)
        g_slope = 2 * (bc * (lack_u * half_v - v * v * half_u) - dr * half_v)
        a, e = diff_dr * sum_dr, 2 * self.moment * turn
        growth = ZERO if self.length is None else self.length[1]
        e_slope, square_slope = 2 * self.moment * bend, growth * (S * C)
        same_sign = a * e > 0
        top, bottom = where(same_sign, g, a - e), where(same_sign, a + e, square)
        top_slope = where(same_sign, g_slope, -e_slope)
        nu = top / bottom
        nu_slope = (top_slope - nu * where(same_sign, e_slope, square_slope)) / bottom
        return 0.5 * (1.0 - nu), -0.5 * nu_slope


class ByRocker(NamedTuple):
    """The kinematic constants of a four-bar linkage with the rocker angle as its coordinate.

    This angle determines the motion at the dead centres of a crank that cannot turn fully.

    Attributes:
        reversed: Constants of the reversed linkage. Its crank is this linkage's rocker, and its
            coupler points from B to A.
    """

    reversed: Loop

    def pose(self, q: tuple[Real, ...]) -> Pose:
        """Computes the pose at a rocker angle, rad."""
        (rocker, coupler, crank), sines = self.reversed.pose(q)
        back = -coupler.direction
        angle = atan2(back.y, back.x)
        return Pose((crank, coupler._replace(position=angle, direction=back), rocker), sines)


@dataclass(frozen=True, repr=False)
class FourBar(Mechanism):
    """A four-bar linkage: crank A0-A, coupler A-B, rocker B0-B, frame A0-B0.

    Attributes:
        frame: The fixed link.
        crank: Driven link, from A0, the origin.
        coupler: Floating link, from the crank pin A to B.
        rocker: Output link, from B0.
        assembly: 'open' if B lies to the left of the line from A to B0, 'crossed' if to the
            right. For a linkage with change points, this holds at crank angles from 0 to pi,
            measured from the frame's angle reduced by whole turns to [-pi, pi].
        gravity: Acceleration of gravity [x, y], m/s^2.
        loads: Loads, such as `Force` and `Friction`.
        dyads: Dyads that the linkage carries.
        points: Traced points of its links.
    """

    other_coordinates: ClassVar[tuple[str, ...]] = ('rocker',)

    frame: Frame
    crank: Body
    coupler: Body
    rocker: Body
    assembly: str = quantity(
        'choice', 'side of the coupler-rocker pin', choices=(OPEN, CROSSED), default=OPEN
    )
    gravity: tuple[float, float] = gravity_quantity()
    loads: Sequence[AppliedLoad] = loads_field()
    dyads: Sequence[Dyad] = dyads_field()
    points: Sequence[TracedPoint] = points_field()

    def require_closed(self) -> None:
        """See `Mechanism.require_closed`.

        Raises:
            MechanismError: One link is longer than the others together.
        """
        longest, *others = sorted(self._lengths(), reverse=True)
        if short_sum(longest, longest, *(-other for other in others)) > 0:
            lack = math.fsum((longest, *(-other for other in others)))
            names = 'the crank', 'the coupler', 'the rocker', 'the frame'
            name = names[self._lengths().index(longest)]
            raise MechanismError(
                f'the longest link, {name}, {longest:g} m, is longer than the other three '
                f'together by {lack:.6g} m: the loop cannot close; shorten it or lengthen the '
                'others'
            )

    def _lengths(self) -> tuple[float, float, float, float]:
        return self.crank.length, self.coupler.length, self.rocker.length, self.frame.length

    def _sums(self) -> dict[str, tuple[float, ...]]:
        """Returns the terms of the length sums that vanish at change points, keyed by formula."""
        r, b, c, d = self._lengths()
        return {
            'coupler + rocker - frame - crank': (b, c, -d, -r),
            'frame + rocker - crank - coupler': (d, c, -r, -b),
            'frame + coupler - crank - rocker': (d, b, -r, -c),
        }

    @property
    def grashof(self) -> str:
        """The Grashof class of the linkage.

        One of 'crank-rocker', 'double-crank', 'rocker-crank', 'double-rocker', 'triple-rocker'
        and 'change-point'.
        """
        r, b, c, d = self._lengths()
        links = {'crank-rocker': r, 'double-rocker': b, 'rocker-crank': c, 'double-crank': d}
        shortest, middle, long, longest = sorted(links.values())
        # Grashof's criterion: (shortest + longest link) - (sum of the other two).
        excess = short_sum(longest, shortest, longest, -middle, -long)
        if excess > 0:
            return 'triple-rocker'
        if excess == 0:
            return 'change-point'
        return min(links, key=lambda name: links[name])

    def loop(self) -> FourBarLoop:
        """Returns the kinematic constants; the coordinate is the crank angle."""
        r, b, c, d = self._lengths()
        longest, side = max(r, b, c, d), 1 if self.assembly == OPEN else -1
        far, near, other = (short_sum(longest, *terms) for terms in self._sums().values())
        ground, (diff_bc, sum_bc) = self._pairs(far, near, other)
        diff_dr, sum_dr = ground
        transmission = self._transmission(far, near, other, sum_dr + sum_bc)
        concentric = diff_dr == 0 and diff_bc == 0
        axis = Vector.at(self.frame.angle)
        return FourBarLoop(
            transmission,
            side,
            axis=axis,
            ground=ground,
            dyad=(diff_bc, side * sum_bc),
            length=None if concentric else (diff_dr * diff_dr, 4 * r * d),
            moment=diff_bc * sum_bc,
            arm=(-r * diff_dr, 2 * r * d),
            quotient=1 if side * transmission.kappa > 0 else -1,
            # If the crank cannot reach theta = 0, L never becomes short.
            close=not transmission.sin_squared.limits and abs(diff_dr) < _CLOSE * sum_dr,
        )

    def _pairs(self, far: float, near: float, other: float) -> tuple[tuple[float, float], ...]:
        """Computes (d - r, d + r) and (b - c, b + c), m, consistent with the short sums."""
        r, b, c, d = self._lengths()
        sum_dr, diff_dr, diff_bc = exact_sum(d, r), exact_sum(d, -r), exact_sum(b, -c)
        if near == 0 and other == 0:
            diff_dr = diff_bc = 0.0
        elif near == 0 or other == 0:
            diff_bc = diff_dr if near == 0 else -diff_dr
        return (diff_dr, sum_dr), (diff_bc, sum_dr if far == 0 else exact_sum(b, c))

    def _transmission(self, far: float, near: float, other: float, around: float) -> Transmission:
        """Creates the transmission from the values of `_sums` and the perimeter `around`, m."""
        r, b, c, d = self._lengths()
        four_bc, delta = 4 * b * c, self.frame.angle
        at_far = exact_sum(d, r, -b, c) * exact_sum(d, r, b, -c) / four_bc
        at_near = exact_sum(b, c, -d, r) * exact_sum(b, c, d, -r) / four_bc
        return Transmission(
            (delta, 0.0),
            sqrt(r * d / (b * c)) * (-1 if nearest_turns(delta) % 2 else 1),
            cos_squared=Square.of(far * around / four_bc, at_near),
            sin_squared=Square.of(near * other / four_bc, at_far),
            refuse=Opaque(lambda crank: self.reach().refuse(crank)),
        )

    def other_loop(self) -> ByRocker:
        """Returns the kinematic constants; the coordinate is the rocker angle."""
        r, b, c, d = self._lengths()
        # Direction from B0 to A0, as a float and its rounding error: the frame's angle plus or
        # minus pi, whichever is closer to 0.
        way = math.copysign(2.0, -self.frame.angle)
        high, error = two_sum(self.frame.angle, way * HALF_PI[0])
        reference = high, error + way * HALF_PI[1]
        loop = FourBar(Frame(d, reference[0]), Body(c), Body(b), Body(r), self.assembly).loop()
        transmission = loop.transmission._replace(reference=reference)
        return ByRocker(
            loop._replace(transmission=transmission, axis=-Vector.at(self.frame.angle))
        )

    def reach(self) -> Reach:
        """Computes the reach of the crank."""
        loop = self.loop()
        pass_by = abs(loop.ground[0]) / (2 * math.sqrt(self.crank.length * self.frame.length))
        return loop.transmission.reach(self.grashof, self._sums(), self._cures(), pass_by)

    def _cures(self) -> Iterator[str]:
        """Yields alternative changes of length that let a limited crank turn fully."""
        r, b, c, d = self._lengths()
        triangle = (b, c, -d), (d, min(b, c), -max(b, c))
        at_most = min(short_sum(max(self._lengths()), *terms) for terms in triangle)
        if at_most > 0:
            yield f'shorten the crank to at most {rounded(at_most, up=False)} m'
        equal = rounded((d + r) / 2, up=True)
        yield f'make coupler and rocker equal, at least {equal} m each'

    def swing_middle(self, what: str, near: float) -> float:
        """Returns the middle of the rocker's swing; see `Mechanism.swing_middle`.

        Raises:
            ConfigurationError: The rocker turns fully.
        """
        lengths, arcs = self._lengths(), self.reach().arcs
        links, _ = self.loop().pose((0.5 * sum(arcs[0]),))
        rocker = links[2].position
        middle = swing_middle(lengths, self.frame.angle, rocker, near if len(arcs) > 1 else None)
        if middle is None:
            raise ConfigurationError(
                f'{what}: the rocker of this {self.grashof} linkage turns fully, so that its '
                'swing has no middle; use a load over crank_angle'
            )
        return middle

    def swing_side(self) -> float | None:
        """See `Mechanism.swing_side`."""
        r, b, c, d = self._lengths()
        longest, angle = max(r, b, c, d), self.frame.angle
        # The rocker's end is too far from the crank pivot, or too close, to be in line with it.
        if short_sum(longest, b, r, -c, -d) < 0:
            return float(wrap(angle + math.pi))
        if abs(short_sum(longest, c, -d)) < abs(short_sum(longest, b, -r)):
            return float(wrap(angle))
        return None

    def loop_structure(self) -> Structure:
        """Returns the links, points and joints; the loop is cut at B."""
        crank, coupler, rocker = self.crank, self.coupler, self.rocker
        A0 = Point.at(0j, 3)
        B0 = Point.at(self.frame.length * direction(self.frame.angle), 3)
        A, B = A0.along(0, crank.length), B0.along(2, rocker.length)
        return Structure(
            (
                Link.turning('crank', crank, 0, A0),
                Link.turning('coupler', coupler, 1, A),
                Link.turning('rocker', rocker, 2, B0),
            ),
            {'A0': A0, 'A': A, 'B': B, 'B0': B0},
            closure=Point.at(-B0.fixed, 3)
            .along(0, crank.length)
            .along(1, coupler.length)
            .along(2, -rocker.length),
            pins=(Pin('A0', None, 0), Pin('A', 0, 1), Pin('B', 1, 2), Pin('B0', None, 2)),
            dyads=((1, 2),),
            other_dyads=((0, 1),),
        )
