# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Assigns the channels of a log to topics, whose names may have been remapped."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeAlias

from linkage_ros.log.reader import LoggedTopic, LogReader
from linkage_ros.motion.drives import FollowDrive
from linkage_ros.wire.topics import MEASURED_JOINT_STATES, Topic

Pairing: TypeAlias = tuple[LoggedTopic, Topic]  # a channel of a log, and the machine's topic in it


def paired(log: LogReader, topics: Iterable[Topic]) -> list[Pairing]:
    """Finds the channels of a log that carry given topics, whatever their names.

    Of several channels of one type, those that kept their name come first, then the others in
    the order in which they were declared, which is that of the topics.

    Args:
        log: The log.
        topics: The topics, in the order of the simulator.

    Returns:
        A channel for each topic found.
    """
    free, pairs = list(log.topics), []
    if isinstance(log.configuration.drive, FollowDrive):
        free = [channel for channel in free if channel != measured_channel(log)]
    for topic in topics:
        fitting = [channel for channel in free if channel.type == topic.interface.name]
        fitting.sort(key=lambda channel: channel.name.rpartition('/')[2] != topic.name)
        if fitting:
            free.remove(fitting[0])
            pairs.append((fitting[0], topic))
    return pairs


def measured_channel(log: LogReader) -> LoggedTopic | None:
    """The channel with the measurements of a crank, which a run declares after its own topics."""
    kind = MEASURED_JOINT_STATES.interface.name
    channels = [channel for channel in log.topics if channel.type == kind]
    return max(channels, key=lambda channel: channel.number) if len(channels) > 1 else None
