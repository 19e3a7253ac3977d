# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Runs of one linkage without a name, for tests."""

from dataclasses import replace
from functools import cache

from linkage_ros.mechanism.registry import MECHANISMS
from linkage_ros.messages.topics import MEASURED_JOINT_STATES
from linkage_ros.motion.inputs import SharedInput
from linkage_ros.run.measured import MeasuredRun
from linkage_ros.run.robot import Robot
from linkage_ros.run.trajectory_ahead import TrajectoryAhead
from linkage_ros.settings.configuration import Configuration


def with_linkage(configuration, **changes):
    """Returns a configuration with other values of the fields of its only linkage."""
    return replace(configuration, linkages=(replace(configuration.only, **changes),))


def by_lengths(configuration):
    """Returns a configuration whose mechanism is given by lengths, if a drawing gives it."""
    mechanism = replace(configuration.mechanism, drawn=None)
    kinds = (name for name, cls in MECHANISMS.items() if type(mechanism) is cls)
    kind = replace(configuration.only.kind, mechanism=next(kinds))
    return with_linkage(configuration, mechanism=mechanism, drawn_mechanism=None, kind=kind)


def alone(linkage):
    """Returns the configuration of a run of one linkage alone."""
    return Configuration((linkage,))


@cache
def run_alone(simulator):
    """Returns the run of the linkage of a simulator alone."""
    return Robot(alone(simulator.linkage))


def templates_of(simulator):
    """Returns the templates of the states of the linkage of a simulator alone."""
    return run_alone(simulator).templates.of(('',))


class Reader:
    """An `Input` of a linkage alone, of which rejected messages are counted as in a run."""

    def __init__(self, source):
        self.source = source

    def read(self, data, received):
        found = SharedInput({'': self.source}).read(data, received)
        for error in found.refused.values():
            raise error
        return found.values['']

    def __getattr__(self, name):
        return getattr(self.source, name)


def inputs_of(simulator):
    """Returns the reader of each topic that the linkage of a simulator alone receives."""
    return {topic: Reader(source) for topic, source in simulator.inputs().items()}


class TrajectoryAlone(TrajectoryAhead):
    """Trajectories of the linkage of a simulator alone."""

    def __init__(self, simulator):
        super().__init__(run_alone(simulator))

    def message_at(self, motion, stamp):
        return super().message_at({'': motion}, stamp)


def answers_of(simulator):
    """Returns what answers batches of measurements of the linkage of a simulator alone."""
    robot = run_alone(simulator)
    return MeasuredRun(robot, robot.inputs()[MEASURED_JOINT_STATES])
