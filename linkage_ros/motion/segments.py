# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Segments of a run's motion, as stored in logs. Each lasts until the next one starts."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import TypeAlias

from linkage_ros.model.structure import Description


@dataclass(frozen=True)
class SpeedSegment:
    """A segment in which the crank accelerates from an initial speed to the set speed.

    Attributes:
        stamp: Stamp of the start, ns.
        phase: Crank angle at the start, turns.
        speed: Crank speed at the start, turns per minute.
        rpm: Set speed, turns per minute.
        acceleration: Magnitude of the acceleration towards the set speed, rad/s^2; 0 for an
            immediate change.
        old_stamp: If a step of the clock started the segment, the stamp of its start on the old
            clock, ns; otherwise None.
    """

    stamp: int
    phase: Fraction
    speed: Fraction
    rpm: float
    acceleration: float
    old_stamp: int | None = None


@dataclass(frozen=True)
class TorqueSegment:
    """A segment in which a motor torque drives the mechanism.

    Attributes:
        stamp: Stamp of the start, ns.
        torque: Torque of the motor at rest, N m.
        old_stamp: If a step of the clock started the segment, the stamp of its start on the old
            clock, ns; otherwise None.
        description: Coordinates and assembly of the motion; None for the mechanism's own.
    """

    stamp: int
    torque: float
    old_stamp: int | None = None
    description: Description | None = None


Segment: TypeAlias = SpeedSegment | TorqueSegment
