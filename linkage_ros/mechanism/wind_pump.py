# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The wind pump: parameters and exact pose at a crank angle and a slider position.

The loop equation is (Deliu and Vlase) l1 e^(i phi1) + l2 e^(i phi2) + l3 e^(i phi3) = xD. Given
the crank pin A and the slider's pin D, coupler and rod form a dyad. With L = |D - A| and
h = phi1 / 2 for xD >= 0 (for xD < 0, use h = (phi1 - pi) / 2 and |xD|), the dyad has the same
factored closed form as the four-bar (docs/mechanisms.md):

    P = (l2+l3)^2 - L^2 = (l2+l3-xD-l1)(l2+l3+xD+l1) + 4 l1 xD cos^2 h
    Q = L^2 - (l2-l3)^2 = (xD-l1-l2+l3)(xD-l1+l2-l3) + 4 l1 xD sin^2 h
    B - A = (D-A) [(l2-l3)(l2+l3) + L^2 + i side sqrt(PQ)] / (2 L^2)

and sin(phi2 - phi3) = side sqrt(PQ) / (2 l2 l3), so no digits are lost near a stretched dyad. The
rates have the form of Deliu and Vlase, phi2' = a11 phi1' + a12 xD', whose coefficients are
misprinted there. They omit the squared-rate terms of the accelerations; they follow from
differentiating the loop equation twice.
"""

import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, NamedTuple, NoReturn

from linkage_ros.errors import UnreachableError
from linkage_ros.formulas import (
    ZERO,
    Opaque,
    Vector,
    atan2,
    cos,
    cross,
    dot,
    require,
    sin,
    sqrt,
    where,
)
from linkage_ros.mechanism.base import Mechanism
from linkage_ros.mechanism.dyads import Dyad, dyads_field
from linkage_ros.mechanism.kinematics import LinkPose, Pose, bends, directions
from linkage_ros.mechanism.loads import loads_field
from linkage_ros.mechanism.loads.base import AppliedLoad
from linkage_ros.mechanism.parts import (
    CROSSED,
    OPEN,
    Body,
    Piston,
    TracedPoint,
    gravity_quantity,
    points_field,
)
from linkage_ros.mechanism.structure import Link, Pin, Point, Structure
from linkage_ros.numeric import Real
from linkage_ros.quantities import quantity
from linkage_ros.units import rad_and_deg

_EPSILON = 2.0**-52


class WindPumpLoop(NamedTuple):
    """The kinematic constants of a wind pump.

    Attributes:
        crank: Length r of the crank, m.
        coupler: Length b of the coupler, m.
        rod: Length c of the rod, m.
        side: 1 for the open assembly, -1 for the crossed one.
        refuse: Function that rejects coordinates.
    """

    crank: float
    coupler: float
    rod: float
    side: int
    refuse: Opaque

    def squares(self, q: tuple[Real, ...]) -> tuple[Real, Real, Real]:
        """Computes P, Q and L^2, m^2; rejects a dyad that cannot close or is collinear."""
        angle, slide = q
        r, b, c = self.crank, self.coupler, self.rod
        half = 0.5 * angle
        sine, cosine = sin(half), cos(half)
        ahead, d = slide >= 0, abs(slide)
        growth, total_length = 4 * r * d, b + c + d + r
        # 4 r d sin^2(theta/2) and 4 r d cos^2(theta/2); theta is the crank angle from the slider.
        near = growth * where(ahead, sine * sine, cosine * cosine)
        far = growth * where(ahead, cosine * cosine, sine * sine)
        one, other = d - r - b + c, d - r + b - c
        stretch, fold = (b + c - d - r) * total_length + far, one * other + near
        # The error of a sum of lengths is about an ulp of their total. The error of a product of
        # such sums shrinks with them, so that a slider may pass through the crank pin.
        ulp = _EPSILON * total_length
        require(stretch > ulp * total_length, self.refuse, *q)
        require(fold > ulp * (abs(one) + abs(other)) + _EPSILON * near, self.refuse, *q)
        return stretch, fold, (d - r) * (d - r) + near

    def pose(self, q: tuple[Real, ...]) -> Pose:
        """Computes the pose of all links at a crank angle, rad, and a slider position, m."""
        angle, slide = q
        r, b, c = self.crank, self.coupler, self.rod
        stretch, fold, square = self.squares(q)
        root = self.side * (sqrt(stretch) * sqrt(fold))
        crank = Vector.at(angle)
        apart = Vector(slide - r * crank.x, -r * crank.y)
        coupler, rod = directions(apart, square, root, b, c)
        # 1 / [l2 sin(phi2 - phi3)] and 1 / [l3 sin(phi2 - phi3)].
        over_b, over_c = 2 * c / root, 2 * b / root
        cos23 = dot(coupler, rod)
        a11, a12 = r * cross(crank, rod) * over_b, -rod.x * over_b
        a21, a22 = r * cross(coupler, crank) * over_c, coupler.x * over_c

        bend = functools.partial(bends, (b, c), (over_b, over_c), cos23)
        by_crank = bend((a11 * a11, a21 * a21), (r * dot(crank, rod), r * dot(crank, coupler)))
        mixed = bend((2 * a11 * a12, 2 * a21 * a22))
        by_slide = bend((a12 * a12, a22 * a22))
        coupler_bends, rod_bends = zip(by_crank, mixed, by_slide, strict=True)
        return Pose(
            (
                LinkPose(angle, crank, (1.0, ZERO), (ZERO, ZERO, ZERO)),
                LinkPose(atan2(coupler.y, coupler.x), coupler, (a11, a12), coupler_bends),
                LinkPose(atan2(rod.y, rod.x), rod, (a21, a22), rod_bends),
                LinkPose(slide, Vector(1.0, ZERO), (ZERO, 1.0), (ZERO, ZERO, ZERO)),
            ),
            (root / (-2 * b * c),),
        )


class ByCoupler(WindPumpLoop):
    """The kinematic constants of a wind pump with crank and coupler angle as its coordinates.

    These angles determine the motion where coupler and rod are in line. `side` is 1 if the x
    component of the rod's direction is positive, otherwise -1.
    """

    def pose(self, q: tuple[Real, ...]) -> Pose:
        """Computes the pose at a crank angle and a coupler angle, rad."""
        r, b, c = self.crank, self.coupler, self.rod
        crank, coupler = map(Vector.at, q)
        rise = -(r * crank.y + b * coupler.y)
        square = (c - rise) * (c + rise)
        require(square > 0, self.refuse, *q)
        run = self.side * sqrt(square)
        # Rate of the rod: run phi3' = -r cos(phi1) phi1' - b cos(phi2) phi2'.
        one, two = -r * crank.x / run, -b * coupler.x / run
        rod_bends = (
            (r * crank.y + rise * (one * one)) / run,
            2 * rise * (one * two) / run,
            (b * coupler.y + rise * (two * two)) / run,
        )
        slide_bends = (
            -r * crank.x - run * (one * one) - rise * rod_bends[0],
            -2 * run * (one * two) - rise * rod_bends[1],
            -b * coupler.x - run * (two * two) - rise * rod_bends[2],
        )
        slopes = -r * crank.y - rise * one, -b * coupler.y - rise * two
        rod, still = Vector(run / c, rise / c), (ZERO, ZERO, ZERO)
        slide = r * crank.x + b * coupler.x + run
        return Pose(
            (
                LinkPose(q[0], crank, (1.0, ZERO), still),
                LinkPose(q[1], coupler, (ZERO, 1.0), still),
                LinkPose(atan2(rod.y, rod.x), rod, (one, two), rod_bends),
                LinkPose(slide, Vector(1.0, ZERO), slopes, slide_bends),
            ),
            (rod.x,),
        )


@dataclass(frozen=True, repr=False)
class WindPump(Mechanism):
    """A wind pump: crank A0-A, coupler A-B, rod B-D, slider D on the x axis.

    It has two degrees of freedom: crank angle and slider position. The loop equation leaves them
    independent; the equations of motion couple them.

    Attributes:
        coordinates: Names of the coordinates: crank angle and slider position.
        crank: Driven link, from A0, the origin.
        coupler: Link from the crank pin A to B.
        rod: Link from B to the slider's pin D.
        slider: The pump's piston, at D.
        assembly: 'open' if B lies to the left of the line from A to D, 'crossed' if to the right.
        gravity: Acceleration of gravity [x, y], m/s^2.
        loads: Loads, such as `Force` and `Friction`.
        dyads: Dyads that the linkage carries.
        points: Traced points of its links.
    """

    coordinates: ClassVar[tuple[str, ...]] = ('crank', 'slider')
    other_coordinates: ClassVar[tuple[str, ...]] = ('crank', 'coupler')

    crank: Body
    coupler: Body
    rod: Body
    slider: Piston
    assembly: str = quantity(
        'choice', 'side of the coupler-rod pin', choices=(OPEN, CROSSED), default=OPEN
    )
    gravity: tuple[float, float] = gravity_quantity()
    loads: Sequence[AppliedLoad] = loads_field()
    dyads: Sequence[Dyad] = dyads_field()
    points: Sequence[TracedPoint] = points_field()

    @classmethod
    def drives(cls, _values: Mapping[str, object]) -> tuple[tuple[str, ...], str]:
        """See `Mechanism.drives`."""
        return ('torque',), (
            'because the crank speed alone does not determine how a wind_pump moves; leave drive '
            'and rpm out, and set motor.torque and start_rpm'
        )

    def loop(self) -> WindPumpLoop:
        """Returns the kinematic constants; the coordinates are crank angle and slider position."""
        return WindPumpLoop(
            self.crank.length,
            self.coupler.length,
            self.rod.length,
            1 if self.assembly == OPEN else -1,
            Opaque(self._refuse),
        )

    def other_loop(self) -> ByCoupler:
        """Returns the kinematic constants; the coordinates are crank and coupler angle."""
        return ByCoupler(*self.loop()[:-1], Opaque(self._refuse_rod))

    def start(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Returns the slider's position, m, and velocity, m/s, at t = 0."""
        return (self.slider.position,), (self.slider.velocity,)

    def _refuse(self, angle: float, slide: float) -> NoReturn:
        raise UnreachableError(
            'coupler and rod do not close the loop, or are in line, at crank angle '
            f'{rad_and_deg(angle)} and slider position {slide:.9g} m; '
            f'{self._slider_range(angle)}',
            crank_angle=angle,
            arcs=(),
        )

    def _refuse_rod(self, crank: float, coupler: float) -> NoReturn:
        raise UnreachableError(
            f'the rod does not reach the guide, or is perpendicular to it, at crank angle '
            f'{rad_and_deg(crank)} and coupler angle {rad_and_deg(coupler)}',
            crank_angle=crank,
            arcs=(),
        )

    def _slider_range(self, crank: float) -> str:
        """Describes the reachable slider positions at a crank angle, for an error message."""
        r, b, c = self.crank.length, self.coupler.length, self.rod.length
        ax, ay = r * math.cos(crank), r * math.sin(crank)
        far = (b + c) ** 2 - ay * ay
        if far <= 0:
            return 'the loop cannot close at this crank angle: lengthen coupler or rod'
        outer, inner = math.sqrt(far), math.sqrt(max((b - c) ** 2 - ay * ay, 0.0))
        spans = [(ax - outer, ax - inner), (ax + inner, ax + outer)]
        words = ' or '.join(f'{low:.6g} to {high:.6g}' for low, high in spans)
        return f'at this crank angle, the slider must be within {words} m'

    def loop_structure(self) -> Structure:
        """Returns the links, points and joints; the loop is cut at D."""
        crank, coupler, rod, slider = self.crank, self.coupler, self.rod, self.slider
        A0 = Point.at(0j, 4)
        A = A0.along(0, crank.length)
        B = A.along(1, coupler.length)
        D = B.along(2, rod.length)
        return Structure(
            (
                Link.turning('crank', crank, 0, A0),
                Link.turning('coupler', coupler, 1, A),
                Link.turning('rod', rod, 2, B),
                Link('slider', slider.mass, 0.0, D, slides=True),
            ),
            {'A0': A0, 'A': A, 'B': B, 'D': D},
            closure=D,
            pins=(Pin('A0', None, 0), Pin('A', 0, 1), Pin('B', 1, 2), Pin('D', 2, 3)),
            dyads=((1, 2),),
            other_dyads=((2, 3),),
        )
