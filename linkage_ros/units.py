# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Units of joints; non-SI units of stamps, ns, and of speeds, turns per minute."""

import math
from typing import NamedTuple

NS_PER_S = 10**9
NS_PER_MS = 10**6
TIME_END = 2**31 * NS_PER_S  # ns, exclusive upper limit of stamps in ROS


class JointUnits(NamedTuple):
    """Units of a joint: of its position, its derivatives, its effort, and effort per rate."""

    position: str
    velocity: str
    acceleration: str
    effort: str
    damping: str


TURNING = JointUnits('rad', 'rad/s', 'rad/s^2', 'N m', 'N m s')
SLIDING = JointUnits('m', 'm/s', 'm/s^2', 'N', 'N s/m')


def radians_per_second(rpm: float) -> float:
    """Converts a speed from turns per minute to rad/s."""
    return rpm * math.pi / 30


def place_words(position: float, units: JointUnits) -> str:
    """Formats the position of a joint for messages."""
    return f'{position:.9g} m' if units == SLIDING else rad_and_deg(position)


def rad_and_deg(angle: float) -> str:
    """Formats an angle, rad, in rad and in deg, for messages."""
    return f'{angle:.9g} rad = {math.degrees(angle):.9g} deg'
