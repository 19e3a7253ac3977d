# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Whether the topics of a log are those of its configuration: schemas, types, what each is of."""

from __future__ import annotations

from linkage_ros.log.channels import Pairing
from linkage_ros.log.reader import LogReader
from linkage_ros.motion.drives import Drive, FollowDrive, TorqueDrive
from linkage_ros.parameters.drives import SpeedFeedForward
from linkage_ros.run.simulator import Simulator
from linkage_ros.wire.interfaces import JOINT_TRAJECTORY
from linkage_ros.wire.topics import COUPLER_POINT, JOINT_COMMANDS, TOPICS


def has_states(pairings: list[Pairing]) -> bool:
    """Whether a channel has a message."""
    return any(channel.messages for channel, _ in pairings)


def check_topics(
    log: LogReader, pairings: list[Pairing], descriptions: list[str], simulator: Simulator
) -> str:
    """Looks for a topic that cannot come from a run of the configuration.

    Args:
        log: The log.
        pairings: Channels, with the topics of the machine that they carry.
        descriptions: Names of the channels with robot descriptions.
        simulator: Machine of the configuration.

    Returns:
        What is wrong with it; empty if there is none.
    """
    interfaces = {t.interface.name: t.interface for t in (*TOPICS, *simulator.topics)}
    carrying = {channel for channel, _ in pairings}
    known_types = {topic.interface.name for _, topic in pairings}
    kinds = {topic.name: topic.interface.name for topic in simulator.topics}
    more = _logged_besides(simulator.configuration.drive)
    for channel in log.topics:
        known = interfaces.get(channel.type)
        if known and channel.layout != ('cdr', 'ros2msg', known.definition):
            return f'{channel.name}: its schema is not that of {channel.type}'
        kind = kinds.get(channel.name.rpartition('/')[2], channel.type)
        if channel in carrying:
            continue
        if channel.type in more:
            more.remove(channel.type)
        elif channel.type in known_types and channel.messages:
            return f'{channel.name} is of the type of another topic: which one is of this run?'
        elif kind != channel.type:
            return f'{channel.name} is of type {channel.type}, not {kind}'
        elif channel.type == COUPLER_POINT.interface.name and COUPLER_POINT.name not in kinds:
            return f'{channel.name} is logged, but the configuration has no coupler.point'
        elif channel.name in descriptions and not channel.messages and has_states(pairings):
            return f'{channel.name} has no message'
    return ''


def _logged_besides(drive: Drive) -> list[str]:
    """Types of what is logged with the states: what a run hears, a trajectory ahead of time."""
    if isinstance(drive, (TorqueDrive, FollowDrive)):
        return [JOINT_COMMANDS.interface.name]
    if isinstance(drive, SpeedFeedForward) and drive.trajectory_command_topic:
        return [JOINT_TRAJECTORY.name]
    return []
