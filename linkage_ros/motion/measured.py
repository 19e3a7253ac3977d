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
from fractions import Fraction
from typing import NamedTuple

from linkage_ros.motion.drives import FollowDrive
from linkage_ros.motion.segments import Coordinates
from linkage_ros.numeric import with_turns, within_two_turns
from linkage_ros.units import NS_PER_S

# ns. Stamps jump back farther than this only if a bag is looped or a simulator is restarted.
_RESTART = NS_PER_S
# A longer gap between measurements, in units of 1 / bandwidth, resets the filter.
_GAP = 10.0

_TURN = 2 * math.pi  # rad
# rad or rad/s. Larger values cannot be measurements, and their squares would overflow.
_LARGEST = 1e12

NOT_NEWER, NOT_FINITE = 'not newer than the one before', 'not finite, or beyond 1e+12'


class Tracked(NamedTuple):
    """The state of the filter for one signal.

    Attributes:
        stamp: Stamp of the last measurement of the signal, ns.
        value: Last measured value of the signal, m.
        error: Last measured value minus the filter's value, m - x.
        rate: Rate of the filter, v.
    """

    stamp: int
    value: float
    error: float
    rate: float

    def advance(self, stamp: int, value: float, w: float) -> 'Tracked':
        """Updates the filter with a new measurement.

        Args:
            stamp: Stamp of the measurement, ns.
            value: The new measured value of the signal.
            w: 2 pi times the bandwidth, rad/s.

        Returns:
            The new state of the filter.
        """
        time = (stamp - self.stamp) / NS_PER_S
        slope = (value - self.value) / time
        gap = slope - self.rate
        drift, decay = gap - w * self.error, math.exp(-w * time)
        error = (self.error + drift * time) * decay
        return Tracked(stamp, value, error, slope - (gap + w * drift * time) * decay)


class FollowMotion:
    """The motion of a measured crank."""

    def __init__(self, drive: FollowDrive, period_turns: int) -> None:
        """Initializes the filter, which starts at the first measurement.

        Args:
            drive: Drive with the bandwidth of the filter.
            period_turns: Number of crank turns after which the mechanism's motion repeats.
        """
        self._w = 2 * math.pi * drive.follow_bandwidth
        self._gap = _GAP / drive.follow_bandwidth if drive.follow_bandwidth else math.inf
        self._period_turns = period_turns
        self._angle: Tracked | None = None
        self._speed: Tracked | None = None
        self._turns = 0  # turns by which the crank is ahead of the sensor's angle

    def at(self, stamp: int, position: float, velocity: float | None = None) -> Coordinates:
        """Updates the motion with a measurement, in order of arrival.

        Args:
            stamp: Time of the measurement, ns.
            position: Crank angle, rad.
            velocity: Crank speed, rad/s; None or NaN if it was not measured.

        Returns:
            The coordinates at the stamp. The crank angle is the measured one; if the motion
            repeats after two turns, it may differ by one turn, so that the motion is continuous
            although the sensor restarts each turn.

        Raises:
            ValueError: The measurement is rejected. The error text is the cause.
        """
        if velocity is not None and math.isnan(velocity):
            velocity = None
        if not all(abs(value) <= _LARGEST for value in (position, velocity or 0.0)):
            raise ValueError(NOT_FINITE)
        last = self._angle
        if last and -_RESTART <= stamp - last.stamp <= 0:
            raise ValueError(NOT_NEWER)
        if last and stamp < last.stamp:
            last, self._speed, self._turns = None, None, 0
        turns = self._turns_since(last, stamp, position) if last else 0
        self._turns += turns
        found = self._track(last, stamp, position + turns * _TURN, velocity or 0.0)
        self._angle = found._replace(value=position)
        rate, change = found.rate, self._w * self._w * found.error
        if velocity is not None:
            self._speed = self._track(self._speed, stamp, velocity, 0.0)
            rate, change = velocity, self._speed.rate
        if not self._w:
            rate = change = 0.0
        angle, _ = within_two_turns(position)
        if self._turns % self._period_turns:
            angle = with_turns(angle, Fraction(-1 if angle > 0 else 1, 2))
        return Coordinates((angle,), (rate,), (change,), position)

    def _track(self, last: Tracked | None, stamp: int, value: float, rate: float) -> Tracked:
        """Updates a filter, or restarts it with the given rate after a gap."""
        if last is None or self._is_gap(last, stamp):
            return Tracked(stamp, value, 0.0, rate if self._w else 0.0)
        return last.advance(stamp, value, self._w)

    def _is_gap(self, last: Tracked, stamp: int) -> bool:
        return (stamp - last.stamp) / NS_PER_S > self._gap

    def _turns_since(self, last: Tracked, stamp: int, position: float) -> int:
        """Returns the turns by which a sensor that restarts at 0 each turn has fallen behind."""
        ahead = last.value
        if not self._is_gap(last, stamp):
            ahead += last.rate * ((stamp - last.stamp) / NS_PER_S)
        elif not self._turns:  # a sensor that never restarted may have turned far in the gap
            return 0
        return round((ahead - position) / _TURN)


def ahead(coordinates: Coordinates, seconds: float) -> Coordinates:
    """Extrapolates coordinates at constant acceleration.

    Args:
        coordinates: Coordinates of the crank alone.
        seconds: Time by which to extrapolate, s.

    Returns:
        The coordinates after that time.
    """
    (q,), (u,), (a,), unwrapped, _ = coordinates
    moved = (u + 0.5 * a * seconds) * seconds
    return Coordinates((q + moved,), (u + a * seconds,), (a,), unwrapped + moved)
