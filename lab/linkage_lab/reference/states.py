# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reference states of linkages, computed with 130 digits.

Positions are intersections of circles; rates, accelerations and torque solve the multibody
equations, from which virtual power eliminates the forces that close the loop and each added dyad.
Digits cancel near change points, but 100 digits remain in every situation (test/test_methods.py).
At a change point the formulas are 0/0; the motion is smooth there, so the state is the mean of the
states 1e-60 rad on either side.
"""

import operator
from collections.abc import Callable, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any, NamedTuple, TypeAlias

from mpmath import mp

from linkage_lab.reference.multibody import Multibody
from linkage_ros import CROSSED, OPEN, FourBar, SliderCrank, UnreachableError
from linkage_ros.formulas import Vector

_DIGITS = 130
_ASIDE = '1e-60'  # rad
_STRAIGHT = '1e-25'  # below this sine of the transmission angle, two states are averaged

_Number: TypeAlias = Any  # an mpf or mpc; mpmath has no type annotations
# Mechanisms whose loop has a closed-form textbook solution.
Linkage: TypeAlias = FourBar | SliderCrank


class _Position(NamedTuple):
    """The position of a loop.

    Attributes:
        coupler: Unit vector of the coupler.
        output: Unit vector of the rocker, or the slider's position, m.
        sine: Sine of the transmission angle.
    """

    coupler: _Number
    output: _Number
    sine: _Number


class _Axes(NamedTuple):
    """Origin of a link, m, and its direction, a unit vector."""

    origin: _Number
    direction: _Number


_Links: TypeAlias = dict[str, _Axes]  # by name


def lengths(linkage: Linkage) -> tuple[float, float, float | None, float]:
    """Returns the lengths of crank, coupler and rocker, and that of the frame or the offset, m.

    The rocker's is None for a slider-crank.
    """
    first = linkage.crank.length, linkage.coupler.length
    if isinstance(linkage, FourBar):
        return *first, linkage.rocker.length, linkage.frame.length
    return *first, None, linkage.slider.offset


def other_assembly(linkage: Linkage) -> Linkage:
    """Returns the linkage in its other assembly."""
    return replace(linkage, assembly=CROSSED if linkage.assembly == OPEN else OPEN)


class Reference:
    """Computes states of a linkage, correct to 100 digits.

    Attributes:
        slides: For each link but the crank, whether it slides.
    """

    def __init__(
        self, mechanism: Linkage, speed: float, acceleration: float, *, decimal: bool = False
    ) -> None:
        """Converts the numbers of the linkage to multiple precision.

        Args:
            mechanism: Linkage to solve.
            speed: Crank speed, rad/s.
            acceleration: Crank acceleration, rad/s^2.
            decimal: Whether lengths are exact decimals, so that 0.1 is a tenth. All other numbers
                have the value of their float.
        """
        self._mechanism, self._motion = mechanism, (speed, acceleration)
        as_typed = repr if decimal else float
        self._lengths = [Fraction(as_typed(x or 0.0)) for x in lengths(mechanism)]
        with mp.workdps(3 * _DIGITS):
            self._length: Callable[[float], _Number] = lambda x: mp.mpf(as_typed(x))
            self._bodies = Multibody(mechanism, mp.mpf, _unit, self._length)
        self.slides = self._bodies.slides[1:]

    def state(self, crank: float) -> dict[str, tuple[_Number, ...]]:
        """Computes the state at a crank angle, rad.

        Returns:
            Values by quantity: 'position' (of each link but the crank, rad or m), 'rate',
            'acceleration', 'torque' (in a tuple).

        Raises:
            UnreachableError: The loop or a dyad does not close at this angle, or the crank's arc
                ends there.
        """
        with mp.workdps(_DIGITS):
            position = self._locate(mp.mpf(crank))
            if abs(position.sine) > mp.mpf(_STRAIGHT):
                return self._solve(mp.mpf(crank), position)
        with mp.workdps(3 * _DIGITS):
            sides = (mp.mpf(crank) + sign * mp.mpf(_ASIDE) for sign in (-1, 1))
            before, after = (self._solve(angle, self._locate(angle)) for angle in sides)
            return {name: tuple(map(_mean, before[name], after[name])) for name in before}

    def _locate(self, crank: _Number) -> _Position:
        """Computes the position of the loop from two circles, or from a circle and a line.

        Both functions take the crank angle relative to the frame or guide, rad, and the unit
        vector of the frame or guide.
        """
        frame = mp.mpf(self._mechanism.frame.angle)
        frame -= 2 * mp.pi * mp.nint(frame / (2 * mp.pi))
        slides = isinstance(self._mechanism, SliderCrank)
        locate = self._on_guide if slides else self._on_circles
        return locate(crank - frame, mp.expj(frame))

    def _on_guide(self, theta: _Number, axis: _Number) -> _Position:
        """Intersects the circle about the crank pin with the path of the slider's pin."""
        crank, coupler, _, offset = self._lengths  # exact
        r, b, _, e = map(mp.convert, self._lengths)
        y = e - r * mp.sin(theta)
        # The coupler is at right angles to the guide if y is -b or b, which y reaches at a change
        # point where theta is pi/2 or -pi/2. From theta + pi/2 these are pi and 0.
        folds = coupler + offset == crank, coupler - offset == crank
        x = self._root_in_assembly(b + y, b - y, theta + mp.pi / 2, folds)
        return _Position(mp.mpc(x, y) * axis / b, mp.mpc(r * mp.cos(theta) + x), x / b)

    def _on_circles(self, theta: _Number, axis: _Number) -> _Position:
        """Intersects the circles of coupler and rocker."""
        crank, coupler, rocker, frame = self._lengths  # exact
        r, b, c, d = map(mp.convert, self._lengths)
        diagonal = axis * (d - r * mp.expj(theta))  # from the crank's pin to the rocker's pivot
        square = abs(diagonal) ** 2
        if not square:
            # Both centres coincide, so that the circles have no direction. An angle beside this
            # one shows whether they meet; `state` then takes the mean over both sides.
            return self._on_circles(theta + mp.mpf(10) ** (10 - mp.dps), axis)
        # At a change point, coupler and rocker are stretched out in line where theta is pi, or
        # folded in line where it is 0.
        folds = coupler + rocker == frame + crank, abs(frame - crank) == abs(coupler - rocker)
        # Heron's formula: four times the area of the triangle of coupler, rocker and diagonal.
        area = self._root_in_assembly((b + c) ** 2 - square, square - (b - c) ** 2, theta, folds)
        # Along the diagonal by the law of cosines, and across it by the area.
        along = (b - c) * (b + c) + square
        vector = diagonal * (along + 1j * area) / (2 * square)
        return _Position(vector / b, (vector - diagonal) / c, area / (2 * b * c))

    def _root_in_assembly(
        self, p: _Number, q: _Number, angle: _Number, folds: tuple[bool, bool]
    ) -> _Number:
        """Returns sqrt(p q) with the sign of the assembly, which alternates at change points.

        Args:
            p: First factor, which is least where the angle is pi.
            q: Second factor, which is least where the angle is 0.
            angle: Crank angle from the axis of symmetry of p and q, rad.
            folds: Whether p, and whether q, has a double root there: a change point.

        Raises:
            UnreachableError: p or q is negative, so the loop cannot close.
        """
        # At an exact change point rounding may make the product negative.
        rounding = mp.mpf(10) ** (10 - mp.dps) * (abs(p) + abs(q)) if any(folds) else 0
        if min(p, q) < -rounding:
            raise UnreachableError('the loop does not close', crank_angle=float(angle), arcs=())
        root = mp.sqrt(max(p, 0)) * mp.sqrt(max(q, 0))
        # cos(angle / 2) changes its sign at pi, and sin(angle / 2) at 0.
        p_folds, q_folds = folds
        has_passed_pi = p_folds and mp.cos(angle / 2) < 0
        has_passed_0 = q_folds and mp.sin(angle / 2) < 0
        is_positive = (self._mechanism.assembly == OPEN) != (has_passed_pi != has_passed_0)
        return root if is_positive else -root

    def _solve(self, crank: _Number, position: _Position) -> dict[str, tuple[_Number, ...]]:
        """Computes rates, accelerations and, by virtual power, the torque at a position."""
        dyads = self._dyads(crank, position)
        numbers = [mp.expj(crank), position.coupler, position.output, *dyads]
        places = [_vector(number) for number in numbers]
        count, bodies = len(places), self._bodies
        speed, acceleration = map(mp.mpf, self._motion)
        # The crank's rate is given, those of the other links follow. There are as many gaps of
        # loop and dyads, in x and y, as other links.
        unknown = [mp.mpf(0)] * (count - 1)
        no_gap_speeds = [mp.mpf(0)] * (count - 1)
        slopes = bodies.closed(places, [mp.mpf(1), *unknown], no_gap_speeds)
        rates = [slope * speed for slope in slopes]
        # The first rows and columns are those of the links, the others those of the multipliers.
        matrix, right = bodies.system(places, rates)
        masses = [row[:count] for row in matrix[:count]]
        applied, bias = right[:count], right[count:]
        accelerations = bodies.closed(places, [acceleration, *unknown], bias)
        inertial = [sum(map(operator.mul, row, accelerations)) for row in masses]
        powers = (
            slope * (force - load)
            for slope, force, load in zip(slopes, inertial, applied, strict=True)
        )
        return {
            'position': tuple(
                number.real if slides else mp.arg(number)
                for number, slides in zip(numbers[1:], self.slides, strict=True)
            ),
            'rate': tuple(rates[1:]),
            'acceleration': tuple(accelerations[1:]),
            'torque': (sum(powers),),
        }

    def _dyads(self, crank: _Number, position: _Position) -> list[_Number]:
        """Computes the unit vectors of the dyads' links, and the positions of their sliders.

        Raises:
            UnreachableError: A dyad does not close.
        """
        frame = mp.expj(mp.mpf(self._mechanism.frame.angle))
        r, b, _, d = map(mp.convert, self._lengths)
        pin = r * mp.expj(crank)
        links = {
            'frame': _Axes(mp.mpf(0), mp.mpf(1)), 'crank': _Axes(mp.mpf(0), mp.expj(crank)),
            'coupler': _Axes(pin, position.coupler), 'rocker': _Axes(d * frame, position.output),
            'slider': _Axes(pin + b * position.coupler, frame),
        }  # fmt: skip
        found: list[_Number] = []
        dyad: Any  # its attributes depend on its kind
        for dyad in self._mechanism.dyads:
            if dyad.barrel:
                found += self._barrel_and_rod(dyad, links, crank)
            elif dyad.slider:
                found += self._link_and_slider(dyad, links, crank)
            else:
                found += self._two_links(dyad, links, crank)
        return found

    def _point(self, links: _Links, link: str, at: Sequence[float] | None) -> _Number:
        """Returns a point of a link, by default its origin, m."""
        origin, direction = links[link]
        return origin + direction * mp.mpc(*map(self._length, at or (0.0, 0.0)))

    def _barrel_and_rod(self, dyad: Any, links: _Links, crank: _Number) -> list[_Number]:
        """Solves a barrel and the rod that slides in it; adds both to the links by name."""
        rod_pin = self._point(links, dyad.from_, dyad.from_at)
        pivot = self._point(links, dyad.to, dyad.to_at)
        offset = self._length(dyad.offset)
        place = self._root(abs(rod_pin - pivot) ** 2 - offset**2, crank)
        barrel = (rod_pin - pivot) / mp.mpc(place, offset)
        links[f'{dyad.name}_barrel'] = _Axes(pivot, barrel)
        links[f'{dyad.name}_rod'] = _Axes(rod_pin, barrel)
        return [barrel, mp.mpc(place)]

    def _link_and_slider(self, dyad: Any, links: _Links, crank: _Number) -> list[_Number]:
        """Intersects the circle of a link with the path of a slider; adds both to the links."""
        start = self._point(links, dyad.from_, dyad.from_at)
        length = self._length(dyad.first.length)
        origin = self._point(links, dyad.slider.on, dyad.slider.at)
        guide = links[dyad.slider.on].direction * mp.expj(mp.mpf(dyad.slider.angle))
        x, y = _vector((start - origin) / guide)
        place = mp.mpc(x + _side(dyad) * self._root(length**2 - y**2, crank))
        joint = origin + place * guide
        first = (joint - start) / length
        links[f'{dyad.name}_first'] = _Axes(start, first)
        links[f'{dyad.name}_slider'] = _Axes(joint, guide)
        return [first, place]

    def _two_links(self, dyad: Any, links: _Links, crank: _Number) -> list[_Number]:
        """Intersects the circles of two links; adds both to the links by name."""
        start = self._point(links, dyad.from_, dyad.from_at)
        end = self._point(links, dyad.to, dyad.to_at)
        b, c = self._length(dyad.first.length), self._length(dyad.second.length)
        square = abs(end - start) ** 2
        along = (square + b**2 - c**2) / 2
        across = _side(dyad) * self._root(b**2 * square - along**2, crank)
        joint = start + (end - start) * mp.mpc(along, across) / square
        first, second = (joint - start) / b, (joint - end) / c
        links[f'{dyad.name}_first'] = _Axes(start, first)
        links[f'{dyad.name}_second'] = _Axes(end, second)
        return [first, second]

    def _root(self, square: _Number, crank: _Number) -> _Number:
        """Returns a square root.

        Raises:
            UnreachableError: The number is negative, so a dyad does not close.
        """
        if square < 0:
            raise UnreachableError('a dyad does not close', crank_angle=float(crank), arcs=())
        return mp.sqrt(square)


def _side(dyad: Any) -> int:
    return 1 if dyad.assembly == OPEN else -1


def _unit(angle: _Number) -> Vector:
    return _vector(mp.expj(angle))


def _vector(number: _Number) -> Vector:
    return Vector(number.real, number.imag)


def _mean(a: _Number, b: _Number) -> _Number:
    # Angles on either side of the jump at pi are averaged across it.
    return a + mp.arg(mp.expj(b - a)) / 2 if abs(a - b) > 3 else (a + b) / 2
