# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Drives of a mechanism: a crank speed, a torque, or a measured crank.

The fields of each class are the parameters of the drive.
"""

from dataclasses import dataclass, field
from typing import TypeAlias

from linkage_ros.numeric import Real
from linkage_ros.quantities import Checked, quantity


@dataclass(frozen=True)
class SpeedDrive(Checked):
    """A drive that turns the crank at a set speed.

    Attributes:
        rpm: Set crank speed, turns per minute, positive counter-clockwise.
        start_rpm: Speed at t = 0, turns per minute; None to start at `rpm`.
        crank_acceleration: Acceleration at which the speed approaches `rpm`, rad/s^2; 0 for an
            immediate change.
        crank_angle: Crank angle at t = 0, rad.
    """

    rpm: float = quantity(
        'number', 'crank speed, counter-clockwise positive', 'rpm', span=(-1e6, 1e6), live=True
    )
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


@dataclass(frozen=True)
class Motor(Checked):
    """A motor whose torque decreases linearly with the crank speed.

    Attributes:
        torque: Torque at rest, N m, positive counter-clockwise.
        damping: Decrease in torque per unit of crank speed, N m s.
    """

    torque: float = quantity(
        'number', 'motor torque at rest, counter-clockwise positive', 'N m', span=(-1e12, 1e12),
        live=True, default=0.0,
    )  # fmt: skip
    damping: float = quantity(
        'number',
        'decrease of motor torque per crank speed',
        'N m s',
        span=(0.0, 1e12),
        default=0.0,
    )

    def at(self, speed: Real) -> Real:
        """Returns the torque, N m, at a crank speed or an array of crank speeds, rad/s."""
        return self.torque - self.damping * speed


@dataclass(frozen=True)
class TorqueDrive(Checked):
    """A drive that applies a torque to the crank.

    Attributes:
        motor: The motor; commanded torques are added to its torque.
        start_rpm: Crank speed at t = 0, turns per minute.
        crank_angle: Crank angle at t = 0, rad.
        torque_limit: Magnitude to which commanded torques are clipped, N m.
        command_timeout: Time for which a command acts, s; a live run refuses less than a tick.
    """

    motor: Motor = field(default_factory=Motor)
    start_rpm: float = quantity(
        'number', 'crank speed at t = 0', 'rpm', span=(-1e6, 1e6), default=0.0
    )
    crank_angle: float = quantity(
        'number', 'crank angle at t = 0', 'rad', span=(-1e6, 1e6), default=0.0
    )
    torque_limit: float = quantity(
        'number', 'largest torque of a command; larger ones are limited to it',
        'N m', span=(0.0, 1e12), default=1e12,
    )  # fmt: skip
    command_timeout: float = quantity(
        'number', 'time for which a command acts; refused if shorter than a tick',
        's', span=(1e-3, 1e9), default=0.1,
    )  # fmt: skip


@dataclass(frozen=True)
class FollowDrive(Checked):
    """A measured crank that the other links follow.

    Attributes:
        follow_bandwidth: Bandwidth of the filter that estimates rates and accelerations, Hz; 0 to
            set both to 0.
    """

    follow_bandwidth: float = quantity(
        'number', 'bandwidth of the filter for rates and accelerations; 0 sets them to 0',
        'Hz', span=(0.0, 1e4), default=20.0,
    )  # fmt: skip

    @property
    def crank_angle(self) -> float:
        """The crank angle before the first measurement, rad."""
        return 0.0


Drive: TypeAlias = SpeedDrive | TorqueDrive | FollowDrive
