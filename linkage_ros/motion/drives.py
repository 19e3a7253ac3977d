# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What drives a mechanism: a crank speed, or a torque. The parameters are read from here."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import TypeAlias

from linkage_ros.errors import ConfigurationError
from linkage_ros.motion.driven_mechanism import TorqueLaw
from linkage_ros.quantities import Checked, quantity, shown

_TOPIC = re.compile(r'/?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*')


@dataclass(frozen=True)
class SpeedDrive(Checked):
    """How a speed-driven crank moves.

    Attributes:
        rpm: Crank speed, counter-clockwise positive, turns per minute.
        start_rpm: Speed at t = 0; None: rpm.
        crank_acceleration: At which the speed moves to rpm, rad/s^2; 0: at once.
        crank_angle: At t = 0, rad.
        effort_command_topic: On which the driving torque is published for a controller; empty:
            it is not.
        lead_time: How far ahead of the stamp that torque is, s.
    """

    rpm: float = quantity(
        'number', 'crank speed, counter-clockwise positive', 'rpm', span=(-1e6, 1e6), live=True
    )
    start_rpm: float | None = quantity(
        'number',
        'crank speed at t = 0, from which it moves to rpm',
        'rpm',
        span=(-1e6, 1e6),
        default=None,
    )
    crank_acceleration: float = quantity(
        'number', 'acceleration at which the speed moves to rpm; 0: at once', 'rad/s^2',
        span=(0.0, 1e9), default=0.0,
    )  # fmt: skip
    crank_angle: float = quantity(
        'number', 'crank angle at t = 0', 'rad', span=(-1e6, 1e6), default=0.0
    )
    effort_command_topic: str = quantity(
        'text', 'topic of the driving torque for a controller; empty: none', default=''
    )
    lead_time: float = quantity(
        'number',
        'time ahead of the stamp for which it is computed',
        's',
        span=(0.0, 10.0),
        default=0.0,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.effort_command_topic and not _TOPIC.fullmatch(self.effort_command_topic):
            raise ConfigurationError(
                f'effort_command_topic = {shown(self.effort_command_topic)}: must be a topic '
                'name, such as /effort_controller/commands'
            )
        if self.lead_time and not self.effort_command_topic:
            raise ConfigurationError(
                f'lead_time = {shown(self.lead_time)}: is for the torque on '
                'effort_command_topic, which names none: name a topic, or leave lead_time out'
            )

    @property
    def initial_rpm(self) -> float:
        """The speed at t = 0, turns per minute."""
        return self.rpm if self.start_rpm is None else self.start_rpm

    @property
    def target(self) -> float:
        """What may be set while it runs: the speed to move to, turns per minute."""
        return self.rpm

    def words(self) -> str:
        """Its speed."""
        if self.start_rpm is None or not self.crank_acceleration:
            return f'{self.rpm:g} rpm'
        return (
            f'from {self.start_rpm:g} to {self.rpm:g} rpm with {self.crank_acceleration:g} rad/s^2'
        )


@dataclass(frozen=True)
class Motor(Checked):
    """A motor line: its torque falls with the crank speed.

    Attributes:
        torque: At rest, N m, counter-clockwise positive.
        damping: What it loses per crank speed, N m s.
    """

    torque: float = quantity(
        'number', 'motor torque at rest, counter-clockwise positive', 'N m', span=(-1e12, 1e12),
        live=True, default=0.0,
    )  # fmt: skip
    damping: float = quantity(
        'number', 'loss of motor torque per crank speed', 'N m s', span=(0.0, 1e12), default=0.0
    )

    def law(self) -> TorqueLaw:
        """The line as what drives a mechanism."""
        torque, damping = self.torque, self.damping
        return lambda _, speed: torque - damping * speed

    def words(self) -> str:
        """The line, in words."""
        lost = f' - {self.damping:g} N m s x speed' if self.damping else ''
        return f'motor {self.torque:g} N m{lost}'


@dataclass(frozen=True)
class TorqueDrive(Checked):
    """How a torque-driven mechanism begins, and what drives it.

    Attributes:
        motor: Its line; commands come on top.
        start_rpm: Crank speed at t = 0, turns per minute.
        crank_angle: At t = 0, rad.
        torque_limit: Largest torque of a command, N m; a larger one is cut to it.
        command_timeout: After which a command counts no more, s.
    """

    motor: Motor = field(default_factory=Motor)
    start_rpm: float = quantity(
        'number', 'crank speed at t = 0', 'rpm', span=(-1e6, 1e6), default=0.0
    )
    crank_angle: float = quantity(
        'number', 'crank angle at t = 0', 'rad', span=(-1e6, 1e6), default=0.0
    )
    torque_limit: float = quantity(
        'number', 'largest torque of a command; larger ones are cut to it',
        'N m', span=(0.0, 1e12), default=1e12,
    )  # fmt: skip
    command_timeout: float = quantity(
        'number', 'time after which a command expires', 's', span=(1e-3, 1e9), default=0.1
    )

    @property
    def initial_rpm(self) -> float:
        """The speed at t = 0, turns per minute."""
        return self.start_rpm

    @property
    def target(self) -> float:
        """What may be set while it runs: the motor's torque at rest, N m."""
        return self.motor.torque

    def words(self) -> str:
        """The motor line and the start."""
        return f'{self.motor.words()}, from {self.start_rpm:g} rpm'


Drive: TypeAlias = SpeedDrive | TorqueDrive
# The names under which parameter files ask for a drive.
DRIVES: dict[str, type[Drive]] = {'speed': SpeedDrive, 'torque': TorqueDrive}
