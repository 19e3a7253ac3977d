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

In the code, h = theta/2, m = mu/2, and x_1 and x_2 are the first and second derivatives of x with
respect to the crank angle.

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
    TracedPoint,
    gravity_quantity,
    points_field,
)
from linkage_ros.mechanism.structure import Link, Pin, Point, Structure, direction
from linkage_ros.mechanism.transmission import HalfAngles, Square, Transmission, swing_middle
from linkage_ros.numeric import (
    HALF_PI,
    Real,
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
        """Computes the pose of crank, coupler and rocker at a crank angle, rad."""
        (crank,) = q
        halves = self.transmission.half_angles(crank)
        half_way = turned(self.axis, halves.cos_h, halves.sin_h)  # e^(i (delta + h))
        m_1, m_2 = self.transmission.slopes(halves, 0.5)
        if self.side < 0:
            m_1, m_2 = -m_1, -m_2
        mean, mean_1, mean_2 = self._mean_direction(half_way, halves, (m_1, m_2))
        # The coupler is turned by -m, the rocker by +m from their mean direction.
        cos_m, signed_sin_m = halves.cos_m, self.side * halves.sin_m
        coupler = Vector(
            mean.x * cos_m + mean.y * signed_sin_m, mean.y * cos_m - mean.x * signed_sin_m
        )
        rocker = Vector(
            mean.x * cos_m - mean.y * signed_sin_m, mean.y * cos_m + mean.x * signed_sin_m
        )
        crank_direction = turned(half_way, halves.cos_h, halves.sin_h)
        return Pose(
            (
                LinkPose(crank, crank_direction, (1.0,), (ZERO,)),
                LinkPose(atan2(coupler.y, coupler.x), coupler, (mean_1 - m_1,), (mean_2 - m_2,)),
                LinkPose(atan2(rocker.y, rocker.x), rocker, (mean_1 + m_1,), (mean_2 + m_2,)),
            ),
            (2 * (signed_sin_m * cos_m),),  # sin mu
        )

    def _mean_direction(
        self, half_way: Vector, halves: HalfAngles, m_slopes: tuple[Real, Real]
    ) -> tuple[Vector, Real, Real]:
        """Computes the mean direction of coupler and rocker, (beta + gamma) / 2.

        `half_way` is e^(i (delta + h)); `m_slopes` are m' and m''.

        Returns:
            The unit vector, and the first and second derivatives of its angle, the first of which
            is (1 - nu) / 2.
        """
        if self.length is None:
            return half_way * self.quotient, 0.5, ZERO
        sin_h, cos_h, sin_m, cos_m, *_ = halves
        m_1, m_2 = m_slopes
        # The brackets in the two equations of the triangles.
        diff_dr, sum_dr = self.ground
        diff_bc, sum_bc = self.dyad
        ground = Vector(diff_dr * cos_h, sum_dr * sin_h)
        dyad = Vector(diff_bc * cos_m, sum_bc * sin_m)
        nearest, growth = self.length
        over_square = 1.0 / (nearest + growth * (sin_h * sin_h))  # 1 / L^2
        mean = turned(half_way, over_square * dot(ground, dyad), over_square * cross(ground, dyad))
        if self.close:
            return mean, *self._mean_near_pivot(halves, m_slopes)
        # (1 - nu) / 2 = [r (r - d cos theta) + (b-c)(b+c) mu'/2] / L^2
        arm, arm_growth = self.arm
        mean_1 = over_square * (arm + arm_growth * (sin_h * sin_h) + self.moment * m_1)
        mean_2 = over_square * (
            (arm_growth - mean_1 * growth) * (sin_h * cos_h) + self.moment * m_2
        )
        return mean, mean_1, mean_2

    def _mean_near_pivot(
        self, halves: HalfAngles, m_slopes: tuple[Real, Real]
    ) -> tuple[Real, Real]:
        """Computes (1 - nu) / 2 and its derivative where A is close to B0, so that L << d.

        With a = (d-r)(d+r) and e = (b-c)(b+c) mu', nu = (a - e) / L^2 loses digits if a and e are
        nearly equal. The identity (a - e)(a + e) = L^2 g, where g is a sum of non-negative terms,
        avoids this cancellation: nu = g / (a + e). The derivative is with respect to the crank
        angle.
        """
        sin_h, cos_h, sin_m, cos_m, u, v = halves
        m_1, m_2 = m_slopes
        kappa = self.transmission.kappa
        p, q = self.transmission.cos_squared.least, self.transmission.sin_squared.least
        (diff_dr, sum_dr), (diff_bc, _) = self.ground, self.dyad
        # 1 - u^2 and 1 - v^2 without cancellation, and half the derivatives of u^2 and v^2.
        one_less_uu, one_less_vv = p / (cos_m * cos_m), q / (sin_m * sin_m)
        u_u_1 = -0.5 * u * one_less_uu * kappa * sin_h / cos_m
        v_v_1 = 0.5 * v * one_less_vv * kappa * cos_h / sin_m
        dr, bc = sum_dr * sum_dr, diff_bc * diff_bc
        g = dr * one_less_vv + bc * one_less_uu * (v * v)
        g_1 = 2 * (bc * (one_less_uu * v_v_1 - v * v * u_u_1) - dr * v_v_1)
        a = diff_dr * sum_dr
        e, e_1 = 2 * self.moment * m_1, 2 * self.moment * m_2
        nearest, growth = self.length or (ZERO, ZERO)
        square, square_1 = nearest + growth * (sin_h * sin_h), growth * (sin_h * cos_h)
        # g / (a + e), or (a - e) / L^2 where these do not cancel.
        same_sign = a * e > 0
        top, bottom = where(same_sign, g, a - e), where(same_sign, a + e, square)
        top_1, bottom_1 = where(same_sign, g_1, -e_1), where(same_sign, e_1, square_1)
        nu = top / bottom
        nu_1 = (top_1 - nu * bottom_1) / bottom
        return 0.5 * (1.0 - nu), -0.5 * nu_1


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
        (diff_dr, sum_dr), (diff_bc, sum_bc) = self._pairs(far, near, other)
        transmission = self._transmission(far, near, other, sum_dr + sum_bc)
        passes_rocker_pivot = diff_dr == 0 and diff_bc == 0
        # If the crank cannot reach theta = 0, L never becomes short.
        reaches_near_end = not transmission.sin_squared.limits
        return FourBarLoop(
            transmission,
            side,
            axis=Vector.at(self.frame.angle),
            ground=(diff_dr, sum_dr),
            dyad=(diff_bc, side * sum_bc),
            length=None if passes_rocker_pivot else (diff_dr * diff_dr, 4 * r * d),
            moment=diff_bc * sum_bc,
            arm=(-r * diff_dr, 2 * r * d),
            quotient=1 if side * transmission.kappa > 0 else -1,
            close=reaches_near_end and abs(diff_dr) < _CLOSE * sum_dr,
        )

    def _pairs(self, far: float, near: float, other: float) -> tuple[tuple[float, float], ...]:
        """Computes (d - r, d + r) and (b - c, b + c), m, consistent with the short sums."""
        r, b, c, d = self._lengths()
        sum_dr, diff_dr, diff_bc = d + r, d - r, b - c
        if near == 0 and other == 0:
            diff_dr = diff_bc = 0.0
        elif near == 0 or other == 0:
            diff_bc = diff_dr if near == 0 else -diff_dr
        return (diff_dr, sum_dr), (diff_bc, sum_dr if far == 0 else b + c)

    def _transmission(self, far: float, near: float, other: float, around: float) -> Transmission:
        """Creates the transmission from the values of `_sums` and the perimeter `around`, m."""
        r, b, c, d = self._lengths()
        four_bc, delta = 4 * b * c, self.frame.angle
        at_far = math.fsum((d, r, -b, c)) * math.fsum((d, r, b, -c)) / four_bc
        at_near = math.fsum((b, c, -d, r)) * math.fsum((b, c, d, -r)) / four_bc
        return Transmission(
            (delta, 0.0),
            sqrt(r * d / (b * c)) * (-1 if nearest_turns(delta) % 2 else 1),
            cos_squared=Square.of(far * around / four_bc, at_near),
            sin_squared=Square.of(near * other / four_bc, at_far),
            refuse=Opaque(lambda crank: self.in_own_terms(self.reach()).refuse(crank)),
        )

    def other_loop(self) -> ByRocker:
        """Returns the kinematic constants; the coordinate is the rocker angle."""
        r, b, c, d = self._lengths()
        # Direction from B0 to A0, as a float and its rounding error: the frame's angle plus or
        # minus pi, whichever is closer to 0.
        half_turns = math.copysign(2.0, -self.frame.angle)  # in units of pi / 2
        high, error = two_sum(self.frame.angle, half_turns * HALF_PI[0])
        reference = high, error + half_turns * HALF_PI[1]
        reversed_linkage = FourBar(Frame(d, high), Body(c), Body(b), Body(r), self.assembly)
        loop = reversed_linkage.loop()
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
            rocker_name = self.in_own_names('the rocker')
            raise ConfigurationError(
                f'{what}: {rocker_name} of this {self.grashof} linkage turns fully, so that its '
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
