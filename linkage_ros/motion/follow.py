# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The motion of a measured crank: its measured angle, and rates from a tracking filter.

The filter tracks a signal m with a value x and a rate v; both poles are at -w = -2 pi bandwidth:

    x' = v + 2 w (m - x)        v' = w^2 (m - x)

The filter tracks a constant rate without error; if the rate changes steadily, v' equals the rate
of change. With e = m - x and d = m' - v the filter is e' = d - 2 w e, d' = -w^2 e. Between two
measurements, m' is assumed to be constant, so

    e(t) = [e + (d - w e) t] exp(-w t)        d(t) = [d + w (d - w e) t] exp(-w t)

exactly, for any time t. If m is the crank angle, v is the speed and w^2 e the acceleration. If the
sensor measures the speed, m is the speed, and v is the acceleration.
"""

from __future__ import annotations

import math
from collections import Counter
from typing import NamedTuple

from linkage_ros.motion.coordinates import Coordinates
from linkage_ros.motion.drives import FollowDrive
from linkage_ros.numeric import within_two_turns
from linkage_ros.units import NS_PER_S

# A larger step back, ns, comes from a bag in a loop or from a restarted simulator.
_RESTART = NS_PER_S
# Relative to 1 / bandwidth; a longer gap resets the filter.
_GAP = 10.0

# Larger values, rad or rad/s, are not measurements, and their squares would overflow.
_LARGEST = 1e12

NOT_NEWER, NOT_FINITE = 'not newer than the one before', 'not finite, or beyond 1e+12'


class Measurement(NamedTuple):
    """A measurement of the crank.

    Attributes:
        stamp: Stamp, ns.
        position: Angle, rad.
        velocity: Speed, rad/s; None: not measured.
    """

    stamp: int
    position: float
    velocity: float | None = None


class Tracked(NamedTuple):
    """The state of the filter for one signal.

    Attributes:
        value: Last measured value of the signal.
        error: Difference of the last measured value from the filter's value.
        rate: Rate of the filter.
    """

    value: float
    error: float
    rate: float

    def advance(self, value: float, time: float, w: float) -> Tracked:
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
    """The motion of a measured crank.

    Attributes:
        left_out: Numbers of rejected measurements, by cause.
    """

    def __init__(self, drive: FollowDrive) -> None:
        """Starts without a measurement.

        Args:
            drive: Settings of the filter.
        """
        self.left_out: Counter[str] = Counter()
        self._w = 2 * math.pi * drive.follow_bandwidth
        self._gap = _GAP / drive.follow_bandwidth if drive.follow_bandwidth else math.inf
        self._last: Measurement | None = None
        self._angle = self._speed = Tracked(0.0, 0.0, 0.0)

    def at(self, measured: Measurement) -> Coordinates | None:
        """Updates the motion with a measurement.

        Args:
            measured: A measurement; the calls must be in the order of arrival.

        Returns:
            The crank at the stamp of the measurement; None: it was rejected and counted.
        """
        stamp, position, velocity = measured
        values = (position,) if velocity is None else (position, velocity)
        if not all(abs(value) <= _LARGEST for value in values):
            self.left_out[NOT_FINITE] += 1
            return None
        last, since = self._last, 0
        if last is not None:
            since = stamp - last.stamp
            if -_RESTART <= since <= 0:
                self.left_out[NOT_NEWER] += 1
                return None
        time = since / NS_PER_S
        if last is None or since < 0 or time > self._gap:
            self._angle = Tracked(position, 0.0, velocity or 0.0)
            self._speed = Tracked(velocity or 0.0, 0.0, 0.0)
        else:
            self._advance(position, velocity, time)
        self._last = measured
        angle, _ = within_two_turns(position)
        return Coordinates((angle,), *self._rates(velocity), position)

    def _advance(self, position: float, velocity: float | None, time: float) -> None:
        # A sensor may restart at 0 each turn: choose the whole turns by the speed.
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
    """Extrapolates coordinates with their acceleration.

    Args:
        coordinates: Coordinates now.
        seconds: Time ahead, s.

    Returns:
        The coordinates after that time.
    """
    (q,), (u,), (a,), unwrapped, _ = coordinates
    moved = (u + 0.5 * a * seconds) * seconds
    return Coordinates((q + moved,), (u + a * seconds,), (a,), unwrapped + moved)
