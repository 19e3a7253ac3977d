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
sensor also measures the speed, a second filter tracks it, and its v is the acceleration.
"""

import math
from typing import NamedTuple

from linkage_ros.motion.drives import FollowDrive
from linkage_ros.motion.segments import Coordinates
from linkage_ros.numeric import within_two_turns
from linkage_ros.units import NS_PER_S

# ns. Stamps jump back farther than this only if a bag is looped or a simulator is restarted.
_RESTART = NS_PER_S
# A longer gap between measurements, in units of 1 / bandwidth, resets the filter.
_GAP = 10.0

# rad or rad/s. Larger values cannot be measurements, and their squares would overflow.
_LARGEST = 1e12

NOT_NEWER, NOT_FINITE = 'not newer than the one before', 'not finite, or beyond 1e+12'


class Tracked(NamedTuple):
    """The state of the filter for one signal.

    Attributes:
        value: Last measured value of the signal, m.
        error: Last measured value minus the filter's value, m - x.
        rate: Rate of the filter, v.
    """

    value: float
    error: float
    rate: float

    def advance(self, value: float, time: float, w: float) -> 'Tracked':
        """Updates the filter with a new measurement.

        Args:
            value: The new measured value of the signal.
            time: Time since the last measurement, s.
            w: 2 pi times the bandwidth, rad/s.

        Returns:
            The new state of the filter.
        """
        slope = (value - self.value) / time
        gap = slope - self.rate
        drift, decay = gap - w * self.error, math.exp(-w * time)
        error = (self.error + drift * time) * decay
        return Tracked(value, error, slope - (gap + w * drift * time) * decay)


class FollowMotion:
    """The motion of a measured crank."""

    def __init__(self, drive: FollowDrive) -> None:
        """Initializes the filter, which starts at the first measurement.

        Args:
            drive: Drive with the bandwidth of the filter.
        """
        self._w = 2 * math.pi * drive.follow_bandwidth
        self._gap = _GAP / drive.follow_bandwidth if drive.follow_bandwidth else math.inf
        self._stamp: int | None = None  # of the last measurement, ns
        self._angle = self._speed = Tracked(0.0, 0.0, 0.0)

    def at(self, stamp: int, position: float, velocity: float | None = None) -> Coordinates:
        """Updates the motion with a measurement, in order of arrival.

        Args:
            stamp: Time of the measurement, ns.
            position: Crank angle, rad.
            velocity: Crank speed, rad/s; None if it was not measured.

        Returns:
            The coordinates at the stamp.

        Raises:
            ValueError: The measurement is rejected. The error text is the cause.
        """
        if not all(abs(value) <= _LARGEST for value in (position, velocity or 0.0)):
            raise ValueError(NOT_FINITE)
        since = -math.inf if self._stamp is None else stamp - self._stamp
        if -_RESTART <= since <= 0:
            raise ValueError(NOT_NEWER)
        if 0 < (time := since / NS_PER_S) <= self._gap:
            self._advance(position, velocity, time)
        else:
            self._angle = Tracked(position, 0.0, velocity or 0.0)
            self._speed = Tracked(velocity or 0.0, 0.0, 0.0)
        self._stamp = stamp
        angle, _ = within_two_turns(position)
        return Coordinates((angle,), *self._rates(velocity), position)

    def _advance(self, position: float, velocity: float | None, time: float) -> None:
        # A sensor may restart at 0 each turn: choose the angle closest to the predicted one.
        turn = 2 * math.pi
        ahead = self._angle.value + self._angle.rate * time
        turns = round((ahead - position) / turn)
        self._angle = self._angle.advance(position + turns * turn, time, self._w)
        self._angle = self._angle._replace(value=position)
        if velocity is not None:
            self._speed = self._speed.advance(velocity, time, self._w)

    def _rates(self, velocity: float | None) -> tuple[tuple[float], tuple[float]]:
        if not self._w:
            return (0.0,), (0.0,)
        if velocity is None:
            return (self._angle.rate,), (self._w * self._w * self._angle.error,)
        return (velocity,), (self._speed.rate,)


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
