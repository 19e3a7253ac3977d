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
from typing import Any, TypeAlias

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
            place = self._locate(mp.mpf(crank))
            if abs(place[2]) > mp.mpf(_STRAIGHT):
                return self._solve(mp.mpf(crank), *place)
        with mp.workdps(3 * _DIGITS):
            sides = (mp.mpf(crank) + sign * mp.mpf(_ASIDE) for sign in (-1, 1))
            before, after = (self._solve(angle, *self._locate(angle)) for angle in sides)
            return {name: tuple(map(_mean, before[name], after[name])) for name in before}

    def _locate(self, crank: _Number) -> tuple[_Number, _Number, _Number]:
        """Computes unit vectors of coupler and rocker (or a slider's position) from two circles.

        The third value is the sine of the transmission angle.
        """
        frame = mp.mpf(self._mechanism.frame.angle)
        frame -= 2 * mp.pi * mp.nint(frame / (2 * mp.pi))
        theta, turn = crank - frame, mp.expj(frame)
        r, b, c, d = map(mp.convert, self._lengths)
        exact_r, exact_b, exact_c, exact_d = self._lengths
        if isinstance(self._mechanism, SliderCrank):
            y = d - r * mp.sin(theta)
            folds = exact_b + exact_d == exact_r, exact_b - exact_d == exact_r
            x = self._height(b + y, b - y, folds, theta + mp.pi / 2)
            return mp.mpc(x, y) * turn / b, mp.mpc(r * mp.cos(theta) + x), x / b
        diagonal = turn * (d - r * mp.expj(theta))
        square = abs(diagonal) ** 2
        if not square:
            return self._locate(crank + mp.mpf(10) ** (10 - mp.dps))
        folds = (
            exact_b + exact_c == exact_d + exact_r,
            abs(exact_d - exact_r) == abs(exact_b - exact_c),
        )
        height = self._height((b + c) ** 2 - square, square - (b - c) ** 2, folds, theta)
        coupler = diagonal * ((b - c) * (b + c) + square + 1j * height) / (2 * square)
        return coupler / b, (coupler - diagonal) / c, height / (2 * b * c)

    def _height(self, p: _Number, q: _Number, folds: tuple[bool, bool], theta: _Number) -> _Number:
        """Returns sqrt(p q) with the sign of the assembly, which alternates at change points.

        Raises:
            UnreachableError: p or q is negative, so the loop cannot close.
        """
        # At an exact change point rounding may make the product negative.
        rounding = mp.mpf(10) ** (10 - mp.dps) * (abs(p) + abs(q)) if any(folds) else 0
        if min(p, q) < -rounding:
            raise UnreachableError('the loop does not close', crank_angle=float(theta), arcs=())
        height = mp.sqrt(max(p, 0)) * mp.sqrt(max(q, 0))
        turns = zip(folds, (mp.cos(theta / 2), mp.sin(theta / 2)), strict=True)
        passed = sum(folds_there and part < 0 for folds_there, part in turns)
        return height if (self._mechanism.assembly == OPEN) != passed % 2 else -height

    def _solve(
        self, crank: _Number, coupler: _Number, output: _Number, _: _Number
    ) -> dict[str, tuple[_Number, ...]]:
        """Computes rates, accelerations and, by virtual power, the torque at a position."""
        (speed, change), bodies = map(mp.mpf, self._motion), self._bodies
        numbers = [mp.expj(crank), coupler, output, *self._dyads(crank, coupler, output)]
        places, still = list(map(_vector, numbers)), [mp.mpf(0)] * len(self.slides)
        slopes = bodies.closed(places, [mp.mpf(1), *still], still)
        rates = [slope * speed for slope in slopes]
        rows, right = bodies.system(places, rates)
        changes = bodies.closed(places, [change, *still], right[len(places) :])
        forces = [sum(map(operator.mul, row, changes)) for row in rows]
        powers = (x * (y - z) for x, y, z in zip(slopes, forces, right, strict=False))
        return {
            'position': tuple(
                number.real if slides else mp.arg(number)
                for number, slides in zip(numbers[1:], self.slides, strict=True)
            ),
            'rate': tuple(rates[1:]),
            'acceleration': tuple(changes[1:]),
            'torque': (sum(powers),),
        }

    def _dyads(self, crank: _Number, coupler: _Number, output: _Number) -> list[_Number]:
        """Computes the unit vectors of the dyads' links, and the positions of their sliders.

        Raises:
            UnreachableError: A dyad does not close.
        """
        mechanism, frame = self._mechanism, mp.expj(mp.mpf(self._mechanism.frame.angle))
        r, b, _, d = map(mp.convert, self._lengths)
        pin = r * mp.expj(crank)
        # Origin and direction of each link, by name.
        bodies = {
            'frame': (mp.mpf(0), mp.mpf(1)), 'crank': (mp.mpf(0), mp.expj(crank)),
            'coupler': (pin, coupler), 'rocker': (d * frame, output),
            'slider': (pin + b * coupler, frame),
        }  # fmt: skip

        def end(link: str, at: Sequence[float]) -> _Number:
            origin, direction = bodies[link]
            return origin + direction * mp.mpc(*map(self._length, at))

        found: list[_Number] = []
        dyad: Any  # what it has depends on its kind
        for dyad in mechanism.dyads:
            start, name = end(dyad.from_, dyad.from_at), dyad.name
            if dyad.barrel:
                to, e = end(dyad.to, dyad.to_at or (0.0, 0.0)), self._length(dyad.offset)
                place = self._root(abs(start - to) ** 2 - e**2, crank)
                barrel = (start - to) / mp.mpc(place, e)
                found += [barrel, mp.mpc(place)]
                bodies |= {f'{name}_barrel': (to, barrel), f'{name}_rod': (start, barrel)}
                continue
            b, side = self._length(dyad.first.length), 1 if dyad.assembly == OPEN else -1
            if dyad.slider:  # its path meets the circle about the first end
                _, carrier = bodies[dyad.slider.on]
                at = end(dyad.slider.on, dyad.slider.at)
                guide = carrier * mp.expj(mp.mpf(dyad.slider.angle))
                x, y = _vector((start - at) / guide)
                place = mp.mpc(x + side * self._root(b**2 - y**2, crank))
                joint = at + place * guide
                found += [(joint - start) / b, place]
                bodies[f'{name}_slider'] = joint, guide
            else:  # the circles about both ends meet
                to, c = end(dyad.to, dyad.to_at or (0.0, 0.0)), self._length(dyad.second.length)
                square = abs(to - start) ** 2
                along = (square + b**2 - c**2) / 2
                across = side * self._root(b**2 * square - along**2, crank)
                joint = start + (to - start) * mp.mpc(along, across) / square
                found += [(joint - start) / b, (joint - to) / c]
                bodies[f'{name}_second'] = to, found[-1]
            bodies[f'{name}_first'] = start, found[-2]
        return found

    def _root(self, square: _Number, crank: _Number) -> _Number:
        """Returns a square root.

        Raises:
            UnreachableError: The number is negative, so a dyad does not close.
        """
        if square < 0:
            raise UnreachableError('a dyad does not close', crank_angle=float(crank), arcs=())
        return mp.sqrt(square)


def _unit(angle: _Number) -> Vector:
    return _vector(mp.expj(angle))


def _vector(number: _Number) -> Vector:
    return Vector(number.real, number.imag)


def _mean(a: _Number, b: _Number) -> _Number:
    # Angles on either side of the jump at pi are averaged across it.
    return a + mp.arg(mp.expj(b - a)) / 2 if abs(a - b) > 3 else (a + b) / 2
