# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The states that methods are measured against: textbook formulas in 130 digits.

Circles are intersected, the loop is differentiated and solved, the powers of all bodies are
added up. All of this cancels near change points: 100 digits are left in every situation
(test/test_methods.py). At a change point itself it is 0/0; the motion is smooth there, so the
mean of two states 1e-60 rad to either side is the limit.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any, NamedTuple, TypeAlias

from mpmath import mp

from linkage_ros.errors import UnreachableError
from linkage_ros.lab.methods.chain import Task
from linkage_ros.model.four_bar import FourBar
from linkage_ros.model.parts import OPEN
from linkage_ros.model.slider_crank import SliderCrank
from linkage_ros.model.structure import Structure

_DIGITS = 130
_ASIDE = '1e-60'
# Where the sine of the transmission angle is smaller, the mean of two states is taken.
_STRAIGHT = '1e-25'
_MANY_TURNS = 1e30  # rad; no angle
_Number: TypeAlias = Any  # an mpf or mpc; mpmath has no types
_Values: TypeAlias = tuple[_Number, ...]


class Exact(NamedTuple):
    """A state, in mpf.

    Attributes:
        position: Of the coupler, rad, and of the output, rad or m.
        rate: Their velocities, per s.
        acceleration: Their accelerations, per s^2.
        torque: The driving torque, N m, in a tuple of one.
    """

    position: _Values
    rate: _Values
    acceleration: _Values
    torque: _Values


class Reference:
    """States of one mechanism, right to 100 digits."""

    def __init__(self, task: Task, lengths: Sequence[str] | None) -> None:
        """Takes the mechanism's doubles as they are.

        Args:
            task: The mechanism and its motion.
            lengths: Decimal texts of crank, coupler, rocker and frame, or crank, coupler and
                offset, that the doubles stand for; None: the doubles are meant.
        """
        mechanism = task.mechanism
        self._task, self._mechanism = task, mechanism
        self._structure: Structure = mechanism.structure()
        links = [mechanism.crank.length, mechanism.coupler.length]
        if isinstance(mechanism, FourBar):
            links += [mechanism.rocker.length, mechanism.frame.length]
        else:
            links += [mechanism.slider.offset]
        self._lengths = tuple(Fraction(length) for length in lengths or links)
        self._side = 1 if mechanism.assembly == OPEN else -1

    @staticmethod
    def difference(value: float, exact: _Number, *, is_angle: bool) -> float:
        """What a double lacks, all digits of the exact value counted; angles without turns."""
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
            UnreachableError: The loop does not close there, or a limit of the crank is there.
        """
        with mp.workdps(_DIGITS):
            place = self._locate(mp.mpf(crank))
            if place is None:
                raise UnreachableError('the loop does not close', crank_angle=crank, arcs=())
            if abs(place[2]) > mp.mpf(_STRAIGHT):
                return self._differentiate(mp.mpf(crank), *place[:2])
        with mp.workdps(3 * _DIGITS):
            # Where a side is beyond a limit of the crank there is no state to both sides.
            beside = [mp.mpf(crank) + sign * mp.mpf(_ASIDE) for sign in (-1, 1)]
            places = [self._locate(angle) for angle in beside]
            if any(place is None for place in places):
                raise UnreachableError('the crank is at its limit', crank_angle=crank, arcs=())
            states = [
                self._differentiate(angle, *place[:2])
                for angle, place in zip(beside, places, strict=True)
                if place is not None
            ]
            return Exact(*(_mean(*values) for values in zip(*states, strict=True)))

    def _locate(self, crank: _Number) -> tuple[_Number, _Number, _Number] | None:
        """Coupler and output as complex numbers, and the sine of the transmission angle."""
        if isinstance(self._mechanism, FourBar):
            r, b, c, d = (_number(x) for x in self._lengths)
            delta = mp.mpf(self._mechanism.frame.angle)
            delta -= 2 * mp.pi * mp.nint(delta / (2 * mp.pi))
            theta = crank - delta
            diagonal = mp.expj(delta) * (d - r * mp.expj(theta))
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
            return coupler, coupler - diagonal, height / (2 * b * c)
        r, b, e = (_number(x) for x in self._lengths)
        guide = mp.mpf(self._mechanism.frame.angle)
        theta = crank - (guide - 2 * mp.pi * mp.nint(guide / (2 * mp.pi)))
        y = e - r * mp.sin(theta)
        fr, fb, fe = self._lengths
        folds = fb + fe == fr, fb - fe == fr
        x = self._height(b + y, b - y, folds, theta + mp.pi / 2)
        if x is None:
            return None
        turn = mp.expj(guide)
        return mp.mpc(x, y) * turn, (r * mp.cos(theta) + x) * turn, x / b

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

    def _differentiate(self, crank: _Number, coupler: _Number, output: _Number) -> Exact:
        speed, change = mp.mpf(self._task.speed), mp.mpf(self._task.acceleration)
        arm = _number(self._lengths[0]) * mp.expj(crank)
        guide = mp.expj(mp.mpf(self._mechanism.frame.angle))
        slides = self._structure.links[-1].slides
        columns = 1j * coupler, -guide if slides else -1j * output
        ratios = _solve(*columns, -1j * arm)
        rates = tuple(ratio * speed for ratio in ratios)
        bias = -arm * speed**2 - coupler * rates[0] ** 2
        if not slides:
            bias += output * rates[1] ** 2
        changes = _solve(*columns, -1j * arm * change - bias)
        position = mp.arg(coupler), (output / guide).real if slides else mp.arg(output)
        torque = self._torque(
            (crank, *position), (mp.mpf(1), *ratios), (speed, *rates), (change, *changes)
        )
        return Exact(position, rates, changes, (torque,))

    def _torque(
        self, position: _Values, ratios: _Values, rates: _Values, changes: _Values
    ) -> _Number:
        """What the powers of all bodies need per speed of the crank."""
        gravity = mp.mpc(*self._mechanism.gravity)
        directions = [mp.expj(angle) for angle in position]
        power = mp.mpf(0)
        *others, last = self._structure.links
        for i, body in enumerate(others if last.slides else self._structure.links):
            velocity, acceleration = mp.mpc(0), mp.mpc(0)
            weights = self._weights(body.center.weights)
            for j, weight in enumerate(weights):
                arm = weight * directions[j]
                velocity += 1j * ratios[j] * arm
                acceleration += (1j * changes[j] - rates[j] ** 2) * arm
            power += body.mass * ((acceleration - gravity) * velocity.conjugate()).real
            power += mp.mpf(body.inertia) * changes[i] * ratios[i]
        if isinstance(self._mechanism, SliderCrank):
            slider = self._mechanism.slider
            along = (gravity / mp.expj(mp.mpf(self._mechanism.frame.angle))).real
            push = slider.mass * (changes[2] - along) + slider.damping * rates[2] - slider.force
            power += push * ratios[2]
        return power

    def _weights(self, weights: tuple[complex, ...]) -> list[_Number]:
        """Weights of a point, the crank's length in the meant digits."""
        others = weights[1:]
        if any(others[:1]):
            return [_number(self._lengths[0]), *(mp.mpc(weight) for weight in others)]
        return [mp.mpc(weight) for weight in weights]


def _solve(first: _Number, second: _Number, right: _Number) -> tuple[_Number, _Number]:
    """The factors x and y with x * first + y * second = right, all of them vectors."""
    determinant = (first.conjugate() * second).imag
    return (
        (right.conjugate() * second).imag / determinant,
        (first.conjugate() * right).imag / determinant,
    )


def _mean(a: _Values, b: _Values) -> _Values:
    # Angles to both sides of pi are the same angle.
    return tuple(
        x + mp.arg(mp.expj(y - x)) / 2 if abs(x - y) > 3 else (x + y) / 2
        for x, y in zip(a, b, strict=True)
    )


def _number(length: Fraction) -> _Number:
    return mp.mpf(length.numerator) / length.denominator
