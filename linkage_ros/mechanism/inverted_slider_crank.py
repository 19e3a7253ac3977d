# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The inverted slider-crank: a cylinder or a slotted lever, and its exact pose.

A rod slides in a barrel, which turns about the fixed pivot B0; the rod's end is pinned to the
crank at A. With theta = alpha - delta and h = theta/2, the vector from B0 to A is

    A - B0 = e^(i (delta + h)) [-(d-r) cos h + i (d+r) sin h]

and with the rod's position s and its offset e to the left of B0, A - B0 = (s + i e) e^(i phi). So

    s^2 = (|d-r| - |e|)(|d-r| + |e|) + x^2        x = 2 sqrt(rd) sin h
        = (d+r - |e|)(d+r + |e|) - y^2            y = 2 sqrt(rd) cos h

in which nothing cancels if the crank turns fully. With L^2 = s^2 + e^2, the direction psi of
A - B0 and the direction phi of the barrel, differentiation with respect to alpha gives

    s s' = x y / 2        s s'' = [q y^2 / s^2 - x^2] / 4        q = (|d-r| - |e|)(|d-r| + |e|)
    psi' = [x^2 / 2 - r (d-r)] / L^2               psi'' = x y (d-r)(d+r) / (2 L^4)
    phi' = psi' + e s' / L^2                       phi'' = psi'' + e (s'' - 2 s s'^2 / L^2) / L^2

and, as a function of s, alpha' = 2 s / (x y) and alpha'' = 2 [x^4 - q (y^2 - x^2)] / (x y)^3.
These formulas were derived for this project.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar, NamedTuple

from linkage_ros.errors import ConfigurationError, MechanismError
from linkage_ros.formulas import ZERO, Opaque, Vector, atan2, sqrt, turned
from linkage_ros.mechanism.base import Description
from linkage_ros.mechanism.driven_slide import CRANK, SlideDriven, Triangle
from linkage_ros.mechanism.dyads import Dyad, dyads_field
from linkage_ros.mechanism.kinematics import FULL_TURN, Arc, LinkPose, Pose, Reach, Stroke
from linkage_ros.mechanism.loads import loads_field
from linkage_ros.mechanism.loads.base import AppliedLoad
from linkage_ros.mechanism.parts import (
    CROSSED,
    OPEN,
    Barrel,
    Body,
    Frame,
    Rod,
    TracedPoint,
    gravity_quantity,
    points_field,
)
from linkage_ros.mechanism.structure import Link, Pin, Point, Structure, direction
from linkage_ros.mechanism.transmission import Square, half_angle, normalized
from linkage_ros.numeric import Real, rounded, short_sum
from linkage_ros.quantities import quantity

CYLINDER = 'cylinder'  # value of `input` if the rod is driven


class _PivotLine(NamedTuple):
    """The line from B0 to A, and the directions that follow from it.

    Attributes:
        crank: Unit vector of the crank.
        barrel: Unit vector of the barrel.
        psi_1: psi', the derivative of the line's direction with respect to the crank angle.
        psi_2: psi''.
        over_length: 1 / L, 1/m.
    """

    crank: Vector
    barrel: Vector
    psi_1: Real
    psi_2: Real
    over_length: Real


class InvertedSliderCrankLoop(NamedTuple):
    """The kinematic constants of an inverted slider-crank; the coordinate is the crank angle.

    Attributes:
        reference: Direction delta from A0 to B0, rad, as a sum of two doubles.
        axis: Unit vector of this direction.
        side: 1 if s > 0, otherwise -1.
        crank: Length r of the crank, m.
        ground: d - r and d + r, m.
        offset: Offset e of the rod's axis, m.
        growth: 2 sqrt(r d), m.
        square: s^2 as a function of h, m^2.
        triangle: The triangle of crank, frame and the line from B0 to A.
        refuse: Function that rejects a coordinate.
    """

    reference: tuple[float, float]
    axis: Vector
    side: int
    crank: float
    ground: tuple[float, float]
    offset: float
    growth: float
    square: Square
    triangle: Triangle
    refuse: Opaque

    @property
    def turns_fully(self) -> bool:
        """Whether a state exists at every crank angle."""
        return not self.square.limits

    def arcs(self) -> tuple[Arc, ...]:
        """Computes the arcs of crank angles at which s exists; see `Reach.arcs`."""
        if self.turns_fully:
            return FULL_TURN
        least, most = float(self.square.least), self.square.most
        nearest = 2 * math.atan2(math.sqrt(-least), math.sqrt(most))
        start = self.reference[0] + nearest
        return (normalized(start, start + 2 * (math.pi - nearest)),)

    def extremes(self) -> None:
        """Returns None: a cylinder has no transmission angle."""

    def pose(self, q: tuple[Real, ...]) -> Pose:
        """Computes the pose of crank, barrel and rod at a crank angle, rad."""
        (crank,) = q
        sin_h, cos_h = half_angle(crank, self.reference)
        x, y = self.growth * sin_h, self.growth * cos_h
        s = self.side * self.square.root(x, y, self.refuse, crank)
        s_1 = 0.5 * (x * y) / s
        s_2 = 0.25 * (self.square.least * (y * y) / (s * s) - x * x) / s
        line = self._line((x, y), (sin_h, cos_h), s)
        over_length = line.over_length
        e_over_square = self.offset * (over_length * over_length)
        phi_1 = line.psi_1 + e_over_square * s_1
        phi_2 = line.psi_2 + e_over_square * (
            s_2 - 2 * (over_length * s_1) * (over_length * s_1) * s
        )
        barrel = line.barrel
        return Pose(
            (
                LinkPose(crank, line.crank, (1.0,), (ZERO,)),
                LinkPose(atan2(barrel.y, barrel.x), barrel, (phi_1,), (phi_2,)),
                LinkPose(s, barrel, (s_1,), (s_2,)),
            ),
            (s * over_length,),
        )

    def _line(self, xy: tuple[Real, Real], half: tuple[Real, Real], s: Real) -> '_PivotLine':
        """Computes the line from B0 to A from x and y, the sine and cosine of h, and s."""
        (x, y), (sin_h, cos_h) = xy, half
        diff_dr, sum_dr = self.ground
        half_way = turned(self.axis, cos_h, sin_h)  # e^(i (delta + h))
        from_pivot = turned(half_way, -diff_dr * cos_h, sum_dr * sin_h)  # A - B0
        square = s * s + self.offset * self.offset
        scale = 1.0 / square
        barrel = turned(from_pivot, scale * s, scale * -self.offset)
        psi_1 = scale * (0.5 * (x * x) - self.crank * diff_dr)
        psi_2 = 0.5 * (x * y) * (scale * diff_dr) * (scale * sum_dr)
        return _PivotLine(turned(half_way, cos_h, sin_h), barrel, psi_1, psi_2, 1.0 / sqrt(square))


class ByRod(InvertedSliderCrankLoop):
    """The kinematic constants with the rod's position as the coordinate.

    `side` is 1 if A lies to the left of the line from A0 to B0, otherwise -1.
    """

    @property
    def turns_fully(self) -> bool:
        """Returns False, because the stroke has ends."""
        return False

    def arcs(self) -> tuple[Arc, ...]:
        """Computes the positions between those at which crank and frame are in line, m.

        At negative positions, the barrel is turned by pi; the rod cannot get there if they differ.
        """
        return self.triangle.arcs()[:1]

    def pose(self, q: tuple[Real, ...]) -> Pose:
        """Computes the pose of crank, barrel and rod at a position of the rod, m."""
        (s,) = q
        least = self.square.least  # q in the module's formulas
        size_of_x, y = self.triangle.roots(s, self.refuse)
        x = self.side * size_of_x
        xy = x * y
        # Derivatives with respect to s: alpha', phi' and so on.
        alpha_1 = 2 * s / xy
        alpha_2 = 2 * (x * x * (x * x) - least * (y * y - x * x)) / (xy * xy * xy)
        line = self._line((x, y), (x / self.growth, y / self.growth), s)
        over_length = line.over_length
        e_over_square = self.offset * (over_length * over_length)
        phi_1 = line.psi_1 * alpha_1 + e_over_square
        phi_2 = (
            line.psi_2 * (alpha_1 * alpha_1)
            + line.psi_1 * alpha_2
            - 2 * e_over_square * s * (over_length * over_length)
        )
        crank, barrel = line.crank, line.barrel
        return Pose(
            (
                LinkPose(atan2(crank.y, crank.x), crank, (alpha_1,), (alpha_2,)),
                LinkPose(atan2(barrel.y, barrel.x), barrel, (phi_1,), (phi_2,)),
                LinkPose(s, barrel, (1.0,), (ZERO,)),
            ),
            (0.5 * xy * over_length / self.crank,),
        )


@dataclass(frozen=True, repr=False)
class InvertedSliderCrank(SlideDriven):
    """An inverted slider-crank: crank A0-A, barrel about B0, rod from the barrel to A.

    The direction of barrel and rod is that in which the rod's position increases, from B0 to A
    without an offset.

    Attributes:
        frame: The fixed link, from A0 to B0.
        crank: Link from A0, the origin; driven, or the output link of a driven cylinder.
        barrel: Cylinder or slotted lever, which turns about B0.
        rod: Link that slides in the barrel and is pinned to the crank at A. Its position
            is measured from the foot of the perpendicular from B0.
        offset: Distance of the rod's axis from B0, positive to the left of the barrel's direction,
            m.
        gravity: Acceleration of gravity [x, y], m/s^2.
        loads: Loads, such as `Force` and `Friction`.
        dyads: Dyads that the linkage carries.
        points: Traced points of its links.
        input: Driven joint: 'crank', or 'cylinder', the rod in its barrel.
        assembly: Side of A from the line from A0 to B0 if the cylinder is driven: 'open' for left,
            'crossed' for right. A crank angle determines it, so a driven crank has only 'open'.
    """

    slide: ClassVar[str] = 'rod'
    slide_input: ClassVar[str] = CYLINDER

    frame: Frame
    crank: Body
    barrel: Barrel = field(default_factory=Barrel)
    rod: Rod = field(default_factory=Rod)
    offset: float = quantity(
        'number', "distance of the rod's axis from B0, to the left of the barrel's direction", 'm',
        span=(-1e9, 1e9), default=0.0,
    )  # fmt: skip
    gravity: tuple[float, float] = gravity_quantity()
    loads: Sequence[AppliedLoad] = loads_field()
    dyads: Sequence[Dyad] = dyads_field()
    points: Sequence[TracedPoint] = points_field()
    input: str = quantity('choice', 'driven joint', choices=(CRANK, CYLINDER), default=CRANK)
    assembly: str = quantity(
        'choice', 'side of the pin A from the line of the fixed pivots, with input: cylinder',
        choices=(OPEN, CROSSED), default=OPEN,
    )  # fmt: skip

    @classmethod
    def unused(cls, values: Mapping[str, object]) -> dict[str, str]:
        """See `Mechanism.unused`."""
        reason = 'the crank angle determines the assembly, unless input is cylinder'
        return {} if values.get('input') == cls.slide_input else {'assembly': reason}

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.input == CRANK and self.assembly != OPEN:
            raise ConfigurationError(
                f'assembly = {self.assembly!r}: must be {OPEN} with input: {CRANK}'
            )

    def _lengths(self) -> tuple[float, float, float]:
        return self.crank.length, self.frame.length, abs(self.offset)

    def _sums(self) -> tuple[float, float, float, float]:
        """Returns |d - r| - |e|, |d - r| + |e|, d + r - |e| and d + r + |e|, m."""
        r, d, e = self._lengths()
        long, short, longest = max(r, d), min(r, d), max(r, d, e)
        terms = (long, -short, -e), (long, -short, e), (long, short, -e), (long, short, e)
        a, b, c, f = (short_sum(longest, *x) for x in terms)
        return a, b, c, f

    def require_closed(self) -> None:
        """See `Mechanism.require_closed`.

        Raises:
            MechanismError: The offset is too large, or equals the difference of frame and crank.
        """
        r, d, _ = self._lengths()
        least, other, most, _ = self._sums()
        if most <= 0:
            raise MechanismError(
                f'the offset of the rod, {self.offset:g} m, is farther from 0 than crank + frame, '
                f'{r + d:g} m: the loop cannot close; bring the offset nearer to 0, or lengthen '
                'crank or frame'
            )
        if least == 0 or other == 0:
            cure = 'change the offset or a length'
            if self.drawn:
                cure = 'draw its line or a pin elsewhere'
            raise MechanismError(
                f'the offset of the rod, {self.offset:g} m, is equal to the difference of frame '
                f'and crank, {d:g} m and {r:g} m, so that the rod has no direction where they are '
                f'in line; {cure}'
            )

    def loop_of(self, description: Description) -> InvertedSliderCrankLoop:
        """Returns the kinematic constants; `assembly` is the sign of s, or the side of A."""
        self.require_closed()
        r, d, _ = self._lengths()
        least, other, most, all_sum = self._sums()
        is_by_rod = description.coordinates == ('rod',)
        kind = ByRod if is_by_rod else InvertedSliderCrankLoop
        reach = self.reach_of_slide if is_by_rod else self.reach_of_crank
        return kind(
            reference=(self.frame.angle, 0.0),
            axis=Vector.at(self.frame.angle),
            side=1 if description.assembly == OPEN else -1,
            crank=r,
            ground=(d - r, d + r),
            offset=self.offset,
            growth=2 * math.sqrt(r * d),
            square=Square.of(least * other, most * all_sum),
            triangle=Triangle.of((r, d), self.offset),
            refuse=Opaque(lambda place: self.in_own_terms(reach()).refuse(place)),
        )

    def reach_of_slide(self) -> Reach:
        """See `SlideDriven`."""
        return Reach(
            'inverted slider-crank', self.loop_of(Description(('rod',), OPEN)).arcs(),
            period_turns=0, limits=('crank and frame are in line at the ends of its stroke',),
            driven=CYLINDER,
        )  # fmt: skip

    def reach_of_crank(self) -> Reach:
        """See `SlideDriven`."""
        r, d, _ = self._lengths()
        least, other, *_ = self._sums()
        loop = self.loop_of(Description(('crank',), OPEN))
        if loop.turns_fully:
            grashof = 'swinging-barrel' if r < d else 'turning-barrel'
            width = math.sqrt(least * other) / loop.growth
            return Reach(grashof, fast=self.frame.angle, width=width)
        limits = (f'|frame - crank| - |offset| = {least:.6g} m is negative',)
        return Reach('non-Grashof', loop.arcs(), limits=limits, cures=tuple(self._cures()))

    def _cures(self) -> Iterator[str]:
        """Yields alternative changes of length that let a limited crank turn fully."""
        r, d, e = self._lengths()
        if d != r:
            yield f'bring the offset nearer to 0 than {rounded(abs(d - r), up=False)} m'
        if d > e:
            yield f'make the crank shorter than {rounded(d - e, up=False)} m'
        yield f'make the crank longer than {rounded(d + e, up=True)} m'

    def stroke(self, what: str, name: str) -> Stroke:
        """See `Mechanism.stroke`; the piston is far from the crank where the cylinder is short.

        Raises:
            ConfigurationError: The link is not the rod, or the crank does not turn fully.
        """
        if self.role_of(name) != 'rod':
            return super().stroke(what, name)
        square, angle = self.loop_of(self.description).square, self.frame.angle
        if square.limits:
            why = self.in_own_names(
                'the rod has no stroke with fixed ends, because the crank does not turn fully; '
                f'{" or ".join(self._cures())}'
            )
            raise ConfigurationError(f'{what}: {why}')
        short, long = math.sqrt(float(square.least)), math.sqrt(square.most)
        return Stroke((short, angle), (long, angle + math.pi))

    def loop_structure(self) -> Structure:
        """Returns the links, points and joints; the loop is cut at A."""
        crank, barrel, rod = self.crank, self.barrel, self.rod
        A0 = Point.at(0j, 3)
        A = A0.along(0, crank.length)
        B0 = Point.at(self.frame.length * direction(self.frame.angle), 3)
        # The barrel is drawn to E: as long as the rod allows or, if that is 0, as a slotted lever.
        triangle = Triangle.of((crank.length, self.frame.length), self.offset)
        mouth = triangle.short[0] or triangle.long[0]
        return Structure(
            (
                Link.turning('crank', crank, 0, A0),
                Link(
                    'barrel', barrel.mass, barrel.inertia, B0.along(1, *barrel.center),
                    origin=B0.fixed,
                ),
                Link(
                    'rod', rod.mass, rod.inertia, A.along(1, *rod.center),
                    parent=1, origin=1j * self.offset, slides=True, pin=A,
                ),
            ),
            {'A0': A0, 'A': A, 'B0': B0, 'E': B0.along(1, mouth, self.offset)},
            closure=Point.at(-B0.fixed, 3).along(0, crank.length),
            pins=(Pin('A0', None, 0), Pin('A', 0, 2), Pin('B0', None, 1)),
            dyads=((0, 2),) if self.drives_slide else ((1, 2),),
            other_dyads=((1, 2),) if self.drives_slide else ((0, 2),),
            driven=2 if self.drives_slide else 0,
            mouth='E',
        )  # fmt: skip
