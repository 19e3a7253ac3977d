# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Writes logs as the node does, without a node, from a plan of ticks, changes and clock steps."""

import itertools
from dataclasses import replace

from one_linkage import templates_of
from state_messages import messages_at

from linkage_ros.log.writer import LogWriter
from linkage_ros.messages.cdr import OK, Status, encode_diagnostics
from linkage_ros.messages.topics import DIAGNOSTICS, ROBOT_DESCRIPTION
from linkage_ros.run.states import Simulator

START = 1_795_000_000_123_456_789
STATUSES = [Status(OK, 'motion', 'kept', {'rate': '200'})]


def ticks(count):
    """Returns the part of a plan for some ticks without delay."""
    return [('tick', 0)] * count


def moments(simulator, plan):
    """Carries out a plan; see `live`.

    Yields:
        The motion, and number and stamp of a tick, both None for a clock step.
    """
    motion, drive, command, t0, tick = (
        simulator.begin(START), simulator.linkage.drive, None, START, 0,
    )  # fmt: skip
    for kind, value in plan:
        if kind == 'rpm':
            drive = replace(drive, rpm=value)
        elif kind == 'motor':
            drive = replace(drive, motor=replace(drive.motor, torque=value))
        elif kind == 'command':
            command = value
        elif kind == 'skip':
            tick += value
        else:
            stamp = t0 + simulator.ticks.elapsed(tick) + value
            if kind == 'step':
                motion, t0 = motion.restamp(stamp - value, stamp), t0 + value
                yield motion, None, None
            motion = motion.under(stamp, simulator.conditions, drive)
            if command is not None:
                motion.command(stamp, command)
            yield motion, tick, stamp
            tick += 1


def live(
    path, configuration, plan, *, prefix='/', names=None, diagnostics=True, topics=None,
    alter=lambda _, made: made.messages,
):  # fmt: skip
    """Writes a log as the node does.

    Args:
        path: The log.
        configuration: Configuration of the run.
        plan: Pairs of a kind and a value. 'rpm', 'motor', 'command': set the speed, rpm, or a
            torque, N m, from the next tick on. 'skip': miss a number of ticks. 'step': step the
            clock by some ns and make a tick. 'tick': make a tick that is late by some ns.
        prefix: Prefix of the topic names.
        names: Other names of topics.
        diagnostics: Whether to add messages that do not belong to states.
        topics: Names of the topics of states; None for all.
        alter: Makes the messages of a state from its number, counted from 1, and the usual
            `StateMessages`.

    Returns:
        The path.
    """
    simulator, number = Simulator(configuration.only), itertools.count(1)
    segment = simulator.begin(START).segment
    with LogWriter(path, configuration, overwrite=True) as log:
        channels = {
            i: log.add_topic(topic, prefix + (names or {}).get(topic.name, topic.name))
            for i, topic in enumerate(templates_of(simulator).topics)
            if topics is None or topic.name in topics
        }
        extra = log.add_topic(DIAGNOSTICS, '/diagnostics') if diagnostics else None
        log.write_motion(segment)
        description = log.add_topic(ROBOT_DESCRIPTION, f'{prefix}robot_description')
        log.write(description, START, simulator.description)
        for motion, tick, stamp in moments(simulator, plan):
            made = None if stamp is None else messages_at(simulator, motion, stamp)
            if motion.segment != segment:  # computing the state may change its description
                log.write_motion(segment := motion.segment)
            if made is None:
                continue
            messages = alter(next(number), made)
            now = stamp + 40_000 + tick % 7
            for i, channel in channels.items():
                log.write(channel, now, messages[i])
            if extra is not None and tick % 50 == 0:
                log.write(extra, now, encode_diagnostics(stamp, 'live', STATUSES))
            if (tick + 1) % 60 == 0:
                log.flush()
    return path
