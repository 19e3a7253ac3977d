# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Tests of the interface of drives, with a kind of its own."""

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest

from linkage_ros import Solver
from linkage_ros.log.reader import LogReader
from linkage_ros.log.verify import verify
from linkage_ros.motion.drives import DRIVES
from linkage_ros.motion.drives.base import Drive
from linkage_ros.motion.segments import Coordinates, Motion, Segment, stacked
from linkage_ros.numeric import within_two_turns
from linkage_ros.programs.log_commands import info
from linkage_ros.programs.record import record
from linkage_ros.quantities import quantity
from linkage_ros.settings.configuration import configure
from linkage_ros.settings.help import help_on_kind
from linkage_ros.settings.summary import summary
from linkage_ros.units import NS_PER_S


@dataclass(frozen=True)
class SettlingSegment(Segment):
    """A crank that slows down to rest: its speed is `speed` exp(-t)."""

    speed: float

    def motion(self):
        return SettlingMotion(self)

    def words(self, units):
        return f'settles from {self.speed:g} {units.velocity}'


class SettlingMotion(Motion):
    def __init__(self, segment):
        self.segment = segment

    def at(self, stamp):
        left = self.segment.speed * math.exp((self.segment.stamp - stamp) / NS_PER_S)
        angle = self.segment.speed - left
        return Coordinates((within_two_turns(angle)[0],), (left,), (-left,), angle)

    def at_all(self, stamps):
        return stacked([self.at(stamp) for stamp in stamps])

    def restamp(self, old, new):
        raise NotImplementedError

    def next_segment(self, logged):
        return replace(logged, speed=self.at(logged.stamp).u[0])


@dataclass(frozen=True)
class SettlingDrive(Drive):
    segment, subject = SettlingSegment, 'settling {}'
    crank_angle = 0.0

    speed: float = quantity('number', 'speed at t = 0', 'rad/s', span=(-1e3, 1e3), default=9.0)

    def words(self, joint):
        return f'settles from {self.speed:g} rad/s'

    def begin(self, stamp, machine):
        return SettlingMotion(SettlingSegment(stamp, self.speed))


@pytest.fixture
def configuration(monkeypatch):
    monkeypatch.setitem(DRIVES, 'settling', SettlingDrive)
    return configure({'drive': 'settling', 'speed': 11.0})


def test_a_drive_of_its_own_is_configured_recorded_and_verified(configuration, tmp_path):
    path = tmp_path / 'run.mcap'
    record(configuration, path, duration=1.0)
    log = LogReader(path)
    assert log.configuration == configuration
    assert log.motions[''] == (SettlingSegment(0, 11.0),)
    report = verify(log)
    assert (report.states, report.difference) == (200, '')
    assert '  0.000000 s: settles from 11 rad/s' in [*info(log)]
    assert 'settles from 11 rad/s' in summary(configuration.only, Solver(configuration.mechanism))
    assert '\n  speed: ' in help_on_kind()


def test_another_motion_of_such_a_drive_is_a_difference(configuration, tmp_path, monkeypatch):
    path = tmp_path / 'run.mcap'
    record(configuration, path, duration=0.1)
    at = SettlingMotion.at
    monkeypatch.setattr(
        SettlingMotion, 'at', lambda self, stamp: at(self, stamp)._replace(u=(np.pi,))
    )
    assert 'recomputed' in verify(LogReader(path)).difference
