# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Loads of parameter files: mistakes, notes, and cranks that reverse between valves."""

import math
import re
from dataclasses import replace

import pytest
from mechanisms import ALL
from ros_harness import assert_refused

from linkage_lab import command_line
from linkage_ros import (
    ConfigurationError,
    Friction,
    LinkageError,
    LinkLoad,
    LoadCurve,
    Pins,
    Solver,
)
from linkage_ros.programs import record as record_module
from linkage_ros.settings import configuration
from linkage_ros.settings.notes import notes

SLIDER = 'mechanism: slider_crank, rpm: 60.0, crank: {length: 0.1}, coupler: {length: 0.3}'
FOUR = (
    'mechanism: four_bar, rpm: 60.0, crank: {length: 0.1}, coupler: {length: 0.315}, '
    'frame: {length: 0.425}, rocker: {length: 0.5}'
)
MECHANISMS = {
    'SLIDER': SLIDER,
    'FOUR': FOUR,
    'SWINGING': FOUR.replace('rpm: 60.0', 'drive: motion')
    + ', motion: {amplitude: 1.0, frequency: 1.0}',
    'TURNING': (
        'mechanism: four_bar, rpm: 60.0, crank: {length: 0.3}, coupler: {length: 0.25}, '
        'frame: {length: 0.1}, rocker: {length: 0.22}'
    ),
    'LIMITED': SLIDER.replace('0.3}', '0.05}').replace('rpm: 60.0', 'drive: torque'),
    'TORQUE': SLIDER.replace('rpm: 60.0', 'drive: torque') + ', motor: {torque: 1.0}',
    'PUMP': (
        'mechanism: wind_pump, motor: {torque: 8.4}, crank: {length: 0.1, inertia: 1.0}, '
        'coupler: {length: 0.8, inertia: 1.0}, rod: {length: 1.6, inertia: 1.0}, '
        'slider: {mass: 6.0, position: 1.5}'
    ),
}
SHORT = {
    'FORCE': 'kind: force, link: crank, force: [1.0, 0.0]',
    'SPRING': 'kind: spring, link: crank',
    'PINS': 'kind: pins, damping: 1.0',
    'GAS': 'kind: gas, link: slider, bore: 0.1, clearance: 0.01, inlet: 1.0e5',
    'CURVE': 'kind: curve, link: slider',
    'POINTS': 'at: [0.0, 1.0], value: [1.0, 2.0]',
    'PRESSURE': 'at: [0.0, 1.0], pressure: [1.0, 2.0]',
    'TDC': 'over: crank_angle_from_tdc',
}
FILES = {
    'words.csv': 'once upon a time\nthere was\n',
    'binary.csv': bytes(range(256)) * 40,
    'semicolons.csv': 'at;value\n0;1\n1;2\n',
    'infinite.csv': 'at,value\n0,1\n1,inf\n',
    'empty.csv': 'at,value\n',
    'unequal.csv': 'at,value\n0,1,2\n',
    'tdc.csv': 'crank_angle_from_tdc_deg,pressure_bar\n-10,1\n0,30\n',
    'mm.csv': 'position_mm,value\n200,1\n300,2\n',
    'two.csv': 'crank_angle_deg,crank_angle,value\n0,0,1\n',
    'unit.csv': 'crank_angle_deg,pressure_psi\n0,1\n',
    'none.csv': 'crank_angle_deg\n0\n',
    'falling.csv': 'crank_angle_deg,value\n10,1\n0,1\n',
    'degrees.csv': 'crank_angle_deg,value\n0,1\n10,1\n',
    'long.csv': 'crank_angle_deg,value\n0,1\n721,1\n',
    'open.csv': 'crank_angle_deg,value\n0,1\n720,2\n',
    'negative.csv': 'crank_angle_deg,pressure\n0,-1\n',
    'word.csv': 'crank_angle_deg,value\n0,one\n',
}
# Mechanism, load, and the words that its error must have, beside the name of the load.
WRONG = """
FOUR     link: crank                              kind is missing | force, spring, pins, gas
FOUR     kind: weight                             kind = 'weight' | one of force
FOUR     kind: load, pin: 0.1                     kind = 'load' | friction
FOUR     FORCE, size: 3.0                         loads.x.size
FOUR     PINS, link: crank                        loads.x.link
SLIDER   CURVE, values: [1.0]                     loads.x.values | value,

FOUR     kind: force, force: [1.0, 0.0]           link is missing
FOUR     kind: force, link: crank                 force is missing
FOUR     kind: force, link: slider, force: [1.0, 0.0]  link = 'slider' | crank, coupler, rocker
SLIDER   kind: force, link: rocker, force: [1.0, 0.0]  link = 'rocker' | crank, coupler, slider
PUMP     kind: force, link: rocker, force: [1.0, 0.0]  rocker | crank, coupler, rod, slider
FOUR     kind: force, link: frame, force: [1.0, 0.0]   link = 'frame'
FOUR     FORCE, axes: body                        axes = 'body' | world, link

FOUR     kind: link, link: crank, stiffness: 1.0  stiffness = 1 | crank
FOUR     kind: link, link: coupler, force: 1.0    link = 'coupler' | crank or rocker
TURNING  kind: link, link: rocker, stiffness: 1.0  stiffness | double-crank

FOUR     kind: spring                             link is missing
FOUR     SPRING, stiffness: stiff                 stiffness = 'stiff'
FOUR     SPRING, to: crank                        to = 'crank'
FOUR     SPRING, to: slider                       to = 'slider' | crank, coupler, rocker, frame
FOUR     kind: spring, link: base, to: frame      link = 'base'

FOUR     kind: pins                               damping is missing
FOUR     PINS, pin: D                             pin = 'D' | A0, A, B, B0
SLIDER   PINS, pin: B0                            pin = 'B0' | A0, A, B
PUMP     PINS, pin: C                             pin = 'C' | A0, A, B, D

TORQUE   kind: friction, guide: 0.1               friction
PUMP     kind: friction, pin: 0.1, pin_radius: 0.1  friction
FOUR     kind: friction, pin: 0.1                 pin = 0.1 | pin_radius = 0
SLIDER   kind: friction, pin_radius: 0.02, guide: 0.1  pin = 0 | pin_radius = 0.02
FOUR     kind: friction, guide: 0.1               guide = 0.1

FOUR     GAS                                      link = 'slider' | crank, coupler, rocker
SWINGING GAS                                      own.yaml | link = 'slider'
SLIDER   kind: gas, link: crank, bore: 0.1, clearance: 0.01, inlet: 1.0e5  crank has no stroke
PUMP     GAS                                      slider has no stroke
LIMITED  GAS                                      stroke
SLIDER   kind: gas, link: slider, clearance: 0.01, inlet: 1.0e5  bore is missing
SLIDER   GAS, outlet: 0.5e5                       outlet = 50000 | 100000 Pa
SLIDER   GAS, outlet: 1.0e8                       outlet = 1e+08 | 0.2 m
SLIDER   GAS, top: left                           top = 'left' | far, near

SLIDER   kind: curve, at: [0.0, 1.0], value: [1.0, 2.0]  link is missing
SLIDER   CURVE, value: [1.0]                      at and value
SLIDER   CURVE, at: [0.0, 1.0]                    at and value, or at and pressure
SLIDER   CURVE, at: [0.0, 1.0], value: [1.0]      value has 1 | loads.x.at 2
SLIDER   CURVE, POINTS, pressure: [1.0, 2.0]      at and value
SLIDER   CURVE, at: [1.0, 0.5], value: [1.0, 2.0]  at must increase | number 2, 0.5
SLIDER   CURVE, at: [0.0, 13.0], value: [1.0, 1.0]  13 rad = 744.845 deg
SLIDER   CURVE, at: [0.0, 6.283185307179586], value: [1.0, 2.0]  ends with 2 | first, 1
SLIDER   CURVE, at: [0.0, .nan], value: [1.0, 1.0]  at = [0.0, nan] | from -1e+09
SLIDER   CURVE, at: [0, x], value: [1.0, 1.0]     at' mixes types, 0 and 'x'
SLIDER   CURVE, at: [x, N], value: [1.0, 1.0]     at': ROS reads N as a boolean
SLIDER   CURVE, at: [], value: [1.0]              at' is an empty list
SLIDER   CURVE, at: [a, b], value: [1.0, 1.0]     at = ['a', 'b'] | list of numbers
SLIDER   CURVE, at: 1.0, value: [1.0]             at = 1.0 | list of numbers
SLIDER   CURVE, at: [0.0, 1.0], value: [0.0, 1.0e+300]  value = [0.0, 1e+300] | to 1e+12 N or N m
SLIDER   CURVE, POINTS, return_value: [1.0, 2.0]  loads.x.over = 'position'
SLIDER   CURVE, POINTS, bore: 0.1                 bore
SLIDER   CURVE, POINTS, top: near                 top
SLIDER   CURVE, PRESSURE                          pressure | bore
SLIDER   CURVE, TDC, top: near, at: [0.0, 1.0e-17], value: [1.0, 2.0]  at must increase
FOUR     kind: curve, link: rocker, PRESSURE, bore: 0.1  rocker | no stroke
SLIDER   kind: curve, link: crank, over: position, POINTS  must be crank_angle
SLIDER   kind: curve, link: coupler, POINTS       link = 'coupler' | crank or slider
SLIDER   kind: curve, link: rocker, POINTS        link = 'rocker' | crank or slider
PUMP     kind: curve, link: rocker, POINTS        link = 'rocker' | crank or slider
TURNING  kind: curve, link: rocker, over: position, POINTS  over = 'position' | rocker
SLIDER   kind: curve, link: crank, TDC, at: [0.0], value: [1.0]  over: crank has no stroke
FOUR     kind: curve, link: rocker, TDC, at: [0.0], value: [1.0]  over: rocker has no stroke
LIMITED  CURVE, TDC, at: [0.0], value: [1.0]      over: | stroke

SLIDER   CURVE, file: no.csv                      no.csv | No such file
SLIDER   CURVE, file: .                           loads.x.file | directory
SLIDER   CURVE, file: words.csv                   words.csv | 'once
SLIDER   CURVE, file: words.csv, POINTS           at, value
SLIDER   CURVE, file: binary.csv                  binary.csv | utf-8
SLIDER   CURVE, file: semicolons.csv              semicolons.csv | 'at;value'
SLIDER   CURVE, file: infinite.csv                inf | list of numbers
SLIDER   CURVE, file: empty.csv                   empty.csv | at,value must be 2 numbers
SLIDER   CURVE, file: unequal.csv                 unequal.csv | at,value must be 2 numbers
SLIDER   CURVE, file: falling.csv                 at must increase
SLIDER   CURVE, file: long.csv                    12.5838 rad = 721 deg
SLIDER   CURVE, file: open.csv                    first, 1
SLIDER   CURVE, file: tdc.csv                     pressure | give loads.x.bore
SLIDER   CURVE, bore: 0.1, file: two.csv          crank_angle_deg, crank_angle, value
SLIDER   CURVE, bore: 0.1, file: unit.csv         'pressure_psi' | pressure_bar
SLIDER   CURVE, bore: 0.1, file: none.csv         none.csv | values
SLIDER   CURVE, bore: 0.1, file: negative.csv     pressure = [-1.0] | from 0
SLIDER   CURVE, bore: 0.1, file: word.csv         word.csv | one
SLIDER   CURVE, bore: 0.1, file: mm.csv           over = 'crank_angle' | position
SLIDER   CURVE, bore: 0.1, over: position, file: tdc.csv  must be crank_angle_from_tdc
SLIDER   CURVE, bore: 0.1, TDC, file: mm.csv      must be position
SLIDER   CURVE, bore: 0.1, TDC, file: degrees.csv  must be crank_angle,
PUMP     CURVE, bore: 0.1, file: tdc.csv          slider has no stroke
"""
LINES = [line for line in WRONG.splitlines() if line]


def written(folder, mechanism, loads):
    """Writes a parameter file, and the CSV files that it names."""
    for name, content in FILES.items():
        if name in loads:
            content = content if isinstance(content, bytes) else content.encode()
            (folder / name).write_bytes(content)
    path = folder / 'own.yaml'
    path.write_text(f'/**: {{ros__parameters: {{{mechanism}, {loads}}}}}\n')
    return path


def configured(folder, mechanism, loads):
    found = configuration.load(str(written(folder, mechanism, loads)))
    Solver(found.mechanism)
    return found


def parsed(line):
    """Returns the mechanism, the load and the words of a line of the table."""
    name, rest = line.split(maxsplit=1)
    text, words = re.split('  +', rest)
    text = ', '.join(SHORT.get(part, part) for part in text.split(', '))
    return MECHANISMS[name], f'loads: {{x: {{{text}}}}}', words.split(' | ')


@pytest.mark.parametrize('line', LINES, ids=range(len(LINES)))
def test_wrong_load_is_refused_in_a_line_for_each_mistake(tmp_path, line):
    mechanism, loads, words = parsed(line)
    with pytest.raises(LinkageError) as caught:
        configured(tmp_path, mechanism, loads)
    found = str(caught.value)
    assert all(part.isprintable() for part in found.splitlines())
    assert 'loads.x' in found or 'friction' in words
    assert [x for x in words if x not in found] == [], found


def test_friction_that_locks_during_a_record_is_one_line(called, tmp_path):
    back = SLIDER.replace('60.0', '-60.0')  # forwards, the weight relieves the guide
    path = written(
        tmp_path, f'{back}, slider: {{mass: 1.0}}', 'loads: {a: {kind: friction, guide: 50.0}}'
    )
    words = r'at [\d.]+ rad = [\d.]+ deg friction locks the mechanism'
    assert_refused(*called(record_module, path, tmp_path / 'run.mcap', '--duration', 0.1), words)
    assert_refused(*called(command_line, 'motion', path, '--out', tmp_path), words)


def test_names_of_loads_are_words_that_differ():
    for name in ('2', 'a b', 'a.b'):
        with pytest.raises(ConfigurationError, match=name):
            Pins(1.0, name=name)
    for loads in (
        (LinkLoad('crank', 1.0, name='a'), Friction(0.1, 0.05, name='a')),
        2 * (Pins(1.0, name='a'),),
    ):
        with pytest.raises(ConfigurationError, match="'a'"):
            replace(ALL['crank_rocker'], loads=loads)


def test_files_of_curves_are_read_beside_the_parameter_file(tmp_path):
    curve = 'a: {kind: curve, link: slider, over: position, file: mm.csv}'
    text = f'loads: {{b: {{kind: pins, damping: 1.0, pin: A}}, {curve}}}'
    assert configured(tmp_path, SLIDER, text).mechanism.loads == (
        LoadCurve('slider', 'position', (0.2, 0.3), (1.0, 2.0), name='a'), Pins(1.0, 'A', name='b')
    )  # fmt: skip


def test_units_that_are_probably_wrong_are_noted(tmp_path):
    loaded = 'loads: {x: {kind: link, link: slider, force: 1.0}}'
    cases = {
        f'{FOUR}, crank_angle: 30.0': ['crank_angle = 30 rad = 278.9 deg .* 30deg = 0.5236 rad'],
        FOUR: ['no link has a mass .*: the torque is 0'],
        f'{FOUR}, joints: {{rocker: {{zero: 90.0}}}}': ['joints.rocker.zero = 90 rad'],
        f'{SLIDER}, joints: {{slider: {{zero: 9.0}}}}, {loaded}': [],
        f'{SLIDER.replace("0.3", "300.0")}, slider: {{mass: 1.0}}': ['300 mm = 0.3 m'],
        f'{SLIDER.replace("0.1", "1e-5")}, slider: {{mass: 1.0}}': ['= 0.01 mm; did you mean'],
        f'{SLIDER}, {loaded}': [],
    }
    for text, expected in cases.items():
        own = notes(configured(tmp_path, text, 'gravity: [0.0, -9.81]'))
        own = own if text == FOUR else [x for x in own if 'torque is 0' not in x]
        assert len(own) == len(expected)
        for words, line in zip(expected, own, strict=True):
            assert re.search(words, line), line


def test_motion_beyond_the_points_of_a_curve_is_noted_once(tmp_path, called):
    text = 'loads: {x: {kind: curve, link: slider, over: position, file: mm.csv}}'
    configured(tmp_path, SLIDER, text)
    code, out, noted = called(record_module, tmp_path / 'own.yaml', tmp_path / 'a.mcap')
    assert (code, 'note:' in out) == (0, False)
    assert noted.count('note:') == 1
    words = r'note: loads\.x\.at spans 0\.2 to 0\.3 m, and the slider has been at 0\.4 m: beyond'
    assert re.search(words, noted)
    wide = text.replace('file: mm.csv', 'at: [0.1, 0.5], value: [1.0, 2.0]')
    configured(tmp_path, SLIDER, wide)
    assert 'note:' not in called(record_module, tmp_path / 'own.yaml', tmp_path / 'b.mcap')[2]


VALVES = f'loads: {{x: {{{SHORT["GAS"]}, outlet: 2.0e5}}}}'
TURN_BACK = 'angles: [0.0, 2.0, 0.0], repeat: true'


def along(law):
    return f'{SLIDER.replace("rpm: 60.0", "drive: motion")}, motion: {{{law}}}'


@pytest.mark.parametrize(
    ('mechanism', 'angle'),
    [
        (f'{SLIDER}, start_rpm: -60.0, crank_acceleration: 20.0, crank_angle: 2.0', r'1\.0130'),
        (along('center: 1.5, amplitude: 0.5, frequency: 0.5'), '(1|2)'),
        (along('center: 1.5, amplitude: 5.0, frequency: 0.5'), '(6.5|-3.5)'),
        (along(f'times: [0.0, 0.5, 1.0], {TURN_BACK}'), '2'),
        (along('times: [0.0, 0.5, 1.0, 2.0, 3.0], angles: [0.0, 2.0, 2.0, 2.0, 1.0], '
               'speeds: [0.0, 0.0, 0.0, 0.0, 0.0]'), '2'),
        (along('times: [0.0, 1.0], angles: [1.0, 2.0], speeds: [-1.0, 0.0]'), r'0\.946502'),
    ],
    ids=range(6),
)  # fmt: skip
def test_motion_that_reverses_the_crank_inside_the_stroke_of_valves_is_refused(
    tmp_path, mechanism, angle
):
    words = rf'loads\.x: the crank reverses at {angle}\d* rad = \S+ deg, inside the stroke'
    with pytest.raises(LinkageError, match=words):
        configured(tmp_path, mechanism, VALVES)
    configured(tmp_path, mechanism, f'loads: {{x: {{{SHORT["GAS"]}}}}}')  # a closed cylinder


@pytest.mark.parametrize(
    'mechanism',
    [
        f'{SLIDER}, start_rpm: 30.0, crank_acceleration: 20.0',
        f'{SLIDER}, start_rpm: -60.0',  # without an acceleration, the start is at rpm
        along(f'center: {math.pi / 2!r}, amplitude: {math.pi / 2!r}, frequency: 0.5'),
        along(
            f'times: [0.0, 0.4, 1.0], angles: [1.0, 1.0, {1.0 + math.tau!r}], '
            'speeds: [0.0, 0.0, 0.0], repeat: true'
        ),
        along('times: [0.0, 0.5, 1.0], angles: [0.0, 2.0, 5.0]'),
    ],
    ids=range(5),
)
def test_crank_that_reverses_at_dead_centres_or_nowhere_has_valves(tmp_path, mechanism):
    configured(tmp_path, mechanism, VALVES)


def test_reversal_that_valves_meet_in_a_run_is_noted_once(tmp_path, called):
    for torque, count in ((-9.0, 1), (0.0, 0)):
        drive = f'drive: torque, start_rpm: 60.0, motor: {{torque: {torque}}}'
        mechanism = SLIDER.replace('rpm: 60.0', drive).replace('0.1}', '0.1, inertia: 1.0}', 1)
        configured(tmp_path, mechanism, VALVES.replace('bore: 0.1', 'bore: 0.001'))
        noted = called(
            record_module, tmp_path / 'own.yaml', tmp_path / f'{count}.mcap', '--duration', '1'
        )[2]  # fmt: skip
        assert noted.count('the crank has reversed') == count
