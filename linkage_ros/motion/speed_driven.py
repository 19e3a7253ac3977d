# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The motion of a speed-driven crank: exact at every stamp, after a second or after years.

Errors do not accumulate, because nothing is summed step by step. A segment has a phase and a speed
at a stamp, and a set speed; the phase at a later stamp is one expression in whole nanoseconds,
reduced by whole turns and then rounded once to a float.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any

import numpy as np

from linkage_ros.motion.coordinates import Coordinates, stacked
from linkage_ros.motion.drives import SpeedDrive
from linkage_ros.motion.segments import SpeedSegment
from linkage_ros.units import NS_PER_S

# Phases, speeds and accelerations are whole numbers of 2^-128 turn, rpm and rpm/s. Every double
# above 1e-22 rpm is such a number exactly; smaller values are rounded by less than 1e-38.
_GRID = 1 << 128
# After whole ns, speeds are whole numbers of 1 / _RPM rpm, and phases, with rate t^2 / 2, are
# whole numbers of 1 / _TURN turn.
_RPM = _GRID * NS_PER_S
_TURN = _RPM * 120 * NS_PER_S
# 2 pi in whole numbers of 2^-256.
_TWO_PI_GRID = 1 << 256
_TWO_PI = 0x6487ED5110B4611A62633145C06E0E68948127044533E63A0105DF531D89CD913
# Angles and speeds are rounded from whole numbers of 2^-_BITS rad and rad/s. A multiplication by
# the size of the unit takes far less time than a division by its inverse.
_BITS = 600
_TURN_SIZE = (_TWO_PI << _BITS) // (_TURN * _TWO_PI_GRID)
_SPEED_SIZE = (_TWO_PI << _BITS) // (60 * _RPM * _TWO_PI_GRID)


class SpeedMotion:
    """The exact motion in one segment.

    Attributes:
        segment: The segment, as in logs.
    """

    def __init__(self, segment: SpeedSegment) -> None:
        self.segment = segment
        self._phase = round(segment.phase * _GRID)
        self._target = round(Fraction(segment.rpm) * _GRID)
        self._speed = round(segment.speed * _GRID)
        gap = self._target - self._speed
        rate = round(Fraction(segment.acceleration) * 60 * _TWO_PI_GRID * _GRID / _TWO_PI)
        rate = max(rate, 1)  # a tiny acceleration must not count as "at once"
        self._ramp_ns = math.ceil(Fraction(abs(gap) * NS_PER_S, rate))
        self._rate = rate if gap > 0 else -rate
        # A settled crank differs by gap^2 / (2 rate) from one that has always turned at the
        # final speed.
        settled = self._phase - round(Fraction(gap * gap, 120 * self._rate))
        self._settled_phase = settled * (_TURN // _GRID)
        self._settled_speed = _radians(self._target * NS_PER_S, _SPEED_SIZE)

    @classmethod
    def begin(cls, drive: SpeedDrive, stamp: int) -> SpeedMotion:
        """Starts the motion of a drive at t = 0.

        Args:
            drive: Settings of the crank's motion.
            stamp: Stamp of t = 0, ns.

        Returns:
            The motion in the first segment.
        """
        phase = Fraction(drive.crank_angle) * _TWO_PI_GRID / _TWO_PI
        # Without acceleration the first change of speed happens at once, at t = 0.
        speed = Fraction(drive.initial_rpm)
        return cls(_segment(stamp, phase, speed, drive.rpm, drive.crank_acceleration))

    def at(self, stamp: int) -> Coordinates:
        """The crank at a stamp at or after the start.

        Args:
            stamp: ns.

        Returns:
            Angle, speed and acceleration, each rounded once.
        """
        elapsed = stamp - self.segment.stamp
        turned, speed, acceleration = self._phase_after(elapsed), self._settled_speed, 0.0
        unwrapped = angle = _radians(turned, _TURN_SIZE)
        if not 0 <= turned < 2 * _TURN:
            angle = _radians(turned % (2 * _TURN), _TURN_SIZE)
        if elapsed < self._ramp_ns:
            speed = _radians(self._speed_after(elapsed), _SPEED_SIZE)
            acceleration = math.copysign(self.segment.acceleration, self._rate)
        return Coordinates((angle,), (speed,), (acceleration,), unwrapped)

    def at_all(self, stamps: Sequence[int]) -> Coordinates:
        """The crank at many stamps, with the same bits as `at`.

        Args:
            stamps: Increasing stamps, at or after the start, ns.

        Returns:
            Arrays; if the speed has settled, speed and acceleration are floats.
        """
        elapsed = [stamp - self.segment.stamp for stamp in stamps]
        if elapsed[0] < self._ramp_ns:
            return stacked([self.at(stamp) for stamp in stamps])
        rate = self._target * 2 * NS_PER_S
        turned = [self._settled_phase + rate * time for time in elapsed]
        unwrapped = angle = np.array([_radians(phase, _TURN_SIZE) for phase in turned])
        if not 0 <= min(turned[0], turned[-1]) <= max(turned[0], turned[-1]) < 2 * _TURN:
            angle = np.array([_radians(phase % (2 * _TURN), _TURN_SIZE) for phase in turned])
        return Coordinates((angle,), (self._settled_speed,), (0.0,), unwrapped)

    def follow(self, stamp: int, drive: Any) -> SpeedMotion:
        """The motion from a stamp on under a drive; a new motion if the speed was set.

        Args:
            stamp: ns.
            drive: The SpeedDrive in force.

        Returns:
            The motion.
        """
        return self if drive.rpm == self.segment.rpm else self.change(stamp, drive.rpm)

    def restamp(self, old: int, new: int) -> SpeedMotion:
        """The motion after a step of the clock, with continuous phase and speed.

        Args:
            old: Moment of the step on the old clock, ns.
            new: The same moment on the new clock, ns.

        Returns:
            The motion in the next segment.
        """
        return self.change(old, self.segment.rpm, new)

    def change(self, stamp: int, rpm: float, restamp: int | None = None) -> SpeedMotion:
        """The motion after a change, with continuous phase and speed.

        Args:
            stamp: Stamp of the change, ns.
            rpm: The new set speed, turns per minute.
            restamp: The same moment on the clock after a step, ns; None: no step of the clock.

        Returns:
            The motion in the next segment.
        """
        start, old = (stamp, None) if restamp is None else (restamp, stamp)
        continued = self.phase(stamp), self.speed(stamp)
        return SpeedMotion(_segment(start, *continued, rpm, self.segment.acceleration, old))

    def phase(self, stamp: int) -> Fraction:
        """Turns at a stamp, unwrapped."""
        return Fraction(self._phase_after(stamp - self.segment.stamp), _TURN)

    def speed(self, stamp: int) -> Fraction:
        """Turns per minute at a stamp."""
        return Fraction(self._speed_after(stamp - self.segment.stamp), _RPM)

    def time_to_turn(self, turns: int) -> int | None:
        """Finds the first moment at which the crank is a number of turns from its start.

        The turns may be forwards or backwards.

        Args:
            turns: More than 0.

        Returns:
            Time after the start, ns; None: never.
        """
        start, goal = self._phase_after(0), turns * _TURN

        def reached(elapsed: int) -> bool:
            return abs(self._phase_after(elapsed) - start) >= goal

        reversal = self._speed * NS_PER_S // -self._rate if self._speed * self._rate < 0 else 0
        late = max(reversal, self._ramp_ns) + 1
        while self._target and not reached(late):
            late *= 2
        # Before the reversal, the distance from the start grows. Its largest value may be at the
        # last ns before the reversal or the first after it. Later, the distance grows again from
        # the moment at which the crank passes the start.
        for low, high in ((0, reversal), (0, reversal + 1), (reversal, late)):
            if reached(high):
                return _first(reached, low, high)
        return None

    def _phase_after(self, elapsed: int) -> int:
        """The phase after a time, ns, in 1 / _TURN turn."""
        twice = 2 * NS_PER_S * elapsed
        if elapsed >= self._ramp_ns:
            return self._settled_phase + self._target * twice
        return self._phase * (_TURN // _GRID) + self._speed * twice + self._rate * elapsed**2

    def _speed_after(self, elapsed: int) -> int:
        """The speed after a time, ns, in 1 / _RPM rpm."""
        if elapsed >= self._ramp_ns:
            return self._target * NS_PER_S
        return self._speed * NS_PER_S + self._rate * elapsed


def _segment(
    stamp: int,
    phase: Fraction,
    speed: Fraction,
    rpm: float,
    acceleration: float,
    old_stamp: int | None = None,
) -> SpeedSegment:
    """Makes a segment with phase and speed on the grid.

    Without acceleration, the segment starts at its set speed.
    """
    speed = speed if acceleration else Fraction(rpm)
    phase, speed = (Fraction(round(value * _GRID), _GRID) for value in (phase, speed))
    return SpeedSegment(stamp, phase, speed, rpm, acceleration, old_stamp)


def _first(reached: Callable[[int], bool], low: int, high: int) -> int:
    """Finds the smallest number from low to high that meets a condition.

    The condition must also hold for all larger numbers. Numbers may exceed 2^63, the limit of
    bisect.
    """
    while low < high:
        middle = (low + high) // 2
        low, high = (low, middle) if reached(middle) else (middle + 1, high)
    return low


def _radians(number: int, size: int) -> float:
    """Converts a number of units to rad or rad/s, correctly rounded; the unit is in 2^-_BITS."""
    return math.ldexp(float(number * size), -_BITS)
