# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the wind pump settles at: the numbers by other hands, laws, and pumps of other kinds."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import oracle_pump
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

from linkage_ros import ConfigurationError, UnreachableError
from linkage_ros.errors import MotionError
from linkage_ros.lab.charts.pump import draw_pump
from linkage_ros.lab.pump.averaging import Averaging
from linkage_ros.lab.pump.boundaries import FOLD, PERIOD_DOUBLING
from linkage_ros.lab.pump.branch import find_states, follow_branch
from linkage_ros.lab.pump.periodic import extremum
from linkage_ros.lab.pump.poincare import PoincareMap
from linkage_ros.lab.pump.pump import analyse
from linkage_ros.lab.pump.runs import follow_run
from linkage_ros.lab.pump.states_table import states_table
from linkage_ros.motion.drives import Motor
from linkage_ros.parameters.configuration import load

PUMP = load('wind_pump').mechanism
MOTOR = Motor(8.4, 1.2)
# By another program, which shares nothing with the package; multipliers to the digits it printed.
LOW = {
    'speed': 2.604252349376, 'stroke': 0.519128369836, 'lowest': 1.133966760583,
    'highest': 1.653095130419, 'point': (1.540999924466, 0.573289247289, 2.568032724352),
    'multipliers': (0.0038 + 0.3505j, 0.0038 - 0.3505j, 0.2851),
}  # fmt: skip
SADDLE = {
    'speed': 3.951611254418, 'multipliers': (1.28656, 0.0824 + 0.2818j, 0.0824 - 0.2818j),
}  # fmt: skip
HIGH = {
    'speed': 6.248845170700, 'stroke': 0.137861636990, 'multipliers': (0.94983, -0.762, -0.337),
}  # fmt: skip


def plain(items, _):
    return items


def slid(**changes):
    return replace(PUMP, slider=replace(PUMP.slider, **changes))


def followed(mechanism, low, high, count, damping=MOTOR.damping):
    """The branch between two speeds."""
    averaged = Averaging(mechanism).follow(np.linspace(low, high, count).tolist())
    poincare = PoincareMap(mechanism, damping)
    return poincare, follow_branch(poincare, averaged, plain)


@pytest.fixture(scope='module')
def analysis():
    return analyse(PUMP, MOTOR, speeds=(2.0, 6.0), quick=True, progress=plain)


# ---------------------------------------------------------------- document 3's figure 3


def test_there_are_two_stable_states_and_one_between(analysis):
    assert [state.stable for state in analysis.states] == [True, False, True]


@pytest.mark.parametrize(('number', 'expected'), list(enumerate((LOW, SADDLE, HIGH))))
def test_the_states_are_those_of_another_program(analysis, number, expected):
    state = analysis.states[number]
    for name, value in expected.items():
        got = getattr(state, name)
        if name == 'multipliers':
            assert got[0] == pytest.approx(value[0], abs=1e-4)
            assert got[1:] == pytest.approx(value[1:], abs=5e-4)
        else:
            assert got == pytest.approx(value, abs=1e-10), name


@pytest.mark.parametrize('number', range(3))
def test_a_settled_motion_comes_back_where_every_body_moves_by_itself(analysis, number):
    state = analysis.states[number]
    x, v, w = state.point
    start = 0.0, x, w, v
    with np.errstate(all='ignore'):
        _, end = oracle_pump.multipliers(oracle_pump.Pump(), start, np.array([0.0, state.period]))
    assert end == pytest.approx((2 * math.pi, *start[1:]), abs=1e-9)


@pytest.mark.parametrize('number', range(3))
def test_the_multipliers_shrink_phase_space_as_resistance_does(analysis, number):
    # Liouville: the volume of phases (q, M q') shrinks by tr(M^-1 D), D the resistances.
    state = analysis.states[number]
    x, _, w, _ = analysis.poincare.orbit(np.array([state.point]).T, state.torque, 512)[..., 0]
    crank = np.linspace(0, 2 * math.pi, 513)
    (m11, m12), (_, m22) = analysis.poincare.solver.matrix((crank, x))
    shrink = (MOTOR.damping * m22 + PUMP.slider.damping * m11) / (m11 * m22 - m12 * m12)
    expected = math.exp(-2 * math.pi * np.mean((shrink / w)[:-1]))
    assert math.prod(state.multipliers) == pytest.approx(expected, rel=1e-7)


def test_averaging_with_one_harmonic_comes_near(analysis):
    speeds = [state.speed for state in analysis.averaged_states]
    assert speeds == pytest.approx([2.6046, 3.8871, 6.3015], abs=5e-5)
    strokes = [state.stroke for state in analysis.averaged_states]
    assert strokes == pytest.approx([state.stroke for state in analysis.states], rel=0.04)


def test_two_stable_states_exist_between_two_folds(analysis):
    (found,) = analysis.branch.bistable_ranges()
    assert (found.low, found.high) == pytest.approx((7.28, 12.65), abs=0.01)
    assert (found.low_is, found.high_is) == (FOLD, FOLD)
    for _, motion in analysis.branch.boundaries:
        assert motion.multipliers[0] == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize(('torque', 'stable'), [(7.27, 1), (12.64, 2)])
def test_next_to_the_folds_states_appear_and_vanish(analysis, torque, stable):
    (found,) = find_states(analysis.poincare, analysis.branch, [torque])
    assert [state.motion.stable for state in found].count(True) == stable
    assert len(found) == 2 * stable - 1


def test_small_changes_of_the_torque_leave_the_pump_about_the_same(analysis):
    changes = {
        (one.state, one.torque > MOTOR.torque): one.changes for one in analysis.sensitivities
    }
    assert changes[0, False]['stroke'] == pytest.approx(-0.0255, abs=2e-4)
    assert changes[0, True]['stroke'] == pytest.approx(0.0246, abs=2e-4)
    assert changes[2, False]['flow'] == pytest.approx(0.0020, abs=2e-4)
    assert changes[2, True]['flow'] == pytest.approx(0.0120, abs=2e-4)
    for (_, up), found in changes.items():
        assert (found['speed'] > 0) == up
        flow = (1 + found['speed']) * (1 + found['stroke']) - 1
        assert found['flow'] == pytest.approx(flow, abs=1e-12)


# ---------------------------------------------------------------- from where


def test_runs_end_at_the_states(analysis):
    ends = {run.name: end for run, end in zip(analysis.runs, analysis.ends, strict=True)}
    assert ends == {
        '2 rad/s': 0,
        '6 rad/s': 2,
        '2% below 3.952 rad/s': 0,
        '2% above 3.952 rad/s': 2,
    }
    slow, fast, *_ = analysis.runs
    assert LOW['speed'] == pytest.approx(np.mean(slow.speeds[-400:]), rel=0.01)
    assert HIGH['speed'] == pytest.approx(np.mean(fast.speeds[-400:]), rel=0.01)


def test_a_turn_that_is_none_is_refused():
    poincare = PoincareMap(PUMP, MOTOR.damping)
    with pytest.raises(MotionError, match='cannot be followed for a turn'):
        poincare.image(np.array([[1.5], [0.0], [0.05]]), 0.0)
    with pytest.raises(UnreachableError, match='do not reach'):
        poincare.image(np.array([[1.5, 2.6], [0.0, 0.0], [2.0, 2.0]]), MOTOR.torque)


# ---------------------------------------------------------------- pumps of other kinds


def test_a_speed_at_which_a_period_doubles_is_told_from_a_fold():
    _, branch = followed(slid(damping=20.0), 5.4, 6.6, 4)
    ((kind, motion),) = branch.boundaries
    assert kind == PERIOD_DOUBLING
    assert motion.multipliers[0] == pytest.approx(-1, abs=1e-6)


def test_without_resistance_nothing_settles():
    poincare, branch = followed(slid(damping=0.0), 6.9, 7.1, 2)
    (states,) = find_states(poincare, branch, [MOTOR.torque])
    # The pump takes no power: the motor turns at its own speed, about which a motion wavers.
    assert all(state.motion.speed == pytest.approx(7, abs=0.01) for state in states)
    assert not any(state.motion.stable for state in states)


def test_a_weaker_motor_keeps_up_one_state(analysis):
    (((state, _),),) = find_states(analysis.poincare, analysis.branch, [5.0])
    assert state.stable
    assert len(states_table(analysis._replace(states=[state]))) == 3


def test_a_pump_without_a_state_is_drawn_and_recorded(analysis, tmp_path):
    none = analysis._replace(states=[], averaged_states=[], sensitivities=[], ends=[None] * 4)
    assert states_table(none) == ['no settled motion found']
    draw_pump(none, 'no state', tmp_path / 'none.png')
    record = json.loads(json.dumps(none.record(), allow_nan=False))
    assert record['states'] == []
    assert record['runs'][0]['settles_at_state'] is None


def test_too_weak_a_motor_has_no_state(analysis):
    assert find_states(analysis.poincare, analysis.branch, [0.3]) == [[]]


@pytest.mark.parametrize(
    ('changes', 'torque', 'speeds', 'error', 'message'),
    [
        ({'position': 3.0}, 8.4, (2.0,), UnreachableError, 'do not reach .* within'),
        ({}, -8.4, (2.0,), ConfigurationError, 'motor.torque = -8.4: must be a number from 1e-09'),
        ({}, 0.0, (2.0,), ConfigurationError, 'motor.torque = 0.0: must be .* to 1e.12 N m'),
        ({}, 8.4, (2.0, 0.0), ConfigurationError, 'start speed = 0.0: must be .* 1e.06 rad/s'),
        ({}, 8.4, (math.inf,), ConfigurationError, 'start speed = inf: must be'),
    ],
)
def test_what_cannot_turn_is_refused_at_once(changes, torque, speeds, error, message):
    with pytest.raises(error, match=message):
        analyse(slid(**changes), Motor(torque, 1.2), speeds=speeds, quick=True, progress=plain)


def test_a_run_that_leaves_says_where(analysis):
    found = follow_run(analysis.poincare.solver, MOTOR, (1.5, 6.0, 2.0), 9.0, 'fast')
    assert 'the motion ends at t = 0.2' in found.ended
    assert found.record()['ended'] == found.ended


# ---------------------------------------------------------------- what is written


def test_the_record_has_every_number(analysis):
    record = json.loads(json.dumps(analysis.record(), allow_nan=False))
    assert [state['stable'] for state in record['states']] == [True, False, True]
    assert record['states'][0]['speed'] == analysis.states[0].speed
    assert [run['settles_at_state'] for run in record['runs']] == [0, 2, 0, 2]
    assert record['torques_with_two_stable_states'][0]['low'] == pytest.approx(7.28, abs=0.01)
    assert [run['duration'] > 30 for run in record['runs']] == [True] * 4
    assert '2.604252' in '\n'.join(states_table(analysis))


@pytest.mark.parametrize('sign', [1, -1])
def test_an_extremum_between_samples_is_found(sign):
    angle = np.arange(32) * (2 * math.pi / 32)
    values = 0.3 + np.cos(angle - 0.7) + 0.2 * np.sin(2 * angle)
    fine = np.linspace(0, 2 * math.pi, 2_000_001)
    course = 0.3 + np.cos(fine - 0.7) + 0.2 * np.sin(2 * fine)
    assert sign * extremum(values, sign) == pytest.approx(np.max(sign * course), abs=1e-11)
    assert extremum(np.full(8, 0.25), sign) == 0.25


def test_the_picture_can_be_read_at_half_its_size(analysis, monkeypatch, tmp_path):
    pages, save = [], Figure.savefig
    monkeypatch.setattr(Figure, 'savefig', lambda *page: pages.append(page) or save(*page))
    draw_pump(analysis, 'wind_pump', tmp_path / 'pump.png')
    ((figure, path),) = pages
    assert path.read_bytes().startswith(b'\x89PNG')
    pixels = 700 / figure.get_figwidth() / 72  # of a point
    texts = [text for text in figure.findobj(Text) if text.get_text() and text.get_visible()]
    assert min(text.get_fontsize() for text in texts) * pixels > 7.9
    plane = figure.axes[0]
    below = plane.get_legend().get_window_extent()
    assert not below.overlaps(plane.xaxis.label.get_window_extent())
    table = figure.axes[-1].texts[0].get_window_extent()
    assert figure.bbox.x0 < table.x0
    assert table.x1 < figure.bbox.x1
    assert figure.bbox.y0 < table.y0
