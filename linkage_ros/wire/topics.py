# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The topics of the node: names, message types, quality of service."""

from __future__ import annotations

from typing import NamedTuple

from linkage_ros.wire.interfaces import (
    CLOCK,
    DIAGNOSTIC_ARRAY,
    FLOAT64,
    FLOAT64_MULTI_ARRAY,
    JOINT_STATE,
    JOINT_TRAJECTORY,
    POINT_STAMPED,
    STRING,
    Interface,
)


class Topic(NamedTuple):
    """A topic of the node.

    Attributes:
        name: Relative name; /diagnostics is absolute.
        interface: Its message type.
        latched: Whether late subscribers get the last message (transient local durability).
        depth: Messages kept for a reader that lags.
        on_demand: Whether it is published only while it has subscribers; logs always have it.
        meaning: Contents of a message, one line for docs/reference.md.
    """

    name: str
    interface: Interface
    latched: bool = False
    depth: int = 10
    on_demand: bool = False
    meaning: str = ''


JOINT_STATES = Topic(
    'joint_states',
    JOINT_STATE,
    meaning='position and velocity of every joint; effort of the crank is the driving torque',
)
DRIVING_TORQUE = Topic(
    'driving_torque', FLOAT64, meaning='the same torque, N m, counter-clockwise positive'
)
MECHANISM_STATE = Topic(
    'mechanism_state',
    JOINT_TRAJECTORY,
    on_demand=True,
    meaning='the same joints with accelerations, as one point',
)
COUPLER_POINT = Topic(
    'coupler_point', POINT_STAMPED, meaning='position of `coupler.point`, where it is set'
)
DIAGNOSTICS = Topic(
    '/diagnostics',
    DIAGNOSTIC_ARRAY,
    meaning='once a second: rate, missed ticks, loop residual, health of log and viewer',
)
ROBOT_DESCRIPTION = Topic(
    'robot_description', STRING, latched=True, depth=1, meaning='URDF of the open tree of links'
)
TOPICS = (
    JOINT_STATES,
    DRIVING_TORQUE,
    MECHANISM_STATE,
    COUPLER_POINT,
    DIAGNOSTICS,
    ROBOT_DESCRIPTION,
)
JOINT_COMMANDS = Topic(
    'joint_commands',
    JOINT_STATE,
    meaning="best effort, with `drive: torque`: the crank's effort is added to the motor's torque",
)
MEASURED_JOINT_STATES = Topic(
    'measured_joint_states',
    JOINT_STATE,
    depth=1000,
    meaning='best effort, with `drive: follow`: the measured crank, which every state answers',
)
# Depth 1: a reader that lags needs only the latest time.
SIMULATED_CLOCK = Topic('/clock', CLOCK, depth=1, meaning='with `use_sim_time`: the time')


def effort_commands(name: str) -> Topic:
    """The topic with the driving torque for a controller."""
    return Topic(
        name, FLOAT64_MULTI_ARRAY, meaning='one number: the driving torque `lead_time` later'
    )


def trajectory_commands(name: str) -> Topic:
    """The topic with the crank's trajectory for a controller."""
    return Topic(
        name,
        JOINT_TRAJECTORY,
        meaning='motion and torque of the crank for `trajectory_horizon` from the stamp on',
    )


def qualified(topic: Topic) -> str:
    """The name of a topic in a graph without namespaces."""
    return topic.name if topic.name.startswith('/') else f'/{topic.name}'
