# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Invalid input is refused with one line that names the wrong value.

`LINES` has examples of whole lines; the other tests do not depend on the wording.
"""

import math
import re
from dataclasses import replace
from decimal import Decimal
from fractions import Fraction
from functools import partial

import numpy as np
import pytest
from mechanisms import ALL

from linkage_ros import (
    Body,
    ConfigurationError,
    Coupler,
    FourBar,
    Frame,
    Friction,
    Guide,
    LinkageError,
    LoadCurve,
    MechanismError,
    Rocker,
    Slider,
    SliderCrank,
    Solver,
    TracedPoint,
    UnreachableError,
    WindPump,
    travel,
)
from linkage_ros.motion.drives.speed import SpeedDrive
from linkage_ros.settings.configuration import configure

FOUR, SLIDER = 'four_bar', 'slider_crank'
GOOD = {
    FOUR: {
        'mechanism': FOUR,
        'frame.length': 0.425,
        'crank.length': 0.1,
        'coupler.length': 0.315,
        'rocker.length': 0.5,
        'rpm': 150.0,
    },
    SLIDER: {
        'mechanism': SLIDER,
        'crank.length': 0.1,
        'coupler.length': 0.3,
        'slider.offset': 0.05,
        'points.x.link': 'coupler',
        'rpm': 150.0,
    },
}
LEFT_OUT = object()
NAN, INF = math.nan, math.inf
DIRECTION = 0.3  # of frame or guide, rad


def configured(kind, name, value):
    """Configures a valid mechanism of which one parameter is changed, added or left out."""
    values = {**GOOD[kind], name: value}
    return configure({name: one for name, one in values.items() if one is not LEFT_OUT})


def parameters(kind, lengths):
    """Returns parameters that are valid, except perhaps the lengths."""
    named = ['crank.length', 'coupler.length']
    named += ['rocker.length', 'frame.length'] if kind == FOUR else ['slider.offset']
    return {**GOOD[kind], 'frame.angle': DIRECTION, **dict(zip(named, lengths, strict=True))}


def described(kind, lengths):
    """Makes the same mechanism from dataclasses, which do not require a full turn."""
    if kind == FOUR:
        r, b, c, d = lengths
        return FourBar(Frame(d, DIRECTION), Body(r), Coupler(b), Body(c))
    r, b, e = lengths
    return SliderCrank(Body(r), Coupler(b), Slider(e), Guide(DIRECTION))


def state(mechanism, *motion):
    return Solver(mechanism).state(*motion)


def point(mechanism, name):
    return Solver(mechanism).point(state(mechanism, 1.0), name)


def forces(mechanism, crank):
    return Solver(mechanism).reactions(state(mechanism, crank, 2.0))


def refused(call, named='', error=LinkageError):
    """Checks that a call is refused with one line for each mistake, and returns the message."""
    with pytest.raises(error) as caught:
        call()
    words = str(caught.value)
    assert named in words
    several = len(getattr(caught.value, 'mistakes', ()))
    assert len(words.splitlines()) == 1 + several
    for line in words.splitlines():
        assert line.isprintable()
        assert len(line) < 600
    return words


CRANK_ROCKER = FourBar(Frame(2.0), Body(1.0), Coupler(3.0), Body(2.5))
HEAVY = replace(CRANK_ROCKER, coupler=Coupler(3.0, mass=1.0))
PARALLELOGRAM = FourBar(Frame(2.0, 0.25), Body(1.0), Coupler(2.0, 1.0), Body(1.0))
STRETCHED = FourBar(Frame(2.0), Body(4.0, 1.0, 0.1), Coupler(2.1), Body(2.2))
CENTRIC = SliderCrank(Body(1.0), Coupler(2.5), Slider(mass=1.0))
PUMP = ALL['document_3']
FOUR_BAR, SLIDER_CRANK = ALL['crank_rocker'], ALL['offset_right']
TWO, THREE = np.array([0.1, 0.2]), np.array([1.5, 1.6, 1.7])
EQUAL_ROD = SliderCrank(Body(1.0), Coupler(1.0), Slider(mass=1.0))


def test_unmodified_values_are_accepted():
    for kind, values in GOOD.items():
        assert configure(values).only.kind.mechanism == kind
    for mechanism in (CRANK_ROCKER, HEAVY, PARALLELOGRAM, CENTRIC):
        assert np.isfinite(state(mechanism, [0.1, 2.0], 3.0, -4.0).torque).all()
        assert all(map(math.isfinite, forces(mechanism, 0.2).shaking_force))


# ---------------------------------------------------------------- examples of whole lines

LINES = [
    (partial(configured, FOUR, 'crank.length', 0),
     'crank.length = 0: must be a number from 1e-09 to 1e+09 m'),
    (partial(configured, FOUR, 'rpm', LEFT_OUT),
     ('rpm is missing: must be a number from -1e+06 to 1e+06 rpm, the crank speed, '
      'counter-clockwise positive; 1 rad/s is 9.5493 rpm')),
    (partial(configured, FOUR, 'gravity', 9.81),
     'gravity = 9.81: must be two numbers, the acceleration of gravity [x, y], m/s^2'),
    (partial(configured, SLIDER, 'log_overwrite', 'yes'),
     "log_overwrite = 'yes': must be true or false"),
    (partial(configured, FOUR, 'joint_prefix', 'a-'),
     "joint_prefix = 'a-': must be text of the form [A-Za-z0-9_]*"),
    (partial(configured, FOUR, 'assembly', 'Open'),
     "assembly = 'Open': must be one of open, crossed; did you mean open?"),
    (partial(configured, FOUR, 'crank', 0.1),
     ("'crank' is not a parameter of a four_bar; write crank: {length: ...}; linkage_record "
     '--help-parameters lists all')),
    (partial(configured, FOUR, 'motor.torque', 1.0),
     ("'motor.torque' is not a parameter of a four_bar: only a crank with drive: torque has "
      'motor; write drive: torque, or leave it out')),
    (partial(configured, SLIDER, 'rocker.length', 1),
     ("'rocker.length' is not a parameter of a slider_crank: only a four_bar has rocker; leave it "
     'out')),
    (lambda: configure(parameters(FOUR, (9, 1, 1, 1))),
     ('the longest link, the crank, 9 m, is longer than the other three together by 6 m: the loop '
     'cannot close; shorten it or lengthen the others')),
    (lambda: configure(parameters(SLIDER, (1, 2, 3.5))),
     ('the offset of the slider, 3.5 m, is farther from 0 than crank + coupler, by 0.5 m: the '
      'loop cannot close; bring the offset nearer to 0, or lengthen crank or coupler')),
    (lambda: configure(parameters(FOUR, (4, 2.1, 2.2, 2))),
     ('the crank of this triple-rocker linkage cannot turn fully: coupler + rocker - frame - '
      'crank = -1.7 m is negative; shorten the crank to at most 1.9 m or make coupler and '
      'rocker equal, at least 3 m each; it reaches 5.1069 to 8.05947 rad = 292.604 to 461.773 '
      'deg; drive: motion, torque or follow moves it within these angles')),
    (lambda: configure(parameters(SLIDER, (2, 2.5, 1))),
     ('the crank of this non-Grashof linkage cannot turn fully: coupler - offset - crank = -0.5 m '
     'is negative; lengthen the coupler to at least 3 m or shorten the crank to at most 1.5 m; it '
     'reaches 5.73512 to 10.5728 rad = 328.598 to 605.779 deg; drive: motion, torque or follow '
     'moves it within these angles')),
    (lambda: state(CENTRIC, [0.0, 1.0], [1.0, NAN]), 'crank speed = nan: must be a finite number'),
    (lambda: state(HEAVY, 1.0, 1e200),
     ('the torque or an acceleration overflows at crank angle = 1, crank speed = 1e+200: lower '
     'them')),
    (lambda: replace(CENTRIC, frame=Frame(1.0)),
     'frame = Frame(length=1.0, angle=0.0): must be of type Guide'),
    (lambda: point(CENTRIC, 'a0'), "point 'a0': must be one of A0, A, B"),
    (lambda: Solver(CRANK_ROCKER).accelerations(0.0, 1.0, 1.0),
     ('links without mass have no finite acceleration under a torque: give them a mass or an '
     'inertia')),
    (lambda: forces(PARALLELOGRAM, 0.25),
     ('at 0.25 rad = 14.3239449 deg all links are in line: the joint forces are infinite at a '
     'change point; choose another angle')),
    (lambda: Solver(PUMP).matrix((0.3,)),
     'q = (0.3,): must be a tuple (crank angle, slider position)'),
]  # fmt: skip


@pytest.mark.parametrize(('call', 'line'), LINES, ids=range(len(LINES)))
def test_whole_line(call, line):
    assert refused(call) == line


# ---------------------------------------------------------------- parameters

NO_NUMBERS = [
    *(NAN, INF, -INF, None, True, False, '1.0', b'1', [], [1.0], {}, 1j, 10**400),
    *(float, Decimal('1.5'), object()),
    *(np.complex128(1 + 2j), np.complex64(1), np.array(1 + 2j)),
]
NO_PAIRS = [
    *([], [1.0], [1.0, 2.0, 3.0], 0.0, 'xy', b'xy', None, [1.0, NAN], [INF, 0.0]),
    *([True, False], ['0', '0'], [[0.0, 1.0], [0.0, 1.0]], [None, None], [10**400, 0]),
    *(np.array(1.0), np.array([0.1 + 1j, 0.2]), [np.complex128(0.1 + 1j), 0.2]),
]
BAD_VALUES = {
    FOUR: {
        'rpm': [*NO_NUMBERS, 1e7, LEFT_OUT],
        'gravity': [*NO_PAIRS, [0, -1e7]],
        'crank.length': [1e-10, LEFT_OUT],
        'coupler.length': [True, LEFT_OUT],
        'rocker.length': [NAN, [0.5], LEFT_OUT],
        'frame.length': [LEFT_OUT],
        'crank.mass': [-1],
        'rocker.inertia': [-1e-9],
        'coupler.center': [[0.1]],
        'rocker.center': [[1, 2, 3]],
        'frame.angle': ['30 deg'],
        'crank_angle': [INF],
        'start_rpm': [-1e7],
        'rate_hz': [0],
        'trajectory_horizon': [1e-3],
        'trajectory_command_topic': ['a b'],
        'mechanism': ['five_bar'],
        'drive': ['hand'],
        'log': [5, None, ['x' * 1000]],
        'joint_prefix': ['a\n', 'é', 'a/', 7],
        'frame_id': ['', '/map', 'tool 0'],
    },
    SLIDER: {
        'crank.length': [10**400, 'a\nb'],
        'slider.offset': [NAN],
        'crank.center': [[NAN, 0]],
        'points.x.at': [[0, 1e10], [NAN, 0.0], [0.1]],
        'points.x.link': ['rocker', 5, 'frame'],
        'crank_acceleration': [-1],
        'assembly': [-1],
        'log_overwrite': [1],
    },
}
# Names: misspelt, of another mechanism or drive, of no mechanism; and names similar to those of
# parameters of every node, since rclpy ignores undeclared ones.
BAD_NAMES = {
    FOUR: [
        'crank.lenght', 'coupler.point.x', 'slider.offset', 'frame.mass', 'zz', '', 'ß',
        'length.x' * 3, 'use_sim_times', 'x.use_sim_time', 'use_sim_time.x',
        'qos_overrides./a.depth',
    ],
    SLIDER: ['rmp', 'wheel.radius', 'a\nb', 'frame.length', 'points.x.from'],
}  # fmt: skip


@pytest.mark.parametrize(
    ('kind', 'name', 'value'),
    [(kind, name, x) for kind in GOOD for name, row in BAD_VALUES[kind].items() for x in row],
)
def test_bad_value_is_refused(kind, name, value):
    words = refused(partial(configured, kind, name, value), name, ConfigurationError)
    assert re.match(f'{re.escape(name)} (= |is missing)', words)


@pytest.mark.parametrize(('kind', 'name'), [(kind, x) for kind in GOOD for x in BAD_NAMES[kind]])
def test_bad_name_is_refused(kind, name):
    words = refused(partial(configured, kind, name, 1), kind, ConfigurationError)
    assert words.startswith(repr(name))


@pytest.mark.parametrize('drive', ['torque', 'follow', 'motion'])
def test_parameter_of_another_drive_is_refused_with_that_drive(drive):
    words = refused(partial(configured, FOUR, 'drive', drive), 'drive: speed', ConfigurationError)
    assert "'rpm'" in words


# ---------------------------------------------------------------- loops and cranks

# Crank, coupler, rocker and frame, or crank, coupler and offset; by how much the loop stays open.
NO_ASSEMBLY = [
    (FOUR, (1, 9, 1, 1), '6 m'),
    (FOUR, (1, 1, 9, 1), '6 m'),
    (FOUR, (1, 2, 3, 6.0000001), '1e-07 m'),
    (FOUR, (1, 1, 1, 3.01), '0.01 m'),
    (SLIDER, (0.2, 2.8, 3.01), '0.01 m'),
]


@pytest.mark.parametrize(('kind', 'lengths', 'gap'), NO_ASSEMBLY)
def test_loop_that_cannot_close_is_refused(kind, lengths, gap):
    for call in (lambda: configure(parameters(kind, lengths)), lambda: described(kind, lengths)):
        refused(call, f' {gap}: ', MechanismError)


TRIPLE, CHANGE, NEITHER = 'triple-rocker', 'change-point', 'non-Grashof'
COUPLER = 'rotating-coupler'
# Crank, coupler, rocker and frame, or crank, coupler and offset; the sums that stop the crank, m.
# test_mobility.py applies the cures.
LIMITED = [
    (FOUR, TRIPLE, (2, 2.1, 2.2, 4), [-1.7]),
    (FOUR, TRIPLE, (2, 1.9, 2, 2.5), [-0.6]),
    (FOUR, TRIPLE, (2, 4, 2.1, 2.2), [-1.7]),
    (FOUR, TRIPLE, (2.2, 2.1, 4, 2), [-2.1]),
    (FOUR, TRIPLE, (5, 1, 1.2, 4), [-6.8]),
    (FOUR, CHANGE, (3, 1, 2, 2), [-2]),
    (FOUR, 'double-rocker', (2.5, 1, 2.2, 2), [-1.3, -1.7]),
    (FOUR, 'rocker-crank', (2.5, 2.2, 1, 2), [-1.3, -1.7]),
    (SLIDER, NEITHER, (2, 2.5, -1), [-0.5]),
    (SLIDER, NEITHER, (1, 1.5, 0.6), [-0.1]),
    (SLIDER, NEITHER, (1, 1.5, -0.6), [-0.1]),
    (SLIDER, NEITHER, (1, 2, 2.5), [-1.5]),
    (SLIDER, CHANGE, (3, 2, 1), [-2]),
    (SLIDER, CHANGE, (3, 2, -1), [-2]),
    (SLIDER, CHANGE, (2, 1, 1), [-2]),
    (SLIDER, COUPLER, (2, 1, 0), [-1, -1]),
    (SLIDER, COUPLER, (3, 1, 0.5), [-1.5, -2.5]),
]


@pytest.mark.parametrize(('kind', 'grashof', 'lengths', 'lacks'), LIMITED)
def test_crank_that_cannot_turn_is_refused_with_class_and_limits(kind, grashof, lengths, lacks):
    words = refused(lambda: configure(parameters(kind, lengths)), grashof, MechanismError)
    assert [*map(float, re.findall(r' = (-\S+) m ', words))] == lacks
    solver = Solver(described(kind, lengths))
    crank = solver.reach.arcs[0][1] + 0.02
    moved = refused(lambda: solver.state(crank, 1.0), grashof, UnreachableError)
    assert f' {crank:.9g} rad = {math.degrees(crank):.9g} deg' in moved
    assert [*map(float, re.findall(r' = (-\S+) m ', moved))] == lacks
    assert np.isfinite(solver.state(crank - 0.04, 1.0).torque)


# ---------------------------------------------------------------- calls in Python

# Calls, and what their errors name.
BAD_CALLS = [
    # Parts and mechanisms.
    (lambda: Body(-1.0), 'length = -1.0'),
    (lambda: Body(1.0, inertia=NAN), 'inertia = nan'),
    (lambda: Body(1.0, center=(1.0,)), 'center = (1.0,)'),
    (lambda: Body(1.0, center={1: 2, 3: 4}), 'center = '),
    (lambda: Frame(1.0, angle=2e3), 'angle = 2000.0'),
    (lambda: replace(CRANK_ROCKER, assembly='up'), 'assembly = '),
    (lambda: replace(CENTRIC, gravity=-9.81), 'gravity = -9.81'),
    (lambda: replace(CRANK_ROCKER, rocker=Body(7.0)), '7 m'),
    (lambda: replace(CENTRIC, slider=Slider(4.0)), '4 m'),
    (lambda: SpeedDrive(2e6), 'rpm = '),
    (lambda: SpeedDrive(60.0, crank_acceleration=-1.0), 'crank_acceleration = '),
    (lambda: configure({'mechanism': 'wind_pump', 'rpm': 60.0}), "5 mistakes:\n(1) 'rpm'"),
    (lambda: FourBar(Frame(2.0), Body(1.0), Slider(), Body(2.5)), 'coupler = '),
    (lambda: FourBar(2.0, Body(1.0), Coupler(3.0), Body(2.5)), 'frame = '),
    *((partial(TracedPoint, 'x', 'coupler', x), 'at = ')
      for x in ({1.0, 2.0}, iter([1, 2]), np.eye(2))),
    *((partial(replace, CRANK_ROCKER, loads=(x,)), 'loads = ')
      for x in (Rocker(1.0), 5.0, LoadCurve, None)),
    *((partial(Solver, x), 'mechanism') for x in (3, None, WindPump, Body(1.0))),
    # States.
    (lambda: state(STRETCHED, np.reshape([0.1] * 3 + [3.0, 3.1, 3.2], (2, 3))), ' 3 rad = '),
    (lambda: Solver(STRETCHED).reach.require_full_turn(), 'deg'),
    (lambda: travel(Solver(STRETCHED)), 'deg'),
    (lambda: state(CRANK_ROCKER, NAN), 'crank angle = nan'),
    (lambda: state(CRANK_ROCKER, 0.0, 1.0, NAN), 'crank acceleration = nan'),
    (lambda: state(CENTRIC, [1.0, 2.0], 1e200), 'crank speed = 1e+200'),
    # Points and reactions.
    (lambda: point(CRANK_ROCKER, 'C'), "'C'"),
    (lambda: forces(EQUAL_ROD, math.pi / 2), ' 1.57079633 rad = 90 deg'),
    # The state of a linkage whose crank turns fully, given to one whose crank does not.
    *((lambda cranks=cranks: Solver(STRETCHED).reactions(state(FOUR_BAR, cranks, 1.0)), '3 rad')
      for cranks in (3.0, np.array([0.1, 3.0]))),
    # Wind pump, and friction.
    (lambda: Solver(PUMP).accelerations((0.0, 1.5), (1e200, 0.0), 1.0),
     'crank speed = 1e+200, slider speed = 0, torque = 1'),
    (lambda: Solver(PUMP).reach, 'WindPump'),
    (lambda: Solver(replace(HEAVY, loads=(Friction(0.1, 0.1),))).accelerations(0.3, 1.0, 2.0),
     'friction'),
    (lambda: configure({'drive': 'follow', 'rate_hz': 3.0}), 'rate_hz'),
]  # fmt: skip
BAD_ARGUMENTS = [
    (lambda: state(FOUR_BAR, TWO, [1.0, 2.0, 3.0]), 'crank angle (2,), crank speed (3,)'),
    (lambda: Solver(PUMP).matrix((TWO, THREE)), 'crank angle (2,), slider position (3,)'),
    (lambda: Solver(PUMP).accelerations((TWO, 1.5), (1.0, 0.0), THREE), 'torque (3,)'),
    (lambda: travel(FOUR_BAR), 'Solver'),
    *((partial(Solver(x).state, 0.3, 1e160), 'crank speed = 1e+160')
      for x in (FOUR_BAR, SLIDER_CRANK)),
    (lambda: Solver(PUMP).state((0.3, 1.5), (1e160, 0.0)), 'crank speed = 1e+160'),
]  # fmt: skip


@pytest.mark.parametrize(
    ('call', 'named', 'error'),
    [
        *((*row, LinkageError) for row in BAD_CALLS),
        *((*row, ConfigurationError) for row in BAD_ARGUMENTS),
    ],
)
def test_bad_call_is_refused(call, named, error):
    refused(call, named, error)


# ---------------------------------------------------------------- arguments of the solver

NO_REAL = [
    'fast', '1.0', '', b'1', 1j, 1 + 0j, None, True, {}, {1.0}, {0: 1.0}, object(), min, 10**400,
    [None, 1.0], ['a', 1.0], [[1.0], [1.0, 2.0]], [1.0, 2j], np.array([1j, 2.0]),
    np.array(['a', 'b']), np.array([None]), np.array([1j, None]), np.array([True]),
    np.array(['2026-01-01'], 'datetime64[s]'), range, iter([1.0]),
]  # fmt: skip
NOT_FINITE = [NAN, -INF, np.array([1.0, NAN])]
WRONG_ROWS = [0.3, 3, None, 'a', 'ab', b'ab', 1j, (), (0.3,), (1.0,) * 3, [1.0] * 3, np.zeros(3),
              np.array(1.0), {}, {1.0, 2.0}, {'crank': 1.0, 'slider': 2.0}, min]  # fmt: skip


@pytest.mark.parametrize('bad', NO_REAL + NOT_FINITE, ids=range(len(NO_REAL + NOT_FINITE)))
def test_non_real_arguments_are_refused(bad):
    pump, q, u = Solver(PUMP), (0.3, 1.5), (2.0, 0.1)
    calls = [
        ('crank angle', lambda: pump.matrix((bad, 1.5))),
        ('slider position', lambda: pump.accelerations((0.3, bad), u, 6.0)),
        ('slider speed', lambda: pump.state(q, (2.0, bad))),
        ('slider acceleration', lambda: pump.state(q, u, (0.0, bad))),
        ('torque', lambda: pump.accelerations(q, u, bad)),
    ]
    for solver in map(Solver, (FOUR_BAR, STRETCHED)):
        calls += [
            ('crank angle', lambda solver=solver: solver.state(bad)),
            ('crank speed', lambda solver=solver: solver.state(0.1, bad)),
            ('crank acceleration', lambda solver=solver: solver.state(0.1, 1, bad)),
            ('crank angle', lambda solver=solver: solver.matrix(bad)),
            ('crank speed', lambda solver=solver: solver.state((0.1,), (bad,))),
            ('torque', lambda solver=solver: solver.accelerations((0.1,), (1.0,), bad)),
        ]
    for name, call in calls:
        refused(call, f'{name} = ', ConfigurationError)


@pytest.mark.parametrize('mechanism', [FOUR_BAR, SLIDER_CRANK])
def test_solver_refuses_what_is_no_state_of_its_mechanism(mechanism):
    solver = Solver(mechanism)
    good = solver.state(0.7, 2.0, 1.5)
    pump = Solver(PUMP).state((0.3, 1.5), (2.0, 0.1), (0.0, 0.0))
    for bad in (None, 0.7, tuple(good), good._replace(position=(1.0, 2.0)), pump):
        for call in (solver.reactions, lambda state: solver.point(state, 'A')):
            refused(lambda call=call, bad=bad: call(bad), 'state = ')
    refused(lambda: solver.point(good, 'a'), "'a'")
    bad = good._replace(velocity=(2.0, np.array([1.0, INF]), good.velocity[2]))
    refused(lambda: solver.point(bad, 'B'), 'coupler velocity = ')
    uneven = good._replace(position=(np.zeros(2), *good.position[1:]), velocity=(np.zeros(3),) * 3)
    refused(lambda: solver.reactions(uneven), 'crank angle (2,), crank speed (3,)')


@pytest.mark.parametrize('bad', WRONG_ROWS, ids=range(len(WRONG_ROWS)))
def test_wrong_numbers_of_coordinates_are_refused(bad):
    solver, q = Solver(PUMP), (0.3, 1.5)
    for name, expected, call in (
        ('q', 'crank angle, slider position', lambda: solver.matrix(bad)),
        ('q', 'crank angle, slider position', lambda: solver.accelerations(bad, q, 1.0)),
        ('u', 'crank speed, slider speed', lambda: solver.state(q, bad)),
        ('u', 'crank speed, slider speed', lambda: solver.accelerations(q, bad, 1.0)),
        ('a', 'crank acceleration, slider acceleration', lambda: solver.state(q, q, bad)),
    ):
        assert f'({expected})' in refused(call, f'{name} = ', ConfigurationError)
    # Two values in total, as required, but not one coordinate and one speed.
    for wrong, rates in (((0.3, 1.5), (2.0,)), ((), (2.0, 1.0))):
        call = partial(Solver(FOUR_BAR).accelerations, wrong, rates, 1.0)
        refused(call, f'q = {wrong}', ConfigurationError)


@pytest.mark.parametrize(
    'two', [2, np.int64(2), np.float32(2), Fraction(2), Decimal(2), np.array(2), np.float64(2)]
)
def test_all_kinds_of_real_numbers_are_floats(two):
    solver = Solver(FOUR_BAR)
    expected = solver.state(2.0, 2.0, 2.0)
    found = solver.state(two, two, two)
    assert found == expected
    assert {type(x) for x in (*found.velocity, found.torque)} == {float}
    found = solver.accelerations([two], np.array([two], object), two)
    assert found == [solver.accelerations(2.0, 2.0, 2.0)]


def test_nested_sequences_are_arrays():
    solver, pump = Solver(SLIDER_CRANK), Solver(PUMP)
    angles, rows = [[0.1, 0.2], [0.3, 0.4]], np.array([[0.1, 0.2, 0.3], [1.4, 1.5, 1.6]])
    for nested, arrays in (
        (solver.matrix(angles), solver.matrix(np.array(angles))),
        (solver.state(angles).torque, solver.state(np.array(angles)).torque),
        (
            pump.energy(pump.state((angles, 1.5), ((2, 3), 0))),
            pump.energy(pump.state((np.array(angles), 1.5), (np.array([2.0, 3.0]), 0.0))),
        ),
        (
            pump.accelerations(rows, (2.0, 0.1), 6.0),
            pump.accelerations(tuple(rows), (2.0, 0.1), 6.0),
        ),
    ):
        assert np.array_equal(nested, arrays)
