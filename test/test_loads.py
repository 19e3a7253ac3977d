# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a machine works against: loads of the output link, load curves, dry friction."""

import math
from dataclasses import replace

import numpy as np
import pytest
from mechanisms import ALL, LIMITED, TURN, four_bar, motion

from linkage_ros import (
    ConfigurationError,
    FourBar,
    Friction,
    LinkLoad,
    LoadCurve,
    MechanismError,
    Rocker,
    Solver,
    UnreachableError,
    travel,
)
from linkage_ros.parameters.configuration import configure, load

CRANKS = np.linspace(-6.0, 6.5, 101)
AT, VALUE, BACK = (-1.0, 1.5, 4.0), (5.0, -7.0, 30.0), (0.0, 2.0, -4.0)
MECHANISMS = {'rocker': ALL['crank_rocker'], 'slider': ALL['offset_right']}
# Each with the force that it exerts at an output position, its rate and a crank angle.
LOADS = {
    'force': (lambda link: LinkLoad(link, 3.0), lambda x, v, q: 3.0),
    'damping': (lambda link: LinkLoad(link, damping=0.7), lambda x, v, q: -0.7 * v),
    'spring': (
        lambda link: LinkLoad(link, stiffness=11.0, rest=0.4),
        lambda x, v, q: -11.0 * (x - 0.4),
    ),
    'over_position': (
        lambda link: LoadCurve(link, 'position', AT, VALUE, BACK),
        lambda x, v, q: np.where(v >= 0, np.interp(x, AT, VALUE), np.interp(x, AT, BACK)),
    ),
    'over_crank_angle': (
        lambda link: LoadCurve(link, at=(0.5, 2.0, 6.0), value=(4.0, -3.0, 8.0)),
        lambda x, v, q: np.interp(np.mod(q - 0.5, TURN), (0, 1.5, 5.5, TURN), (4, -3, 8, 4)),
    ),
}


def with_loads(mechanism, *loads):
    """The mechanism with these loads, and none of its own on the output link."""
    name = 'rocker' if isinstance(mechanism, FourBar) else 'slider'
    part = getattr(mechanism, name)
    bare = replace(part, **dict.fromkeys(part.load_fields, 0.0))
    return replace(mechanism, **{name: bare}, loads=loads)


def moved(mechanism, cranks=CRANKS):
    solver = Solver(mechanism)
    return solver, solver.state(*motion(mechanism, cranks))


@pytest.mark.parametrize('link', MECHANISMS)
@pytest.mark.parametrize('name', LOADS)
def test_a_load_asks_for_the_torque_of_its_virtual_power(link, name):
    make, force = LOADS[name]
    loaded = with_loads(MECHANISMS[link], make(link))
    _, state = moved(with_loads(MECHANISMS[link]))
    solver, found = moved(loaded)
    x, v = state.position[-1], state.velocity[-1]
    if link == 'rocker':
        x = np.unwrap(x)
        x = x - TURN * np.round((np.mean(x) - loaded.swing_middle(2, '')) / TURN)
    exerted = force(x, v, CRANKS)
    size = np.max(np.abs(found.torque)) + np.max(np.abs(state.torque))
    assert np.allclose(found.torque - state.torque, -exerted * v / 2.0, rtol=0, atol=1e-13 * size)
    (got,) = solver.load_forces(found).values()
    assert np.allclose(got, exerted, rtol=1e-13, atol=1e-12)
    assert solver.reactions(found).torque == pytest.approx(found.torque, abs=1e-12 * size)


@pytest.mark.parametrize('link', MECHANISMS)
def test_an_array_has_the_bits_of_its_states(link):
    """But for NumPy's functions: the programs are bound to those of `math` for both."""
    makers = LOADS['over_position'][0], LOADS['over_crank_angle'][0]
    solver = Solver(with_loads(MECHANISMS[link], *(make(link) for make in makers)))
    q, u, a = motion(MECHANISMS[link], CRANKS)
    together = solver._moving.arrays(*q, *u, *a, by_math=True).torque
    alone = [solver.state(crank, *u, *a).torque for crank in CRANKS.tolist()]
    assert together.tolist() == alone


def test_a_link_load_is_what_the_link_itself_says():
    given = with_loads(MECHANISMS['rocker'], LinkLoad('rocker', 1.0, 2.0, 3.0, 0.4))
    assert given.loads == ()
    assert isinstance(given.rocker, Rocker)
    assert [getattr(given.rocker, name) for name in Rocker.load_fields] == [1.0, 2.0, 3.0, 0.4]
    with pytest.raises(ConfigurationError, match='given twice'):
        replace(given, loads=(LinkLoad('rocker', 1.0),))


def test_what_is_no_load_is_refused():
    with pytest.raises(ConfigurationError, match='must be a LinkLoad, LoadCurve or Friction'):
        with_loads(MECHANISMS['rocker'], Rocker(1.0))


def test_parameters_say_all_loads():
    configuration = load('quadrilateral')
    loads = (
        LinkLoad('rocker', 1.0, 2.0, 3.0, 0.4),
        LoadCurve('crank', at=(0.0, 1.0), value=(1.0, 2.0)),
        Friction(0.1, 0.01),
    )
    configuration = replace(configuration, mechanism=replace(configuration.mechanism, loads=loads))
    assert configure(configuration.parameters()) == configuration


def test_a_file_gives_the_curve_of_its_columns(tmp_path):
    path = tmp_path / 'curve.csv'
    path.write_text('at, value, return_value\n-1, 5, 0\n1.5, -7, 2\n\n4e0, 30, -4\n')
    assert LoadCurve('slider', 'position', file=str(path)) == LoadCurve(
        'slider', 'position', AT, VALUE, BACK
    )


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        ('', 'first line'),
        ('at,value\n', 'holds no points'),
        ('at,value\n0,1\n1,one\n', 'row 3: must be 2 finite numbers'),
        ('at,value\n0,1\n1,nan\n', 'row 3'),
        ('at,value\n0,1,2\n', 'row 2'),
        ('at,value\n0,1\n1,1e15\n', r'load\.value = \(1\.0, .*: must be .* to 1e\+12 N or N m'),
        (None, 'No such file'),
    ],
)
def test_a_file_that_is_no_table_is_refused(tmp_path, text, words):
    path = tmp_path / 'curve.csv'
    if text is not None:
        path.write_text(text)
    with pytest.raises(ConfigurationError, match=words):
        LoadCurve('slider', file=str(path))


# ---------------------------------------------------------------- the rocker's swing


@pytest.mark.parametrize(
    'lengths', [(1, 3, 2.5, 2.2), (2, 1.5, 1.6, 2.2), LIMITED['triple_rocker_near']]
)
@pytest.mark.parametrize('angle', [0.0, 1.3, math.pi, -2.5])
@pytest.mark.parametrize('assembly', ['open', 'crossed'])
def test_the_middle_of_the_swing_is_between_its_ends(lengths, angle, assembly):
    mechanism = four_bar(lengths, angle, assembly)
    solver = Solver(mechanism)
    (start, end), *_ = solver.reach.arcs
    inside = 1e-6 * (end - start)
    cranks = np.linspace(start + inside, end - inside, 20_001)
    swung = np.unwrap(solver.state(cranks).position[2])
    middle = mechanism.swing_middle(2, '')
    assert abs(middle) <= math.pi
    low, high = swung.min(), swung.max()
    if solver.reach.turns_fully:
        assert math.remainder(0.5 * (low + high) - middle, TURN) == pytest.approx(0, abs=1e-6)
    turns = TURN * round((0.5 * (low + high) - middle) / TURN)
    assert middle - math.pi < low - turns < high - turns < middle + math.pi


def test_what_depends_on_the_place_of_a_rocker_that_turns_is_refused():
    turning = ALL['double_crank']
    for loads in (
        (LinkLoad('rocker', stiffness=1.0),),
        (LoadCurve('rocker', 'position', AT, VALUE),),
    ):
        with pytest.raises(ConfigurationError, match='turns fully'):
            Solver(with_loads(turning, *loads))
    assert travel(Solver(turning)).extremes is None


# ---------------------------------------------------------------- dry friction

RUBBING = {
    'rocker': (MECHANISMS['rocker'], Friction(0.1, 0.05)),
    'slider': (MECHANISMS['slider'], Friction(0.1, 0.05, 0.2)),
}


@pytest.mark.parametrize('link', RUBBING)
def test_friction_takes_the_power_of_its_forces(link):
    mechanism, friction = RUBBING[link]
    rubbing = with_loads(mechanism, friction)
    solver, state = moved(rubbing)
    _, smooth = moved(with_loads(mechanism))
    forces, pairs = solver.reactions(state), solver.structure.pins
    lost = 0.0
    for pin in pairs:
        size = np.hypot(*forces.pins[pin.name])
        first = 0.0 if pin.first is None else state.velocity[pin.first]
        second = state.velocity[pin.second] if link == 'rocker' or pin.second != 2 else 0.0
        lost = lost + friction.pin * friction.pin_radius * size * np.abs(second - first)
    if link == 'slider':
        lost = lost + friction.guide * np.abs(forces.guide_force * state.velocity[2])
    gain = (state.torque - smooth.torque) * 2.0
    assert np.min(gain) > 0
    assert np.allclose(gain, lost, rtol=1e-11, atol=1e-11 * np.max(lost))
    assert np.allclose(
        forces.torque, state.torque, rtol=0, atol=1e-12 * np.max(np.abs(state.torque))
    )


@pytest.mark.parametrize('link', RUBBING)
def test_friction_of_an_array_has_the_digits_of_its_states(link):
    mechanism, friction = RUBBING[link]
    solver, together = moved(with_loads(mechanism, friction))
    alone = [solver.state(crank, 2.0, 1.5).torque for crank in CRANKS.tolist()]
    assert np.allclose(together.torque, alone, rtol=0, atol=1e-14 * np.max(np.abs(alone)))


def test_nothing_rubs_at_rest_and_friction_turns_with_the_motion():
    mechanism, friction = RUBBING['slider']
    rubbing, smooth = Solver(with_loads(mechanism, friction)), Solver(with_loads(mechanism))
    assert rubbing.state(0.7) == smooth.state(0.7)
    forth, back = (rubbing.state(0.7, u).torque - smooth.state(0.7, u).torque for u in (2.0, -2.0))
    assert forth > 0 > back


def test_a_mechanism_that_locks_itself_is_refused_with_the_angle():
    solver = Solver(with_loads(MECHANISMS['slider'], Friction(5.0, 1.0, 3.0)))
    with pytest.raises(UnreachableError, match=r'at 40\.\d* deg friction locks'):
        solver.state(0.7, 2.0)
    with pytest.raises(UnreachableError, match='friction locks'):
        solver.state(CRANKS, 2.0)


def test_friction_under_a_given_torque_is_refused():
    solver = Solver(with_loads(MECHANISMS['slider'], Friction(0.1, 0.01)))
    with pytest.raises(MechanismError, match='leave friction out'):
        solver.accelerations(0.3, 1.0, 2.0)


# ---------------------------------------------------------------- refusals

CURVE = {'load.link': 'rocker', 'load.at': [0.0, 1.0], 'load.value': [1.0, 2.0]}


@pytest.mark.parametrize(
    ('values', 'words'),
    [
        ({**CURVE, 'load.at': [1.0, 1.0]}, r'load\.at must rise: its number 2, 1, is not above 1'),
        ({**CURVE, 'load.value': [1.0]}, r'load\.value has 1 numbers and load\.at 2'),
        ({**CURVE, 'load.at': [0.0, 7.0]}, r'load\.at spans 7 rad: must be at most one turn'),
        ({**CURVE, 'load.at': [0.0, TURN]}, 'they must be equal, or leave the last point out'),
        ({**CURVE, 'load.at': [0.0, math.nan]}, r'load\.at = .* must be a list of numbers'),
        ({**CURVE, 'load.at': []}, r'load\.at = \[\]: must be a list of numbers'),
        ({**CURVE, 'load.link': 'slider'}, r"load\.link = 'slider': must be crank or rocker"),
        ({'load.at': [0.0, 1.0]}, r'load\.link is missing: must be one of crank, rocker, slider'),
        ({'load.link': 'rocker'}, 'load needs at and value'),
        ({**CURVE, 'load.return_value': [1.0, 2.0]}, r"is for load\.over = 'position'"),
        ({**CURVE, 'load.link': 'crank', 'load.over': 'position'}, 'must be crank_angle'),
        ({**CURVE, 'load.file': 'x.csv'}, 'leave out at, value and return_value'),
        ({'friction.pin': -0.1}, r'friction\.pin = -0\.1: must be a number from 0'),
        ({'rocker.stiffness': -1.0}, r'rocker\.stiffness = -1\.0: must be a number from 0'),
        ({'drive': 'torque', 'friction.pin': 0.1, 'friction.pin_radius': 0.1}, 'leave friction'),
    ],
)
def test_wrong_loads_are_refused(values, words):
    with pytest.raises((ConfigurationError, MechanismError), match=words):
        configure(values)
