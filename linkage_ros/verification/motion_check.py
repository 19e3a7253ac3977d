# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Checks that the segments of a log follow from its configuration and from each other."""

from __future__ import annotations

from linkage_ros.motion.segments import Segment, SpeedSegment
from linkage_ros.motion.speed_driven import SpeedMotion
from linkage_ros.run.simulator import Simulator
from linkage_ros.verification.timeline import moment, seconds


def check_motions(simulator: Simulator, motions: tuple[Segment, ...]) -> str:
    """Compares each segment with the one computed from the configuration and its predecessor.

    The time of a change, and the new rpm, torque or clock, are taken from the log.

    Args:
        simulator: Simulator of the configuration.
        motions: The logged segments.

    Returns:
        The first difference; empty if there is none.
    """
    past: Segment | None = None
    for number, logged in enumerate(motions, 1):
        due, source = simulator.begin(logged.stamp).segment, 'the configuration gives'
        if past is not None:
            begin = moment(logged)
            if begin < past.stamp:
                return (
                    f'motion record {number} begins at {seconds(begin)}, before record '
                    f'{number - 1} does'
                )
            due, source = _following(past, logged), 'what went before gives'
        for name, value in reversed(vars(due).items()):  # what users set comes last
            if (found := vars(logged).get(name)) != value:
                return f'motion record {number} has {name} = {found}, {source} {value}'
        past = logged
    return ''


def _following(past: Segment, logged: Segment) -> Segment:
    """Computes a segment from its predecessor and the time, rpm or torque of the logged one."""
    if isinstance(past, SpeedSegment) and isinstance(logged, SpeedSegment):
        restamp = None if logged.old_stamp is None else logged.stamp
        return SpeedMotion(past).change(moment(logged), logged.rpm, restamp).segment
    return logged if type(past) is type(logged) else past
