# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The motions that integrators are measured against: right to 1e-17 in SI units.

The loop is cut open (`cut_loop`), so that no formula of the package's own equations of motion is
used, and the motion is followed by extrapolation (Gragg, Bulirsch and Stoer: Hairer, Norsett and
Wanner, Solving Ordinary Differential Equations I, II.9), which is no registered method, in
decimals of 34 digits. Instead of angles, cosines and sines turn, cos' = -w sin and sin' = w cos:
no trigonometry is left. A step is right to 1e-20; how close a motion comes is told by shorter
steps of another order, by a quadrature of the energy and by an oracle of another hand
(test/test_integrators.py).
"""

from __future__ import annotations

from decimal import Context, Decimal, localcontext
from typing import NamedTuple, TypeAlias

from mpmath import mp

from linkage_ros.lab.methods.cut_loop import CutLoop, Pair, eliminate
from linkage_ros.lab.methods.loop import solve_2x2
from linkage_ros.lab.methods.problems import InitialValueProblem

_CONTEXT = Context(prec=34)
_LOOK = Decimal('0.04')  # s between two looks for an end
_SHORTEST = Decimal('1e-6')  # s
_CLOSED = 4  # corrections of a position in doubles until all digits are right
_State: TypeAlias = tuple[Decimal, ...]


class Accuracy(NamedTuple):
    """How closely a reference is followed.

    Attributes:
        longest: Step, s.
        rows: Of the extrapolation: its order is twice that.
        tolerance: What the last two rows of a step may differ by, in SI units.
    """

    longest: Decimal = Decimal('0.1')
    rows: int = 12
    tolerance: Decimal = Decimal('1e-20')


class MotionReference:
    """Follows one motion.

    Attributes:
        time: Up to which it is followed, s.
    """

    def __init__(self, problem: InitialValueProblem, accuracy: Accuracy | None = None) -> None:
        """Closes the loop at the start.

        Args:
            problem: The motion and its start.
            accuracy: Of the steps.
        """
        self._accuracy = accuracy or Accuracy()
        self._span = self._accuracy.longest
        self._problem = problem
        with localcontext(_CONTEXT):
            self._loop = CutLoop(problem.mechanism, _CONTEXT.create_decimal, unit)
            motor = problem.motor
            self._torque, self._damping = Decimal(motor.torque), Decimal(motor.damping)
            self.time = Decimal(0)
            self._state = self._begin()

    def at(self, time: float) -> tuple[Decimal, ...]:
        """The motion at a time.

        Args:
            time: Not before the time reached, s.

        Returns:
            Coordinates, then their rates; the crank with all its turns.
        """
        with localcontext(_CONTEXT):
            self._follow(Decimal(time))
            angle, *rest = self._state
            if not self._loop.slides:
                return angle, rest[-3]
            return angle, rest[6], rest[7], rest[10]

    def end(self, until: float) -> float | None:
        """When coupler and third link first come into line: there the coordinates end.

        Args:
            until: Where the search ends, s.

        Returns:
            Time, s, right to 1e-15 s; None: never until then.
        """
        with localcontext(_CONTEXT):
            side = self._sine() > 0
            while self.time < Decimal(until):
                before = self.time, self._state, self._sine()
                self._follow(self.time + _LOOK)
                if (self._sine() > 0) != side:
                    return self._line(before, (self.time, self._sine()))
        return None

    def _line(
        self,
        before: tuple[Decimal, _State, Decimal],
        after: tuple[Decimal, Decimal],
    ) -> float:
        """Where the sine vanishes between two times: secants, kept between them."""
        (low, _, one), (high, other) = before, after
        first, last, side = low, high, one > 0
        while abs(last - first) > Decimal('1e-17'):
            middle = last - other * (last - first) / (other - one)
            if not low < middle < high:
                middle = (low + high) / 2
            self.time, self._state = before[:2]
            self._follow(middle)
            (first, one), (last, other) = (last, other), (middle, self._sine())
            low, high = (middle, high) if (other > 0) == side else (low, middle)
        return float(last)

    def _sine(self) -> Decimal:
        c2, s2, c3, s3 = self._state[3:7]
        return c2 * s3 - s2 * c3

    def _begin(self) -> _State:
        """Angle of the crank; cosine and sine of each link; slider; all rates."""
        loop, count = self._loop, self._problem.count
        q, u = self._problem.start[:count], self._problem.start[count:]
        # From doubles, which serve as a first guess.
        links = self._problem.driven.solver.state(q, u, (0.0,) * count).position[:3]
        directions = [unit(angle) for angle in (q[0], *links[1:])]
        place = [Decimal(x) for x in q[1:]]
        velocity = [Decimal(x) for x in u[1:]]
        arms = []
        for _ in range(_CLOSED):
            gap = loop.gap(directions, place[0] if place else None)
            arms = [(-d * s, d * c) for d, (c, s) in zip(loop.lengths, directions, strict=True)]
            turns = solve_2x2((arms[1], arms[2]), (-gap[0], -gap[1]))
            for j, turn in zip((1, 2), turns, strict=True):
                directions[j] = _turned(directions[j], turn)
        spin = Decimal(u[0])
        x, y = (velocity[0] if velocity else 0) - arms[0][0] * spin, -arms[0][1] * spin
        spins = spin, *solve_2x2((arms[1], arms[2]), (x, y))
        cosines = [value for pair in directions for value in pair]
        return Decimal(q[0]), *cosines, *place, *spins, *velocity

    def _slope(self, state: _State) -> _State:
        _, c1, s1, c2, s2, c3, s3, *rest = state
        velocity = None
        if self._loop.slides:
            rest, velocity = rest[1:4], rest[4]
        w1, w2, w3 = rest
        found = self._loop.accelerations(
            ((c1, s1), (c2, s2), (c3, s3)), rest, velocity, self._torque - self._damping * w1,
            eliminate,
        )  # fmt: skip
        turning = w1, -w1 * s1, w1 * c1, -w2 * s2, w2 * c2, -w3 * s3, w3 * c3
        return (*turning, *found) if velocity is None else (*turning, velocity, *found)

    def _follow(self, time: Decimal) -> None:
        """Steps as long as the extrapolation allows.

        Raises:
            ArithmeticError: No step is short enough.
        """
        tolerance = self._accuracy.tolerance
        while (left := time - self.time) > 0:
            span = min(self._span, left)
            try:
                state, apart = self._extrapolated(span)
            except ArithmeticError:  # of a step that went astray
                state, apart = self._state, Decimal('Infinity')
            if apart <= tolerance:
                # Not the sum where it ends: that is rounded.
                self._state, self.time = state, time if span == left else self.time + span
                if span == self._span and apart < tolerance / 10**5:
                    self._span = min(2 * span, self._accuracy.longest)
            elif span < _SHORTEST:
                raise ArithmeticError(f'the reference cannot be followed beyond {self.time} s')
            else:
                self._span = span / 2

    def _extrapolated(self, span: Decimal) -> tuple[_State, Decimal]:
        """One step: where it ends, and what its last two rows differ by."""
        start, slope = self._state, self._slope(self._state)
        above: list[_State] = []
        for i in range(1, self._accuracy.rows + 1):
            row = [self._midpoint(start, slope, span, 2 * i)]
            for j, old in enumerate(above, 1):
                part = Decimal(i * i) / (i - j) ** 2 - 1
                row.append(tuple([x + (x - y) / part for x, y in zip(row[-1], old, strict=True)]))
            last, above = above, row
        return above[-1], max(abs(x - y) for x, y in zip(above[-1], last[-1], strict=True))

    def _midpoint(self, start: _State, slope: _State, span: Decimal, parts: int) -> _State:
        """Gragg's modified midpoint rule."""
        h = span / parts
        before, here = start, _moved(start, h, slope)
        for _ in range(parts - 1):
            before, here = here, _moved(before, 2 * h, self._slope(here))
        return here


def unit(angle: float) -> Pair:
    """Cosine and sine of a double, in all digits.

    Args:
        angle: rad.

    Returns:
        Decimals.
    """
    with mp.workdps(40):
        return Decimal(str(mp.cos(angle))), Decimal(str(mp.sin(angle)))


def _moved(state: _State, h: Decimal, slope: _State) -> _State:
    """Of Decimals: the sums of motion/fixed_step_integrator.py begin with a double."""
    return tuple([value + h * rate for value, rate in zip(state, slope, strict=True)])


def _turned(direction: Pair, turn: Decimal) -> Pair:
    """A direction turned by a little, of length 1."""
    (cos, sin) = direction
    cos, sin = cos - sin * turn, sin + cos * turn
    length = (cos * cos + sin * sin).sqrt()
    return cos / length, sin / length
