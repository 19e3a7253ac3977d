# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Whether the pieces of motion of a log follow from its configuration and from each other."""

from __future__ import annotations

from linkage_ros.log.metadata import encode_motion
from linkage_ros.motion.torque_driven import RunMotion
from linkage_ros.run.machine import Machine
from linkage_ros.verification.timeline import moment, seconds


def check_motions(machine: Machine, motions: tuple[RunMotion, ...]) -> str:
    """Compares each piece of motion with what follows from the configuration and those before.

    Only when and to which rpm or clock a piece changes is its own.

    Args:
        machine: Of the configuration.
        motions: The logged pieces.

    Returns:
        What differs; empty if nothing does.
    """
    for number, logged in enumerate(motions, 1):
        if number == 1:
            due, source = machine.begin(logged.stamp), 'the configuration gives'
        else:
            past = motions[number - 2]
            begin = moment(logged)
            if begin < past.stamp:
                return (
                    f'motion record {number} begins at {seconds(begin)}, before record '
                    f'{number - 1} does'
                )
            restamp = None if logged.before is None else logged.stamp
            due, source = past.change(begin, logged.target, restamp), 'what went before gives'
        found, expected = encode_motion(logged), encode_motion(due)
        for name in ('phase', 'rpm', 'acceleration', 'speed', 'torque', 'before'):
            if found.get(name) != expected.get(name):
                which = 'the first motion record' if number == 1 else f'motion record {number}'
                return f'{which} has {name} = {found.get(name)}, {source} {expected.get(name)}'
    return ''
