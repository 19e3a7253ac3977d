# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_chart motion --fluctuation: the motion under a torque, with the flywheel found."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from ros_harness import assert_refused
from scipy.interpolate import CubicSpline

from linkage_ros import Solver, chart_tool
from linkage_ros.errors import ConfigurationError, MechanismError
from linkage_ros.lab.flywheel import Crank
from linkage_ros.motion.adaptive_integrator import AdaptiveSteps
from linkage_ros.motion.driven_mechanism import DrivenMechanism
from linkage_ros.motion.drives import Motor
from linkage_ros.parameters.configuration import load
from linkage_ros.units import radians_per_second

_STEP = math.pi / 1000  # rad at the first speed, between two looks at a run
PLANT = """
linkage_node:
  ros__parameters:
    mechanism: four_bar
    drive: torque
    motor: {torque: 12.0, damping: 0.5}
    frame: {length: 0.425, angle: 5.497787143782138}
    crank: {length: 0.1, inertia: 0.0245}
    coupler: {length: 0.315, mass: 2.0, inertia: 0.016, center: [0.1575, 0.0]}
    rocker: {length: 0.5, mass: 3.5, inertia: 0.066, center: [0.25, 0.0], damping: 5.0}
"""


def with_crank_inertia(mechanism, added):
    crank = mechanism.crank
    return replace(mechanism, crank=replace(crank, inertia=crank.inertia + added))


def driven(mechanism, law, start, turns=1):
    """Crank angles and speeds of a torque-driven run from angle 0, at even times."""
    steps = AdaptiveSteps(DrivenMechanism(Solver(mechanism), law), (0.0, start))
    angles, speeds = [0.0], [start]
    while angles[-1] < 2 * math.pi * turns:
        steps.advance(len(angles) * _STEP / start)
        angles.append(steps.phase[0] + 4 * math.pi * steps.pairs)
        speeds.append(steps.phase[1])
    return np.array(angles), np.array(speeds)


def check_balance(mechanism, cycle):
    """The mechanism and the flywheel take the torque at every angle, by inverse dynamics."""
    slope = CubicSpline(cycle.crank, cycle.velocity)(cycle.crank, 1)
    state = Solver(mechanism).state(cycle.crank, cycle.velocity, cycle.velocity * slope)
    size = np.abs(state.torque).max()
    away = np.abs(state.torque - cycle.demand)
    assert np.median(away) < 1e-6 * size
    assert (away < 1e-3 * size).mean() > 0.97  # the slope of a speed leaps where a load does
    assert cycle.velocity[-1] == pytest.approx(cycle.velocity[0], rel=1e-8)


@pytest.mark.parametrize(
    'preset', ['quadrilateral', 'compressor', 'wiper', 'press', 'coupler_point']
)
def test_the_mechanism_and_the_flywheel_take_the_torque_at_every_angle(preset):
    """No energy enters the test, and friction where there is any."""
    configuration = load(preset)
    crank, speed = Crank(configuration.mechanism), radians_per_second(configuration.drive.rpm)
    cycle = crank.cycle(speed, crank.inertia_for(0.02, speed))
    assert cycle.fluctuation == pytest.approx(0.02, rel=1e-9)
    assert cycle.speed == pytest.approx(speed, rel=1e-9)
    assert np.ptp(cycle.torque) < 1e-12
    check_balance(configuration.mechanism, cycle)


@pytest.mark.parametrize('fluctuation', [0.02, 0.5, 2.0])
def test_a_strong_fan_has_a_cycle_with_any_flywheel(fluctuation):
    """A damping that takes all energy within a turn; substituting speeds diverges there."""
    mechanism = load('quadrilateral').mechanism
    mechanism = replace(mechanism, rocker=replace(mechanism.rocker, damping=80.0))
    crank = Crank(mechanism)
    for added in (0.0, crank.inertia_for(fluctuation, 15.0)):
        cycle = crank.cycle(15.0, added)
        check_balance(mechanism, cycle)
    assert cycle.fluctuation == pytest.approx(fluctuation, rel=1e-9)


def test_direction_does_not_matter_to_inertia():
    mechanism = replace(load('quadrilateral').mechanism, gravity=(0.0, 0.0))
    found = [Crank(mechanism).inertia_for(0.05, speed) for speed in (15.0, -15.0, 30.0)]
    assert found == pytest.approx([found[0]] * 3, rel=1e-9)
    mechanism = with_crank_inertia(mechanism, 1.6)
    assert Crank(mechanism).inertia_for(0.02, 15.0) == 0.0


def test_a_crank_without_inertia_and_one_too_slow_have_no_cycle():
    with pytest.raises(MechanismError, match='no steady cycle of its speed was found'):
        Crank(load('quadrilateral').mechanism).cycle(1e-4, 0.0)
    crank = Crank(load('slider_crank').mechanism)
    with pytest.raises(ConfigurationError, match='without a mass'):
        crank.cycle(6.0, 0.0)
    assert crank.cycle(6.0, crank.inertia_for(0.1, 6.0)).fluctuation == pytest.approx(0.1)


@pytest.mark.parametrize('added', [0.0, 0.2])
@pytest.mark.parametrize('sign', [1.0, -1.0])
def test_a_motor_settles_where_its_line_meets_the_mechanism(added, sign):
    mechanism, motor = load('compressor').mechanism, Motor(sign * 40.0, 0.3)
    mechanism = replace(mechanism, loads=())
    cycle = Crank(mechanism).under(motor, sign * 70.0, added)
    assert cycle.speed * sign > 0
    assert cycle.torque == pytest.approx(sign * 40.0 - 0.3 * cycle.velocity)
    check_balance(with_crank_inertia(mechanism, added), cycle._replace(demand=cycle.torque))


def test_a_torque_driven_run_settles_at_the_cycle_of_its_motor():
    mechanism, motor = replace(load('compressor').mechanism, loads=()), Motor(40.0, 0.3)
    cycle = Crank(mechanism).under(motor, 70.0, 0.0)
    angles, speeds = driven(mechanism, lambda u: motor.at(u), 70.0, turns=5)
    last = speeds[angles > angles[-1] - 2 * math.pi]
    assert np.ptp(last) / cycle.speed == pytest.approx(cycle.fluctuation, rel=1e-3)


def test_a_motor_too_weak_to_start_carries_a_cycle_that_is_fast_enough():
    """At 0.5 rad/s the weights, of up to 1.45 N m, stop a crank that gets 0.3 N m."""
    crank, motor = Crank(load('quadrilateral').mechanism), Motor(0.3, 0.02)
    assert crank.under(motor, 0.5, 0.5).speed == pytest.approx(15.0, rel=0.01)


@pytest.mark.parametrize('motor', [Motor(0.5, 0.01), Motor(-20.0, 0.1), Motor(50.0)])
def test_a_motor_that_does_not_carry_the_cycle(motor):
    """Too weak, against the motion, and without a loss that would end its gain."""
    mechanism = load('compressor').mechanism if motor.damping else load('quadrilateral').mechanism
    assert Crank(mechanism).under(motor, 90.0, 0.05) is None


# ---------------------------------------------------------------- the command


def test_the_command_says_what_the_quadrilateral_needs(tmp_path, called):
    options = 'motion', 'quadrilateral', '--fluctuation', '0.02', '--out', tmp_path
    code, out, _ = called(chart_tool, *options)
    assert code == 0
    _, torque, power, flywheel, first, picture, *_ = out.splitlines()
    assert torque == 'driving torque: peak 8.547 N m, rms 4.242 N m, mean 0 N m'
    assert power == 'driving power: peak 134.3 W, rms 66.64 W, mean 0 W'
    assert flywheel == (
        'fluctuation 0.02: add 1.4173 kg m^2 to the crank (without: 0.5848)'
    )  # fmt: skip
    assert first == 'to first order: 7.278 J between the extremes, 1.4748 kg m^2 in total'
    assert (tmp_path / 'quadrilateral_flywheel.png').samefile(picture)


def test_the_command_judges_a_motor(tmp_path, called):
    (tmp_path / 'plant.yaml').write_text(PLANT)
    options = '--rpm', 200, '--fluctuation', '0.1', '--out', tmp_path
    code, out, _ = called(chart_tool, 'motion', tmp_path / 'plant.yaml', *options)
    assert code == 0
    lines = out.splitlines()
    line, carried, bare = lines[5:8]
    assert line.startswith('motor 12 N m - 0.5 N m s x speed: 1.528 N m at this speed, where the')
    assert carried.startswith('with the flywheel: the motor carries the cycle at ')
    assert bare.startswith('without: the motor carries the cycle at ')


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        (['quadrilateral', '--fluctuation', '0'], "'0': must be a number from 1e-06 to 1"),
        (['quadrilateral', '--fluctuation', '2'], "'2': must be a number from 1e-06 to 1"),
        (['quadrilateral', '--fluctuation', '0.1', '--rpm', '0'], 'not for 0 rpm and 0 rad/s^2'),
        (
            ['quadrilateral', '--fluctuation', '0.1', '--acceleration', '1'],
            'a steady speed other than 0, not for 150 rpm and 1 rad/s^2: change',
        ),
        (['wind_pump', '--fluctuation', '0.1'], 'leave --fluctuation out'),
    ],
)
def test_case_without_fluctuation_gives_one_line(tmp_path, called, arguments, words):
    given = called(chart_tool, 'motion', *arguments, '--out', tmp_path)
    assert_refused(*given, re.escape(words))
