# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Non-SI units: stamps are in nanoseconds, and users specify speeds in turns per minute."""

import math

NS_PER_S = 10**9
NS_PER_MS = 10**6
TIME_END = 2**31 * NS_PER_S  # ns, exclusive upper limit of stamps in ROS


def radians_per_second(rpm: float) -> float:
    """Converts a speed from turns per minute to rad/s."""
    return rpm * math.pi / 30


def rad_and_deg(angle: float) -> str:
    """Formats an angle, rad, in rad and in deg, for messages."""
    return f'{angle:.9g} rad = {math.degrees(angle):.9g} deg'
