# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The swing of a four-bar's rocker, from the lengths."""

import math

from linkage_ros.numeric import short_sum, wrap


def swing(crank: float, coupler: float, rocker: float, frame: float) -> tuple[float, float]:
    """The smallest and the largest angle between the rocker and the frame.

    The end of the rocker is between |coupler - crank| and coupler + crank away from the crank's
    pivot, which bounds the angle by the law of cosines.

    Args:
        crank: Length of the crank, m.
        coupler: Length of the coupler, m.
        rocker: Length of the rocker, m.
        frame: Length of the frame, m.

    Returns:
        Angles in [0, pi], rad; 0 or pi: the rocker crosses the line of the frame.
    """
    longest = max(crank, coupler, rocker, frame)
    nearest, farthest = abs(short_sum(longest, coupler, -crank)), coupler + crank
    low, high = 0.0, math.pi
    if abs(short_sum(longest, rocker, -frame)) < nearest:
        low = _angle(rocker, frame, nearest)
    if short_sum(longest, coupler, crank, -rocker, -frame) < 0:
        high = _angle(rocker, frame, farthest)
    return low, high


def middle(low: float, high: float, both_sides: bool, frame: float, rocker: float) -> float:
    """The middle of a rocker's swing.

    Args:
        low: From `swing`.
        high: From `swing`.
        both_sides: Whether it swings, or may swing, to both sides of the frame's line.
        frame: Direction of the frame, rad.
        rocker: One of the rocker's directions, rad.

    Returns:
        Direction in [-pi, pi], rad.
    """
    found = 0.5 * (low + high)
    if low == 0 or high == math.pi or both_sides:
        found = math.pi if high == math.pi else 0.0
    back: float = wrap(frame + math.pi)  # from B0 to A0
    side = math.copysign(1.0, wrap(rocker - back))
    result: float = wrap(back + side * found)
    return result


def _angle(rocker: float, frame: float, opposite: float) -> float:
    """The angle between two sides of a triangle."""
    cosine = (rocker * rocker + frame * frame - opposite * opposite) / (2 * rocker * frame)
    return math.acos(max(-1.0, min(1.0, cosine)))
