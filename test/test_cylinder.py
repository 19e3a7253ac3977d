# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The inverted slider-crank: limits of the crank, refusals, drives, and joints of a robot."""

import pytest
from mechanisms import cylinder, worst_errors
from oracle import oracle_of

from linkage_ros import (
    ConfigurationError,
    LinkageError,
    MechanismError,
    Solver,
    UnreachableError,
)
from linkage_ros.settings.configuration import configure, load

SHAPER = {
    name: value
    for name, value in load('shaper').parameters().items()
    if not name.startswith(('dyads.', 'loads.'))
}


def shaper(**values):
    """Returns a configuration of the shaper with other values; None leaves a value out."""
    given = {**SHAPER, **{name.replace('__', '.'): value for name, value in values.items()}}
    return configure({name: value for name, value in given.items() if value is not None})


@pytest.mark.parametrize('lengths', [(1, 2.2, 1.7), (2.2, 1, -1.9), (1, 1, 0.3), (1, 2, 1.0625)])
@pytest.mark.parametrize('angle', [0.3, -2.0, 7.0])
def test_crank_is_limited_where_the_rod_no_longer_reaches_it(lengths, angle):
    mechanism = cylinder(lengths, angle)
    solver, oracle = Solver(mechanism), oracle_of(mechanism)
    ((low, high),) = solver.reach.arcs
    for end, outwards in ((low, -1), (high, 1)):
        for distance in (1e-3, 1e-9, 1e-13):
            assert not oracle.closes(end + outwards * distance)
            with pytest.raises(UnreachableError, match='cannot move at'):
                solver.state(end + outwards * distance)
            assert oracle.closes(end - outwards * distance)
            solver.state(end - outwards * distance)
    assert max(worst_errors(solver, [low + 0.01, low + 0.9, high - 0.3], period=0)) < 1e-12


def test_errors_grow_only_with_the_rounding_of_the_angle_near_a_limit():
    """Near the end of the arc, s grows with the square root of the distance."""
    mechanism = cylinder((1, 2.2, 1.7))
    (low, _), *_ = Solver(mechanism).reach.arcs
    for distance in (1e-4, 1e-8):
        errors = worst_errors(Solver(mechanism), [low + distance], period=0)
        assert max(errors) < 1e-14 / distance


@pytest.mark.parametrize('ratio', [1e-3, 1e-7, 1e-11])
def test_states_are_right_where_the_crank_pin_passes_close_to_the_pivot(ratio):
    for offset in (0.0, 0.75 * ratio):
        solver = Solver(cylinder((1.0, 1.0 + ratio, offset), 0.0))
        angles = [x * ratio for x in (-5.0, -1.0, -0.2, 0.0, 0.3, 2.0)]
        assert max(worst_errors(solver, [*angles, 1.0, 3.0])) < 1e-13


@pytest.mark.parametrize(
    ('lengths', 'words'),
    [
        ((1, 2, 3), 'crank .* frame, 3 m: the loop cannot close'),
        ((1, 2, -9), 'the loop cannot close; bring the offset nearer to 0'),
        ((1, 2, 1), 'is equal to the difference of frame and crank'),
        ((0.3, 0.1, -0.2), 'is equal to the difference'),  # not in binary
        ((1, 1, 0), 'is equal to the difference'),
    ],
)
def test_lengths_without_a_motion_are_refused(lengths, words):
    with pytest.raises(MechanismError, match=words):
        cylinder(lengths)


@pytest.mark.parametrize(
    ('values', 'words'),
    [
        ({'assembly': 'open'}, "'assembly' is not a parameter of an inverted_slider_crank"),
        ({'offset': 0.2}, r'\|frame - crank\| - \|offset\| = -0.02 m is negative; bring the'),
        ({'offset': 0.18}, 'is equal to the difference'),
        ({'loads.gas.kind': 'gas', 'loads.gas.link': 'barrel', 'loads.gas.bore': 0.1,
          'loads.gas.clearance': 0.1, 'loads.gas.inlet': 1e5}, 'barrel has no stroke'),
        ({'joints.rod.parent': 'frame'}, 'joints.rod.parent = .*: must be barrel'),
    ],
)  # fmt: skip
def test_bad_values_are_refused(values, words):
    with pytest.raises(LinkageError, match=words):
        _ = shaper(**values).robot_joints


def test_gas_needs_a_crank_that_turns_fully():
    gas = {'kind': 'gas', 'link': 'rod', 'bore': 0.1, 'clearance': 0.1, 'inlet': 1e5}
    values = {f'loads.gas.{name}': value for name, value in gas.items()}
    limited = {'offset': 0.2, 'drive': 'torque', 'crank_angle': 1.0, 'rpm': None,
               'crank_acceleration': None, 'start_rpm': 0.0,
               'trajectory_command_topic': None, 'trajectory_horizon': None,
               'effort_command_topic': None, 'lead_time': None}  # fmt: skip
    shaper(**limited)
    with pytest.raises(ConfigurationError, match='no stroke with fixed ends'):
        shaper(**limited, **values)
