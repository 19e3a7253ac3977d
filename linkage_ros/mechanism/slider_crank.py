# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The slider-crank: parameters, mobility and exact pose.

In the guide's axes, the loop equation is eq. 2 of Redaelli 2024, with an added offset e:

    r e^(i alpha) + b e^(i beta) = x + i e

Let mu be the transmission angle between the coupler and the normal of the guide. The imaginary
parts give cos mu = sin beta = (e - r sin alpha) / b. With theta = alpha + pi/2, this is the same
map as for a four-bar (`transmission`),

    cos^2(mu/2) = (b+e-r)/2b + (r/b) cos^2(theta/2)
    sin^2(mu/2) = (b-e-r)/2b + (r/b) sin^2(theta/2)

from which beta = pi/2 -+ mu and x = r cos alpha + b cos beta follow without division.

If the slider is driven, its position x gives h, half the angle alpha - beta (`driven_slide`):

    e^(i (alpha + beta)/2) = (x + i e) [(r+b) cos h - i (r-b) sin h] / L^2       L^2 = x^2 + e^2
    h' = -x / [4rb sin h cos h]
    alpha' = [2b ((r+b) cos^2 h - (r-b) sin^2 h) h' - e] / L^2
    beta' = -[2r ((r+b) cos^2 h + (r-b) sin^2 h) h' + e] / L^2

and the second derivatives, with h'' in the place of h' and x (alpha' + beta') in that of e. If
r = b and e = 0, (alpha + beta)/2 is the guide's direction. These formulas were derived for this
project.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import ClassVar, NamedTuple

from linkage_ros.errors import ConfigurationError, MechanismError
from linkage_ros.formulas import ZERO, Opaque, Vector, atan2, sqrt, turned
from linkage_ros.mechanism.base import Description
from linkage_ros.mechanism.driven_slide import CRANK, SlideDriven, Triangle
from linkage_ros.mechanism.dyads import Dyad, dyads_field
from linkage_ros.mechanism.kinematics import LinkPose, Pose, Reach, Stroke
from linkage_ros.mechanism.loads import loads_field
from linkage_ros.mechanism.loads.base import AppliedLoad
from linkage_ros.mechanism.parts import (
    CROSSED,
    OPEN,
    Body,
    Guide,
    Slider,
    TracedPoint,
    gravity_quantity,
    points_field,
)
from linkage_ros.mechanism.structure import Link, Pin, Point, Structure, direction
from linkage_ros.mechanism.transmission import Square, Transmission
from linkage_ros.numeric import (
    HALF_PI,
    Real,
    nearest_turns,
    rounded,
    short_sum,
    two_sum,
)
from linkage_ros.quantities import quantity

SLIDER = 'slider'  # value of `input` if the slider is driven


class SliderCrankLoop(NamedTuple):
    """The kinematic constants of a slider-crank.

    Attributes:
        transmission: Map from crank angle to transmission angle.
        side: 1 for the open assembly, -1 for the crossed one.
        guide: Cosine and sine of the guide's direction.
        crank: Length r of the crank, m.
        coupler: Length b of the coupler, m.
        offset: Offset e of the guide, m.
    """

    transmission: Transmission
    side: int
    guide: Vector
    crank: float
    coupler: float
    offset: float

    def pose(self, q: tuple[Real, ...]) -> Pose:
        """Computes the pose of crank, coupler and slider at a crank angle, rad."""
        (angle,) = q
        r, b, guide = self.crank, self.coupler, self.guide
        halves = self.transmission.half_angles(angle)
        sin_h, cos_h, sin_m, cos_m, *_ = halves
        half_sin_mu, cos_mu = sin_m * cos_m, (cos_m - sin_m) * (cos_m + sin_m)
        two_b = 2 * self.side * b
        # b e^(i beta) in the axes of base_link.
        x = guide.x * two_b * half_sin_mu - guide.y * b * cos_mu
        y = guide.x * b * cos_mu + guide.y * two_b * half_sin_mu
        # In the guide's axes: r e^(i alpha) and b e^(i beta).
        crank = Vector(2 * r * (sin_h * cos_h), r * ((sin_h - cos_h) * (sin_h + cos_h)))
        coupler = Vector(two_b * half_sin_mu, b * cos_mu)
        # First and second derivatives of beta, and of the slider's position.
        mu_1, mu_2 = self.transmission.slopes(halves)
        beta_1, beta_2 = -self.side * mu_1, -self.side * mu_2
        slide_1 = -(crank.y + coupler.y * beta_1)
        slide_2 = -(crank.x + coupler.x * (beta_1 * beta_1) + coupler.y * beta_2)
        along, across = guide.x / r, guide.y / r
        over_b = 1 / b
        return Pose(
            (
                LinkPose(angle, turned(crank, along, across), (1.0,), (ZERO,)),
                LinkPose(atan2(y, x), Vector(over_b * x, over_b * y), (beta_1,), (beta_2,)),
                LinkPose(crank.x + coupler.x, guide, (slide_1,), (slide_2,)),
            ),
            (2 * self.side * half_sin_mu,),
        )


class BySlider(NamedTuple):
    """The kinematic constants of a slider-crank with the slider's position as its coordinate.

    This position determines the motion at the dead centres of a crank that cannot turn fully.

    Attributes:
        side: 1 if the crank pin lies to the left of the line from A0 to B, -1 if to the right;
            with a change point, this holds at positive positions.
        guide: Cosine and sine of the guide's direction.
        lengths: Lengths r and b of crank and coupler, m.
        ground: r - b, ZERO if equal, and r + b, m.
        offset: Offset e of the guide, m.
        growth: 2 sqrt(r b), m.
        triangle: The triangle A0, A, B.
        refuse: Function that rejects a position of the slider.
    """

    side: int
    guide: Vector
    lengths: tuple[float, float]
    ground: tuple[Real, float]
    offset: float
    growth: float
    triangle: Triangle
    refuse: Opaque

    def pose(self, q: tuple[Real, ...]) -> Pose:
        """Computes the pose at a position of the slider, m.

        h is half the angle from coupler to crank, and x_1 and x_2 are derivatives of x with
        respect to the position.
        """
        (slide,) = q
        side, least = self.side, self.triangle.least
        scaled_cos, scaled_sin = self.triangle.roots(slide, self.refuse)
        cos_h, sin_h = scaled_cos / self.growth, side * scaled_sin / self.growth
        ratio = 1.0 if least is ZERO else slide / scaled_cos
        change = ratio * slide / (scaled_sin * scaled_sin)
        if least is not ZERO:
            change = change - least / (scaled_cos * scaled_cos * scaled_cos)
        h_1, h_2 = -side * ratio / scaled_sin, -side * change / scaled_sin
        half_way, alphas, betas = self._directions(slide, (cos_h, sin_h), (h_1, h_2))
        links = []
        for sine, (first, second) in ((sin_h, alphas), (-sin_h, betas)):
            direction = turned(turned(half_way, cos_h, sine), self.guide.x, self.guide.y)
            position = atan2(direction.y, direction.x)
            links.append(LinkPose(position, direction, (first,), (second,)))
        links.append(LinkPose(slide, self.guide, (1.0,), (ZERO,)))
        return Pose(tuple(links), (-2 * sin_h * cos_h,))

    def _directions(
        self, slide: Real, half: tuple[Real, Real], slopes: tuple[Real, Real]
    ) -> tuple[Vector, tuple[Real, Real], tuple[Real, Real]]:
        """Computes the mean direction of crank and coupler, and the slopes of both directions.

        Args:
            slide: Position of the slider, m.
            half: Cosine and sine of h.
            slopes: h' and h''.

        Returns:
            e^(i (alpha + beta)/2) in the guide's axes; alpha' and alpha''; beta' and beta''.
        """
        (r, b), e, (cos_h, sin_h), (h_1, h_2) = self.lengths, self.offset, half, slopes
        diff_rb, sum_rb = self.ground
        if diff_rb is ZERO and self.triangle.least is ZERO:  # A0 and B can meet
            return Vector(1.0, ZERO), (h_1, h_2), (-h_1, -h_2)
        over_square = 1.0 / (slide * slide + e * e)
        half_way = turned(Vector(slide, e), sum_rb * cos_h, -diff_rb * sin_h) * over_square
        cos_squared, sin_squared = cos_h * cos_h, sin_h * sin_h
        of_crank = 2 * b * (sum_rb * cos_squared - diff_rb * sin_squared)
        of_coupler = 2 * r * (sum_rb * cos_squared + diff_rb * sin_squared)
        alpha_1 = (of_crank * h_1 - e) * over_square
        beta_1 = (-of_coupler * h_1 - e) * over_square
        e_2 = slide * (alpha_1 + beta_1)  # in the place of e in the second derivatives
        alpha_2 = (of_crank * h_2 - e_2) * over_square
        beta_2 = (-of_coupler * h_2 - e_2) * over_square
        return half_way, (alpha_1, alpha_2), (beta_1, beta_2)


@dataclass(frozen=True, repr=False)
class SliderCrank(SlideDriven):
    """A slider-crank: crank A0-A, coupler A-B, slider at B on a straight guide.

    Attributes:
        crank: Link from A0, the origin; driven, or the output link of a driven slider.
        coupler: Connecting rod, from the crank pin A to B.
        slider: Output link or driven link, at B. Its position is measured along the guide from
            the foot of the perpendicular from A0.
        frame: Fixed link with the direction of the guide.
        assembly: 'open' if the slider is ahead of the crank pin when the crank points along the
            guide, 'crossed' if the slider is behind it. With a change point, this holds at the
            guide's angle reduced by whole turns to [-pi, pi]. If the slider is driven: side of the
            crank pin A from the line from A0 to B, 'open' for left, 'crossed' for right; with a
            change point, this holds at positive positions of the slider.
        gravity: Acceleration of gravity [x, y], m/s^2.
        loads: Loads, such as `Force` and `Friction`.
        dyads: Dyads that the linkage carries.
        points: Traced points of its links.
        input: Driven joint: 'crank' or 'slider'.
    """

    slide: ClassVar[str] = 'slider'
    slide_input: ClassVar[str] = SLIDER

    crank: Body
    coupler: Body
    slider: Slider = field(default_factory=Slider)
    frame: Guide = field(default_factory=Guide)
    assembly: str = quantity(
        'choice', 'side of the crank pin on which the slider is; with input: slider, side of the '
        'pin A from the line from A0 to B', choices=(OPEN, CROSSED), default=OPEN,
    )  # fmt: skip
    gravity: tuple[float, float] = gravity_quantity()
    loads: Sequence[AppliedLoad] = loads_field()
    dyads: Sequence[Dyad] = dyads_field()
    points: Sequence[TracedPoint] = points_field()
    input: str = quantity('choice', 'driven joint', choices=(CRANK, SLIDER), default=CRANK)

    def require_closed(self) -> None:
        """See `Mechanism.require_closed`.

        Raises:
            MechanismError: The offset is too large.
        """
        r, b, e = self._lengths()
        beyond = short_sum(self._longest(), abs(e), -r, -b)
        if beyond == 0 and self.drives_slide:
            raise MechanismError(
                f'the offset of the slider, {e:g} m, is equal to crank + coupler, so that the '
                'slider cannot move; bring the offset nearer to 0, or lengthen crank or coupler'
            )
        if beyond > 0:
            raise MechanismError(
                f'the offset of the slider, {e:g} m, is farther from 0 than crank + coupler, by '
                f'{math.fsum((abs(e), -r, -b)):.6g} m: the loop cannot close; bring the offset '
                'nearer to 0, or lengthen crank or coupler'
            )

    def _lengths(self) -> tuple[float, float, float]:
        return self.crank.length, self.coupler.length, self.slider.offset

    def _longest(self) -> float:
        return max(*map(abs, self._lengths()))

    def _sums(self) -> dict[str, tuple[float, ...]]:
        """Returns the terms of the length sums that vanish at change points, keyed by formula."""
        r, b, e = self._lengths()
        return {
            'coupler + offset - crank': (b, e, -r),
            'coupler - offset - crank': (b, -e, -r),
        }

    @property
    def grashof(self) -> str:
        """The Grashof class of the linkage.

        One of 'crank-slider' (the crank turns fully), 'rotating-coupler' (the coupler turns
        fully), 'non-Grashof' (neither turns fully) and 'change-point'.
        """
        r, b, e = self._lengths()
        crank = short_sum(self._longest(), r, abs(e), -b)
        coupler = short_sum(self._longest(), b, abs(e), -r)
        if crank == 0 or coupler == 0:
            return 'change-point'
        if crank < 0:
            return 'crank-slider'
        return 'rotating-coupler' if coupler < 0 else 'non-Grashof'

    def _transmission(self) -> Transmission:
        """Returns the transmission, with the angle 2h measured from the guide's normal."""
        r, b, e = self._lengths()
        longest, guide = self._longest(), self.frame.angle
        p, q = (short_sum(longest, *terms) / (2 * b) for terms in self._sums().values())
        high, error = two_sum(guide, -HALF_PI[0])
        return Transmission(
            reference=(high, error - HALF_PI[1]),
            kappa=sqrt(r / b) * (-1 if nearest_turns(guide) % 2 else 1),
            cos_squared=Square.of(p, most=short_sum(longest, b, e, r) / (2 * b)),
            sin_squared=Square.of(q, most=short_sum(longest, b, -e, r) / (2 * b)),
            refuse=Opaque(lambda crank: self.in_own_terms(self.reach_of_crank()).refuse(crank)),
        )

    def loop_of(self, description: Description) -> SliderCrankLoop | BySlider:
        """Returns the kinematic constants by the crank angle or by the slider's position."""
        (r, b, e), guide = self._lengths(), Vector.at(self.frame.angle)
        side = 1 if description.assembly == OPEN else -1
        if description.coordinates == (CRANK,):
            return SliderCrankLoop(self._transmission(), side, guide, r, b, e)
        return BySlider(
            side,
            guide,
            lengths=(r, b),
            ground=(short_sum(self._longest(), r, -b) or ZERO, r + b),
            offset=e,
            growth=2 * math.sqrt(r * b),
            triangle=self._triangle(),
            refuse=Opaque(lambda x: self.in_own_terms(self.reach_of_slide()).refuse(x)),
        )

    def _triangle(self) -> Triangle:
        r, b, e = self._lengths()
        return Triangle.of((r, b), e)

    def stroke(self, what: str, name: str) -> Stroke:
        """See `Mechanism.stroke`; at its ends, crank and coupler are in line.

        Raises:
            ConfigurationError: The link does not slide, or its stroke has no fixed ends.
        """
        if self.role_of(name) != 'slider':
            return super().stroke(what, name)
        if self.drives_slide:
            crank = self.in_own_names('the crank')
            raise ConfigurationError(
                f'{what}: a gas, a pressure and crank_angle_from_tdc need a stroke whose ends '
                f'{crank} determines, but {name} is driven; use a curve of values over position, '
                f'or let {crank} be the input'
            )
        if self.grashof != 'crank-slider':
            why = self.in_own_names(
                'because the crank does not turn fully with one reversal at each end; lengthen '
                'the coupler'
            )
            raise ConfigurationError(
                f'{what}: this {self.grashof} linkage has no stroke with fixed ends, {why}'
            )
        r, b, _ = self._lengths()
        return Stroke(far=self._end(b + r, 0.0), near=self._end(b - r, math.pi))

    def _end(self, length: float, turn: float) -> tuple[float, float]:
        """Returns an end of the stroke, m, and the crank angle there, rad.

        Args:
            length: Distance of the slider from the crank pivot, m.
            turn: Angle from the line between them to the crank, rad.
        """
        side, e = 1 if self.assembly == OPEN else -1, self.slider.offset
        position = side * math.sqrt((length - e) * (length + e))
        return position, math.atan2(e, position) + self.frame.angle + turn

    def reach_of_slide(self) -> Reach:
        """See `SlideDriven`."""
        limits = ('crank and coupler are in line at the ends of its stroke',)
        arcs = self._triangle().arcs()
        return Reach('slider-crank', arcs, period_turns=0, limits=limits, driven=SLIDER)

    def reach_of_crank(self) -> Reach:
        """See `SlideDriven`."""
        return self._transmission().reach(self.grashof, self._sums(), self._cures())

    def _cures(self) -> Iterator[str]:
        """Yields alternative changes of length that let a limited crank turn fully."""
        r, b, e = self._lengths()
        yield f'lengthen the coupler to at least {rounded(r + abs(e), up=True)} m'
        if (shorter := short_sum(self._longest(), b, -abs(e))) > 0:
            yield f'shorten the crank to at most {rounded(shorter, up=False)} m'

    def loop_structure(self) -> Structure:
        """Returns the links, points and joints; the loop is cut at B."""
        crank, coupler, slider = self.crank, self.coupler, self.slider
        foot = 1j * slider.offset * direction(self.frame.angle)
        A0 = Point.at(0j, 3)
        A = A0.along(0, crank.length)
        B = A.along(1, coupler.length)
        return Structure(
            (
                Link.turning('crank', crank, 0, A0),
                Link.turning('coupler', coupler, 1, A),
                Link(
                    'slider', slider.mass, 0.0, B,
                    origin=foot, angle=self.frame.angle, slides=True,
                ),
            ),
            {'A0': A0, 'A': A, 'B': B},
            closure=B,
            pins=(Pin('A0', None, 0), Pin('A', 0, 1), Pin('B', 1, 2)),
            dyads=((0, 1),) if self.drives_slide else ((1, 2),),
            other_dyads=((1, 2),) if self.drives_slide else ((0, 1),),
            driven=2 if self.drives_slide else 0,
        )  # fmt: skip
