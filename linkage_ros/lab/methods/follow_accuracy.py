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
from collections.abc import Sequence
from typing import Any

import numpy as np

from linkage_ros.dynamics.solver import Solver
from linkage_ros.lab.methods.measure import Progress
from linkage_ros.lab.reference.problems import preset
from linkage_ros.motion.coordinates import Coordinates, stacked
from linkage_ros.motion.drives import FollowDrive, Motor, TorqueDrive
from linkage_ros.motion.follow import FollowMotion, Measurement
from linkage_ros.motion.torque_driven import TorqueMotion
from linkage_ros.numeric import Array
from linkage_ros.units import NS_PER_S, radians_per_second

BITS = (12, 14, 16, 18, 20)
BANDWIDTHS = (5.0, 7.0, 10.0, 14.0, 20.0, 30.0, 40.0, 60.0, 80.0, 120.0, 160.0, 240.0)  # Hz
RPM = 150.0
_DAMPING = 20.0  # damping of the motor, N m s: the speed stays within 3 % of 150 rpm
_PERIOD = NS_PER_S // 1000  # between measurements, ns
_TURN = 400  # measurements; two turns to settle, two that are compared


def measure_follow(
    *, quick: bool, progress: Progress
) -> tuple[list[dict[str, Any]], tuple[float, float]]:
    """Measures all encoders and bandwidths.

    Args:
        quick: Whether to use only every second encoder and every fourth bandwidth.
        progress: Wraps an iterable in a progress bar with a label.

    Returns:
        The points: resolution, whether the velocity is measured as well, bandwidth of the filter,
        Hz, and largest torque error, relative to the largest torque at a constant speed. Then
        the lowest and highest crank speed, rpm.
    """
    solver, speed = Solver(preset('quadrilateral').mechanism), radians_per_second(RPM)
    drive = TorqueDrive(motor=Motor(_DAMPING * speed, _DAMPING), start_rpm=RPM)
    stamps = [n * _PERIOD for n in range(1, 4 * _TURN + 1)]
    true = TorqueMotion(solver, drive, 0, _PERIOD).at_all(stamps)

    def torque(moments: Coordinates) -> Array:
        (q,), (u,), (a,), *_ = moments
        found: Array = solver.state(q, u, a).torque
        return found[2 * _TURN :]

    turn = np.linspace(0.0, 2 * math.pi, _TURN)
    peak = np.abs(solver.state(turn, np.full(_TURN, speed), np.zeros(_TURN)).torque).max()
    bits, bandwidths = (BITS[::2], BANDWIDTHS[::4]) if quick else (BITS, BANDWIDTHS)
    kinds, points = list(itertools.product((False, True), bits)), []
    for velocity, bit in progress(kinds, 'errors, a followed crank'):
        angles = _rounded(true.unwrapped, 2 * math.pi / 2**bit)
        speeds = _rounded(true.u[0], 4 * speed / 2**bit) if velocity else itertools.repeat(None)
        measured = list(map(Measurement, stamps, angles, speeds))
        for bandwidth in bandwidths:
            motion = FollowMotion(FollowDrive(bandwidth))
            followed = stacked([found for one in measured if (found := motion.at(one))])
            error = float(np.abs(torque(followed) - torque(true)).max() / peak)
            points.append({
                'bits': bit, 'measured_velocity': velocity, 'follow_bandwidth': bandwidth,
                'max_error': error,
            })  # fmt: skip
    compared = true.u[0][2 * _TURN :] / radians_per_second(1.0)
    return points, (compared.min(), compared.max())


def _rounded(values: Array, step: float) -> Sequence[float]:
    found: list[float] = (step * np.rint(values / step)).tolist()
    return found
