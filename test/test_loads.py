# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Loads and friction: descriptions, refusals, and comparison with Newton-Euler in 50 digits."""

import math
from dataclasses import replace

import numpy as np
import pytest
from mechanisms import (
    ALL,
    CHANGE_POINTS,
    FULL,
    LIMITED,
    PUMPS,
    TURN,
    force_errors,
    four_bar,
    motion,
    slider_crank,
    with_loads,
    worst_errors,
)
from mpmath import mp
from oracle import Oracle, oracle_of
from ros_harness import assert_refused

from linkage_lab import command_line
from linkage_ros import (
    ConfigurationError,
    FourBar,
    Friction,
    LinkLoad,
    LoadCurve,
    Solver,
    UnreachableError,
)
from linkage_ros.mechanism.kinematics import LinkPose
from linkage_ros.mechanism.loads.gas import GasForce
from linkage_ros.programs import record as record_module
from linkage_ros.quantities import build, flatten

SLIDER = 'mechanism: slider_crank, rpm: 60.0, crank: {length: 0.1}, coupler: {length: 0.3}'
FOUR = (
    'mechanism: four_bar, rpm: 60.0, crank: {length: 0.1}, coupler: {length: 0.315}, '
    'frame: {length: 0.425}'
)
TURNING = (
    'mechanism: four_bar, rpm: 60.0, crank: {length: 0.3}, coupler: {length: 0.25}, '
    'frame: {length: 0.1}'
)
PUMP = (
    'mechanism: wind_pump, motor: {torque: 8.4}, crank: {length: 0.1, inertia: 1.0}, '
    'coupler: {length: 0.8, inertia: 1.0}, rod: {length: 1.6, inertia: 1.0}, '
    'slider: {mass: 6.0, position: 1.5}'
)
ROCKER, TURNING_ROCKER = ', rocker: {length: 0.5}', ', rocker: {length: 0.22}'
POINTS = 'at: [0.0, 1.0], value: [1.0, 2.0]'
FILES = {
    'words.csv': b'once upon a time\nthere was\n',
    'binary.csv': bytes(range(256)) * 40,
    'semicolons.csv': b'at;value\n0;1\n1;2\n',
    'infinite.csv': b'at,value\n0,1\n1,inf\n',
    'falling.csv': b'at,value\n0,1\n-1,2\n',
    'empty.csv': b'at,value\n',
    'unequal.csv': b'at,value\n0,1,2\n',
}
CRANKS = np.linspace(-6.0, 6.5, 101)
ON = {'rocker': ALL['crank_rocker'], 'slider': ALL['offset_right']}
# All kinds of loads, on a rocker and on a slider.
EXAMPLES = {
    LinkLoad: lambda link: LinkLoad(link, 1.0, 2.0, 3.0, 0.4),
    LoadCurve: lambda link: LoadCurve(
        link, 'position', (-1.0, 1.5, 4.0), (5.0, -7.0, 30.0), (0.0, 2.0, -4.0)
    ),
    Friction: lambda link: Friction(1.0, 0.05, 0.55) if link == 'slider' else Friction(0.1, 0.05),
}


def on(mechanism, kind, text):
    """Returns parameters of a mechanism with a load."""
    return f'{mechanism}, loads: {{a: {{kind: {kind}, {text}}}}}'


WRONG = {
    # Points.
    'not rising': (on(SLIDER, 'curve', 'link: slider, at: [1.0, 0.5], value: [1.0, 2.0]'),
                   r'loads\.a\.at must increase: number 2, 0\.5, is not above 1 before it'),
    'unequal': (on(SLIDER, 'curve', 'link: slider, at: [0.0, 1.0], value: [1.0]'),
                r'loads\.a\.value has 1 numbers and loads\.a\.at 2: give one for each point'),
    'more than a turn': (on(SLIDER, 'curve', 'link: slider, at: [0.0, 13.0], value: [1.0, 1.0]'),
                         r'a\.at spans 13 rad = 744\.845 deg .*: must span at most two turns'),
    'unequal ends': (
        on(SLIDER, 'curve', f'link: slider, at: [0.0, {TURN}], value: [1.0, 2.0]'),
        'ends with 2: must .* turns, the last value must equal the first, 1',
    ),
    'return over the angle': (
        on(SLIDER, 'curve', f'link: slider, {POINTS}, return_value: [1.0, 2.0]'),
        r"is for loads\.a\.over = 'position'",
    ),
    'negative spring': (on(FOUR + ROCKER, 'link', 'link: rocker, stiffness: -1.0'),
                        r'loads\.a\.stiffness = -1\.0: must be a number from 0'),
    'spring on the crank': (
        on(FOUR + ROCKER, 'link', 'link: crank, stiffness: 1.0'),
        r'loads\.a\.stiffness = 1: the swing of a crank',
    ),
    'link load of the coupler': (
        on(FOUR + ROCKER, 'link', 'link: coupler, force: 1.0'),
        r"loads\.a\.link = 'coupler': must be crank or rocker",
    ),
    'nan': (on(SLIDER, 'curve', 'link: slider, at: [0.0, .nan], value: [1.0, 1.0]'),
            r'loads\.a\.at = \[0\.0, nan\]: must be a list of numbers from -1e\+09'),
    'mixed': (on(SLIDER, 'curve', 'link: slider, at: [0, 1.5], value: [1.0, 1.0]'),
              r"'loads\.a\.at' mixes types, 0 and 1\.5; give one"),
    'empty': (on(SLIDER, 'curve', 'link: slider, at: [], value: [1.0]'),
              r"'loads\.a\.at' is an empty list; write"),
    'words for numbers': (on(SLIDER, 'curve', 'link: slider, at: [a, b], value: [1.0, 1.0]'),
                          r"loads\.a\.at = \['a', 'b'\]: must be a list of numbers"),
    'one number': (on(SLIDER, 'curve', 'link: slider, at: 1.0, value: [1.0]'),
                   r'loads\.a\.at = 1\.0: must be a list of numbers'),
    'huge': (on(SLIDER, 'curve', 'link: slider, at: [0.0, 1.0], value: [0.0, 1.0e+300]'),
             r'loads\.a\.value = \[0\.0, 1e\+300\]: must be .* from -1e\+12 to 1e\+12 N or N m'),
    'no points': (on(SLIDER, 'curve', 'link: slider, value: [1.0]'), 'a needs at and value'),
    'no link': (on(SLIDER, 'curve', f'{POINTS}'), r'loads\.a\.link is missing: must be text'),
    # Files.
    'missing file': (on(SLIDER, 'curve', 'link: slider, file: no.csv'),
                     r"loads\.a\.file = 'no\.csv': No such file or directory; give the path"),
    'a folder': (on(SLIDER, 'curve', 'link: slider, file: .'), r"'\.': Is a directory; give"),
    **{
        name: (on(SLIDER, 'curve', f'link: slider, file: {name}'), words)
        for name, words in {
            'words.csv': r"'words\.csv': its first line names 'once.*give the path",
            'binary.csv': r"'binary\.csv': 'utf-8' codec can.t decode.*; give the path of a CSV",
            'semicolons.csv': "its first line names 'at;value'",
            'infinite.csv': r'must be a list of numbers from',
            'empty.csv': 'each line below at,value must be 2 numbers',
            'unequal.csv': 'each line below at,value must be 2 numbers',
            'falling.csv': r'loads\.a\.at must increase: number 2, -1, is not above 0',
        }.items()
    },
    'file and points': (on(SLIDER, 'curve', f'link: slider, file: words.csv, {POINTS}'),
                        'leave out at, value, which the file contains'),
    # Links.
    'over position on a crank': (on(SLIDER, 'curve', f'link: crank, over: position, {POINTS}'),
                                 r'must be crank_angle if loads\.a\.link is crank'),
    'another link': (on(SLIDER, 'curve', f'link: coupler, {POINTS}'),
                     r"loads\.a\.link = 'coupler': must be crank or slider"),
    "another mechanism's": (on(SLIDER, 'curve', f'link: rocker, {POINTS}'),
                            r"loads\.a\.link = 'rocker': must be crank or slider"),
    "another's of a pump": (on(PUMP, 'curve', f'link: rocker, {POINTS}'),
                            r"loads\.a\.link = 'rocker': must be crank or slider"),
    'a rocker that turns': (on(TURNING + TURNING_ROCKER, 'curve',
                               f'link: rocker, over: position, {POINTS}'),
                            r"loads\.a\.over = 'position': the rocker .* turns fully"),
    'its spring': (on(TURNING + TURNING_ROCKER, 'link', 'link: rocker, stiffness: 1.0'),
                   r'loads\.a\.stiffness: the rocker of this double-crank linkage turns fully'),
    'rest outside': (on(FOUR + ROCKER, 'link', 'link: rocker, rest: 1e10'),
                     r'loads\.a\.rest = 10000000000\.0: must be a number from -1e\+09 to'),
    'unknown': (on(SLIDER, 'curve', 'link: slider, values: [1.0]'),
                r"'loads\.a\.values' is not a parameter .* loads\.a has .*, value,"),
    # Friction.
    'under a torque': ((f'{SLIDER.replace("rpm: 60.0", "drive: torque")}, motor: {{torque: 1.0}}, '
                       'loads: {a: {kind: friction, guide: 0.1}}'),
                      'leave friction out where the torque is given'),
    'of a pump': (on(PUMP, 'friction', 'pin: 0.1, pin_radius: 0.1'), 'leave friction out'),
    'negative': (on(SLIDER, 'friction', 'guide: -0.1'),
                 r'loads\.a\.guide = -0\.1: must be a number from 0 to 100'),
    'no radius': (on(FOUR + ROCKER, 'friction', 'pin: 0.1'),
                  r'loads\.a\.pin = 0\.1 with loads\.a\.pin_radius = 0: give both above'),
    'radius alone': (on(SLIDER, 'friction', 'pin_radius: 0.02, guide: 0.1'),
                     r'loads\.a\.pin = 0 with loads\.a\.pin_radius = 0\.02: give both above 0'),
    'no guide': (on(FOUR + ROCKER, 'friction', 'guide: 0.1'),
                 r'loads\.a\.guide = 0\.1: this mechanism has no guide; leave it out'),
}  # fmt: skip


@pytest.mark.parametrize(('text', 'words'), WRONG.values(), ids=WRONG)
def test_a_wrong_load_is_one_line_of_every_command(called, tmp_path, monkeypatch, text, words):
    monkeypatch.chdir(tmp_path)
    for name, content in FILES.items():
        if name in text:
            (tmp_path / name).write_bytes(content)
    (tmp_path / 'wrong.yaml').write_text(f'/**: {{ros__parameters: {{{text}}}}}\n')
    asked = ('wrong.yaml', 'run.mcap', '--duration', 0.1)
    assert_refused(*called(record_module, *asked), words)
    assert_refused(*called(command_line, 'motion', 'wrong.yaml', '--out', 'charts'), words)
    assert not (tmp_path / 'run.mcap').exists()


def test_friction_that_locks_during_a_record_is_one_line(called, tmp_path):
    path = tmp_path / 'locks.yaml'
    back = SLIDER.replace('60.0', '-60.0')  # forwards, the weight relieves the guide
    text = f'{back}, slider: {{mass: 1.0}}, loads: {{a: {{kind: friction, guide: 50.0}}}}'
    path.write_text(f'/**: {{ros__parameters: {{{text}}}}}\n')
    words = r'at [\d.]+ rad = [\d.]+ deg friction locks the mechanism: .* equilibrium; lower'
    assert_refused(*called(record_module, path, tmp_path / 'run.mcap', '--duration', 0.1), words)
    assert_refused(*called(command_line, 'motion', path, '--out', tmp_path), words)


def test_spreadsheet_gives_the_curve_in_its_columns(tmp_path):
    """The file has a byte order mark, Windows line ends, an empty row and quoted numbers."""
    path = tmp_path / 'sheet.csv'
    text = '\ufeffat, value,return_value\r\n"-1","5.5",0\r\n1.5,-7,2\r\n\r\n4e0,30,-4\r\n'
    path.write_bytes(text.encode())
    expected = (-1.0, 1.5, 4.0), (5.5, -7.0, 30.0), (0.0, 2.0, -4.0)
    (read,) = with_loads(ON['slider'], LoadCurve('slider', 'position', file=str(path))).loads
    assert read == LoadCurve('slider', 'position', *expected, name='curve_1')


@pytest.mark.parametrize('link', ON)
@pytest.mark.parametrize('kind', EXAMPLES)
def test_laws_of_every_kind_of_load(link, kind):
    loaded, bare = with_loads(ON[link], EXAMPLES[kind](link)), with_loads(ON[link])
    solver, q, u, a = Solver(loaded), *motion(loaded, CRANKS)
    state = solver.state(q, u, a)
    # The drive supplies the power of the loads in addition to inertia and weights.
    taken = (state.torque - Solver(bare).state(q, u, a).torque) * 2.0
    forces = solver.load_forces(state)
    power = sum(x * state.velocity[solver.links.index(name)] for name, x in forces.items())
    size = np.max(np.abs(taken))
    assert size > 0
    assert np.allclose(taken, -power, rtol=0, atol=1e-11 * size)
    # Newton's and Euler's equations need the same torque.
    needed = solver.reactions(state).torque
    assert np.allclose(needed, state.torque, rtol=0, atol=1e-12 * np.max(np.abs(state.torque)))
    # An array has the bits of its single states if both use the functions of `math`.
    together = Solver(loaded, by_math=True).state(q, u, a)
    alone = [solver.state(x, *u, *a) for x in CRANKS.tolist()]
    assert together.torque.tolist() == [one.torque for one in alone]
    # The parameters contain the load.
    assert build(type(loaded), flatten(loaded)) == loaded != bare


def test_loads_with_one_name_are_refused():
    loads = LinkLoad('crank', 1.0, name='a'), Friction(0.1, 0.05, name='a')
    with pytest.raises(ConfigurationError, match="two loads have the name 'a': rename one"):
        replace(ALL['crank_rocker'], loads=loads)


def test_frictions_act_together_and_are_told_apart_by_name():
    """Two coefficients for all pins act like their sum, in proportion."""
    mechanism = with_loads(ON['slider'], Friction(0.1, 0.05, 0.2, name='a'))
    state = Solver(mechanism).state(CRANKS, 2.0, 1.5)
    parts = Friction(0.04, 0.05, name='worn'), Friction(0.06, 0.05, 0.2, name='dry')
    solver = Solver(with_loads(mechanism, *parts))
    found = solver.state(CRANKS, 2.0, 1.5)
    assert np.allclose(found.torque, state.torque, rtol=1e-12)
    wrenches = solver.wrenches(found)
    assert [*wrenches] == ['dry', 'worn']
    crank = [sum(x.effort for x in wrenches[name] if x.body == 0) for name in wrenches]
    assert np.allclose(crank[1] * 0.06, crank[0] * 0.04, rtol=1e-12)


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
    middle = mechanism.swing_middle('', 0.0)
    assert abs(middle) <= math.pi
    low, high = swung.min(), swung.max()
    if solver.reach.turns_fully:
        assert math.remainder(0.5 * (low + high) - middle, TURN) == pytest.approx(0, abs=1e-6)
    turns = TURN * round((0.5 * (low + high) - middle) / TURN)
    assert middle - math.pi < low - turns < high - turns < middle + math.pi


CLOSE = 1e-11
# Rockers that swing across the jump of angles at pi, and through the line of the frame.
ROCKERS = {
    'across_the_seam': four_bar(FULL['crank_rocker'], 1.3),
    'through_the_line': four_bar(CHANGE_POINTS['p0'], 0.2, 'crossed'),
}
SLIDERS = {
    'offset_left': slider_crank(FULL['offset_left'], -1.1),
    'offset_right': slider_crank(FULL['offset_right'], 5.5, 'crossed'),
}
MECHANISMS = {**ROCKERS, **SLIDERS, 'pump': PUMPS['pump'], 'pump_open': PUMPS['pump_open']}
RUBBING = {'rocker': Friction(0.2, 0.08), 'slider': Friction(0.1, 0.05, 0.2)}


def loads_of(link, middle):
    """Returns loads of every kind, with corners in the swing around a middle angle."""
    places = tuple(middle + x for x in (-0.4, 0.05, 0.3))
    return {
        'force': LinkLoad(link, 3.0),
        'damping': LinkLoad(link, damping=0.7),
        'spring': LinkLoad(link, stiffness=11.0, rest=middle + 0.4),
        'over_position': LoadCurve(link, 'position', places, (5.0, -7.0, 30.0), (0.0, 2.0, -4.0)),
        'over_crank_angle': LoadCurve(link, at=(0.5, 2.0, 6.0), value=(4.0, -3.0, 8.0)),
        'brake': LinkLoad('crank', -2.0, 0.3),
        'on_the_crank': LoadCurve('crank', at=(-7.0, -5.0), value=(2.0, 9.0)),
        'friction': RUBBING[link],
    }


def loaded(name, *kinds):
    """Returns a mechanism with loads of these kinds."""
    mechanism = MECHANISMS[name]
    if isinstance(mechanism, FourBar):
        spring = with_loads(mechanism, LinkLoad('rocker', stiffness=1.0))
        found = loads_of('rocker', float(oracle_of(spring).middle))
    else:
        found = loads_of('slider', 1.6)
    return with_loads(mechanism, *(found[kind] for kind in kinds))


def error(mechanism, cranks, speed=2.0, acceleration=1.5, meant=None):
    """Computes the largest error of any quantity; the reference solves the mechanism `meant`."""
    solver = Solver(mechanism)
    solver.mechanism = meant or mechanism
    motion = cranks, speed, acceleration
    states = worst_errors(solver, *motion, period=0, floor=1e-2)
    return max(*states, *force_errors(solver, *motion))


KINDS = tuple(loads_of('rocker', 0.0))


@pytest.mark.parametrize('kind', KINDS)
@pytest.mark.parametrize('name', ['across_the_seam', 'offset_right'])
def test_each_load_gives_the_torque_and_forces_of_newton_and_euler(name, kind):
    assert error(loaded(name, kind), [0.8, -3.0]) < CLOSE


@pytest.mark.parametrize(
    ('name', 'speed', 'acceleration'),
    [
        *((name, -2.0, 1.5) for name in MECHANISMS),
        *((name, 150.0, 1e3) for name in ('across_the_seam', 'offset_right')),
        *((name, 0.0, -1.5) for name in ('across_the_seam', 'offset_right', 'pump')),
    ],
)
def test_all_loads_at_once_in_either_direction_and_at_rest(name, speed, acceleration):
    kinds = KINDS[:-1] if name.startswith('pump') else KINDS
    kinds = [kind for kind in kinds if kind not in ('force', 'damping', 'spring')]
    mechanism = loaded(name, *kinds)
    link = 'rocker' if isinstance(mechanism, FourBar) else 'slider'
    mechanism = replace(mechanism, loads=(*mechanism.loads, LinkLoad(link, 3.0, 0.7, 11.0, 0.4)))
    assert error(mechanism, [-4.1, 1.3], speed, acceleration) < CLOSE


# Critical positions.


def curve(points, value, over='crank_angle', **more):
    bare = slider_crank(FULL['offset_right'], 0.3, point=(0.1, 0.2))
    return with_loads(bare, LoadCurve('slider', over, points, value, **more))


@pytest.mark.parametrize(
    ('points', 'cranks'),
    [
        ((0.5, 2.0, 6.0), [0.5, 2.0, 6.0, 2.0 - TURN, math.nextafter(2.0, 0)]),
        ((0.5, 2.0, 6.0), [0.5 + 1000 * TURN, 2.0 - 1000 * TURN, 6.0 + 1000 * TURN]),
        ((1.0, 2.0, 1.0 + TURN), [1.0, 1.0 + TURN, 1.0 - 1e-12, 1.0 - 1000 * TURN]),
        ((-9.0, -7.0, -4.0), [-8.0, -5.0, 0.3, 901.5]),
        ((901.0, 902.0, 905.0), [1.5, 902.0, 902.0 - 286 * math.pi]),
        ((1.0, 1.001, 4.0), [1.0005, 1.0005 + 1000 * TURN, 1.0005 - 1000 * TURN]),
        ((0.5, 3.0, 6.75), [0.5 + 1000 * TURN, 0.4999, 0.48 - TURN]),
    ],
)
def test_curves_over_the_crank_angle_at_and_between_their_points(points, cranks):
    value = (8.0, -3.0, 8.0) if points[2] - points[0] == TURN else (-40.0, 900.0, 8.0)
    assert error(curve(points, value), cranks, -2.0) < 2e-13


def test_curves_over_a_position_at_their_points():
    cranks = [0.4, 1.9, 4.0]
    bare = Solver(curve((0.0,), (0.0,)))
    places = sorted(bare.state(crank).position[2] for crank in cranks)
    steep = (places[0], places[1], places[1] + 1e-4)
    for speed in (2.0, -2.0):
        for points in (places, steep):
            loads = curve(points, (5.0, -7.0, 30.0), 'position', return_value=(0.0, 2.0, -4.0))
            assert error(loads, cranks, speed) < 1e-11


@pytest.mark.parametrize('name', MECHANISMS)
@pytest.mark.parametrize('loads', [('spring',), ('force',), ('curve',), ('spring', 'curve')])
def test_energy_of_loads_with_a_potential_closes_the_power_balance(name, loads):
    """The curve has its corners in the motion, which also leaves its ends."""
    mechanism = MECHANISMS[name]
    link = 'rocker' if isinstance(mechanism, FourBar) else 'slider'
    middle = mechanism.swing_middle('', 0.0) or 1.6
    places = tuple(middle + x for x in (-0.4, 0.05, 0.3))
    kinds = {
        'spring': LinkLoad(link, stiffness=11.0, rest=middle + 0.4),
        'force': LinkLoad(link, 3.0),
        'curve': LoadCurve(link, 'position', places, (5.0, -7.0, 30.0)),
    }
    mechanism = with_loads(mechanism, *(kinds[kind] for kind in loads))
    solver = Solver(mechanism)
    for crank in np.linspace(-6.0, 6.5, 25).tolist():
        q, u, _ = motion(mechanism, crank)
        torque, step = 4.0, 1e-5
        a = solver.accelerations(q, u, torque)

        def energy(time, q=q, u=u, a=a):
            moved = [x + time * (y + 0.5 * time * z) for x, y, z in zip(q, u, a, strict=True)]
            rates = [y + time * z for y, z in zip(u, a, strict=True)]
            return sum(solver.energy(solver.state(tuple(moved), tuple(rates))))

        power = (energy(step) - energy(-step)) / (2 * step)
        size = abs(torque * u[0]) + abs(energy(0.0))
        assert power == pytest.approx(torque * u[0], abs=1e-6 * size)


@pytest.mark.parametrize('clearance', [1e-7, 1e-3, 10.0])
@pytest.mark.parametrize(
    'exponent', [1.0, *(1.0 + sign * 10.0**-k for k in range(1, 17) for sign in (-1, 1))]
)
def test_energy_of_a_closed_gas_has_all_digits_near_an_isothermal_one(exponent, clearance):
    """At 1 + 1e-16, the exponent is 1."""
    area, inlet, largest = 0.03, 1e5, clearance + 0.2
    gas = GasForce(0, area, 1.0, 0.0, clearance, largest, inlet, None, exponent, 0.0)
    for share in (0.0, 1e-6, 0.3, 0.9):
        place = -share * 0.2
        (found, *_) = gas.potential([LinkPose(np.array([place]), None, None, None)])
        assert gas.potential([LinkPose(place, None, None, None)]) == pytest.approx(
            found, rel=2e-15
        )
        with mp.workdps(50):
            volumes = [mp.mpf(area) * mp.mpf(x) for x in (largest, clearance - place)]
            ratio, extra = volumes[0] / volumes[1], mp.mpf(exponent) - 1
            work = (ratio**extra - 1) / extra if extra else mp.log(ratio)
            assert abs(found / (inlet * volumes[0] * work) - 1) < 2e-15


def test_torque_on_a_rocker_that_turns_fully_has_no_potential():
    bare = four_bar(FULL['double_crank'])
    loads = with_loads(bare), with_loads(bare, LinkLoad('rocker', 7.0))
    energies = [x.energy(x.state(CRANKS, 2.0)) for x in map(Solver, loads)]
    assert np.array_equal(*energies)


@pytest.mark.parametrize('angle', [0.3, 3.0])
def test_spring_and_curve_of_a_double_rocker_are_reduced_to_the_swing_of_each_circuit(angle):
    """Each arc of the crank is a circuit: the rocker stays on one side of the frame's line."""
    bare = with_loads(four_bar(LIMITED['double_rocker_two_arcs'], angle))
    arcs = Solver(bare).reach.arcs
    assert len(arcs) == 2
    for low, high in arcs:
        cranks = np.linspace(low, high, 402)[1:-1]
        both = [
            Solver(replace(bare, assembly=assembly)).state(cranks).position[2]
            for assembly in ('open', 'crossed')
        ]
        swung = np.unwrap(np.concatenate([both[0], both[1][::-1]]))
        middle = 0.5 * (swung.min() + swung.max())
        for rest in np.linspace(-9.0, 9.0, 61).tolist():
            near = middle + math.remainder(rest - middle, TURN)
            spring = Solver(with_loads(bare, LinkLoad('rocker', stiffness=2.0, rest=rest)))
            state = spring.state(cranks)
            pull = spring.load_forces(state)['rocker']
            assert pull == pytest.approx(-2.0 * (swung[:400] - near), abs=1e-9)
            points, value = (rest - 0.5, rest + 0.5), (3.0, 8.0)
            curve = Solver(with_loads(bare, LoadCurve('rocker', 'position', points, value)))
            push = curve.load_forces(curve.state(cranks))['rocker']
            expected = np.interp(swung[:400], (near - 0.5, near + 0.5), value)
            assert push == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize('turns', [-3, 0, 1])
def test_positions_of_a_rocker_ignore_whole_turns(turns):
    mechanism = loaded('across_the_seam', 'over_position')
    (curve,) = mechanism.loads
    moved = replace(curve, at=tuple(x + turns * TURN for x in curve.at))
    rest = float(Oracle(mechanism).middle) + 0.4 + turns * TURN
    mechanism = replace(mechanism, loads=(moved, LinkLoad('rocker', stiffness=9.0, rest=rest)))
    assert error(mechanism, [0.4, 3.9]) < 1e-13


@pytest.mark.parametrize(
    ('friction', 'crank', 'locks'),
    [
        (Friction(guide=1.0), 1.0, 0.8484727408779),
        (Friction(guide=1.0), 4.2, 8.287186818148),
        (Friction(1.0, 1.0, 0.2), 1.0, 0.5333537900804),
        (Friction(1.0, 0.25, 1.0), 0.3, 0.9645420075187),
        (Friction(1.0, 0.25, 1.0), 2.2, 1.372153762702),
    ],
)
def test_friction_is_solved_until_it_locks(friction, crank, locks):
    """Forces reach 1e3 times those without friction; beyond, the reference has no solution."""
    name = 'guide' if friction.guide == 1.0 else 'pin_radius'

    def rubs(share):
        rubbing = replace(friction, **{name: share * locks})
        return with_loads(SLIDERS['offset_right'], rubbing)

    for share in (0.8, 0.99, 0.999):
        assert error(rubs(share), [crank]) < CLOSE
    Solver(rubs(1 - 1e-9)).state(crank, 2.0, 1.5)
    with pytest.raises(UnreachableError, match='friction locks the mechanism: no joint forces'):
        Solver(rubs(1 + 1e-9)).state(crank, 2.0, 1.5)
    with pytest.raises(ArithmeticError, match='no friction'):
        Oracle(rubs(1 + 1e-6)).state(crank, 2.0, 1.5)


def test_strong_friction_that_does_not_lock_is_solved_in_many_small_steps():
    """It takes more than 1000 rounds; a lock was reported there, where the forces are small."""
    bare = slider_crank(FULL['short_coupler'], -0.0144)
    for friction in (Friction(23.15, 0.05, 23.15), Friction(30.0, 0.05, 30.0)):
        assert error(with_loads(bare, friction), [1.613]) < CLOSE
