# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The end of a record: after a time, or after a number of turns of the crank."""

from __future__ import annotations

import math
from fractions import Fraction

from linkage_ros.errors import ConfigurationError
from linkage_ros.motion.speed_driven import SpeedMotion
from linkage_ros.motion.torque_driven import Motion
from linkage_ros.quantities import Quantity
from linkage_ros.run.machine import Machine
from linkage_ros.units import NS_PER_S

DEFAULT_DURATION = 10.0
_LONGEST = 1e9  # s; stamps of thirty years still fit ROS's time
DURATION = Quantity('number', 'how long', 's', 1e-9, _LONGEST)
REVOLUTIONS = Quantity('whole', 'how far the crank turns', 'turns', 1, _LONGEST)
_PATIENCE = 3600  # s, for revolutions that a torque is to make


def count_states(
    machine: Machine, motion: Motion, duration: float | None, revolutions: int | None
) -> int | None:
    """The number of states in a record.

    Args:
        machine: Which is recorded.
        motion: Motion of its crank, from t = 0.
        duration: s; None: 10.
        revolutions: Turns of the crank, either way, instead of a duration.

    Returns:
        The number; None where only the motion shows when the crank has turned so far.

    Raises:
        ConfigurationError: A value is out of range, or the crank never turns so far.
    """
    if revolutions is None:
        end = _nanoseconds(DEFAULT_DURATION if duration is None else duration)
    else:
        REVOLUTIONS.clean('revolutions', revolutions)
        if not isinstance(motion, SpeedMotion):
            return None
        end = _time_to_turn(motion, revolutions)
    return machine.tick_at(end - 1) + 1


def has_turned(angle: float, revolutions: int, stamp: int) -> bool:
    """Whether a torque-driven crank has made its revolutions.

    Args:
        angle: Since the start, rad.
        revolutions: Turns, either way.
        stamp: Time since the start, ns.

    Returns:
        Whether it has.

    Raises:
        ConfigurationError: It has not within an hour.
    """
    turned = abs(angle) / (2 * math.pi)
    if stamp > _PATIENCE * NS_PER_S:
        raise ConfigurationError(
            f'the crank has not come {revolutions} revolutions far within {_PATIENCE} s, but '
            f'{turned:.3g}: give a --duration'
        )
    return turned >= revolutions


def _nanoseconds(duration: float) -> int:
    """A duration as it was typed."""
    DURATION.clean('duration', duration)
    # The decimals count: in binary, 0.535 * 10^9 is a little more than 535000000.
    return math.ceil(Fraction(repr(float(duration))) * NS_PER_S)


def _time_to_turn(motion: SpeedMotion, revolutions: int) -> int:
    """When the crank has made its revolutions, ns.

    Raises:
        ConfigurationError: Never, or not in a lifetime.
    """
    turned = motion.time_to_turn(revolutions)
    if turned is None:
        raise ConfigurationError(
            f'the crank comes to rest before {revolutions} revolutions: '
            'give a --duration, or an rpm other than 0'
        )
    if turned > _LONGEST * NS_PER_S:
        raise ConfigurationError(
            f'{revolutions} revolutions take longer than {_LONGEST:g} s: '
            'give fewer, or a higher rpm'
        )
    return turned
