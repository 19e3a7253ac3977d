# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The states that methods are measured against, in 130 digits.

Circles are intersected for the position; rates, accelerations and the torque are the solution of
the multibody equations. All of this cancels near change points: 100 digits are left in every
situation (test/test_methods.py). At a change point itself it is 0/0; the motion is smooth there,
so the limit is the mean of two states 1e-60 rad to either side.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any, NamedTuple, TypeAlias

from mpmath import mp

from linkage_ros.errors import UnreachableError
from linkage_ros.formulas import Vector
from linkage_ros.lab.reference.multibody import Multibody, eliminate
from linkage_ros.model.four_bar import FourBar
from linkage_ros.model.parts import OPEN
from linkage_ros.model.slider_crank import SliderCrank

_DIGITS = 130
_ASIDE = '1e-60'  # rad
_STRAIGHT = '1e-25'  # sine of the transmission angle: below, the mean of two states is taken
_MANY_TURNS = 1e30  # rad; no angle
_Number: TypeAlias = Any  # an mpf or mpc; mpmath has no types
_Values: TypeAlias = tuple[_Number, ...]


class Exact(NamedTuple):
    """A state, in mpf.

    Attributes:
        position: Position of the coupler, rad, and of the output, rad or m.
        rate: Their velocities, per s.
        acceleration: Their accelerations, per s^2.
        torque: The driving torque, N m, in a tuple of one.
    """

    position: _Values
    rate: _Values
    acceleration: _Values
    torque: _Values


class _Place(NamedTuple):
    """Coupler and output as complex numbers of their lengths; the transmission angle's sine."""

    coupler: _Number
    output: _Number
    sine: _Number


class Reference:
    """States of one mechanism, right to 100 digits."""

    def __init__(
        self,
        mechanism: FourBar | SliderCrank,
        speed: float,
        acceleration: float,
        lengths: Sequence[str] | None = None,
    ) -> None:
        """Takes the mechanism's doubles as they are.

        Args:
            mechanism: The linkage.
            speed: Crank speed, rad/s.
            acceleration: Crank acceleration, rad/s^2.
            lengths: Decimal texts of crank, coupler, rocker and frame, or crank, coupler and
                offset, that the doubles stand for; None: the doubles are meant.
        """
        self._mechanism, self._motion = mechanism, (speed, acceleration)
        links = [mechanism.crank.length, mechanism.coupler.length]
        if isinstance(mechanism, FourBar):
            links += [mechanism.rocker.length, mechanism.frame.length]
        else:
            links += [mechanism.slider.offset]
        self._lengths = tuple(Fraction(length) for length in lengths or links)
        self._side = 1 if mechanism.assembly == OPEN else -1
        with mp.workdps(3 * _DIGITS):
            meant = dict(zip(links, map(_number, self._lengths), strict=True))
            self._bodies = Multibody(mechanism, mp.mpf, _unit, meant)

    @staticmethod
    def difference(value: float, exact: _Number, *, is_angle: bool) -> float:
        """The error of a double in all digits of the exact value; angles without turns."""
        with mp.workdps(_DIGITS):
            apart = mp.mpf(value) - exact
            if is_angle and abs(apart) < _MANY_TURNS:
                apart -= 2 * mp.pi * mp.nint(apart / (2 * mp.pi))
            return float(apart)

    def state(self, crank: float) -> Exact:
        """The state at a crank angle.

        Args:
            crank: rad.

        Returns:
            The state.

        Raises:
            UnreachableError: The loop does not close there, or the crank has a limit there.
        """
        with mp.workdps(_DIGITS):
            place = self._locate(mp.mpf(crank))
            if place is None:
                raise UnreachableError('the loop does not close', crank_angle=crank, arcs=())
            if abs(place.sine) > mp.mpf(_STRAIGHT):
                return self._solve(mp.mpf(crank), place)
        with mp.workdps(3 * _DIGITS):
            states = []
            for sign in (-1, 1):
                angle = mp.mpf(crank) + sign * mp.mpf(_ASIDE)
                place = self._locate(angle)
                if place is None:
                    raise UnreachableError('the crank is at its limit', crank_angle=crank, arcs=())
                states.append(self._solve(angle, place))
            return Exact(*(_mean(*values) for values in zip(*states, strict=True)))

    def _locate(self, crank: _Number) -> _Place | None:
        """Where circles intersect; None: they do not."""
        frame = mp.mpf(self._mechanism.frame.angle)
        frame -= 2 * mp.pi * mp.nint(frame / (2 * mp.pi))
        theta, turn = crank - frame, mp.expj(frame)
        if isinstance(self._mechanism, FourBar):
            r, b, c, d = map(_number, self._lengths)
            diagonal = turn * (d - r * mp.expj(theta))
            square = abs(diagonal) ** 2
            if not square:
                return self._locate(crank + mp.mpf(10) ** (10 - mp.dps))
            p, q = (b + c) ** 2 - square, square - (b - c) ** 2
            fr, fb, fc, fd = self._lengths
            folds = fb + fc == fd + fr, (fd - fr) ** 2 == (fb - fc) ** 2
            height = self._height(p, q, folds, theta)
            if height is None:
                return None
            coupler = diagonal * ((b - c) * (b + c) + square + 1j * height) / (2 * square)
            return _Place(coupler / b, (coupler - diagonal) / c, height / (2 * b * c))
        r, b, e = map(_number, self._lengths)
        y = e - r * mp.sin(theta)
        fr, fb, fe = self._lengths
        x = self._height(b + y, b - y, (fb + fe == fr, fb - fe == fr), theta + mp.pi / 2)
        if x is None:
            return None
        return _Place(mp.mpc(x, y) * turn / b, mp.mpc(r * mp.cos(theta) + x), x / b)

    def _height(
        self, p: _Number, q: _Number, folds: tuple[bool, bool], theta: _Number
    ) -> _Number | None:
        """The root of p q with the sign of the assembly, which alternates at change points."""
        if p < 0 or q < 0:
            # At an exact change point rounding may leave less than nothing.
            if min(p, q) < -(mp.mpf(10) ** (10 - mp.dps)) * (abs(p) + abs(q)) or not any(folds):
                return None
            p, q = max(p, mp.mpf(0)), max(q, mp.mpf(0))
        sign = self._side
        if folds[0] and mp.cos(theta / 2) < 0:
            sign = -sign
        if folds[1] and mp.sin(theta / 2) < 0:
            sign = -sign
        return sign * mp.sqrt(p) * mp.sqrt(q)

    def _solve(self, crank: _Number, place: _Place) -> Exact:
        """The accelerations and the torque that give the crank its motion, all at once."""
        speed, change = map(mp.mpf, self._motion)
        zero, one, bodies = mp.mpf(0), mp.mpf(1), self._bodies
        places = [_unit(crank), _vector(place.coupler), _vector(place.output)]
        rates = bodies.closed(places, speed, [])
        closure, (x, y) = bodies.closure(places, rates)
        masses, forces = bodies.balance(places, rates)
        rows = [[*masses[j], closure[0][j], closure[1][j], zero if j else -one] for j in range(3)]
        rows += [[*row, zero, zero, zero] for row in (*closure, [one, zero, zero])]
        found = eliminate(rows, [*forces, -x, -y, change])
        slides = bodies.slides[-1]
        position = mp.arg(place.coupler), place.output.real if slides else mp.arg(place.output)
        return Exact(position, tuple(rates[1:]), tuple(found[1:3]), (found[5],))


def _unit(angle: _Number) -> Vector:
    return _vector(mp.expj(angle))


def _vector(number: _Number) -> Vector:
    return Vector(number.real, number.imag)


def _mean(a: _Values, b: _Values) -> _Values:
    # Angles to both sides of pi are the same angle.
    return tuple(
        x + mp.arg(mp.expj(y - x)) / 2 if abs(x - y) > 3 else (x + y) / 2
        for x, y in zip(a, b, strict=True)
    )


def _number(length: Fraction) -> _Number:
    return mp.mpf(length.numerator) / length.denominator
