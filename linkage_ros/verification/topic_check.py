# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Checks the topics of a log against its configuration: schemas, types and contents."""

from __future__ import annotations

from linkage_ros.log.reader import LogReader, Pairing
from linkage_ros.motion.drives import Drive, FollowDrive, TorqueDrive
from linkage_ros.parameters.drives import SpeedFeedForward
from linkage_ros.run.simulator import Simulator
from linkage_ros.wire.interfaces import JOINT_TRAJECTORY
from linkage_ros.wire.topics import COUPLER_POINT, JOINT_COMMANDS, TOPICS


def check_topics(log: LogReader, pairings: list[Pairing], simulator: Simulator) -> str:
    """Finds a topic that cannot come from a run of the configuration.

    Args:
        log: The log.
        pairings: Channels with the topics that they carry.
        simulator: Simulator of the configuration.

    Returns:
        The error of that topic; empty if there is none.
    """
    interfaces = {t.interface.name: t.interface for t in (*TOPICS, *simulator.topics)}
    kinds = {topic.name: topic.interface.name for topic in simulator.topics}
    own = {*kinds.values(), COUPLER_POINT.interface.name}
    carrying = {channel for channel, _ in pairings}
    more = _logged_besides(simulator.configuration.drive)
    for channel in log.topics:
        known = interfaces.get(channel.type)
        if known and channel.layout != ('cdr', 'ros2msg', known.definition):
            return f'{channel.name}: its schema is not that of {channel.type}'
        kind = kinds.get(channel.name.rpartition('/')[2], channel.type)
        if kind != channel.type:
            return f'{channel.name} is of type {channel.type}, not {kind}'
        if channel in carrying or not channel.messages or channel.type not in own:
            continue
        if channel.type not in more:
            return f'{channel.name} is not a topic of this run, but has the type of one'
        more.remove(channel.type)
    return ''


def _logged_besides(drive: Drive) -> list[str]:
    """Types of the other logged topics: received messages and trajectories."""
    if isinstance(drive, (TorqueDrive, FollowDrive)):
        return [JOINT_COMMANDS.interface.name]
    if isinstance(drive, SpeedFeedForward) and drive.trajectory_command_topic:
        return [JOINT_TRAJECTORY.name]
    return []
