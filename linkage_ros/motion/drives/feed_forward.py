# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Parameters of the torque for a controller, which follow those of the drive itself."""

from dataclasses import dataclass

from linkage_ros.motion.drives.base import Drive
from linkage_ros.quantities import TOPIC_NAME, quantity


@dataclass(frozen=True, kw_only=True)
class FeedForward(Drive):
    """A drive with a feed-forward torque for a controller."""

    effort_command_topic: str = quantity(
        'text', 'topic of the driving torque for a controller; empty: none',
        pattern=TOPIC_NAME, default='',
    )  # fmt: skip
    lead_time: float = quantity(
        'number', 'time after the stamp for which the torque is computed', 's',
        span=(0.0, 10.0), default=0.0,
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class TrajectoryFeedForward(FeedForward):
    """A drive that knows its motion in advance, with a trajectory for a controller."""

    trajectory_command_topic: str = quantity(
        'text', "topic of the crank's motion and torque ahead of time; empty: none",
        pattern=TOPIC_NAME, default='',
    )  # fmt: skip
    trajectory_horizon: float = quantity(
        'number', 'duration of that motion; a new message follows after half this time', 's',
        span=(0.01, 10.0), default=0.5,
    )  # fmt: skip
