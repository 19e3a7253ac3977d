# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""When a record ends: after a time, or once the crank has made its turns."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable
from fractions import Fraction

from linkage_ros.errors import ConfigurationError
from linkage_ros.motion.speed_driven import SpeedMotion
from linkage_ros.motion.torque_driven import Motion
from linkage_ros.quantities import Quantity
from linkage_ros.run.machine import Machine, Snapshot
from linkage_ros.units import NS_PER_S

DEFAULT_DURATION = 10.0
_LONGEST = 1e9  # s; stamps of thirty years still fit ROS's time
DURATION = Quantity('number', 'how long', 's', 1e-9, _LONGEST)
REVOLUTIONS = Quantity('whole', 'how far the crank turns', 'turns', 1, _LONGEST)
_PATIENCE = 3600  # s, for revolutions that a torque is to make


class End:
    """When a record ends.

    Attributes:
        ticks: Those of the record, or all where the motion has to tell.
    """

    def __init__(
        self,
        machine: Machine,
        motion: Motion,
        duration: float | None,
        revolutions: int | None,
    ) -> None:
        """Takes how long the record is to be.

        Args:
            machine: That is recorded.
            motion: Of its crank, from t = 0.
            duration: s; by default 10.
            revolutions: Turns of the crank, either way, instead of a duration.

        Raises:
            ConfigurationError: It is out of range, or the crank never turns so far.
        """
        self.ticks: Iterable[int]
        self._turns: int | None = None
        self._start = machine.configuration.drive.crank_angle
        if revolutions is None:
            self.ticks = _ticks(machine, _nanoseconds(duration))
            return
        REVOLUTIONS.clean('revolutions', revolutions)
        if isinstance(motion, SpeedMotion):
            self.ticks = _ticks(machine, _time_to_turn(motion, revolutions))
        else:
            self.ticks, self._turns = itertools.count(), revolutions

    def reached(self, stamp: int, snapshot: Snapshot) -> bool:
        """Whether a state is at or beyond the end that the motion tells.

        Args:
            stamp: Of the state, ns.
            snapshot: The state.

        Returns:
            Whether the record ends before it.

        Raises:
            ConfigurationError: It does not come.
        """
        if self._turns is None:
            return False
        turned = abs(snapshot.coordinates.unwrapped - self._start) / (2 * math.pi)
        if stamp > _PATIENCE * NS_PER_S:
            raise ConfigurationError(
                f'the crank has not come {self._turns} revolutions far within {_PATIENCE} s, but '
                f'{turned:.3g}: give a --duration'
            )
        return turned >= self._turns


def _ticks(machine: Machine, end: int) -> range:
    """The states in [0, end), ns."""
    return range(machine.tick_at(end - 1) + 1)


def _nanoseconds(duration: float | None) -> int:
    """A duration as it was typed."""
    seconds = DEFAULT_DURATION if duration is None else duration
    DURATION.clean('duration', seconds)
    # What was typed in decimals is meant: 0.535 * 10^9 is a little more than 535000000.
    return math.ceil(Fraction(repr(float(seconds))) * NS_PER_S)


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
