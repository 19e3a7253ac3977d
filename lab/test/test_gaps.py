# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Charts of mechanisms that pass change points, where joint forces are infinite."""

import csv
import json
import math
from dataclasses import replace

import numpy as np
import pytest
from mechanisms import CHANGE_POINTS, TURN, four_bar
from mpmath import mp
from oracle import Oracle
from ros_harness import assert_refused
from transforms import turned

from linkage_lab import command_line
from linkage_lab.charts import movie
from linkage_lab.charts.economy import Economy
from linkage_lab.charts.motion import _measures
from linkage_lab.flywheel import Crank
from linkage_lab.period import extent, law_period, period_to_show, speed_driven_period
from linkage_ros import Friction, load
from linkage_ros.motion.drives.law import LawDrive, Prescribed

SPEED = 6.0
EQUAL = """/**:
  ros__parameters:
    mechanism: slider_crank
    rpm: 60.0
    crank: {length: 0.1, mass: 0.5, center: [0.05, 0.0]}
    coupler: {length: 0.1, mass: 0.5, center: [0.05, 0.0]}
    slider: {mass: 1.0}
"""
FRICTION = '    loads: {wear: {kind: friction, guide: 0.1}}\n'
FOUR_BARS = [name for name, lengths in CHANGE_POINTS.items() if len(lengths) == 4]


def equal(tmp_path, text=EQUAL):
    path = tmp_path / 'equal.yaml'
    path.write_text(text)
    return path


def rows(path):
    with path.open() as stream:
        return [*csv.DictReader(stream)]


@pytest.mark.parametrize('name', FOUR_BARS)
def test_only_pin_forces_are_infinite_at_a_change_point_also_in_a_turned_machine(name):
    found = []
    for angle in (0.0, 0.1234):
        machine = turned(four_bar(CHANGE_POINTS[name]), angle)
        period = speed_driven_period(machine, SPEED, reactions=True)
        columns = period.with_gaps()
        at = period.crank[np.isnan(columns['pin_A.x'].values)]
        assert np.abs(np.sin(at - 0.3 - angle)).max() < 1e-9
        assert np.isfinite(columns['driving_torque'].values).all()
        force = extent(period.x, period.columns['pin_A.x'].values)
        assert (force.low, force.high, force.rms) == (-math.inf, math.inf, math.inf)
        measures = _measures(period)
        found.append([measures['peak shaking force [N]'], measures['rms torque [N m]']])
    assert found[1] == pytest.approx(found[0], rel=1e-9)


def test_finite_forces_at_a_change_point_have_their_limit(tmp_path):
    machine = load(str(equal(tmp_path))).mechanism
    for angle in (0.0, 0.1234):
        period = speed_driven_period(turned(machine, angle), SPEED, reactions=True)
        at = np.abs(period.crank - angle - math.pi / 2).argmin()
        # Weights of 2 kg, and two centres at 0.05 m, accelerated towards the guide.
        along, across = (period.columns[f'shaking_force.{x}'].values[at] for x in 'xy')
        force = complex(along, across) * np.exp(-1j * angle)
        assert force == pytest.approx(-1j * (2 * 9.81 - 0.05 * SPEED**2), abs=1e-9)
        assert extent(period.x, period.columns['pin_A.y'].values).high < 20


def limited(radius=0.01):
    """Friction that keeps the forces at its change points finite, at a negative speed."""
    machine = replace(four_bar(CHANGE_POINTS['parallelogram']), gravity=(0.0, 0.0))
    return replace(machine, loads=(Friction(pin=0.1, pin_radius=radius),))


@pytest.mark.parametrize('radius', [1e-1, 1e-2, 1e-3])
def test_forces_that_friction_keeps_finite_have_their_limit_in_fifty_digits(radius):
    machine = limited(radius)
    period = speed_driven_period(machine, -SPEED, reactions=True)
    (gaps,) = np.nonzero(period.gaps['driving_torque'])
    assert len(gaps) == 4
    for i, way in zip(gaps, (-1, 1, -1, 1), strict=True):
        with mp.workdps(150):
            start = mp.mpf(machine.frame.angle)
            at = start + mp.pi * mp.nint((mp.mpf(period.crank[i]) - start) / mp.pi)
            right = Oracle(machine).solve(at + way * mp.mpf('1e-25'), -SPEED, 0.0)
        torque, force = (period.columns[name].values[i] for name in ('driving_torque', 'pin_A.x'))
        assert torque == pytest.approx(float(right.torque), rel=1e-9)
        assert force == pytest.approx(float(right.pins['A'].real), rel=1e-9)


def test_flywheel_and_economy_pass_change_points_with_finite_forces():
    machine = limited()
    period = speed_driven_period(machine, -SPEED)
    cycle = Crank(machine).cycle(-SPEED, 1e6)
    assert cycle.torque[0] == pytest.approx(period.mean_power / -SPEED, rel=1e-6)
    economy = Economy(machine, '')
    peak = economy._full_torque(-SPEED * 30 / math.pi).peak
    torque = extent(period.x, period.columns['driving_torque'].values)
    assert peak == pytest.approx(max(torque.high, -torque.low), rel=1e-5)  # 1e-9 rad aside


def test_forces_along_a_law_are_infinite_at_a_change_point():
    machine = four_bar(CHANGE_POINTS['parallelogram'])
    law = Prescribed(times=(0.0, 0.7, 2.0), angles=(0.1, 2.0, 0.1 + TURN), repeat=True)
    period = law_period(speed_driven_period(machine, 1.0).solver, LawDrive(law), reactions=True)
    force = np.hypot(*(period.columns[f'pin_A.{x}'].values for x in 'xy'))
    at = period.crank[np.isinf(force)]
    assert len(at) >= 4
    assert np.abs(np.sin(at - 0.3)).max() < 1e-7
    assert extent(period.x, force).high == math.inf


@pytest.mark.parametrize(('text', 'options'), [(EQUAL, ['--reactions']), (EQUAL + FRICTION, [])])
def test_table_leaves_angles_without_forces_empty(tmp_path, called, undrawn, text, options):
    given = 'motion', equal(tmp_path, text), *options, '--csv', '30', '--out', tmp_path / 'out'
    code, _, error = called(command_line, *given)
    assert code == 0
    (note,) = error.splitlines()
    assert '90' in note
    assert '270' in note
    name = 'pin_A.x [N]' if options else 'driving_torque [N m]'
    table = rows(tmp_path / 'out/equal_motion.csv')
    assert [row['crank_angle [deg]'] for row in table if not row[name]] == ['90.0', '270.0']
    assert all(row['slider.position [m]'] for row in table)


def test_friction_that_locks_at_a_change_point_has_infinite_torque(tmp_path):
    machine = load(str(equal(tmp_path, EQUAL + FRICTION))).mechanism
    measures = _measures(speed_driven_period(turned(machine, 0.1234), SPEED))
    assert measures['peak torque [N m]'] == measures['rms torque [N m]'] == math.inf
    assert measures['mean power [W]'] == math.inf
    assert measures['stroke [m]'] == pytest.approx(0.4)


def test_movies_have_no_torque_where_it_is_infinite(tmp_path, called, monkeypatch):
    monkeypatch.setattr(movie, '_SECONDS', 0.2)
    shown = period_to_show(
        str(path := equal(tmp_path, EQUAL + FRICTION)), load(str(path)).only, None
    )
    monkeypatch.setattr(movie, 'period_to_show', lambda *_: shown)
    for name in ('equal.html', 'equal.gif'):
        code, _, error = called(command_line, 'movie', path, tmp_path / name)
        assert (code, sum('90' in line for line in error.splitlines())) == (0, 1)
    text = (tmp_path / 'equal.html').read_text()
    (line,) = (line for line in text.splitlines() if '"quantities"' in line)
    data = json.loads(line[line.index('{') : line.rindex('}') + 1], parse_constant=pytest.fail)
    assert any(None in quantity['values'] for quantity in data['quantities'])


def test_economy_and_flywheel_refuse_an_infinite_torque_in_one_line(tmp_path, called, undrawn):
    path, out = equal(tmp_path, EQUAL + FRICTION), tmp_path / 'out'
    assert_refused(*called(command_line, 'economy', path, '--out', out), 'friction')
    given = 'motion', path, '--fluctuation', '0.1', '--out', out
    code, _, error = called(command_line, *given)
    assert code
    assert 'friction' in error.splitlines()[-1]
