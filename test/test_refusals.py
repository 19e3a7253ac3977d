# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Invalid input is refused with one line that names the value and valid input.

In the expected lines, an ellipsis stands for any text.
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
    UnreachableError,
    WindPump,
    assemblies,
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
        'rpm': 150.0,
    },
}
LEFT_OUT = object()
NAN, INF = math.nan, math.inf

A_LENGTH = 'must be a number from 1e-09 to 1e+09 m'
AN_OFFSET = 'must be a number from -1e+09 to 1e+09 m'
A_PAIR = 'must be two numbers … each from -1e+09 to 1e+09 m'
AN_RPM = 'must be a number from -1e+06 to 1e+06 rpm'
A_MASS = 'must be a number from 0 to 1e+12 kg'
AN_INERTIA = 'must be a number from 0 to 1e+12 kg m^2'
AN_ANGLE = 'must be a number from -1000 to 1000 rad'
A_TEXT = 'must be text of the form [A-Za-z0-9_]*'
A_RATE = 'must be a number from 0.01 to 100000 Hz'
NO_LOOP = 'm: the loop cannot close; shorten it or lengthen the others'
NO_REACH = 'm: the loop cannot close; bring the offset nearer to 0, or lengthen crank or coupler'


LISTED = 'linkage_record --help lists all'
CRANK_HAS = 'crank has length, mass, inertia, center'


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
# One parameter of a valid configuration is changed, added or omitted.
BAD_VALUES = [
    *((FOUR, 'rpm', value, f'rpm = …: {AN_RPM}') for value in NO_NUMBERS),
    *((FOUR, 'gravity', value, 'gravity = …: must be two numbers, …') for value in NO_PAIRS),
    # Lengths.
    (FOUR, 'crank.length', 0, f'crank.length = 0: {A_LENGTH}'),
    (FOUR, 'rocker.length', NAN, f'rocker.length = nan: {A_LENGTH}'),
    (FOUR, 'crank.length', 1e-10, f'crank.length = 1e-10: {A_LENGTH}'),
    (FOUR, 'rocker.length', [0.5], f'rocker.length = [0.5]: {A_LENGTH}'),
    (FOUR, 'coupler.length', True, f'coupler.length = True: {A_LENGTH}'),
    (SLIDER, 'crank.length', 10**400, f'crank.length = 10000000…: {A_LENGTH}'),
    (SLIDER, 'crank.length', 'a\nb', rf"crank.length = 'a\nb': {A_LENGTH}"),
    (SLIDER, 'slider.offset', NAN, f'slider.offset = nan: {AN_OFFSET}'),
    # Masses, forces, centres, coupler point, gravity.
    (FOUR, 'crank.mass', -1, f'crank.mass = -1: {A_MASS}'),
    (FOUR, 'rocker.inertia', -1e-9, f'rocker.inertia = -1e-09: {AN_INERTIA}'),
    (SLIDER, 'slider.damping', -0.1, 'slider.damping = -0.1: must be a number from 0 … N s/m'),
    (SLIDER, 'slider.force', INF, 'slider.force = inf: must be a number from -1e+12 to 1e+12 N'),
    (FOUR, 'coupler.center', [0.1], f'coupler.center = [0.1]: {A_PAIR}'),
    (FOUR, 'rocker.center', [1, 2, 3], f'rocker.center = [1, 2, 3]: {A_PAIR}'),
    (SLIDER, 'crank.center', [NAN, 0], f'crank.center = [nan, 0]: {A_PAIR}'),
    (SLIDER, 'coupler.point', [0, 1e10], f'coupler.point = [0, 10000000000.0]: {A_PAIR}'),
    (FOUR, 'gravity', 9.81, 'gravity = 9.81: must be two numbers, each from …'),
    (FOUR, 'gravity', [0, -1e7], 'gravity = [0, -10000000.0]: … from -1e+06 to 1e+06 m/s^2'),
    # Angles and motion.
    (FOUR, 'frame.angle', '30 deg', f"frame.angle = '30 deg': {AN_ANGLE}"),
    (FOUR, 'crank_angle', INF, 'crank_angle = inf: must be a number from -1e+06 to 1e+06 rad'),
    (FOUR, 'rpm', 1e7, f'rpm = 10000000.0: {AN_RPM}'),
    (FOUR, 'start_rpm', -1e7, f'start_rpm = -10000000.0: {AN_RPM}'),
    (SLIDER, 'crank_acceleration', -1, 'crank_acceleration = -1: must be a number from 0 …'),
    (FOUR, 'rate_hz', 0, f'rate_hz = 0: {A_RATE}'),
    (FOUR, 'trajectory_horizon', 1e-3, '… must be a number from 0.01 to 10 s'),
    (FOUR, 'trajectory_command_topic', 'a b', '… must be text of the form …'),
    # Strings and switches.
    (FOUR, 'mechanism', 'five_bar', "mechanism = 'five_bar': must be one of four_bar, slider_…"),
    (FOUR, 'drive', 'hand', "drive = 'hand': must be one of speed…"),
    (FOUR, 'assembly', 'Open', "assembly = 'Open': must be one of open, crossed"),
    (SLIDER, 'assembly', -1, 'assembly = -1: must be one of open, crossed'),
    (FOUR, 'log', 5, 'log = 5: must be text'),
    (FOUR, 'log', None, 'log = None: must be text'),
    (FOUR, 'log', ['x' * 1000], "log = ['xxx…xxx']: must be text"),
    (SLIDER, 'log_overwrite', 'yes', "log_overwrite = 'yes': must be true or false"),
    (SLIDER, 'log_overwrite', 1, 'log_overwrite = 1: must be true or false'),
    (FOUR, 'joint_prefix', 'a-', f"joint_prefix = 'a-': {A_TEXT}"),
    *((FOUR, 'joint_prefix', x, f'joint_prefix = …: {A_TEXT}') for x in ('a\n', 'é', 'a/', 7)),
    *((FOUR, 'frame_id', x, 'frame_id = …: must be text of …') for x in ('', '/map', 'tool 0')),
    # Names: misspelt, of another mechanism, of no mechanism.
    (FOUR, 'crank.lenght', 1, f"'crank.lenght' is … of a four_bar; {CRANK_HAS}; {LISTED}"),
    (
        FOUR,
        'coupler.point.x',
        1,
        f"'coupler.point.x' is not … of a four_bar; coupler has … point; {LISTED}",
    ),
    (SLIDER, 'rmp', 1, f"'rmp' is not a parameter of a slider_crank; {LISTED}"),
    (SLIDER, 'rocker.length', 1, '… of a slider_crank: only a four_bar has rocker; leave it out'),
    (FOUR, 'slider.offset', 0, '… of a four_bar: only a slider_crank or a wind_pump has slider…'),
    (FOUR, 'frame.mass', 1, f"'frame.mass' is … frame has length, angle; {LISTED}"),
    (SLIDER, 'wheel.radius', 1, f"'wheel.radius' is … of a slider_crank; {LISTED}"),
    (SLIDER, 'a\nb', 1, rf"'a\nb' is not a parameter of a slider_crank; {LISTED}"),
    (FOUR, 'crank', 0.1, f"'crank' is … {CRANK_HAS}; write crank: {{length: ...}}; {LISTED}"),
    (SLIDER, 'frame.length', 1, '… only a four_bar or … has frame.length; leave it out'),
    *((FOUR, x, 1, f'… of a four_bar; {LISTED}') for x in ('zz', '', 'ß', 'length.x' * 3)),
    (FOUR, 'motor.torque', 1.0, '… only a crank with drive: torque has …; leave it out'),
    (FOUR, 'drive', 'torque', "'rpm' … a torque-driven four_bar: only … drive: speed has rpm; …"),
    (FOUR, 'drive', 'follow', "'rpm' … a measured four_bar: only … drive: speed has rpm; …"),
    # Parameters of every node, and similar names; rclpy ignores undeclared ones.
    *((FOUR, x, True, f'{x!r} is … of a four_bar…') for x in ('use_sim_times', 'x.use_sim_time')),
    *((FOUR, x, 1, '… of a four_bar…') for x in ('use_sim_time.x', 'qos_overrides./a.depth')),
    # Required parameters.
    *(
        (FOUR, f'{link}.length', LEFT_OUT, f'{link}.length is missing: {A_LENGTH}')
        for link in ('crank', 'coupler', 'rocker')
    ),
    (FOUR, 'frame.length', LEFT_OUT, f'frame.length is missing: {A_LENGTH}'),
    (FOUR, 'rpm', LEFT_OUT, f'rpm is missing: {AN_RPM}'),
]

# Crank, coupler, rocker and frame, or crank, coupler and offset: the loop closes nowhere.
NO_ASSEMBLY = [
    (FOUR, (9, 1, 1, 1), f'the longest link, 9 m, … by 6 {NO_LOOP}'),
    (FOUR, (1, 9, 1, 1), f'the longest link, 9 m, … by 6 {NO_LOOP}'),
    (FOUR, (1, 1, 9, 1), f'the longest link, 9 m, … by 6 {NO_LOOP}'),
    (FOUR, (1, 2, 3, 6.0000001), f'the longest link, 6 m, … by 1e-07 {NO_LOOP}'),
    (FOUR, (1, 1, 1, 3.01), f'the longest link, 3.01 m, … by 0.01 {NO_LOOP}'),
    (SLIDER, (1, 2, 3.5), f'the offset of the slider, 3.5 m, … by 0.5 {NO_REACH}'),
    (SLIDER, (0.2, 2.8, 3.01), f'the offset of the slider, 3.01 m, … by 0.01 {NO_REACH}'),
]


# ---------------------------------------------------------------- cranks that cannot turn

LEFT, RIGHT = 'coupler + offset - crank', 'coupler - offset - crank'
FAR = 'coupler + rocker - frame - crank'
NEAR, OTHER = 'frame + rocker - crank - coupler', 'frame + coupler - crank - rocker'
TRIPLE, CHANGE, NEITHER = 'triple-rocker', 'change-point', 'non-Grashof'
COUPLER = 'rotating-coupler'
# Crank, coupler, rocker and frame, or crank, coupler and offset; the links that stop the crank,
# and by how much; the suggested cures (test_mobility.py applies them).
LIMITED = [
    (FOUR, TRIPLE, (4, 2.1, 2.2, 2), {FAR: 1.7}, 'shorten the crank to at most 1.9 m or …'),
    (FOUR, TRIPLE, (2, 2.1, 2.2, 4), {FAR: 1.7}, 'shorten the crank to at most 0.3 m or …'),
    (FOUR, TRIPLE, (2, 1.9, 2, 2.5), {FAR: 0.6}, 'shorten the crank to at most 1.4 m or …'),
    (FOUR, TRIPLE, (2, 4, 2.1, 2.2), {NEAR: 1.7}, '… 0.3 m or make … 2.1 m each'),
    (FOUR, TRIPLE, (2.2, 2.1, 4, 2), {OTHER: 2.1}, 'shorten the crank to at most 0.1 m or …'),
    (
        FOUR,
        TRIPLE,
        (5, 1, 1.2, 4),
        {FAR: 6.8},
        'make coupler and rocker equal, at least 4.5 m each',
    ),
    (FOUR, CHANGE, (3, 1, 2, 2), {FAR: 2}, 'shorten the crank to at most 1 m or …'),
    (
        FOUR,
        'double-rocker',
        (2.5, 1, 2.2, 2),
        {FAR: 1.3, OTHER: 1.7},
        'shorten … 0.8 m or … 2.25 m each',
    ),
    (FOUR, 'rocker-crank', (2.5, 2.2, 1, 2), {FAR: 1.3, NEAR: 1.7}, '… 0.8 m or … 2.25 m each'),
    (SLIDER, NEITHER, (2, 2.5, 1), {RIGHT: 0.5}, 'lengthen the coupler to at least 3 m or …'),
    (SLIDER, NEITHER, (2, 2.5, -1), {LEFT: 0.5}, '… shorten the crank to at most 1.5 m'),
    (SLIDER, NEITHER, (1, 1.5, 0.6), {RIGHT: 0.1}, 'lengthen … 1.6 m or … at most 0.9 m'),
    (SLIDER, NEITHER, (1, 1.5, -0.6), {LEFT: 0.1}, 'lengthen … 1.6 m or … at most 0.9 m'),
    (SLIDER, NEITHER, (1, 2, 2.5), {RIGHT: 1.5}, 'lengthen the coupler to at least 3.5 m'),
    (SLIDER, CHANGE, (3, 2, 1), {RIGHT: 2}, '… shorten the crank to at most 1 m'),
    (SLIDER, CHANGE, (3, 2, -1), {LEFT: 2}, '… shorten the crank to at most 1 m'),
    (SLIDER, CHANGE, (2, 1, 1), {RIGHT: 2}, 'lengthen the coupler to at least 3 m'),
    (SLIDER, COUPLER, (2, 1, 0), {LEFT: 1, RIGHT: 1}, 'lengthen … 2 m or … at most 1 m'),
    (SLIDER, COUPLER, (3, 1, 0.5), {LEFT: 1.5, RIGHT: 2.5}, '… 3.5 m or … at most 0.5 m'),
]
DIRECTION = 0.3  # of frame or guide, rad


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


# ---------------------------------------------------------------- calls in Python

CRANK_ROCKER = FourBar(Frame(2.0), Body(1.0), Coupler(3.0), Body(2.5))
TRACED = replace(CRANK_ROCKER, coupler=Coupler(3.0, mass=1.0, point=(1.5, 0.2)))
PARALLELOGRAM = FourBar(Frame(2.0, 0.25), Body(1.0), Coupler(2.0, 1.0), Body(1.0))
STRETCHED = FourBar(Frame(2.0), Body(4.0, 1.0, 0.1), Coupler(2.1), Body(2.2))
CENTRIC = SliderCrank(Body(1.0), Coupler(2.5), Slider(mass=1.0))
PUMP = ALL['document_3']
FOUR_BAR, SLIDER_CRANK = ALL['crank_rocker'], ALL['offset_right']
TWO, THREE = np.array([0.1, 0.2]), np.array([1.5, 1.6, 1.7])
EQUAL_ROD = SliderCrank(Body(1.0), Coupler(1.0), Slider(mass=1.0))

CANNOT_MOVE = 'the crank of this triple-rocker linkage cannot move at'
OVERFLOW = 'the torque or an acceleration overflows at … crank speed = 1e+200…: lower them'
BAD_CALLS = [
    # Parts and mechanisms.
    (lambda: Body(-1.0), f'length = -1.0: {A_LENGTH}'),
    (lambda: Body(1.0, inertia=NAN), f'inertia = nan: {AN_INERTIA}'),
    (lambda: Body(1.0, center=(1.0,)), f'center = (1.0,): {A_PAIR}'),
    (lambda: Frame(1.0, angle=2e3), f'angle = 2000.0: {AN_ANGLE}'),
    (lambda: replace(CRANK_ROCKER, assembly='up'), "assembly = 'up': … one of open, crossed"),
    (lambda: replace(CENTRIC, gravity=-9.81), 'gravity = -9.81: must be two numbers, …'),
    (
        lambda: replace(CRANK_ROCKER, rocker=Body(7.0)),
        'the longest link, 7 m, is longer … by 1 m: …',
    ),
    (lambda: replace(CENTRIC, slider=Slider(4.0)), 'the offset of the slider, 4 m, … by 0.5 m: …'),
    (lambda: SpeedDrive(2e6), f'rpm = 2000000.0: {AN_RPM}'),
    (lambda: SpeedDrive(60.0, crank_acceleration=-1.0), 'crank_acceleration = -1.0: must be …'),
    (
        lambda: configure({'mechanism': 'wind_pump', 'rpm': 60.0}),
        "5 mistakes: (1) 'rpm' … a torque-driven wind_pump: only a crank with drive: speed …",
    ),
    # States.
    (lambda: state(STRETCHED, math.pi), f'{CANNOT_MOVE} … = 180 deg: … it reaches … deg'),
    (
        lambda: state(STRETCHED, np.reshape([0.1] * 3 + [3.0, 3.1, 3.2], (2, 3))),
        f'{CANNOT_MOVE} 3 rad = 171.887339 deg: … reaches …',
    ),
    (
        lambda: Solver(STRETCHED).reach.require_full_turn(),
        '… cannot turn fully: … it reaches … deg',
    ),
    (lambda: state(CRANK_ROCKER, NAN), 'crank angle = nan: must be a finite number'),
    (lambda: state(CENTRIC, [0.0, 1.0], [1.0, NAN]), 'crank speed = nan: must be a finite number'),
    (
        lambda: state(CRANK_ROCKER, 0.0, 1.0, NAN),
        'crank acceleration = nan: must be a finite number',
    ),
    (lambda: state(TRACED, 1.0, 1e200), OVERFLOW),
    (lambda: state(CENTRIC, [1.0, 2.0], 1e200), OVERFLOW),
    (
        lambda: FourBar(Frame(2.0), Body(1.0), Body(3.0), Body(2.5)),
        'coupler = Body(…: must be of type Coupler',
    ),
    (
        lambda: FourBar(2.0, Body(1.0), Coupler(3.0), Body(2.5)),
        'frame = 2.0: must be of type Frame',
    ),
    (lambda: replace(CENTRIC, frame=Frame(1.0)), 'frame = Frame(…: must be of type Guide'),
    (lambda: Coupler(1.0, point={1.0, 2.0}), f'point = {{1.0, 2.0}}: {A_PAIR}'),
    (lambda: Body(1.0, center={1: 2, 3: 4}), f'center = {{1: 2, 3: 4}}: {A_PAIR}'),
    (lambda: Coupler(1.0, point=iter([1, 2])), f'point = <… object at …>: {A_PAIR}'),
    (lambda: Coupler(1.0, point=np.eye(2)), f'point = array([[1., 0.], [0., 1.]]): {A_PAIR}'),
    # Points and reactions.
    (lambda: point(CRANK_ROCKER, 'C'), "point 'C': must be one of A0, A, B, B0"),
    (lambda: point(CENTRIC, 'a0'), "point 'a0': must be one of A0, A, B"),
    # Wind pump, and mechanisms without masses.
    (
        lambda: Solver(PUMP).accelerations((0.0, 1.5), (1e200, 0.0), 1.0),
        '… overflows at …, crank speed = 1e+200, slider speed = 0, torque = 1: lower them…',
    ),
    (
        lambda: Solver(CRANK_ROCKER).accelerations(0.0, 1.0, 1.0),
        'links without mass have no finite acceleration…',
    ),
    (lambda: Solver(PUMP).reach, 'a WindPump has 2 degrees of freedom: its crank …'),
    (lambda: assemblies(PUMP, 0.0), '… 2 degrees of freedom…'),
    *(
        (partial(assemblies, CENTRIC, x), f'crank angle = …{words}…')
        for x, words in ((NAN, 'nan'), ('a', "'a'"), (None, 'None'), ([1.0, 2.0], ''))
    ),
    *(
        (partial(Solver, x), '… must be a mechanism, such as a FourBar…')
        for x in (3, None, WindPump, Body(1.0))
    ),
    (lambda: travel(Solver(STRETCHED)), '… cannot turn fully…'),
    # Loads.
    *(
        (
            partial(replace, CRANK_ROCKER, loads=(x,)),
            'loads = …: must be of type AppliedLoad',
        )
        for x in (Rocker(1.0), 5.0, LoadCurve, None)
    ),
    (
        lambda: Solver(replace(TRACED, loads=(Friction(0.1, 0.1),))).accelerations(0.3, 1.0, 2.0),
        '… leave friction out…',
    ),
    (
        lambda: configure({'drive': 'follow', 'rate_hz': 3.0}),
        "'rate_hz' is not … four_bar: measurements set the rate; leave it…",
    ),
    (
        lambda: forces(PARALLELOGRAM, 0.25),
        'at 0.25 rad = 14.3239449 deg … change point; choose another angle',
    ),
    (
        lambda: forces(EQUAL_ROD, math.pi / 2),
        'at 1.57079633 rad = 90 deg … change point; choose another angle',
    ),
    # The state of a linkage whose crank turns fully, given to one whose crank does not.
    *(
        (
            lambda cranks=cranks: Solver(STRETCHED).reactions(state(FOUR_BAR, cranks, 1.0)),
            f'{CANNOT_MOVE} 3 rad = 171.8…',
        )
        for cranks in (3.0, np.array([0.1, 3.0]))
    ),
]
TOO_MUCH = '…overflows at crank angle = 0.3…crank speed = 1e+160…'
BAD_ARGUMENTS = [
    # Shapes.
    *(
        (call, f'the shapes of crank angle (2,), …{words} do not broadcast: give one shape…')
        for words, call in (
            ('speed (3,)', lambda: state(FOUR_BAR, TWO, [1.0, 2.0, 3.0])),
            ('slider position (3,)', lambda: Solver(PUMP).matrix((TWO, THREE))),
            ('torque (3,)', lambda: Solver(PUMP).accelerations((TWO, 1.5), (1.0, 0.0), THREE)),
        )
    ),
    (lambda: travel(FOUR_BAR), '…: must be a Solver, as in Solver(mechanism)'),
    (lambda: Solver(FOUR_BAR).energy(0.3, 1e160), TOO_MUCH),
    (lambda: Solver(SLIDER_CRANK).energy(0.3, 1e160), TOO_MUCH),
    (lambda: Solver(PUMP).energy((0.3, 1.5), (1e160, 0.0)), TOO_MUCH),
]


def state(mechanism, *motion):
    return Solver(mechanism).state(*motion)


def point(mechanism, name):
    return Solver(mechanism).point(state(mechanism, 1.0), name)


def forces(mechanism, crank):
    return Solver(mechanism).reactions(state(mechanism, crank, 2.0))


# ---------------------------------------------------------------- the tests


def refused(call, expected, error=LinkageError):
    """Checks that a call is refused with the expected line, and returns the error."""
    with pytest.raises(error) as caught:
        call()
    words = str(caught.value)
    parts = map(re.escape, re.split(' ?… ?', expected))
    assert re.fullmatch('.*'.join(parts), words), words  # a dot does not match a line break
    assert words.splitlines() == [words]
    assert words.isprintable()
    assert len(words) < 600
    return words


def test_unmodified_table_values_are_accepted():
    for kind, values in GOOD.items():
        assert configure(values).kind.mechanism == kind
    for mechanism in (CRANK_ROCKER, TRACED, PARALLELOGRAM, CENTRIC):
        assert np.isfinite(state(mechanism, [0.1, 2.0], 3.0, -4.0).torque).all()
        assert all(map(math.isfinite, forces(mechanism, 0.2).shaking_force))


@pytest.mark.parametrize(('kind', 'name', 'value', 'expected'), BAD_VALUES)
def test_bad_value_is_refused(kind, name, value, expected):
    values = {**GOOD[kind], name: value}
    if value is LEFT_OUT:
        del values[name]
    words = refused(lambda: configure(values), expected, ConfigurationError)
    assert words.startswith((name, repr(name), repr('rpm')))


@pytest.mark.parametrize(('kind', 'lengths', 'expected'), NO_ASSEMBLY)
def test_loop_that_cannot_close_is_refused(kind, lengths, expected):
    refused(lambda: configure(parameters(kind, lengths)), expected, MechanismError)
    refused(lambda: described(kind, lengths), expected, MechanismError)


def limits(words):
    """Parses a message: the links that stop the crank, by how much, m, and the cures."""
    *clauses, cures = words.partition(': ')[2].rpartition('; it reaches ')[0].split('; ')
    pairs = (re.fullmatch(r'(.*) = -(\S+) m is negative', clause).groups() for clause in clauses)
    found = {words: float(lack) for words, lack in pairs}
    return found, cures


@pytest.mark.parametrize(('kind', 'grashof', 'lengths', 'stops', 'cure'), LIMITED)
def test_crank_that_cannot_turn_is_refused_with_class_limits_and_cure(
    kind, grashof, lengths, stops, cure
):
    """A state out of reach has the same message without cures, which test_mobility.py tests."""
    words = refused(
        lambda: configure(parameters(kind, lengths)),
        f'the crank of this {grashof} linkage cannot turn fully: … it reaches … deg…',
        MechanismError,
    )
    found, cures = limits(words)
    assert found == stops
    assert re.fullmatch('.*'.join(map(re.escape, re.split(' ?… ?', cure))), cures), cures
    solver = Solver(described(kind, lengths))
    crank = solver.reach.arcs[0][1] + 0.02
    moved = refused(lambda: solver.state(crank, 1.0), '…', UnreachableError)
    turn = f'move at {crank:.9g} rad = {math.degrees(crank):.9g} deg'
    lengths_alone, _, drives = words.partition('; drive: ')
    assert 'torque' in drives
    assert moved == lengths_alone.replace(f'; {cures}', '').replace('turn fully', turn)
    assert np.isfinite(solver.state(crank - 0.04, 1.0).torque)


@pytest.mark.parametrize(
    ('call', 'expected', 'error'),
    [
        *((*row, LinkageError) for row in BAD_CALLS),
        *((*row, ConfigurationError) for row in BAD_ARGUMENTS),
    ],
)
def test_bad_call_is_refused(call, expected, error):
    refused(call, expected, error)


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
FINITE = '{} = …: must be a finite number…'


@pytest.mark.parametrize('bad', NO_REAL + NOT_FINITE, ids=range(len(NO_REAL + NOT_FINITE)))
def test_non_real_arguments_are_refused(bad):
    pump, q, u = Solver(PUMP), (0.3, 1.5), (2.0, 0.1)
    calls = [
        ('crank angle', lambda: pump.matrix((bad, 1.5))),
        ('slider position', lambda: pump.accelerations((0.3, bad), u, 6.0)),
        ('slider speed', lambda: pump.energy(q, (2.0, bad))),
        ('slider acceleration', lambda: pump.state(q, u, (0.0, bad))),
        ('torque', lambda: pump.accelerations(q, u, bad)),
    ]
    for solver in map(Solver, (FOUR_BAR, STRETCHED)):
        calls += [
            ('crank angle', lambda solver=solver: solver.state(bad)),
            ('crank speed', lambda solver=solver: solver.state(0.1, bad)),
            ('crank acceleration', lambda solver=solver: solver.state(0.1, 1, bad)),
            ('crank angle', lambda solver=solver: solver.matrix(bad)),
            ('crank speed', lambda solver=solver: solver.energy((0.1,), (bad,))),
            ('torque', lambda solver=solver: solver.accelerations((0.1,), (1.0,), bad)),
        ]
    for name, call in calls:
        refused(call, FINITE.format(name), ConfigurationError)


@pytest.mark.parametrize('mechanism', [FOUR_BAR, SLIDER_CRANK])
def test_solver_refuses_what_is_no_state_of_its_mechanism(mechanism):
    solver = Solver(mechanism)
    good = solver.state(0.7, 2.0, 1.5)
    pump = Solver(PUMP).state((0.3, 1.5), (2.0, 0.1), (0.0, 0.0))
    for bad in (None, 0.7, tuple(good), good._replace(position=(1.0, 2.0)), pump):
        for call in (solver.reactions, lambda state: solver.point(state, 'A')):
            refused(lambda call=call, bad=bad: call(bad), '…state = … must be a State of this…')
    refused(lambda: solver.point(good, 'a'), "point 'a': must be one of A0, A, B…")
    bad = good._replace(velocity=(2.0, np.array([1.0, INF]), good.velocity[2]))
    refused(lambda: solver.point(bad, 'B'), FINITE.format('coupler velocity'))
    uneven = good._replace(position=(np.zeros(2), *good.position[1:]), velocity=(np.zeros(3),) * 3)
    refused(lambda: solver.reactions(uneven), '…crank angle (2,), crank speed (3,)…')


@pytest.mark.parametrize('bad', WRONG_ROWS, ids=range(len(WRONG_ROWS)))
def test_wrong_numbers_of_coordinates_are_refused(bad):
    solver, q = Solver(PUMP), (0.3, 1.5)
    for name, expected, call in (
        ('q', 'crank angle, slider position', lambda: solver.matrix(bad)),
        ('q', 'crank angle, slider position', lambda: solver.accelerations(bad, q, 1.0)),
        ('u', 'crank speed, slider speed', lambda: solver.energy(q, bad)),
        ('u', 'crank speed, slider speed', lambda: solver.accelerations(q, bad, 1.0)),
        ('a', 'crank acceleration, slider acceleration', lambda: solver.state(q, q, bad)),
    ):
        refused(call, f'{name} = …must be a tuple ({expected})…', ConfigurationError)
    # Two values in total, as required, but not one coordinate and one speed.
    for wrong, rates in (((0.3, 1.5), (2.0,)), ((), (2.0, 1.0))):
        call = partial(Solver(FOUR_BAR).accelerations, wrong, rates, 1.0)
        refused(call, f'q = {wrong}: must be a tuple (crank angle,)…', ConfigurationError)


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
            pump.energy((angles, 1.5), ((2, 3), 0)),
            pump.energy((np.array(angles), 1.5), (np.array([2.0, 3.0]), 0.0)),
        ),
        (
            pump.accelerations(rows, (2.0, 0.1), 6.0),
            pump.accelerations(tuple(rows), (2.0, 0.1), 6.0),
        ),
    ):
        assert np.array_equal(nested, arrays)
