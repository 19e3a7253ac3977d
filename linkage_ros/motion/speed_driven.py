# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The motion of a speed-driven crank: exact at every stamp, after a second or after years.

Nothing is ever added step by step. A piece of motion is a phase and a speed at a stamp and the
speed it moves to; its phase at a later stamp is one expression in whole numbers of nanoseconds,
reduced by whole turns, and only then rounded to a float, once.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction
from typing import NamedTuple

from linkage_ros.motion.drives import SpeedDrive
from linkage_ros.units import NS_PER_S

# Phases, speeds and accelerations are whole numbers of 2^-128 turn, rpm and rpm/s. Every rpm
# above 1e-22 that a double can hold is one exactly; what rounding there is stays below 1e-38.
_GRID = 1 << 128
_NS_PER_MINUTE = 60 * NS_PER_S
# Turns at a changing speed, rate t^2 / 2 in rpm/s and ns, are whole numbers of 1 / this.
_RAMP = 120 * NS_PER_S * NS_PER_S
# 2 pi in whole numbers of 2^-256.
_TWO_PI_GRID = 1 << 256
_TWO_PI = 0x6487ED5110B4611A62633145C06E0E68948127044533E63A0105DF531D89CD913


class CrankState(NamedTuple):
    """The crank, and what else is a coordinate, at one stamp.

    Attributes:
        angle: Within [0, 4 pi), rad: a state repeats after at most two turns.
        unwrapped: The whole angle turned, correctly rounded, rad.
        speed: rad/s.
        acceleration: rad/s^2.
        slide: Position, m, velocity and acceleration of a free slider; empty: there is none.
    """

    angle: float
    unwrapped: float
    speed: float
    acceleration: float
    slide: tuple[float, ...] = ()

    @property
    def q(self) -> tuple[float, ...]:
        """All coordinates, the crank within two turns, rad and m."""
        return self.angle, *self.slide[:1]

    @property
    def u(self) -> tuple[float, ...]:
        """Their rates, rad/s and m/s."""
        return self.speed, *self.slide[1:2]

    @property
    def a(self) -> tuple[float, ...]:
        """Their accelerations, rad/s^2 and m/s^2."""
        return self.acceleration, *self.slide[2:]


class CrankMotion:
    """One piece of motion: from a phase and a speed at a stamp to the speed that was asked for.

    Attributes:
        stamp: Start, ns.
        rpm: The speed it moves to, turns per minute.
        acceleration: At which it does so, rad/s^2, not negative; 0: at once.
        before: What the moment of the start was called until then, ns, where a step of the clock
            began the piece; None: the clock went on.
    """

    def __init__(
        self,
        stamp: int,
        phase: Fraction,
        speed: Fraction,
        rpm: float,
        acceleration: float,
        before: int | None = None,
    ) -> None:
        """Describes a piece of motion.

        Args:
            stamp: Start, ns.
            phase: Turns at the start.
            speed: At the start, turns per minute; ignored where acceleration is 0.
            rpm: Speed to move to, turns per minute.
            acceleration: Not negative, rad/s^2.
            before: The start on the clock as it stood before a step; None: there was none.
        """
        self.stamp, self.rpm, self.acceleration = stamp, rpm, acceleration
        self.before = before
        self._phase, self._target = round(phase * _GRID), round(Fraction(rpm) * _GRID)
        self._speed = round(speed * _GRID) if acceleration else self._target
        gap = self._target - self._speed
        rate = round(Fraction(acceleration) * 60 * _TWO_PI_GRID * _GRID / _TWO_PI)
        self._rate = max(rate, 1)  # an acceleration next to nothing still is none "at once"
        self._ramp_ns = Fraction(abs(gap) * NS_PER_S, self._rate) if gap else Fraction(0)
        self._rate = self._rate if gap > 0 else -self._rate
        # Once settled, the crank is where it would be had it always turned at its final speed,
        # but for gap^2 / (2 rate).
        lost = Fraction(gap * gap, 120 * self._rate) if gap else Fraction(0)
        self._settled_phase = self._phase - round(lost)
        self._settled_speed = _radians(self._target, 60 * _GRID)

    @classmethod
    def begin(cls, drive: SpeedDrive, stamp: int) -> CrankMotion:
        """The motion that a drive asks for from its start.

        Args:
            drive: The settings.
            stamp: Start, ns.

        Returns:
            The first piece of motion.
        """
        phase = Fraction(drive.crank_angle) * _TWO_PI_GRID / _TWO_PI
        # Without acceleration the first change of speed happens at once, at t = 0.
        return cls(stamp, phase, Fraction(drive.initial_rpm), drive.rpm, drive.crank_acceleration)

    def at(self, stamp: int) -> CrankState:
        """The crank at a stamp at or after the start.

        Args:
            stamp: ns.

        Returns:
            Angle, speed and acceleration, each rounded once.
        """
        elapsed = stamp - self.stamp
        if elapsed >= self._ramp_ns:
            scale = _NS_PER_MINUTE
            turned = self._settled_phase * scale + self._target * elapsed
            speed, acceleration = self._settled_speed, 0.0
        else:
            scale = _RAMP
            turned = self._ramp_turned(elapsed)
            speed = _radians(self._speed * NS_PER_S + self._rate * elapsed, _GRID * _NS_PER_MINUTE)
            acceleration = self.acceleration if self._rate > 0 else -self.acceleration
        turn = _GRID * scale
        unwrapped = _radians(turned, turn)
        if 0 <= turned < 2 * turn:
            return CrankState(unwrapped, unwrapped, speed, acceleration)
        return CrankState(_radians(turned % (2 * turn), turn), unwrapped, speed, acceleration)

    @property
    def target(self) -> float:
        """What may be set while it runs: the speed it moves to, turns per minute."""
        return self.rpm

    def next(self, stamp: int, rpm: float) -> CrankMotion:
        """The piece that a stamp lies in: this one, or a new one where the speed is another.

        Args:
            stamp: ns.
            rpm: The speed to move to, turns per minute.

        Returns:
            The piece.
        """
        return self if rpm == self.rpm else self.change(stamp, rpm)

    def words(self) -> str:
        """From where to which speed it moves."""
        crank = self.at(self.stamp)
        ramp = f' at {self.acceleration:g} rad/s^2' if self.acceleration else ''
        return f'from {crank.unwrapped:.6f} rad, {crank.speed:.6f} rad/s to {self.rpm:g} rpm{ramp}'

    def _ramp_turned(self, elapsed: int) -> int:
        """Turns while the speed changes, in units of 1 / (_RAMP grid)."""
        linear = 2 * NS_PER_S * self._speed * elapsed
        return self._phase * _RAMP + linear + self._rate * elapsed * elapsed

    def change(self, stamp: int, rpm: float, restamp: int | None = None) -> CrankMotion:
        """The motion from a stamp on, its phase and speed continued.

        Args:
            stamp: Where the change happens, ns.
            rpm: The new speed to move to, turns per minute.
            restamp: What this moment is called from now on, where the clock was stepped.

        Returns:
            The next piece of motion.
        """
        continued = self.phase(stamp), self.speed(stamp), rpm, self.acceleration
        if restamp is None:
            return CrankMotion(stamp, *continued)
        return CrankMotion(restamp, *continued, before=stamp)

    def time_to_turn(self, turns: int) -> int | None:
        """The first moment at which the crank is this many turns from its start, either way.

        Args:
            turns: More than 0.

        Returns:
            ns after the start; None: it never is.
        """
        goal = turns * _GRID

        def reached(elapsed: int) -> bool:
            return abs(self.phase(self.stamp + elapsed) * _GRID - self._phase) >= goal

        reversal = self._speed * NS_PER_S // -self._rate if self._speed * self._rate < 0 else 0
        # The farthest point before it may lie on either side of the moment of reversal.
        for turning in (reversal, reversal + 1):
            if reversal and reached(turning):
                return _first(reached, 0, turning)
        end = math.ceil(self._ramp_ns)
        if self._target == 0 and not reached(end):
            return None
        # From the reversal on the distance grows, after it has perhaps passed the start.
        late = max(reversal, end) + 1
        while not reached(late):
            late *= 2
        return _first(reached, reversal, late)

    def phase(self, stamp: int) -> Fraction:
        """Turns at a stamp, unwrapped."""
        elapsed = stamp - self.stamp
        if elapsed >= self._ramp_ns:
            turned = self._settled_phase * _NS_PER_MINUTE + self._target * elapsed
            return Fraction(turned, _GRID * _NS_PER_MINUTE)
        return Fraction(self._ramp_turned(elapsed), _GRID * _RAMP)

    def speed(self, stamp: int) -> Fraction:
        """Turns per minute at a stamp."""
        elapsed = stamp - self.stamp
        if elapsed >= self._ramp_ns:
            return Fraction(self._target, _GRID)
        return Fraction(self._speed * NS_PER_S + self._rate * elapsed, _GRID * NS_PER_S)


def _first(reached: Callable[[int], bool], low: int, high: int) -> int:
    """The first number from low to high for which a condition, once true, stays true.

    bisect cannot: its ranges end at 2^63, ours do not.
    """
    while low < high:
        middle = (low + high) // 2
        low, high = (low, middle) if reached(middle) else (middle + 1, high)
    return low


def _radians(numerator: int, turn: int) -> float:
    """2 pi numerator / turn, correctly rounded."""
    return numerator * _TWO_PI / (turn * _TWO_PI_GRID)
