# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Charts, movies and travel of cylinders and slotted levers."""

import math
from dataclasses import replace

import numpy as np
import pytest
from test_chart import table

from linkage_lab import command_line
from linkage_ros import Solver, load, travel


def test_a_driven_cylinder_is_charted_over_time_in_newtons(tmp_path, called):
    code, out, err = called(command_line, 'motion', 'excavator', '--reactions', '--out', tmp_path)
    assert code == 0, err
    assert 'rod 0.82 to 1.4 m, crank ' in out
    columns, solver = table(tmp_path / 'excavator_motion.csv'), Solver(load('excavator').mechanism)
    rows = [
        columns[f'rod.{x}'] for x in ('position [m]', 'velocity [m/s]', 'acceleration [m/s^2]')
    ]
    state = solver.state(*rows)
    force = columns['driving_force [N]']
    assert force == pytest.approx(state.torque)
    assert columns['driving_power [W]'] == pytest.approx(force * rows[1])
    assert columns['crank.transmission_ratio [rad/m]'] == pytest.approx(
        solver.state(rows[0], 1.0).velocity[0]
    )
    assert not {'driving_torque [N m]', 'crank_angle [rad]'} & columns.keys()


def test_a_cylinder_without_a_law_is_charted_over_its_stroke(tmp_path, called):
    text = '/**: {ros__parameters: {mechanism: inverted_slider_crank, input: cylinder, '
    text += 'drive: torque, crank_angle: 0.5, frame: {length: 0.5}, '
    text += 'crank: {length: 1.2, inertia: 2.0}}}'
    path = tmp_path / 'arm.yaml'
    path.write_text(text)
    code, out, err = called(command_line, 'motion', path, '--out', tmp_path)
    assert code == 0, err
    assert '0.01 m/s over its stroke (assumed), rod 0.71 to 1.69 m' in out
    assert table(tmp_path / 'arm_motion.csv')['rod.velocity [m/s]'] == pytest.approx(0.01)
    code, out, err = called(command_line, 'motion', path, '--rpm', 5, '--out', tmp_path / 'new')
    assert code == 2
    assert '--rpm is for a crank' in err


def test_the_page_of_a_driven_cylinder_shows_its_force(tmp_path, called):
    code, _, err = called(command_line, 'movie', 'excavator', tmp_path / 'excavator.html')
    assert code == 0, err
    page = (tmp_path / 'excavator.html').read_text()
    for name in ('Cylinder position', 'Cylinder speed', 'Crank position', 'Driving force'):
        assert f'<dt>{name}</dt>' in page
    assert 'Driving torque' not in page


def test_the_quick_return_is_that_of_the_lever():
    """The lever is tangent to the crank's circle where it reverses: sin(swing / 2) = r / d."""
    mechanism = replace(load('shaper').mechanism, dyads=(), loads=())
    found = travel(Solver(mechanism))
    half = math.asin(mechanism.crank.length / mechanism.frame.length)
    assert found.output == 'barrel'
    assert np.ptp(found.extremes) == pytest.approx(2 * half)
    assert found.time_ratio == pytest.approx((math.pi + 2 * half) / (math.pi - 2 * half))
