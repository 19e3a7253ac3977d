# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Logs of version 0.1.0, which knew neither joint_prefix nor frame_id, read by this version.

test/data holds them as that version recorded them: 0.1 s of two presets. Its URDF gave links the
names of joints, so this version compares everything but robot_description.
"""

from pathlib import Path

import pytest
from ros_harness import report_of, verified
from test_verify import flip, rewrite

from linkage_ros import replay
from linkage_ros.log.reader import LogReader
from linkage_ros.log.recover import recover
from linkage_ros.log_tool import verdict
from linkage_ros.parameters.configuration import load
from linkage_ros.record import record
from linkage_ros.verification.verify import verify

LOGS = {
    preset: Path(__file__).parent / 'data' / f'version_0_1_0_{preset}.mcap'
    for preset in ('quadrilateral', 'wind_pump')
}
STATES = 20
each_log = pytest.mark.parametrize('preset', LOGS)


@each_log
def test_it_is_verified_except_for_the_description(preset):
    with LogReader(LOGS[preset]) as log:
        assert log.configuration == load(preset)
        report = verify(log)
        words = list(verdict(log, report))
        topics = {topic.name for topic in log.topics}
    assert (report.states, report.difference) == (STATES, '')
    assert report.others == ('/robot_description',)
    assert {*report.compared, *report.others} == topics
    assert report.absent == ()
    assert '  not recomputable, so not compared: /robot_description' in words


@each_log
@pytest.mark.parametrize('topic', ['/joint_states', '/driving_torque', '/mechanism_state'])
def test_a_changed_state_in_it_is_found(tmp_path, preset, topic):
    path = tmp_path / 'run.mcap'
    path.write_bytes(LOGS[preset].read_bytes())
    rewrite(path, flip(topic, 9, -1, 1))
    assert topic in report_of(path).difference


def test_the_description_of_a_log_of_this_version_is_compared(tmp_path):
    path = tmp_path / 'run.mcap'
    record(load('quadrilateral'), path, duration=0.1)
    assert '/robot_description' in report_of(path).compared
    rewrite(path, flip('/robot_description', 0, 100, 1))
    assert '/robot_description' in report_of(path).difference


@each_log
def test_it_is_recovered(tmp_path, preset):
    data, cut, out = LOGS[preset].read_bytes(), tmp_path / 'cut.mcap', tmp_path / 'out.mcap'
    for kept in (data, data[:-100]):
        cut.write_bytes(kept)
        recover(cut, out, overwrite=True)
        assert verified(out).states == STATES


@each_log
def test_it_is_replayed_in_a_viewer(called, tmp_path, preset):
    words = '--no-ros', '--viewer', tmp_path / 'run.rrd', '--rate', 10
    code, out, err = called(replay, LOGS[preset], *words)
    assert (code, err) == (0, '')
    assert 'messages replayed' in out
