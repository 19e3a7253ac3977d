# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The state at which a wind pump settles from one start."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from linkage_ros.errors import ConfigurationError
from linkage_ros.lab.pump.attractors import Search
from linkage_ros.lab.pump.harmonic_balance import HarmonicBalance
from linkage_ros.lab.pump.motions import Motions
from linkage_ros.lab.pump.periodic_motion import PeriodicMotion
from linkage_ros.lab.pump.starts import named_starts, require_forwards
from linkage_ros.model.wind_pump import WindPump
from linkage_ros.motion.drives import Motor

_SETTLING_BLOCKS = 20  # of a single motion


def settle(
    mechanism: WindPump,
    motor: Motor,
    speed: float,
    progress: Callable[[Iterable[Any], str], Any],
) -> PeriodicMotion:
    """Follows a pump until it is near to a stable motion.

    Args:
        mechanism: The pump, with the start of its slider.
        motor: Motor of the pump.
        speed: Speed of the crank at angle 0, rad/s.
        progress: Wraps what is gone through, with a word for it: a progress bar.

    Returns:
        The stable motion.

    Raises:
        ConfigurationError: Motor or speed turn nothing forwards, or it does not settle.
        LinkageError: The motion leaves what the coordinates describe.
    """
    require_forwards(mechanism, motor, [speed])
    balance = HarmonicBalance(mechanism, motor.damping)
    _, start = named_starts(mechanism, [speed], [])
    motions = Motions(balance.solver, motor, start)
    search = Search(balance, motor, motions)
    search.run(progress, _SETTLING_BLOCKS)
    motions.require_going(0)
    if search.unidentified[0]:
        raise ConfigurationError(
            f'from {speed:g} rad/s the pump does not settle within {motions.turns(0):.0f} turns: '
            'linkage_chart pump draws what it does'
        )
    return search.states[int(search.belongs[0])]
