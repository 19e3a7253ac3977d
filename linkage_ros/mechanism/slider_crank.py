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
    gravity_quantity,
)
from linkage_ros.mechanism.points import TracedPoint, points_field
from linkage_ros.mechanism.structure import Link, Pin, Point, Structure, direction
from linkage_ros.mechanism.transmission import Square, Transmission
from linkage_ros.numeric import (
    HALF_PI,
    Real,
    exact_sum,
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
        """Computes the pose at a crank angle.

        Args:
            q: Crank angle, rad, as the only element.

        Returns:
            The pose of crank, coupler and slider.
        """
        (angle,) = q
        r, b, guide = self.crank, self.coupler, self.guide
        halves = self.transmission.half_angles(angle)
        S, C, sin_m, cos_m, *_ = halves
        # Half of sin mu, and cos mu.
        sine, cosine = sin_m * cos_m, (cos_m - sin_m) * (cos_m + sin_m)
        two_b = 2 * self.side * b
        x = guide.x * two_b * sine - guide.y * b * cosine
        y = guide.x * b * cosine + guide.y * two_b * sine
        # In the guide's axes: r e^(i alpha) and b e^(i beta).
        crank = Vector(2 * r * (S * C), r * ((S - C) * (S + C)))
        coupler = Vector(two_b * sine, b * cosine)
        first, second = self.transmission.slopes(halves)
        turn, bend = -self.side * first, -self.side * second
        slope = -(crank.y + coupler.y * turn)
        curvature = -(crank.x + coupler.x * (turn * turn) + coupler.y * bend)
        along, across = guide.x / r, guide.y / r
        over_b = 1 / b
        return Pose(
            (
                LinkPose(angle, turned(crank, along, across), (1.0,), (ZERO,)),
                LinkPose(atan2(y, x), Vector(over_b * x, over_b * y), (turn,), (bend,)),
                LinkPose(crank.x + coupler.x, guide, (slope,), (curvature,)),
            ),
            (2 * self.side * sine,),
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
        """Computes the pose at a position of the slider, m."""
        (slide,) = q
        (r, b), e, side, least = self.lengths, self.offset, self.side, self.triangle.least
        fold, stretch = self.triangle.roots(slide, self.refuse)
        cosine, sine = fold / self.growth, side * stretch / self.growth
        # h' and h''.
        slope = 1.0 if least is ZERO else slide / fold
        change = slope * slide / (stretch * stretch)
        if least is not ZERO:
            change = change - least / (fold * fold * fold)
        turn, bend = -side * slope / stretch, -side * change / stretch
        near, far = self.ground
        if near is ZERO and least is ZERO:  # A0 and B can meet
            half_way, slopes, bends = Vector(1.0, ZERO), (turn, -turn), (bend, -bend)
        else:
            over = 1.0 / (slide * slide + e * e)
            half_way = turned(Vector(slide, e), far * cosine, -near * sine) * over
            square, other = cosine * cosine, sine * sine
            one, two = 2 * b * (far * square - near * other), 2 * r * (far * square + near * other)
            slopes = (one * turn - e) * over, (-two * turn - e) * over
            both = slide * (slopes[0] + slopes[1])
            bends = (one * bend - both) * over, (-two * bend - both) * over
        links = []
        for across, rate, second in zip((sine, -sine), slopes, bends, strict=True):
            way = turned(turned(half_way, cosine, across), self.guide.x, self.guide.y)
            links.append(LinkPose(atan2(way.y, way.x), way, (rate,), (second,)))
        return Pose((*links, LinkPose(slide, self.guide, (1.0,), (ZERO,))), (-2 * sine * cosine,))


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
            refuse=Opaque(lambda crank: self.reach_of_crank().refuse(crank)),
        )

    def loop_of(self, description: Description) -> SliderCrankLoop | BySlider:
        """Returns the kinematic constants by the crank angle or by the slider's position."""
        (r, b, e), guide = self._lengths(), Vector.at(self.frame.angle)
        side = 1 if description.assembly == OPEN else -1
        if description.coordinates == (CRANK,):
            return SliderCrankLoop(self._transmission(), side, guide, r, b, e)
        ground = short_sum(self._longest(), r, -b) or ZERO, exact_sum(r, b)
        return BySlider(
            side, guide, (r, b), ground, e, 2 * math.sqrt(r * b), self._triangle(),
            Opaque(lambda x: self.reach_of_slide().refuse(x)),
        )  # fmt: skip

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
            raise ConfigurationError(
                f'{what}: a gas, a pressure and crank_angle_from_tdc need a stroke whose ends the '
                f'crank determines, but {name} is driven; use a curve of values over position, or '
                'let the crank be the input'
            )
        if self.grashof != 'crank-slider':
            raise ConfigurationError(
                f'{what}: this {self.grashof} linkage has no stroke with fixed ends, because its '
                'crank does not turn fully with one reversal at each end; lengthen the coupler'
            )
        (r, b, e), side = self._lengths(), 1 if self.assembly == OPEN else -1
        found = []
        for length, turn in ((b + r, 0.0), (b - r, math.pi)):
            at = side * math.sqrt((length - e) * (length + e))
            found.append((at, math.atan2(e, at) + self.frame.angle + turn))
        far, near = found
        return Stroke(far, near)

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
