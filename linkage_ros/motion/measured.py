# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Motion of a measured crank: its measured angle, and rates from a tracking filter.

The filter tracks a signal m with a value x and a rate v. Both poles are at -w = -2 pi bandwidth:

    x' = v + 2 w (m - x)        v' = w^2 (m - x)

If m' is constant, the filter settles without error. If m'' is constant, v' settles at m''. With
e = m - x and d = m' - v, the filter is e' = d - 2 w e, d' = -w^2 e. If m' is constant between two
measurements,

    e(t) = [e + (d - w e) t] exp(-w t)        d(t) = [d + w (d - w e) t] exp(-w t)

exactly, for any time t. If m is the crank angle, v is the speed and w^2 e the acceleration. If the
sensor also measures the speed, a second filter tracks it, and its v is the acceleration. The
speed may be missing from some measurements.
"""

import math
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import NamedTuple

from linkage_ros.motion.inputs import StaleError
from linkage_ros.motion.segments import Coordinates, Gravity, Segment
from linkage_ros.numeric import with_turns, within_two_turns
from linkage_ros.units import NS_PER_S, JointUnits

# ns. Stamps jump back farther than this only if a bag is looped or a simulator is restarted.
_RESTART = NS_PER_S
# A longer gap between measurements, in units of 1 / bandwidth, resets the filter.
_GAP = 10.0

_TURN = 2 * math.pi  # rad
# rad or rad/s. Larger values cannot be measurements, and their squares would overflow.
_LARGEST = 1e12

NOT_NEWER, NOT_FINITE = 'not newer than the one before', 'not finite, or beyond 1e+12'


@dataclass(frozen=True)
class FollowSegment(Segment):
    """Measurements under a changed gravity; those before the first change have no segment."""

    gravity: Gravity

    def words(self, units: JointUnits) -> str:  # noqa: ARG002, for other segments
        """Describes the segment."""
        return 'measured'


class _Filter(NamedTuple):
    """The filter for one signal after a measurement.

    Attributes:
        w: Bandwidth, rad/s.
        gap: Time after which the filter starts again, s.
        stamp: Stamp of the last measurement of the signal, ns; None before the first one.
        value: Last measured value of the signal, m.
        error: Last measured value minus the filter's value, m - x.
        rate: Rate of the filter, v.
    """

    w: float
    gap: float
    stamp: int | None = None
    value: float = 0.0
    error: float = 0.0
    rate: float = 0.0

    def elapsed(self, stamp: int) -> float:
        """Returns the time since the last measurement, s; inf before the first and after a gap."""
        if self.stamp is None:
            return math.inf
        time = (stamp - self.stamp) / NS_PER_S
        return math.inf if time > self.gap else time

    def advanced(self, stamp: int, time: float, value: float, rate: float) -> '_Filter':
        """Returns the filter after a new measurement; see the module for the formulas.

        Args:
            stamp: Stamp of the measurement, ns.
            time: Result of `elapsed` for this stamp, s.
            value: The new measured value of the signal.
            rate: Rate of the filter if it starts, or restarts after a gap.
        """
        w = self.w
        if time == math.inf:
            return _Filter(w, self.gap, stamp, value, 0.0, rate if w else 0.0)
        slope = (value - self.value) / time  # m'
        e, d = self.error, slope - self.rate
        drift, decay = d - w * e, math.exp(-w * time)
        error = (e + drift * time) * decay
        new_rate = slope - (d + w * drift * time) * decay
        return _Filter(w, self.gap, stamp, value, error, new_rate)


class Tracked(NamedTuple):
    """State of a `TrackingFilter` after a measurement.

    Attributes:
        angle: Filter of the position.
        speed: Filter of the measured speed.
        turns: Turns by which the crank is ahead of the sensor's angle.
    """

    angle: _Filter
    speed: _Filter
    turns: int = 0


class TrackingFilter:
    """The motion of a measured crank.

    Attributes:
        tracked: The filters. The value of an earlier time may be set to take measurements back.
    """

    def __init__(self, bandwidth: float, period_turns: int) -> None:
        """Initializes the filter, which starts at the first measurement.

        Args:
            bandwidth: Bandwidth of the filter, Hz; 0 to set rates and accelerations to 0.
            period_turns: Number of crank turns after which the mechanism's motion repeats; 0 for a
                slide, which has no turns.
        """
        self._period_turns = period_turns
        w = 2 * math.pi * bandwidth
        self._w2 = w * w
        start = _Filter(w, _GAP / bandwidth if bandwidth else math.inf)
        self.tracked = self._start = Tracked(start, start)

    def at(self, stamp: int, position: float, velocity: float | None = None) -> Coordinates:
        """Updates the motion with a measurement, in order of arrival.

        Args:
            stamp: Time of the measurement, ns.
            position: Crank angle, rad, or position of a slide, m.
            velocity: Rate of the position, rad/s or m/s; None or NaN if it is not measured.

        Returns:
            The coordinates at the stamp. The crank angle is the measured one; if the motion
            repeats after two turns, it may differ by one turn, so that the motion is continuous
            although the sensor restarts each turn.

        Raises:
            ValueError: The measurement is rejected. The error text is the cause.
        """
        self.check(stamp, position, velocity)
        if velocity is not None and math.isnan(velocity):
            velocity = None
        before = self.tracked
        if before.angle.stamp is not None and stamp <= before.angle.stamp:  # a bag is looped
            before = self._start
        turns, angle = self._turned(before, stamp, position, velocity)
        speed = before.speed
        if velocity is not None:
            speed = speed.advanced(stamp, speed.elapsed(stamp), velocity, 0.0)
        self.tracked = Tracked(angle, speed, turns)
        if not self._w2:  # without a filter
            rate = acceleration = 0.0
        elif velocity is not None:
            rate, acceleration = velocity, speed.rate
        else:
            rate, acceleration = angle.rate, self._w2 * angle.error
        q = self._within_period(position, turns)
        return Coordinates((q,), (rate,), (acceleration,), position)

    def _turned(
        self, before: Tracked, stamp: int, position: float, velocity: float | None
    ) -> tuple[int, _Filter]:
        """Returns the turns by which the crank is ahead of the sensor, and the angle's filter."""
        filter_, turns, time = before.angle, before.turns, before.angle.elapsed(stamp)
        turned = 0
        if self._period_turns:
            turned = self._turns_since(filter_, turns, time, position)
        filter_ = filter_.advanced(stamp, time, position + turned * _TURN, velocity or 0.0)
        if turned:
            filter_ = filter_._replace(value=position)
        return turns + turned, filter_

    def _within_period(self, position: float, turns: int) -> float:
        """Returns a position of the sensor in the period of the motion; see `Coordinates.q`."""
        if not self._period_turns:
            return position
        q, _ = within_two_turns(position)
        if turns % self._period_turns:
            q = with_turns(q, Fraction(-1 if q > 0 else 1, 2))
        return q

    def check(self, stamp: int, position: float, velocity: float | None = None) -> None:
        """Checks a measurement, without updating the motion.

        Raises:
            StaleError: The measurement is not newer than the last one.
            ValueError: The measurement is rejected. The error text is the cause.
        """
        speed = 0.0 if velocity is None or math.isnan(velocity) else velocity
        if not (abs(position) <= _LARGEST and abs(speed) <= _LARGEST):
            raise ValueError(NOT_FINITE)
        last = self.tracked.angle.stamp
        if last is not None and 0 <= last - stamp <= _RESTART:
            raise StaleError(NOT_NEWER)

    @staticmethod
    def _turns_since(angle: _Filter, turns: int, time: float, position: float) -> int:
        """Returns the turns by which a sensor that restarts at 0 each turn has fallen behind."""
        ahead = angle.value
        if time < math.inf:
            ahead += angle.rate * time
        elif not turns:  # a sensor that never restarted may have turned far in the gap
            return 0
        return round((ahead - position) / _TURN)


def extrapolated(coordinates: Coordinates, seconds: float) -> Coordinates:
    """Extrapolates coordinates of the crank, and of base_link, at constant acceleration."""
    (q,), (u,), (a,), unwrapped, *_ = coordinates
    conditions = coordinates.conditions
    moved = (u + 0.5 * a * seconds) * seconds
    if conditions.frame:
        angle, rate, change = conditions.frame
        turned = angle + (rate + 0.5 * change * seconds) * seconds
        conditions = replace(conditions, frame=(turned, rate + change * seconds, change))
    return coordinates._replace(
        q=(q + moved,), u=(u + a * seconds,), unwrapped=unwrapped + moved, conditions=conditions
    )
