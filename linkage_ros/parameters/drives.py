# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The drives by the names under which parameter files ask for them."""

from __future__ import annotations

import re
from dataclasses import dataclass

from linkage_ros.errors import ConfigurationError
from linkage_ros.motion.drives import Drive, FollowDrive, SpeedDrive, TorqueDrive
from linkage_ros.quantities import Checked, quantity, shown

_TOPIC = re.compile(r'/?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*')


@dataclass(frozen=True)
class FeedForward(Checked):
    """The driving torque for a controller, ahead of time.

    Attributes:
        effort_command_topic: Topic of the driving torque for a controller; empty: none.
        lead_time: How far ahead of the stamp that torque is computed, s.
    """

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


@dataclass(frozen=True)
class SpeedFeedForward(FeedForward, SpeedDrive):
    """A crank at a given speed, and its torque for a controller."""


@dataclass(frozen=True)
class FollowFeedForward(FeedForward, FollowDrive):
    """A measured crank, and its torque for a controller."""


DRIVES: dict[str, type[Drive]] = {
    'speed': SpeedFeedForward,
    'torque': TorqueDrive,
    'follow': FollowFeedForward,
}
