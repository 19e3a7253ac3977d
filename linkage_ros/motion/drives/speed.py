# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A crank at a set speed."""

import math
from dataclasses import dataclass

from linkage_ros.mechanism.base import Mechanism
from linkage_ros.mechanism.ranges import Ranges
from linkage_ros.mechanism.solver import Solver
from linkage_ros.mechanism.structure import Link
from linkage_ros.motion.at_speed import SpeedMotion, SpeedSegment
from linkage_ros.motion.drives.base import Machine
from linkage_ros.motion.drives.feed_forward import TrajectoryFeedForward
from linkage_ros.quantities import quantity

# Plotted: turns, and shortest and longest duration, s. Rerun draws a curve where the time axis was
# in the previous frame, so that a slow computer would show no curve of a time shorter than that
# between two of its frames.
_TURNS, _SHORTEST, _LONGEST = 5, 2.0, 60.0
_STANDING_SECONDS = 10.0  # plotted at standstill


@dataclass(frozen=True)
class SpeedDrive(TrajectoryFeedForward):
    """A drive that turns the crank at a set speed, from which it starts without `start_rpm`."""

    segment = SpeedSegment

    rpm: float = quantity(
        'number', 'crank speed, counter-clockwise positive; 1 rad/s is 9.5493 rpm', 'rpm',
        span=(-1e6, 1e6), live=True,
    )  # fmt: skip
    start_rpm: float | None = quantity(
        'number',
        'crank speed at t = 0, which then approaches rpm',
        'rpm',
        span=(-1e6, 1e6),
        default=None,
    )
    crank_acceleration: float = quantity(
        'number', 'acceleration at which the speed approaches rpm; 0: immediately', 'rad/s^2',
        span=(0.0, 1e9), default=0.0,
    )  # fmt: skip
    crank_angle: float = quantity(
        'number', 'crank angle at t = 0', 'rad', span=(-1e6, 1e6), default=0.0
    )

    @property
    def initial_rpm(self) -> float:
        """The speed at t = 0, turns per minute."""
        return self.rpm if self.start_rpm is None else self.start_rpm

    def reversals(self) -> list[float]:
        """Returns the crank angle at which the crank reverses before it reaches `rpm`, rad."""
        if not self.crank_acceleration or not self.initial_rpm * self.rpm < 0:
            return []
        speed = self.initial_rpm * math.tau / 60
        return [self.crank_angle + 0.5 * speed * abs(speed) / self.crank_acceleration]

    def words(self, joint: Link) -> str:  # noqa: ARG002, always a crank
        """Describes the speed."""
        if self.start_rpm is None or not self.crank_acceleration:
            return f'{self.rpm:g} rpm'
        speeds = f'from {self.start_rpm:g} to {self.rpm:g} rpm'
        return f'{speeds} with {self.crank_acceleration:g} rad/s^2'

    def check(self, mechanism: Mechanism) -> None:
        """Checks that the crank can turn fully, and that it does not reverse inside valves."""
        solver = Solver(mechanism)
        otherwise = '; drive: motion, torque or follow moves it within these angles'
        if mechanism.drawn and solver.reach.near_equalities:
            otherwise += '; if this sum is to be 0, give the links of the loop their length'
        solver.reach.require_full_turn(otherwise)
        Ranges(solver).require_valves(self.reversals())

    def begin(self, stamp: int, machine: Machine) -> SpeedMotion:  # noqa: ARG002
        """Starts the motion; see `Drive.begin`."""
        return SpeedMotion.begin(
            stamp, self.crank_angle, self.initial_rpm, self.rpm, self.crank_acceleration
        )

    @property
    def plotted_seconds(self) -> float:
        """Duration of a few turns, s."""
        rpm = abs(self.rpm)
        if not rpm:
            return _STANDING_SECONDS
        return min(max(_TURNS * 60 / rpm, _SHORTEST), _LONGEST)
