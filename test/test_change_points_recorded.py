# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Mechanisms that pass change points, recorded through spin-up and reversal."""

import math

import numpy as np
import pytest
from ros_harness import logged

from linkage_ros.parameters.configuration import load
from linkage_ros.record import record
from linkage_ros.run.simulator import Simulator
from linkage_ros.wire.codecs import JointStateCodec

# At theta = pi the coupler and the rocker stretch, at theta = 0 they fold: both are passed.
PARALLELOGRAM = 'mechanism: four_bar, frame: {length: 0.3}, rocker: {length: 0.1, mass: 1.0}'
FOLDING = 'mechanism: four_bar, frame: {length: 0.2, angle: 0.4}, rocker: {length: 0.2}'
KITE = 'mechanism: four_bar, frame: {length: 0.1}, rocker: {length: 0.3}'
EQUAL_ROD = 'mechanism: slider_crank, frame: {angle: 2.0}, slider: {mass: 0.5, damping: 3.0}'
OFFSET_ROD = 'mechanism: slider_crank, slider: {mass: 0.5, offset: 0.1}'
COUPLERS = {PARALLELOGRAM: 0.3, FOLDING: 0.3, KITE: 0.3, EQUAL_ROD: 0.1, OFFSET_ROD: 0.2}
NAMES = ('parallelogram', 'folding', 'kite', 'rod as long as the crank', 'offset rod')


def parameters(head, **motion):
    coupler = f'coupler: {{length: {COUPLERS[head]}, mass: 0.4, point: [0.1, 0.05]}}'
    values = ', '.join(f'{name}: {value}' for name, value in motion.items())
    return f'/**: {{ros__parameters: {{{head}, crank: {{length: 0.1}}, {coupler}, {values}}}}}\n'


def states(log, messages):
    """Stamps, and the members' positions and velocities as they were published."""
    codec = JointStateCodec(Simulator(log.configuration).joints)
    rows = [codec.decode(message.data) for message in messages['/joint_states']]
    return np.array([stamp for stamp, _ in rows]), np.array([numbers for _, numbers in rows])


def check_smooth(stamps, rows, slides):
    """Positions follow the velocities: a jump to the other branch would be seen.

    The trapezoid is right to the third power of the step, times the jerk.
    """
    seconds = np.diff(stamps) * 1e-9
    for joint in range(3):
        position, velocity = rows[:, joint], rows[:, 3 + joint]
        moved = np.diff(position)
        if joint and not (slides and joint == 2):
            moved -= 2 * math.pi * np.rint(moved / (2 * math.pi))
        mean = 0.5 * (velocity[1:] + velocity[:-1])
        speed = np.abs(rows[:, 3 + joint]).max() + 1e-9
        assert np.abs(moved - mean * seconds).max() < 0.05 * speed * seconds.max(), joint


@pytest.mark.parametrize('head', COUPLERS, ids=NAMES)
def test_spin_up_and_reversal_pass_all_change_points_in_a_record(tmp_path, head):
    (tmp_path / 'linkage.yaml').write_text(
        parameters(head, rpm=-240.0, start_rpm=300.0, crank_acceleration=40.0, rate_hz=1000.0)
    )
    configuration = load(str(tmp_path / 'linkage.yaml'))
    assert Simulator(configuration).solver.mobility.grashof == 'change-point'
    record(configuration, tmp_path / 'run.mcap', duration=2.0)
    log, messages = logged(tmp_path / 'run.mcap')
    stamps, rows = states(log, messages)
    assert np.isfinite(rows).all()
    assert np.ptp(rows[:, 0]) > 4 * math.pi  # both turns of the period, both ways
    assert rows[0, 3] == pytest.approx(10 * math.pi)
    assert rows[-1, 3] == pytest.approx(-8 * math.pi)
    assert np.any(np.abs(rows[:, 3]) < 0.05)
    check_smooth(stamps, rows, configuration.kind.mechanism == 'slider_crank')
    assert len(messages['/coupler_point']) == len(stamps)


def test_a_jump_to_the_other_branch_would_be_seen(tmp_path):
    (tmp_path / 'linkage.yaml').write_text(parameters(FOLDING, rpm=300.0, rate_hz=1000.0))
    record(load(str(tmp_path / 'linkage.yaml')), tmp_path / 'run.mcap', duration=0.5)
    stamps, rows = states(*logged(tmp_path / 'run.mcap'))
    check_smooth(stamps, rows, slides=False)
    folded = np.remainder(rows[:, 0] - 0.4, 4 * math.pi) > 2 * math.pi
    rows[folded, 2] = 0.8 - rows[folded, 2]  # mirrored at the frame, as principal roots would be
    with pytest.raises(AssertionError):
        check_smooth(stamps, rows, slides=False)
