# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Charts and movies of cranks that follow a law of motion, or that cannot turn fully."""

import itertools
import json
import math
import re

import numpy as np
import pytest
from PIL import Image
from ros_harness import assert_refused
from test_chart import table

from linkage_lab import command_line
from linkage_lab.charts import movie
from linkage_lab.period import TURNING, law_period
from linkage_ros import Solver, load
from linkage_ros.settings.configuration import configure

LIMITED = """
/**:
  ros__parameters:
    mechanism: four_bar
    drive: {drive}
    {rest}
    frame: {{length: 0.425, angle: 5.497787143782138}}
    crank: {{length: 0.3, inertia: 0.0245}}
    coupler: {{length: 0.315, mass: 2.0, inertia: 0.016, center: [0.1575, 0.0]}}
    rocker: {{length: 0.5, mass: 3.5, inertia: 0.066, center: [0.25, 0.0]}}
    loads: {{brake: {{kind: link, link: rocker, force: -3.0}}}}
"""
LAWS = {
    'sine': 'motion: {center: 1.2, amplitude: 0.5, frequency: 0.5, phase: 0.3}',
    'points': 'motion: {times: [0.0, 0.3, 1.0], angles: [1.2, 2.0, 1.0]}',
    'speeds': 'motion: {times: [0.0, 0.3, 1.0], angles: [1.2, 2.0, 1.2], speeds: [0.0, 1.0, 0.0]}',
    'ends moving': 'motion: {times: [0.0, 1.0], angles: [1.2, 1.5], speeds: [0.0, 1.0]}',
}


@pytest.fixture
def file(tmp_path):
    def write(drive, rest='', name='servo'):
        path = tmp_path / f'{name}.yaml'
        path.write_text(LIMITED.format(drive=drive, rest=rest))
        return path

    return write


@pytest.mark.parametrize('law', LAWS)
def test_a_law_is_charted_over_time(tmp_path, called, file, law):
    path = file('motion', LAWS[law])
    code, out, err = called(command_line, 'motion', path, '--reactions', '--out', tmp_path)
    assert code == 0, err
    columns, design = table(tmp_path / 'servo_motion.csv'), load(str(path))
    time, solver = columns['time [s]'], Solver(design.mechanism)
    end = design.drive.motion.law.duration / 1e9
    assert time[0] == 0
    assert end - 2e-9 < time[-1] <= end
    assert np.diff(time).min() > 0
    names = [f'crank.{word} [{unit}]' for word, unit in TURNING]
    state = solver.state(*(columns[name] for name in names))
    assert columns['driving_torque [N m]'] == pytest.approx(state.torque)
    # The rate is the slope of the angle, and the acceleration that of the rate.
    for whole, part in itertools.pairwise(names):
        smooth = np.diff(time) > 1e-4
        steps, means = np.diff(columns[whole]), columns[part]
        means = 0.5 * (means[1:] + means[:-1]) * np.diff(time)
        assert steps[smooth] == pytest.approx(means[smooth], abs=2e-4)
    low, high = columns['crank.direction [rad]'].min(), columns['crank.direction [rad]'].max()
    assert f'crank {math.degrees(low):.4g} to {math.degrees(high):.4g} deg' in out


def test_both_sides_of_a_jump_in_acceleration_are_charted(file):
    design = load(str(file('motion', LAWS['speeds'])))
    period = law_period(Solver(design.mechanism), design.drive)
    at = np.flatnonzero(np.diff(period.x) < 1e-9)
    assert period.x[at] == pytest.approx([0.3])
    jump = np.diff(period.columns['crank.angular_acceleration'].values)[at]
    assert abs(jump) > 10


@pytest.mark.parametrize('drive', ['follow', 'torque'])
def test_a_limited_crank_without_a_law_is_charted_over_its_arc(tmp_path, called, file, drive):
    rest = 'crank_angle: 2.0' if drive == 'torque' else ''
    path = file(drive, rest)
    code, out, err = called(command_line, 'motion', path, '--out', tmp_path)
    assert code == 0, err
    assert '1 rpm over its arc' in out
    columns = table(tmp_path / 'servo_motion.csv')
    ((low, high),) = Solver(load(str(path)).mechanism).reach.arcs
    if drive == 'torque':  # the arc around 2 rad starts a turn before
        low, high = low - math.tau, high - math.tau
    crank = columns['crank_angle [rad]']
    assert crank[0] - low == pytest.approx(0.01 * (high - low))
    assert high - crank[-1] == pytest.approx(0.01 * (high - low))
    assert set(columns['crank.angular_velocity [rad/s]']) == {math.pi / 30}
    said = re.search(r'crank (-?[\d.]+) to (-?[\d.]+) deg', out)
    assert [float(x) for x in said.groups()] == pytest.approx(np.degrees(crank[[0, -1]]), rel=2e-4)


@pytest.mark.parametrize(('drive', 'rest'), [('motion', LAWS['points']), ('follow', '')])
def test_movies_of_limited_cranks(tmp_path, monkeypatch, called, file, drive, rest):
    monkeypatch.setattr(movie, '_SECONDS', 0.5)
    for name in ('made.gif', 'made.html'):
        code, _, err = called(command_line, 'movie', file(drive, rest), tmp_path / name)
        assert code == 0, err
    with Image.open(tmp_path / 'made.gif') as image:
        assert image.n_frames == 10
    page = (tmp_path / 'made.html').read_text()
    data = json.loads(re.search(r'\{"time".*\}', page)[0])
    assert data['across'][0] == pytest.approx(data['start'], rel=1e-6)
    assert data['across'][-1] == pytest.approx(data['end'], rel=1e-6)
    assert ('Time, s' in page) == (drive == 'motion')


def test_options_and_mixtures_that_do_not_fit_are_refused(called, file):
    law, arc = file('motion', LAWS['sine']), file('follow', name='arc')
    for option in ('--fluctuation', '--acceleration'):
        for path in (law, arc):
            words = f'{option} is for a crank that turns at a given speed'
            assert_refused(*called(command_line, 'motion', path, option, 0.02), words)
    assert_refused(*called(command_line, 'motion', law, arc), 'drawn over time.*separately')


def test_means_of_a_law_do_not_depend_on_how_fast_it_is():
    """A load is given over the crank angle; a work of 30 J per turn, however short."""
    design = {
        'mechanism': 'four_bar', 'drive': 'motion', 'frame.length': 0.425, 'crank.length': 0.1,
        'coupler.length': 0.315, 'rocker.length': 0.5, 'motion.angles': [0.0, 4.0, math.tau],
        'motion.repeat': True, 'loads.saw.kind': 'curve', 'loads.saw.link': 'crank',
        'loads.saw.at': [0.0, 3.0, 6.0], 'loads.saw.value': [0.0, -10.0, 0.0],
    }  # fmt: skip
    for duration in (1e-4, 1e-3, 1.0, 1e5):
        times = [0.0, 0.5 * duration, duration]
        made = configure(design | {'motion.times': times})
        period = law_period(Solver(made.mechanism), made.drive)
        assert period.mean_power * duration == pytest.approx(30.0, rel=1e-12)
