# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Period of a run: motions, loads and laws of one and two turns, in all combinations."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from mechanisms import CHANGE_POINTS, FULL, TURN, cylinder, four_bar
from test_law_chart import LIMITED

from linkage_lab.charts.motion import _measures
from linkage_lab.period import extent, law_period, period_to_show, speed_driven_period
from linkage_ros import LoadCurve, Solver, load
from linkage_ros.internals import LawMotion
from linkage_ros.mechanism.kinematics import Reach
from linkage_ros.motion.drives.law import LawDrive, Prescribed

COMMON = 6  # turns in which all runs below repeat
MOTIONS = {1: FULL['crank_rocker'], 2: CHANGE_POINTS['p0']}
LOADS = {
    1: LoadCurve('crank', at=(0.4, 2.0, 5.5), value=(40.0, -30.0, 80.0)),
    2: LoadCurve('crank', at=(0.4, 2.0, 8.5, 11.0), value=(40.0, -30.0, 80.0, 0.0)),
}
# Crank turns of a repetition, and its inner angles as shares of it; the first angle is 0.3.
LAWS = {1: (0.3, 0.6), -1: (0.3, 0.6), 2: (0.2, 0.75), 3: (0.3, 0.8), 0: (2.0, 4.0)}


def mechanism(motion, turns):
    return replace(four_bar(MOTIONS[motion]), loads=(LOADS[turns],))


def drive(turns):
    first, second = LAWS[turns]
    size = TURN * turns if turns else 1.0
    angles = (0.3, 0.3 + first * size, 0.3 + second * size, 0.3 + TURN * turns)
    law = Prescribed(times=(0.0, 0.7, 1.4, 2.2), angles=angles, repeat=True)
    return LawDrive(motion=law)


def figures(power, torque):
    """Returns mean power, rms and extreme torques, from values at equal steps."""
    return power.mean(), math.sqrt((torque**2).mean()), torque.min(), torque.max()


def of_period(period):
    found = extent(period.x, period.columns['driving_torque'].values)
    return period.mean_power, found.rms, found.low, found.high


@pytest.mark.parametrize(('motion', 'load', 'law'), [*itertools.product(MOTIONS, LOADS, LAWS)])
def test_figures_of_a_law_are_those_of_many_turns(motion, load, law):
    solver, along = Solver(mechanism(motion, load)), drive(law)
    period = law_period(solver, along)
    turned = (period.crank[-1] - period.crank[0]) / TURN
    assert turned == pytest.approx(
        math.copysign(math.lcm(motion, load, abs(law)), law) if law else 0.0, abs=1e-6
    )
    rounds = COMMON // abs(law) if law else 2
    stamps = range(1_000_000, along.motion.law.duration * rounds, 2_000_000)
    q, u, a = (row[0] for row in LawMotion.begin(along.motion.law, 0).at_all(stamps)[:3])
    torque = solver.torque(q, u, a)
    right = figures(torque * u, torque)
    size, found = max(map(abs, right)), of_period(period)
    assert found[:2] == pytest.approx(right[:2], abs=1e-4 * size)
    # The extremes may be at a jump, beside the steps.
    assert found[2:] == pytest.approx(right[2:], abs=2e-3 * size)
    assert period.speed == pytest.approx(np.abs(u).mean(), rel=1e-6)


@pytest.mark.parametrize(('motion', 'load'), [*itertools.product(MOTIONS, LOADS)])
@pytest.mark.parametrize('speed', [2.0, -2.0])
def test_figures_at_a_speed_are_those_of_many_turns(motion, load, speed):
    solver = Solver(mechanism(motion, load))
    period = speed_driven_period(solver.mechanism, speed)
    assert period.turns == math.lcm(motion, load)
    torque = solver.torque(np.linspace(0.0, COMMON * TURN, 120_000, endpoint=False), speed)
    right = figures(torque * speed, torque)
    assert of_period(period) == pytest.approx(right, abs=2e-4 * max(map(abs, right)))


def test_period_of_a_cylinder_or_of_a_law_to_and_fro_has_no_turns():
    assert Reach('', driven='cylinder', period_turns=0).period_with(LOADS.values()) == 0
    assert Reach('').period_with(LOADS.values(), 0) == 0
    assert Reach('', period_turns=2).period_with((), 3) == 6


@pytest.mark.parametrize('turn', [-1, 0, 1, 2])
def test_a_limited_crank_has_the_load_of_its_own_turn(tmp_path, turn):
    path = tmp_path / 'limited.yaml'
    text = LIMITED.format(drive='torque', rest=f'crank_angle: {2.0 + turn * TURN}')
    points = 'at: [0.0, 6.0, 7.0, 12.0], value: [1.0, 1.0, 9.0, 9.0]'
    path.write_text(f'{text}    loads: {{cam: {{kind: curve, link: crank, {points}}}}}\n')
    design = load(str(path)).only
    period, _ = period_to_show(str(path), design, None)
    middle = len(period.crank) // 2
    assert period.columns['crank.load'].values[middle] == (9.0 if turn % 2 else 1.0)


@pytest.mark.parametrize('turns', [1, 2])
def test_a_link_that_turns_fully_has_no_swing(turns):
    turning = replace(cylinder((2.5, 1, -0.6)), loads=(LOADS[turns],))
    assert Solver(turning).output == 'barrel'
    found = _measures(speed_driven_period(turning, 2.0))
    along = _measures(law_period(Solver(turning), drive(1)))
    for measures in (found, along):
        assert measures['swing [deg]'] is None
        assert measures['stroke [m]'] is None
