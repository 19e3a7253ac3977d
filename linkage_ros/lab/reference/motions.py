# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The motions that integrators are measured against: right to 1e-17 in SI units.

The multibody equations are followed by extrapolation (Gragg, Bulirsch and Stoer: Hairer, Norsett
and Wanner, Solving Ordinary Differential Equations I, II.9), which is no registered method. Unit
vectors turn in place of angles, so that no trigonometry is left, and the numbers are decimals of
34 digits, which C computes five times as fast as mpmath. Shorter steps, a quadrature of the energy
and an oracle of another hand agree (test/test_integrators.py).
"""

from __future__ import annotations

from decimal import Context, Decimal, localcontext
from typing import Any, TypeAlias

import numpy as np
from mpmath import mp
from scipy import optimize

from linkage_ros.formulas import Vector, cross, dot
from linkage_ros.lab.reference.multibody import Multibody, eliminate
from linkage_ros.lab.reference.problems import InitialValueProblem

_CONTEXT = Context(prec=34)
_LOOK = 0.04  # s between two looks for an end
_SHORTEST = Decimal('1e-6')  # s
_GROWTH = Decimal('1.1')  # of a step that was short enough
_ROWS = 12  # of the extrapolation at most: its order is twice that
_TOLERANCE = Decimal('1e-20')  # of a step, in SI units
_CLOSED = 4  # corrections of a position in doubles until all digits are right
_State: TypeAlias = Any  # an array of Decimals; NumPy has no type for it


class MotionReference:
    """Follows one motion.

    Attributes:
        time: Up to which it is followed, s.
    """

    def __init__(self, problem: InitialValueProblem, longest: float = 0.1) -> None:
        """Closes the loop at the start.

        Args:
            problem: The motion and its start.
            longest: Longest step, s.
        """
        self._problem = problem
        self._span = self._longest = Decimal(longest)
        with localcontext(_CONTEXT):
            self._bodies = Multibody(problem.mechanism, _CONTEXT.create_decimal, unit)
            self._motor = Decimal(problem.motor.torque), Decimal(problem.motor.damping)
            self.time = Decimal(0)
            self._state = self._begin()

    def at(self, time: float) -> tuple[Decimal, ...]:
        """The motion at a time.

        Args:
            time: s.

        Returns:
            Coordinates, then their rates; the crank with all its turns.
        """
        with localcontext(_CONTEXT):
            self._follow(Decimal(time) - self.time)
            self.time = Decimal(time)
            places, rates = self._split(self._state)
            slid = [(place.x, rate) for place, rate in zip(places, rates, strict=True)][3:]
            return self._state[0], *(x for x, _ in slid), rates[0], *(v for _, v in slid)

    def end(self, until: float) -> float | None:
        """When coupler and third link first come into line: there the coordinates end.

        Args:
            until: Where the search ends, s.

        Returns:
            Time, s, right to 1e-15 s; None: never until then.
        """
        start, time = self._sine(0.0) > 0, 0.0
        while time < until:
            before, time = time, time + _LOOK
            if (self._sine(time) > 0) != start:
                return float(optimize.brentq(self._sine, before, time, xtol=1e-16))
        return None

    def _sine(self, time: float) -> float:
        """The sine of the angle between coupler and third link at a time."""
        self.at(time)
        (_, coupler, third, *_), _rates = self._split(self._state)
        return float(cross(coupler, third))

    def _begin(self) -> _State:
        """The crank angle; the place of each link as two numbers; all rates."""
        count, bodies = self._problem.count, self._bodies
        q, u = self._problem.start[:count], self._problem.start[count:]
        # From doubles, which serve as a first guess.
        found = self._problem.driven.solver.state(q, u, (0.0,) * count).position
        places = [
            Vector(Decimal(x), Decimal(0)) if slides else unit(x)
            for x, slides in zip(found, bodies.slides, strict=True)
        ]
        for _ in range(_CLOSED):
            turns = bodies.dependent(places, bodies.gap(places))
            for j, turn in enumerate(turns, 1):
                places[j] = _turned_by(places[j], turn)
        rates = bodies.closed(places, Decimal(u[0]), [Decimal(rate) for rate in u[1:]])
        return np.array([Decimal(q[0]), *(x for place in places for x in place), *rates])

    def _split(self, state: _State) -> tuple[list[Vector], list[Decimal]]:
        count = len(self._bodies.slides)
        places = state[1 : 1 + 2 * count].reshape(count, 2)
        return [Vector(*place) for place in places], state[1 + 2 * count :].tolist()

    def _slope(self, state: _State) -> _State:
        places, rates = self._split(state)
        torque, damping = self._motor
        slides = self._bodies.slides
        moving = [
            Vector(rate, Decimal(0)) if slid else place.left() * rate
            for place, rate, slid in zip(places, rates, slides, strict=True)
        ]
        found = self._bodies.accelerations(places, rates, torque - damping * rates[0], eliminate)
        return np.array([rates[0], *(x for vector in moving for x in vector), *found])

    def _follow(self, left: Decimal) -> None:
        """Follows the motion for a time, s, in steps as long as the extrapolation allows.

        Raises:
            ArithmeticError: No step is short enough.
        """
        while left:
            span = max(-self._span, min(self._span, left))
            try:
                found = self._extrapolated(span)
            except ArithmeticError:  # of a step that went astray
                found = None
            if found is not None:
                self._state, left = found, left - span
                self._span = min(self._longest, self._span * _GROWTH)
            elif abs(span) < _SHORTEST:
                raise ArithmeticError(f'the reference cannot be followed beyond {self.time} s')
            else:
                self._span = abs(span) / 2

    def _extrapolated(self, span: Decimal) -> _State | None:
        """The state after a step; None: its rows differ by more than the tolerance."""
        slope = self._slope(self._state)
        above: list[_State] = []
        for i in range(1, _ROWS + 1):
            row = [self._midpoint(slope, span, 2 * i)]
            for j, old in enumerate(above, 1):
                row.append(row[-1] + (row[-1] - old) / (Decimal(i * i) / (i - j) ** 2 - 1))
            if above and abs(row[-1] - above[-1]).max() <= _TOLERANCE:
                return row[-1]
            above = row
        return None

    def _midpoint(self, slope: _State, span: Decimal, parts: int) -> _State:
        """Gragg's modified midpoint rule."""
        h, before = span / parts, self._state
        here = before + h * slope
        for _ in range(parts - 1):
            before, here = here, before + 2 * h * self._slope(here)
        return here


def unit(angle: float) -> Vector:
    """The unit vector in the direction of a double, rad, in Decimals."""
    with mp.workdps(40):
        return Vector(Decimal(str(mp.cos(angle))), Decimal(str(mp.sin(angle))))


def _turned_by(place: Vector, turn: Decimal) -> Vector:
    """A unit vector turned by a little."""
    moved = place + place.left() * turn
    length: Decimal = dot(moved, moved).sqrt()
    return moved * (1 / length)
