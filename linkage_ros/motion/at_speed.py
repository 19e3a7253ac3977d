# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Motion of a speed-driven crank, exact at every stamp even after years.

Errors do not accumulate, because nothing is summed step by step. A segment defines phase and speed
at its start, and a set speed. The phase at a later stamp is a closed expression in integer
nanoseconds. It is reduced by whole turns and then rounded once to a float.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, cast

import numpy as np

from linkage_ros.mechanism.conditions import Conditions
from linkage_ros.motion.segments import Coordinates, Gravity, Motion, Segment, stacked
from linkage_ros.units import NS_PER_S, TIME_END, JointUnits

# Phases, speeds and accelerations are integers in units of 2^-128 turn, rpm and rpm/s. Doubles
# above 1e-22 are exact in these units; rounding changes smaller values by less than 1e-38.
_GRID = 1 << 128
# With time in integer ns, speeds are integers in units of 1 / _RPM rpm. Phases, which include
# rate t^2 / 2, are integers in units of 1 / _TURN turn.
_RPM = _GRID * NS_PER_S
_TURN = _RPM * 120 * NS_PER_S
# 2 pi in units of 2^-256.
_TWO_PI_GRID = 1 << 256
_TWO_PI = 0x6487ED5110B4611A62633145C06E0E68948127044533E63A0105DF531D89CD913
# Angles and speeds are rounded from integers in units of 2^-_BITS rad and rad/s. Multiplying by
# the size of a unit is much faster than dividing by its inverse.
_BITS = 600
_TURN_SIZE = (_TWO_PI << _BITS) // (_TURN * _TWO_PI_GRID)
_SPEED_SIZE = (_TWO_PI << _BITS) // (60 * _RPM * _TWO_PI_GRID)


@dataclass(frozen=True)
class SpeedSegment(Segment):
    """A segment in which the crank accelerates from an initial speed to the set speed.

    Attributes:
        phase: Crank angle at the start, turns.
        speed: Crank speed at the start, turns per minute.
        rpm: Set speed, turns per minute.
        acceleration: Magnitude of the acceleration towards the set speed, rad/s^2; 0 for an
            immediate change.
    """

    phase: Fraction
    speed: Fraction
    rpm: float
    acceleration: float
    old_stamp: int | None = None
    gravity: Gravity | None = None

    def motion(self) -> 'SpeedMotion':
        """Returns the motion in this segment."""
        return SpeedMotion(self)

    def words(self, units: JointUnits) -> str:  # noqa: ARG002, for other segments
        """Describes crank angle and speed at the start, and the set speed."""
        _, (speed,), _, angle, *_ = SpeedMotion(self).at(self.stamp)
        ramp = f' at {self.acceleration:g} rad/s^2' if self.acceleration else ''
        return f'from {angle:.6f} rad, {speed:.6f} rad/s to {self.rpm:g} rpm{ramp}'


class SpeedMotion(Motion):
    """The exact motion in one segment.

    Attributes:
        segment: The segment, in the form stored in logs.
    """

    segment: SpeedSegment

    def __init__(self, segment: SpeedSegment, conditions: Conditions | None = None) -> None:
        self.segment = segment
        self.conditions = segment.conditions if conditions is None else conditions
        self._phase = round(segment.phase * _GRID)
        self._target = round(Fraction(segment.rpm) * _GRID)
        self._speed = round(segment.speed * _GRID)
        gap = self._target - self._speed
        rpm_per_s = Fraction(segment.acceleration) * 60 * _TWO_PI_GRID / _TWO_PI
        # A tiny acceleration must not be treated as an immediate change.
        rate = max(round(rpm_per_s * _GRID), 1)
        self._ramp_ns = math.ceil(Fraction(abs(gap) * NS_PER_S, rate))
        self._rate = rate if gap > 0 else -rate
        # After the ramp, the phase differs by gap^2 / (2 rate), in rpm s, from that of a crank
        # that has always turned at the set speed. A turn is 60 rpm s.
        settled = self._phase - round(Fraction(gap * gap, 120 * self._rate))
        self._settled_phase = settled * (_TURN // _GRID)
        self._settled_speed = _radians(self._target * NS_PER_S, _SPEED_SIZE)

    @classmethod
    def begin(
        cls, stamp: int, angle: float, start_rpm: float, rpm: float, acceleration: float
    ) -> 'SpeedMotion':
        """Starts a motion.

        Args:
            stamp: Stamp of t = 0, ns.
            angle: Crank angle at t = 0, rad.
            start_rpm: Speed at t = 0, turns per minute; ignored if the acceleration is 0.
            rpm: Set speed, turns per minute.
            acceleration: Acceleration towards the set speed, rad/s^2; 0 for an immediate change.
        """
        phase = Fraction(angle) * _TWO_PI_GRID / _TWO_PI
        return cls(_segment(stamp, phase, Fraction(start_rpm), rpm, acceleration))

    def at(self, stamp: int) -> Coordinates:
        """Computes crank angle, speed and acceleration, each rounded once; see `Motion.at`."""
        elapsed = stamp - self.segment.stamp
        turned, speed, acceleration = self._phase_after(elapsed), self._settled_speed, 0.0
        angle = _radians(turned % (2 * _TURN), _TURN_SIZE)
        if elapsed < self._ramp_ns:
            speed = _radians(self._speed_after(elapsed), _SPEED_SIZE)
            acceleration = math.copysign(self.segment.acceleration, self._rate)
        unwrapped = _radians(turned, _TURN_SIZE)
        return Coordinates(
            (angle,), (speed,), (acceleration,), unwrapped, conditions=self.conditions
        )

    def at_all(self, stamps: Sequence[int]) -> Coordinates:
        """Computes the coordinates at many stamps; see `Motion.at_all`.

        Once the set speed is reached, speed and acceleration are floats.
        """
        elapsed = [stamp - self.segment.stamp for stamp in stamps]
        if elapsed[0] < self._ramp_ns:
            return stacked([self.at(stamp) for stamp in stamps])
        rate = self._target * 2 * NS_PER_S
        turned = [self._settled_phase + rate * time for time in elapsed]
        angle = np.array([_radians(phase % (2 * _TURN), _TURN_SIZE) for phase in turned])
        unwrapped = np.array([_radians(phase, _TURN_SIZE) for phase in turned])
        return Coordinates(
            (angle,), (self._settled_speed,), (0.0,), unwrapped, conditions=self.conditions
        )

    def under(self, stamp: int, conditions: Conditions, drive: Any) -> 'SpeedMotion':
        """Returns the motion under conditions and a `SpeedDrive`; see `Motion.under`."""
        gravity, segment = conditions.gravity, self.segment
        if drive.rpm == segment.rpm and gravity == segment.gravity:
            return cast('SpeedMotion', super().under(stamp, conditions, drive))
        segment = self.change(stamp, drive.rpm).segment
        return SpeedMotion(replace(segment, gravity=gravity), conditions)

    def restamp(self, old: int, new: int) -> 'SpeedMotion':
        """Returns the motion after a step of the clock, with continuous phase and speed."""
        return self.change(old, self.segment.rpm, new)

    def change(self, stamp: int, rpm: float, restamp: int | None = None) -> 'SpeedMotion':
        """Returns the motion after a change of speed or clock, with continuous phase and speed.

        Args:
            stamp: Stamp of the change, ns.
            rpm: The new set speed, turns per minute.
            restamp: Stamp of the change on the new clock, ns; None if the clock was not stepped.
        """
        segment = _segment(
            stamp=stamp if restamp is None else restamp,
            phase=self.phase(stamp),
            speed=self.speed(stamp),
            rpm=rpm,
            acceleration=self.segment.acceleration,
            old_stamp=None if restamp is None else stamp,
        )
        return SpeedMotion(replace(segment, gravity=self.segment.gravity), self.conditions)

    def next_segment(self, logged: SpeedSegment) -> SpeedSegment:
        """Recomputes the next segment; only set speed and gravity are those of the logged one."""
        if logged.old_stamp is None:
            segment = self.change(logged.stamp, logged.rpm).segment
        else:
            segment = self.change(logged.old_stamp, logged.rpm, logged.stamp).segment
        return replace(segment, gravity=logged.gravity)

    def phase(self, stamp: int) -> Fraction:
        """Returns the unwrapped crank angle at a stamp, turns."""
        return Fraction(self._phase_after(stamp - self.segment.stamp), _TURN)

    def speed(self, stamp: int) -> Fraction:
        """Returns the crank speed at a stamp, turns per minute."""
        return Fraction(self._speed_after(stamp - self.segment.stamp), _RPM)

    def time_to_turn(self, turns: int) -> int:
        """Finds when the crank is first a number of turns from its start; see `Motion`."""
        start, goal = self._phase_after(0), turns * _TURN

        def is_reached(elapsed: int) -> bool:
            return abs(self._phase_after(elapsed) - start) >= goal

        reverses = self._speed * self._rate < 0
        reversal = self._speed * NS_PER_S // -self._rate if reverses else 0
        late = max(reversal, self._ramp_ns) + 1
        while self._target and not is_reached(late):
            late *= 2
        # `_first` requires intervals in which the condition, once true, remains true. The distance
        # from the start grows until the reversal; its maximum is at the ns before or after it. If
        # the goal is not reached there, it is reached only after the crank has passed its start.
        for low, high in ((0, reversal), (0, reversal + 1), (reversal, late)):
            if is_reached(high):
                return _first(is_reached, low, high)
        return TIME_END

    def _phase_after(self, elapsed: int) -> int:
        """Returns the phase after a time, ns, in units of 1 / _TURN turn."""
        twice = 2 * NS_PER_S * elapsed
        if elapsed >= self._ramp_ns:
            return self._settled_phase + self._target * twice
        return self._phase * (_TURN // _GRID) + self._speed * twice + self._rate * elapsed**2

    def _speed_after(self, elapsed: int) -> int:
        """Returns the speed after a time, ns, in units of 1 / _RPM rpm."""
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
    """Creates a segment with phase and speed rounded to multiples of 1 / _GRID.

    If the acceleration is 0, the segment starts at its set speed.
    """
    speed = speed if acceleration else Fraction(rpm)
    phase, speed = (Fraction(round(value * _GRID), _GRID) for value in (phase, speed))
    return SpeedSegment(stamp, phase, speed, rpm, acceleration, old_stamp)


def _first(is_reached: Callable[[int], bool], low: int, high: int) -> int:
    """Finds the smallest integer in [low, high] that meets a condition.

    The condition must also hold for all larger integers of the range. The integers may exceed
    2^63, the limit of `bisect`.
    """
    while low < high:
        middle = (low + high) // 2
        if is_reached(middle):
            high = middle
        else:
            low = middle + 1
    return low


def _radians(number: int, size: int) -> float:
    """Converts `number` units of `size` 2^-_BITS to rad or rad/s, correctly rounded."""
    return math.ldexp(float(number * size), -_BITS)
