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
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, ClassVar, NamedTuple, NoReturn

from linkage_ros.errors import ConfigurationError, MechanismError, UnreachableError
from linkage_ros.formulas import ZERO, Opaque, Vector, atan2, dot, require, sqrt, turned
from linkage_ros.mechanism.base import Mechanism
from linkage_ros.mechanism.dyads import dyads_field
from linkage_ros.mechanism.kinematics import LinkPose, Pose, Reach, Stroke, bends, directions
from linkage_ros.mechanism.loads import loads_field
from linkage_ros.mechanism.parts import (
    CROSSED,
    OPEN,
    Body,
    Coupler,
    Guide,
    Slider,
    gravity_quantity,
)
from linkage_ros.mechanism.structure import Link, Pin, Point, Structure, coupler_point, direction
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


class SliderCrankLoop(NamedTuple):
    """The kinematic constants of a slider-crank.

    Attributes:
        transmission: Map from crank angle to transmission angle.
        side: 1 for the open assembly, -1 for the crossed one.
        guide: Cosine and sine of the guide's direction.
        crank: Length r of the crank, m.
        coupler: Length b of the coupler, m.
        offset: Offset e of the guide, m.
        refuse: Function that rejects a position of the slider.
    """

    transmission: Transmission
    side: int
    guide: Vector
    crank: float
    coupler: float
    offset: float
    refuse: Opaque

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


class BySlider(SliderCrankLoop):
    """The kinematic constants of a slider-crank with the slider's position as its coordinate.

    This position determines the motion at the dead centres of a crank that cannot turn fully.
    `side` is 1 if the crank pin lies to the left of the line from A0 to B, -1 if to the right.
    """

    def pose(self, q: tuple[Real, ...]) -> Pose:
        """Computes the pose at a position of the slider, m."""
        (slide,) = q
        r, b, e, guide = self.crank, self.coupler, self.offset, self.guide
        square = slide * slide + e * e
        stretch, fold = (r + b) * (r + b) - square, square - (r - b) * (r - b)
        require(stretch > 0, self.refuse, slide)
        require(fold > 0, self.refuse, slide)
        root = self.side * (sqrt(stretch) * sqrt(fold))
        # In the guide's axes.
        crank, coupler = directions(Vector(slide, e), square, root, r, b)
        over_r, over_b, cosine = 2 * b / root, 2 * r / root, dot(crank, coupler)
        one, other = -coupler.x * over_r, crank.x * over_b
        squares = one * one, other * other
        bend, other_bend = bends((r, b), (over_r, over_b), cosine, squares)
        links = []
        for link, rate, change in ((crank, one, bend), (coupler, other, other_bend)):
            way = turned(link, guide.x, guide.y)
            links.append(LinkPose(atan2(way.y, way.x), way, (rate,), (change,)))
        return Pose((*links, LinkPose(slide, guide, (1.0,), (ZERO,))), (root / (-2 * r * b),))


@dataclass(frozen=True)
class SliderCrank(Mechanism):
    """A slider-crank: crank A0-A, coupler A-B, slider at B on a straight guide.

    Attributes:
        crank: Driven link, from A0, the origin.
        coupler: Connecting rod, from the crank pin A to B.
        slider: Output link, at B. Its position is measured along the guide from the foot of the
            perpendicular from A0.
        frame: Fixed link with the direction of the guide.
        assembly: 'open' if the slider is ahead of the crank pin when the crank points along the
            guide, 'crossed' if the slider is behind it. With a change point, this holds at the
            guide's angle reduced by whole turns to [-pi, pi].
        gravity: Acceleration of gravity [x, y], m/s^2.
        loads: Loads, such as `Force` and `Friction`.
        dyads: Dyads that the linkage carries.
    """

    other_coordinates: ClassVar[tuple[str, ...]] = ('slider',)

    crank: Body
    coupler: Coupler
    slider: Slider = field(default_factory=Slider)
    frame: Guide = field(default_factory=Guide)
    assembly: str = quantity(
        'choice', 'side of the crank pin on which the slider is', choices=(OPEN, CROSSED),
        default=OPEN,
    )  # fmt: skip
    gravity: tuple[float, float] = gravity_quantity()
    loads: tuple[Any, ...] = loads_field()
    dyads: tuple[Any, ...] = dyads_field()

    def require_closed(self) -> None:
        """See `Mechanism.require_closed`.

        Raises:
            MechanismError: The offset is too large.
        """
        r, b, e = self._lengths()
        if short_sum(self._longest(), abs(e), -r, -b) > 0:
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
        r, b, e = self._lengths()
        longest, guide = self._longest(), self.frame.angle
        far, near = (short_sum(longest, *terms) for terms in self._sums().values())
        high, low = two_sum(guide, -HALF_PI[0])
        return Transmission(
            (high, low - HALF_PI[1]),
            sqrt(r / b) * (-1 if nearest_turns(guide) % 2 else 1),
            cos=Square.of(far / (2 * b), short_sum(longest, b, e, r) / (2 * b)),
            sin=Square.of(near / (2 * b), short_sum(longest, b, -e, r) / (2 * b)),
            refuse=Opaque(lambda crank: self.reach().refuse(crank)),
        )

    def loop(self) -> SliderCrankLoop:
        """Returns the kinematic constants; the coordinate is the crank angle."""
        transmission, guide = self._transmission(), Vector.at(self.frame.angle)
        lengths, side = self._lengths(), 1 if self.assembly == OPEN else -1
        return SliderCrankLoop(transmission, side, guide, *lengths, Opaque(self._refuse_slide))

    def other_loop(self) -> BySlider:
        """Returns the kinematic constants; the coordinate is the slider's position."""
        return BySlider(*self.loop())

    def _refuse_slide(self, slide: float) -> NoReturn:
        raise UnreachableError(
            f'with the slider at {slide:.9g} m, crank and coupler do not reach it or are in line',
            crank_angle=math.nan,
            arcs=(),
        )

    def stroke(self, what: str, name: str) -> Stroke:
        """See `Mechanism.stroke`; at its ends, crank and coupler are in line.

        Raises:
            ConfigurationError: The link does not slide, or its stroke has no fixed ends.
        """
        if name != 'slider':
            return super().stroke(what, name)
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

    def reach(self) -> Reach:
        """Computes the reach of the crank."""
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
            {'A0': A0, 'A': A, 'B': B, **coupler_point(coupler, A)},
            closure=B,
            pins=(Pin('A0', None, 0), Pin('A', 0, 1), Pin('B', 1, 2)),
            dyads=((1, 2),),
            other_dyads=((0, 1),),
        )  # fmt: skip
