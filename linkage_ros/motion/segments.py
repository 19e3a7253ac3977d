# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The segments of a run's motion, as a log keeps them; each lasts until the next begins."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import TypeAlias

from linkage_ros.model.structure import Description


@dataclass(frozen=True)
class SpeedSegment:
    """A segment in which the crank goes from a phase and a speed to a set speed.

    Attributes:
        stamp: Start, ns.
        phase: Phase at the start, turns.
        speed: Speed at the start, turns per minute.
        rpm: Set speed, turns per minute.
        acceleration: Acceleration towards the set speed, rad/s^2, not negative; 0: the speed
            changes at once.
        old_stamp: Start on the clock before the clock was stepped, ns; None: it was not stepped.
    """

    stamp: int
    phase: Fraction
    speed: Fraction
    rpm: float
    acceleration: float
    old_stamp: int | None = None


@dataclass(frozen=True)
class TorqueSegment:
    """A segment in which the mechanism is driven by a motor torque.

    Attributes:
        stamp: Start, ns.
        torque: Torque of the motor at rest, N m.
        old_stamp: Start on the clock before the clock was stepped, ns; None: it was not stepped.
        description: Coordinates and assembly of the states; None: the mechanism's own.
    """

    stamp: int
    torque: float
    old_stamp: int | None = None
    description: Description | None = None


Segment: TypeAlias = SpeedSegment | TorqueSegment
