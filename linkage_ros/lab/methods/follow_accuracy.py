# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Torque error of a measured crank, over the filter's bandwidth and the encoder's bits.

A motor whose torque falls steeply with the speed turns the quadrilateral at 150 rpm. An encoder
rounds the angle to 2^bits steps a turn; a sensor with as many bits, over twice the speed in both
directions, rounds the speed. `FollowMotion` gets both 1000 times a second.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import numpy as np

from linkage_ros.dynamics.solver import Solver
from linkage_ros.lab.reference.problems import preset
from linkage_ros.motion.coordinates import Coordinates, stacked
from linkage_ros.motion.drives import FollowDrive, Motor, TorqueDrive
from linkage_ros.motion.follow import FollowMotion, Measurement
from linkage_ros.motion.torque_driven import TorqueMotion
from linkage_ros.units import NS_PER_S, radians_per_second

BITS = (12, 14, 16, 18, 20)
BANDWIDTHS = (5.0, 7.0, 10.0, 14.0, 20.0, 30.0, 40.0, 60.0, 80.0, 120.0, 160.0, 240.0)  # Hz
RPM = 150.0
_DAMPING = 20.0  # of the motor, N m s: the speed stays within 3 % of 150 rpm
_PERIOD = NS_PER_S // 1000  # between measurements, ns
_TURN = 400  # measurements; two turns to settle, two that are compared


class FollowError(NamedTuple):
    """A point of the chart.

    Attributes:
        bits: Resolution of the encoder.
        measured_velocity: Whether the velocity is measured as well.
        follow_bandwidth: Bandwidth of the filter, Hz.
        max_error: Largest torque error, relative to the largest torque at a constant speed.
    """

    bits: int
    measured_velocity: bool
    follow_bandwidth: float
    max_error: float


class FollowBench:
    """A crank under a motor, its true torque, and its torque from filtered measurements.

    Attributes:
        rpm: Lowest and highest crank speed.
    """

    def __init__(self) -> None:
        mechanism = preset('quadrilateral').mechanism
        self._solver, speed = Solver(mechanism), radians_per_second(RPM)
        drive = TorqueDrive(motor=Motor(_DAMPING * speed, _DAMPING), start_rpm=RPM)
        motion = TorqueMotion(self._solver, drive, 0, _PERIOD)
        self._stamps = [n * _PERIOD for n in range(1, 4 * _TURN + 1)]
        true = motion.at_all(self._stamps)
        self._angle, (self._speed,), self._true = true.unwrapped, true.u, self._torque(true)
        compared = self._speed[2 * _TURN :] / radians_per_second(1.0)
        self.rpm = float(compared.min()), float(compared.max())
        turn = np.linspace(0.0, 2 * math.pi, _TURN)
        steady = self._solver.state(turn, np.full(_TURN, speed), np.zeros(_TURN))
        self._peak = np.abs(steady.torque).max()

    def error(self, bits: int, bandwidth: float, *, with_velocity: bool) -> FollowError:
        """Torque error for an encoder and a bandwidth, Hz."""
        angles = _rounded(self._angle, 2 * math.pi / 2**bits)
        speeds = _rounded(self._speed, 4 * radians_per_second(RPM) / 2**bits)
        known = speeds if with_velocity else itertools.repeat(None)
        motion = FollowMotion(FollowDrive(bandwidth))
        measured = map(Measurement, self._stamps, angles, known)
        followed = stacked([found for one in measured if (found := motion.at(one))])
        errors = np.abs(self._torque(followed) - self._true)[2 * _TURN :]
        return FollowError(bits, with_velocity, bandwidth, float(errors.max() / self._peak))

    def _torque(self, coordinates: Coordinates) -> Any:
        (q,), (u,), (a,), _, _ = coordinates
        return self._solver.state(q, u, a).torque


def _rounded(values: Any, step: float) -> Any:
    return (step * np.rint(values / step)).tolist()


def measure_follow(
    bench: FollowBench, *, quick: bool, progress: Callable[[Iterable[Any], str], Any]
) -> list[FollowError]:
    """Measures all encoders and bandwidths.

    Args:
        bench: The crank and its measurements.
        quick: Whether to use only every second encoder and every fourth bandwidth.
        progress: Wraps an iterable in a progress bar with a label.

    Returns:
        The points.
    """
    bits, bandwidths = (BITS[::2], BANDWIDTHS[::4]) if quick else (BITS, BANDWIDTHS)
    kinds = [(one, velocity) for velocity in (False, True) for one in bits]
    return [
        bench.error(one, bandwidth, with_velocity=velocity)
        for one, velocity in progress(kinds, 'errors, a followed crank')
        for bandwidth in bandwidths
    ]
