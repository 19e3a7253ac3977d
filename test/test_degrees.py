# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Angles in degrees and whole numbers in parameters: in files, on the real node, in studies."""

import math

import mpmath
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from mechanisms import examples
from ros_harness import (
    assert_refused,
    dump,
    node_arguments,
    set_parameter,
    stop,
    verified,
    watched,
)

from linkage_lab.sweep.study import read_study
from linkage_ros import ConfigurationError, load
from linkage_ros.errors import ParameterWarning
from linkage_ros.node import linkage_node
from linkage_ros.programs import record
from linkage_ros.quantities import Quantity
from linkage_ros.settings.configuration import configure
from linkage_ros.settings.yaml_file import read_parameter_file

ANGLE = Quantity('number', 'an angle', 'rad', -1e9, 1e9)
SLIDER = {
    'mechanism': 'slider_crank', 'rpm': 60, 'crank.length': 0.06, 'coupler.length': 0.18,
    'coupler.mass': 0.6, 'coupler.center': [0.06, 0.0], 'coupler.inertia': 0.002,
    'slider.mass': 0.4,
}  # fmt: skip
CURVE = {'loads.x.kind': 'curve', 'loads.x.link': 'slider', 'loads.x.value': [1, 2, 1]}
SPRING = {'loads.x.kind': 'link', 'loads.x.stiffness': 1}


@pytest.mark.parametrize(
    ('text', 'value'),
    [('180deg', math.pi), ('90deg', math.pi / 2), ('-360deg', -math.tau), ('0deg', 0.0)],
)
def test_quarter_turns_are_those_of_the_math_module(text, value):
    assert ANGLE.clean('x', text) == value
    assert math.copysign(1, ANGLE.clean('x', '-0deg')) == 1


@examples(200)
@given(st.decimals(-1e6, 1e6, allow_nan=False, allow_infinity=False))
def test_decimal_is_rounded_once(degrees):
    with mpmath.workdps(80):
        exact = mpmath.mpf(str(degrees)) * mpmath.pi / 180
        assert ANGLE.clean('x', f'{degrees}deg') == float(exact)


@pytest.mark.parametrize(
    ('unit', 'kind', 'value', 'hint'),
    [
        ('rad', 'number', '85 deg', 'write 85deg'),
        ('rad', 'number', '-12.5°', 'write -12.5deg'),
        ('rad', 'number', '85 Degrees', 'write 85deg'),
        ('rad', 'number', '85', 'write 85deg'),
        ('rad', 'number', '1e9deg', '1e9deg is 1.74533e[+]07 rad'),
        ('rad', 'list', ['1deg', '2 deg'], 'write 2deg'),
        ('rad/s', 'number', '85deg', 'only angles in rad'),
        ('m', 'pair', ['1deg', '2deg'], 'only angles in rad'),
        ('', 'whole', '85deg', 'only angles in rad'),
        ('m/s^2', 'pair', '[0, -9.81]', 'do not mix whole numbers'),
    ],
)
def test_other_texts_and_quantities_are_refused_with_a_hint(unit, kind, value, hint):
    with pytest.raises(ConfigurationError, match=f'x = .*{hint}'):
        Quantity(kind, 'a quantity', unit, -1e6, 1e6).clean('x', value)


def law(**values):
    rest = {name: value for name, value in SLIDER.items() if name != 'rpm'}
    return {**rest, 'drive': 'motion', **{f'motion.{name}': x for name, x in values.items()}}


@pytest.mark.parametrize(
    ('degrees', 'radians'),
    [
        ({**SLIDER, 'crank_angle': '85deg'}, {**SLIDER, 'crank_angle': 85 * math.pi / 180}),
        (
            {**SLIDER, 'joints.coupler.zero': '90deg', 'frame.angle': '-90deg'},
            {**SLIDER, 'joints.coupler.zero': math.pi / 2, 'frame.angle': -math.pi / 2},
        ),
        (
            {**SLIDER, **CURVE, 'loads.x.at': ['0deg', '180deg', '360deg']},
            {**SLIDER, **CURVE, 'loads.x.at': [0.0, math.pi, math.tau]},
        ),
        (
            law(times=[0, 1], angles=['0deg', '90deg']),
            law(times=[0.0, 1.0], angles=[0.0, math.pi / 2]),
        ),
        (
            law(center='180deg', amplitude='45deg', frequency=1, phase='90deg'),
            law(center=math.pi, amplitude=math.pi / 4, frequency=1.0, phase=math.pi / 2),
        ),
    ],
)
def test_configuration_in_degrees_is_that_in_radians(degrees, radians):
    assert configure(degrees).parameters() == configure(radians).parameters()


@pytest.mark.parametrize(
    ('values', 'name'),
    [
        ({**SLIDER, 'joints.slider.zero': '90deg'}, 'joints.slider.zero = 90deg'),
        ({**SLIDER, **SPRING, 'loads.x.link': 'slider', 'loads.x.rest': '5deg'},
         'loads.x.rest = 5deg'),
        ({**SLIDER, **CURVE, 'loads.x.over': 'position', 'loads.x.at': ['1deg', '2deg', '3deg']},
         'loads.x.at = 1deg'),
        ({**law(amplitude='1deg', frequency=1), 'input': 'slider'}, 'motion.amplitude = 1deg'),
        ({**SLIDER, 'crank.length': '85deg'}, 'crank.length = .* only angles'),
    ],
)  # fmt: skip
def test_positions_in_degrees_are_refused(values, name):
    with pytest.raises(ConfigurationError, match=name):
        configure(values)


HIDDEN = [
    ('crank_angle: 1.5', 'crank_angle:=85deg', 'crank_angle = 1.5 .* hides -p crank_angle:=85deg'),
    ('rpm: 60', 'rpm:=90.5', 'rpm = 60 .* hides -p rpm:=90.5'),
    ('gravity: [0, -10]', 'gravity:=[0.0, -9.81]', r'gravity = \[0, -10\] .* hides'),
]


@pytest.mark.parametrize(('line', 'rule', 'words'), HIDDEN)
def test_value_that_rcl_ignores_is_refused(called, tmp_path, line, rule, words):
    path = tmp_path / 'own.yaml'
    path.write_text(f'/**:\n  ros__parameters:\n    {line}\n')
    outcome = called(linkage_node, '--ros-args', '--params-file', path, '-p', rule)
    assert_refused(*outcome, words)


STUDY = 'base: {}\nmeasures: [peak_torque]\n'


def test_study_takes_degrees_for_angles_alone(tmp_path):
    def columns(text):
        path = tmp_path / 'study.yaml'
        path.write_text(STUDY.format('quadrilateral') + text)
        return [leaf.quantity for leaf in read_study(str(path)).columns]

    (frame,) = columns('ranges: {frame.angle: [0deg, 90deg]}\nrpm: 60')
    assert (frame.low, frame.high) == (0.0, math.pi / 2)
    (frame,) = columns('tolerances: {frame.angle: 1deg}\nrpm: 60')
    assert frame.high - frame.low == pytest.approx(math.pi / 90, rel=1e-12)
    with pytest.raises(ConfigurationError, match=r'tolerances\.crank\.length = .* only angles'):
        columns('tolerances: {crank.length: 1deg}\nrpm: 60')


@pytest.mark.parametrize(
    'line', ['swing: [1deg, 2deg]', 'ranges: {loads.cylinder.rest: [1deg, 2deg]}',
             'tolerances: {loads.cylinder.rest: 1deg}'],
)  # fmt: skip
def test_study_of_a_cylinder_takes_no_degrees_for_its_positions(tmp_path, line):
    path = tmp_path / 'study.yaml'
    ranges = '' if 'rest' in line else 'ranges: {crank.mass: [1, 1.5]}\n'
    path.write_text(f'{STUDY.format("excavator")}{ranges}speed: 0.1\n{line}\n')
    with pytest.raises(
        ConfigurationError, match=r'deg: must be in m, because the (rod|cylinder) slides'
    ):
        read_study(str(path))


FILE = """/**:
  ros__parameters:
    mechanism: slider_crank
    crank: {length: 0.06}
    coupler: {length: 0.18, mass: 0.6, center: [0.06, 0.0], inertia: 0.002}
    slider: {mass: 0.4}
    gravity: [0, -10]
    joints: {coupler: {zero: 90deg}}
    loads: {x: {kind: curve, link: slider, at: [0deg, "180deg", 360deg], value: [1, 2, 1]}}
    rpm: 60
"""


def test_node_converts_degrees_and_whole_numbers(tmp_path):
    """In files, on the command line, and in what `ros2 param` sets."""
    path, log = tmp_path / 'own.yaml', tmp_path / 'run.mcap'
    path.write_text(FILE)
    arguments = node_arguments(log=log, crank_angle='-90deg')
    with watched(['/joint_states'], *arguments, '--params-file', path) as (listener, process):
        listener.await_more(10)
        declared = dump(listener)
        assert declared['crank_angle'].double_value == -math.pi / 2
        assert declared['joints.coupler.zero'].double_value == math.pi / 2
        assert list(declared['loads.x.at'].double_array_value) == [0.0, math.pi, math.tau]
        assert list(declared['gravity'].double_array_value) == [0.0, -10.0]
        # The values of the file are those that the node has.
        same = {
            'crank_angle': {'type': 4, 'string_value': '-90deg'},
            'loads.x.at': {'type': 9, 'string_array_value': ['0deg', '180deg', '360deg']},
            'loads.x.value': {'type': 7, 'integer_array_value': [1, 2, 1]},
        }
        for name, value in same.items():
            assert set_parameter(listener, name, **value).successful, name
        other = {'type': 4, 'string_value': '85deg'}
        assert not set_parameter(listener, 'crank_angle', **other).successful
        refused = set_parameter(listener, 'rpm', **other)
        assert 'only angles' in refused.reason
        assert set_parameter(listener, 'gravity', type=7, integer_array_value=[0, -5]).successful
        stop(process)
    verified(log)


def written(tmp_path, lines):
    path = tmp_path / 'own.yaml'
    path.write_text('/**:\n  ros__parameters:\n' + ''.join(f'    {line}\n' for line in lines))
    return path


MIXED = ['a: [0, -9.81]', 'b: {c: [1.5, 2, 3e0]}', 'd: [1, 2]', 'e: [1.0, 2.0]']


def test_list_with_whole_numbers_is_read_as_floats_and_noted_with_the_line_to_write(tmp_path):
    path = written(tmp_path, MIXED)
    with pytest.warns(ParameterWarning) as found:
        values = read_parameter_file(path)
    assert values == {'a': [0.0, -9.81], 'b.c': [1.5, 2.0, 3.0], 'd': [1, 2], 'e': [1.0, 2.0]}
    assert {type(x) for x in values['b.c']} == {float}
    assert {type(x) for x in values['d']} == {int}
    (words,) = [str(warning.message) for warning in found]
    assert words.endswith('line 3: a: [0.0, -9.81]; line 4: b.c: [1.5, 2.0, 3.0]')
    with pytest.raises(ConfigurationError, match=r'ROS refuses .* a: \[0\.0, -9\.81\]'):
        read_parameter_file(path, for_ros=True)


def test_lines_to_write_are_read_without_a_note(tmp_path):
    path = written(tmp_path, MIXED)
    with pytest.warns(ParameterWarning) as found:
        values = read_parameter_file(path)
    lines = str(found[0].message).partition('write ')[2].split('; ')
    lines = [line.partition(': ')[2] for line in lines]
    assert read_parameter_file(written(tmp_path, [*lines, *MIXED[2:]]), for_ros=True) == values


@pytest.mark.parametrize(
    'line', ['a: [0, true]', 'a: [0.5, 1, x]', 'a: [85deg, 3]', 'a: [0.0, -9,81]', 'a: [0, 010]']
)
def test_other_mixed_lists_are_refused(tmp_path, line):
    with pytest.raises(ConfigurationError, match='line 3'):
        read_parameter_file(written(tmp_path, [line]))


def test_list_without_spaces_has_no_decimal_comma(tmp_path):
    with pytest.warns(ParameterWarning):
        values = read_parameter_file(written(tmp_path, ['a: [0,90,180.5]']))
    assert values == {'a': [0.0, 90.0, 180.5]}


DRAWING = """
mechanism: drawing
gravity: [0, -9.81]
rpm: 60
drawing: {units: mm, input: crank, frame: [A0, B0], pins: {A0: [0, 0], A: [30, 40],
  B: [150.5, 120], B0: [160, 0]}, links: {crank: {pins: [A0, A]}, coupler: {pins: [A, B]},
  rocker: {pins: [B, B0], mass: 1, center: [155, 60]}}}
""".strip().split('\n')


def test_every_program_but_the_node_reads_mixed_lists(called, tmp_path):
    path, log = written(tmp_path, DRAWING), tmp_path / 'run.mcap'
    code, _, error = called(record, path, log, '--duration', '0.1')
    assert code == 0, error
    assert error.count('note: ') == error.count('ROS refuses lists') == 1
    with pytest.warns(ParameterWarning):
        assert load(str(path)).mechanism == configure_lines(DRAWING).mechanism
    outcome = called(linkage_node, '--ros-args', '--params-file', path)
    assert_refused(*outcome, r'ROS refuses .*line 4: gravity: \[0\.0, -9\.81\]')


def configure_lines(lines):
    """Returns the configuration of lines of YAML, read by PyYAML."""
    flat = {}

    def add(name, value):
        if isinstance(value, dict):
            for key, inner in value.items():
                add(f'{name}.{key}'.lstrip('.'), inner)
        else:
            flat[name] = value

    add('', yaml.safe_load('\n'.join(lines)))
    return configure(flat)


def test_node_reads_pins_as_whole_numbers(tmp_path):
    text = [line.replace('150.5', '150').replace('9.81', '10') for line in DRAWING]
    path, log = written(tmp_path, text), tmp_path / 'run.mcap'
    arguments = [*node_arguments(log=log), '--params-file', path]
    with watched(['/joint_states'], *arguments) as (listener, process):
        listener.await_more(10)
        assert list(dump(listener)['drawing.pins.A'].double_array_value) == [30.0, 40.0]
        stop(process)
    verified(log)
