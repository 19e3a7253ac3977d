# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_import: the linkage in a closed loop of somebody's robot model."""

import math
import re
import resource
from pathlib import Path

import mujoco  # required by these tests: without it they must fail, not be skipped
import numpy as np
import pytest
import yaml
from robots import Tree, make_robot
from ros_harness import assert_refused

from linkage_lab import command_line
from linkage_lab.robots import artist, import_tool, mjcf
from linkage_lab.robots.import_tool import read_robot
from linkage_lab.robots.loops import Request
from linkage_lab.robots.robot_drawing import draw_robot
from linkage_ros import Conditions
from linkage_ros.mechanism.registry import MECHANISMS
from linkage_ros.mechanism.solver import Solver
from linkage_ros.messages.joints import joint_rows
from linkage_ros.programs import record
from linkage_ros.quantities import build, flatten
from linkage_ros.settings.configuration import configure, load
from linkage_ros.settings.yaml_file import read_parameter_file


def random_values(random):
    """Returns parameters of a random linkage that closes at a random crank angle, and a pose."""
    while True:
        r, b, c, d = random.uniform(0.05, 1.0, size=4)
        if random.integers(2):
            values = {'mechanism': 'four_bar', 'frame.length': d, 'rocker.length': c}
        else:
            values = {'mechanism': 'slider_crank', 'slider.offset': (c - 0.5) * 0.5}
        values.update({'crank.length': r, 'coupler.length': b})
        values['frame.angle'] = random.uniform(-math.pi, math.pi)
        values['assembly'] = str(random.choice(('open', 'crossed')))
        for link in ('crank', 'coupler', 'rocker'):
            if f'{link}.length' in values:
                values[f'{link}.mass'] = random.uniform(0.1, 3)
                values[f'{link}.inertia'] = random.uniform(0.001, 0.1)
                values[f'{link}.center'] = tuple(random.normal(size=2) * 0.1)
        if 'slider.offset' in values:
            values['slider.mass'] = random.uniform(0.1, 3)
        crank = random.uniform(-math.pi, math.pi)
        try:
            solver = Solver(build(MECHANISMS[values['mechanism']], values))
            state = solver.state(crank, 1.0, 0.0)
        except ValueError:
            continue
        if max(map(abs, state.velocity)) < 20:  # else both assemblies are one
            return values, dict(zip(solver.links, map(float, state.position), strict=True))


def pose_of(made, own):
    """Returns the joint values at positions of the links."""
    values = {}
    for link, (name, zero, sign, parent) in made.joints.items():
        move = own[link] - (0.0 if parent in {'frame', 'slider'} else own[parent]) - zero
        values[name] = sign * (move if link == 'slider' else math.remainder(move, math.tau))
    return values


def joints_of(found, solver, state):
    """Returns position, rate and acceleration of the robot's joints in messages, by name."""
    configuration = configure({'drive': 'follow', **found.parameters})
    structure, joints = solver.structure, configuration.only.robot_joints
    driven = structure.driven
    value = joints[driven].value(state.position[driven])
    rows = joint_rows(structure.links, state, value, joints, driven)
    names = [joint.name for joint in joints]
    return dict(zip(names, zip(*rows[:3], strict=True), strict=True))


def written(tmp_path, made):
    path = tmp_path / 'robot.urdf'
    path.write_text(made.text)
    return path


@pytest.mark.parametrize('seed', range(90))
def test_random_robot_has_the_torque_of_all_its_links(seed, tmp_path):
    """Two thirds of the robots hang on a hip that turns at 5 rad/s and 40 rad/s^2."""
    random = np.random.default_rng(seed)
    values, own = random_values(random)
    hip = (None, 'continuous', 'revolute')[seed % 3]
    cuts = ('A', 'B', 'B0') if 'rocker.length' in values else ('A', 'B')
    made = make_robot(values, random, cuts[seed // 3 % len(cuts)], hip=hip)
    robot, pose, tree = read_robot(written(tmp_path, made)), pose_of(made, own), Tree(made.text)
    request = Request('crank_motor', [made.close], at=pose, world='root' if hip else '')
    found = draw_robot(robot, request)
    assert max(found.residual, found.gap) < 1e-12
    assert not found.notes
    assert type(found.mechanism) is MECHANISMS[values['mechanism']]
    others, pivot, under = {}, (0.0, 0.0), Conditions()
    if hip:  # gravity is that of the joint's 0
        assert draw_robot(robot, request._replace(at={**pose, 'hip': 0.9})).values == found.values
        others['hip'] = 0.7, 5.0, 40.0
        pivot, turn = found.values['frame_joint.pivot'], found.values['frame_joint.ratio']
        under = Conditions(frame=tuple(turn * x for x in others['hip']))
    solver = Solver(found.mechanism, pivot=pivot)
    state = solver.state(found.mechanism.drawn.position, 3.0, 7.0, under=under)
    rows = joints_of(found, solver, state) | others
    q, u, a = (dict(zip(rows, row, strict=True)) for row in zip(*rows.values(), strict=True))
    assert tree.gap(q, made.close) < 1e-12
    torque = tree.power(q, u, a, along={**u, 'hip': 0.0}) / 3.0
    assert state.torque == pytest.approx(torque, abs=1e-11 * abs(torque))


@pytest.mark.parametrize('seed', range(12))
def test_change_points_survive_the_rounding_errors_of_a_tilted_model(seed, tmp_path):
    random = np.random.default_rng(seed)
    a, b, c = sorted(round(float(x), 3) for x in random.uniform(0.1, 1, 3))
    lengths = [
        {'mechanism': 'four_bar', 'coupler.length': b, 'rocker.length': a, 'frame.length': b},
        {'mechanism': 'four_bar', 'coupler.length': b, 'rocker.length': c,
         'frame.length': round(b + c - a, 3)},
        {'mechanism': 'slider_crank', 'coupler.length': round(a + b, 3), 'slider.offset': b},
    ][seed % 3]  # fmt: skip
    values = {'crank.length': a, 'frame.angle': random.uniform(-3, 3), **lengths}
    for link in ('crank', 'coupler', 'rocker'):
        if f'{link}.length' in values:
            values |= {f'{link}.mass': 1.0, f'{link}.inertia': 0.1}
    solver = Solver(build(MECHANISMS[values['mechanism']], values))
    state = solver.state(random.uniform(-3, 3))
    own = dict(zip(solver.links, map(float, state.position), strict=True))
    made = make_robot(values, random)
    request = Request('crank_motor', [made.close], at=pose_of(made, own))
    found = draw_robot(read_robot(written(tmp_path, made)), request)
    assert found.mechanism.reach().has_change_point
    text = import_tool.parameter_text(found, 'robot.urdf')
    (tmp_path / 'robot.yaml').write_text(text)
    assert load(str(tmp_path / 'robot.yaml')).mechanism == found.mechanism


# A leg: the motor of the knee sits in the hip and drives the shank by a parallel four-bar.
LEG = """<robot name="leg">
  <link name="base"/><link name="thigh"/>
  <joint name="hip" type="revolute"><parent link="base"/><child link="thigh"/>
    <axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="9" velocity="9"/></joint>
  <link name="crank_link"><inertial><origin xyz="0.03 0 0"/><mass value="0.2"/>
    <inertia ixx="1e-4" iyy="2e-4" izz="3e-4"/></inertial></link>
  <joint name="knee_motor" type="continuous"><parent link="thigh"/><child link="crank_link"/>
    <origin xyz="0 0.03 0"/><axis xyz="0 -1 0"/></joint>
  <link name="rod"><inertial><origin xyz="0 0 -0.15"/><mass value="0.1"/>
    <inertia ixx="1e-4" iyy="2e-4" izz="3e-4"/></inertial></link>
  <joint name="rod_joint" type="continuous"><parent link="crank_link"/><child link="rod"/>
    <origin xyz="0.06 0 0"/><axis xyz="0 1 0"/></joint>
  <link name="rod_tip"/>
  <joint name="rod_end" type="fixed"><parent link="rod"/><child link="rod_tip"/>
    <origin xyz="0 0 -0.3" rpy="1 2 3"/></joint>
  <link name="shank"><inertial><origin xyz="0 0 -0.15"/><mass value="0.6"/>
    <inertia ixx="5e-3" iyy="6e-3" izz="1e-4"/></inertial></link>
  <joint name="knee" type="revolute"><parent link="thigh"/><child link="shank"/>
    <origin xyz="0 0.03 -0.3"/><axis xyz="0 1 0"/><mimic joint="knee_motor" multiplier="-1"/>
    </joint>
  <link name="lug"/>
  <joint name="lug_weld" type="fixed"><parent link="shank"/><child link="lug"/>
    <origin xyz="0.06 0 0"/></joint>
  <link name="foot"><inertial><mass value="0.1"/><inertia ixx="1" iyy="1" izz="1"/></inertial>
    </link>
  <joint name="ankle" type="revolute"><parent link="shank"/><child link="foot"/>
    <origin xyz="0 0 -0.3"/><axis xyz="0 1 0"/></joint>
</robot>
"""
CLOSE = '--crank', 'knee_motor', '--close', 'rod_tip', 'lug'


def same_linkage(values, expected):
    """Compares two imports but for the names of pins."""
    rows = [
        {name: value for name, value in x.items() if not name.startswith('drawing.')}
        for x in (values, expected)
    ]
    values, expected = rows
    return values.keys() == expected.keys() and all(
        values[name] == pytest.approx(value, abs=1e-12) for name, value in expected.items()
    )


@pytest.fixture
def run(called, tmp_path):
    """Imports a model; returns the parameters, or exit code and output if it was refused.

    The parameters are those of the file, and of the mechanism that its drawing shows.
    """

    def start(model, *arguments, name='leg.urdf'):
        path, out = tmp_path / name, tmp_path / 'leg.yaml'
        path.write_text(model)
        options = '-o', out, '--overwrite', '--gap', 1, *arguments
        code, printed, error = called(import_tool, path, *options)
        if code:
            return code, printed, error
        values = read_parameter_file(out)
        return {**flatten(configure(values).mechanism), **values}, printed + error

    return start


def test_leg_with_parallel_four_bar(run):
    values, printed = run(LEG, *CLOSE, '--at', 'hip=0.5')
    assert values['mechanism'] == 'drawing'
    assert values['drive'] == 'follow'
    # Lengths keep their digits, so that the parallelogram stays one.
    lengths = [values[f'{link}.length'] for link in ('crank', 'coupler', 'rocker', 'frame')]
    assert lengths == [0.06, 0.3, 0.06, 0.3]
    assert values['crank.center'] == (0.03, 0.0)
    assert [values[f'{link}.inertia'] for link in ('crank', 'coupler', 'rocker')] == [
        2e-4, 2e-4, 6e-3,
    ]  # fmt: skip
    assert values['rocker.mass'] == 0.6  # without the foot
    # x, z and -y of the thigh are the plane's axes; gravity is that of the swung hip.
    assert values['gravity'] == pytest.approx([9.81 * math.sin(0.5), -9.81 * math.cos(0.5)])
    assert values['frame.angle'] == pytest.approx(-math.pi / 2)
    assert values['joints.crank_link.ratio'] == 1
    assert values['joints.shank.ratio'] == values['joints.rod.ratio'] == -1
    for words in ('hip', 'ankle', 'mimic'):
        assert words in printed.partition('note')[2]
    turned, _ = run(LEG, *CLOSE, '--up', '1', '0', '0')
    assert turned['gravity'] == pytest.approx([0.0, -9.81])


def test_units_that_are_probably_wrong_are_noted(run):
    _, printed = run(LEG, *CLOSE, '--at', 'hip=90')
    assert '90 deg = 1.571 rad' in printed
    _, printed = run(LEG.replace('0 -0.3"', '0 -300"').replace('0.03 -0.3"', '0.03 -300"'), *CLOSE)
    assert 'rod, has 300 m' in printed


SLIDER = """<robot name="pump">
  <link name="base"/><link name="frame"/><link name="arm"/><link name="rod"/><link name="tip"/>
  <joint name="hip" type="continuous"><parent link="base"/><child link="frame"/>
    <axis xyz="0 1 0"/></joint>
  <joint name="motor" type="continuous"><parent link="frame"/><child link="arm"/>
    <axis xyz="0 1 0"/></joint>
  <joint name="pin" type="continuous"><parent link="arm"/><child link="rod"/>
    <origin xyz="0.1 0 0"/><axis xyz="0 1 0"/></joint>
  <joint name="end" type="fixed"><parent link="rod"/><child link="tip"/>
    <origin xyz="0 0 0.3"/></joint>
  <link name="piston"><inertial><origin xyz="0 0.5 0.04"/><mass value="2"/>
    <inertia ixx="1" iyy="1" izz="1"/></inertial></link>
  <joint name="slide" type="prismatic"><parent link="frame"/><child link="piston"/>
    <origin xyz="0.1 0 0.3"/><axis xyz="0 0 1"/></joint>
</robot>"""


def test_centre_of_mass_off_the_pin_of_a_slider_is_noted(run):
    made = SLIDER, '--crank', 'motor', '--close', 'tip', 'piston'
    _, printed = run(*made)
    assert 'the centre of mass of piston is 0.04 m from its pin' in printed
    assert_refused(*run(*made, '--world', 'base'), 'from its pin: on a frame that turns it')
    _, printed = run(SLIDER.replace('0 0.5 0.04', '0 0.5 0'), *made[1:], '--world', 'base')
    assert 'centre of mass' not in printed


@pytest.mark.parametrize(
    ('model', 'arguments', 'speed'),
    [
        (LEG, CLOSE, ['--rpm', '30']),
        (SLIDER, ('--crank', 'slide', '--close', 'tip', 'piston'), []),
    ],
)
def test_printed_commands_run(model, arguments, speed, run, called, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    _, printed = run(model, *arguments)
    ((command, words),) = re.findall(r'; linkage_chart (\w+) (.*) shows it\n', printed)
    assert words.split()[1:] == speed
    assert called(command_line, command, *words.split())[0] == 0
    file, log = Path('leg.yaml'), Path('leg.mcap')
    code, _, error = called(record, file, log)
    assert code == 2
    (law,) = re.findall(r'drive: motion and (motion: \{.*\})', error)
    drive, text = 'drive: "follow"', file.read_text()
    assert drive in text
    file.write_text(text.replace(drive, f'drive: motion\n    {law}'))
    assert called(record, file, log, '--duration', 2.0, '--rate', 10)[0] == 0


@pytest.mark.parametrize('turns', [-1, 0, 3])
def test_reach_is_given_next_to_the_value_that_is_out_of_reach(run, turns):
    given = -1.57 + turns * math.tau
    longer = LEG.replace('xyz="0 0 -0.3" rpy', 'xyz="0 0 -0.35" rpy')
    code, _, error = run(longer, *CLOSE, '--at', f'knee_motor={given}')
    assert code == 2
    start, end = map(float, re.search(r'from (\S+) to (\S+) rad', error).groups())
    assert 0 < abs((start + end) / 2 - given) <= math.pi + 1e-4
    for inside in (start + 0.01, end - 0.01):
        assert len(run(longer, *CLOSE, '--at', f'knee_motor={inside}')) == 2


def test_crank_that_mimics_a_measured_joint_can_be_mapped_to_it(run):
    coupled = LEG.replace('multiplier="-1"', 'multiplier="-2" offset="0.3"')
    values, printed = run(coupled, '--crank', 'knee', *CLOSE[2:])
    assert values['joints.shank.name'] == 'knee'
    (cure,) = re.findall(r'joints.shank (name: .*)', printed)
    other = yaml.safe_load(f'{{{cure}}}')
    assert other['name'] == 'knee_motor'
    motor = 0.7
    knee = -2 * motor + 0.3
    own = knee / values['joints.shank.ratio'] + values['joints.shank.zero']
    assert other['ratio'] * (own - other['zero']) == pytest.approx(motor, abs=1e-15)


def test_pose_chooses_the_assembly(run):
    assert run(LEG, *CLOSE)[0]['assembly'] != run(LEG, *CLOSE, '--at', 'knee=2.5')[0]['assembly']


# The leg's four-bar again, closed by the file itself, in the plane x-z.
MJCF = """<mujoco>
  <compiler angle="degree" eulerseq="zyx"/>
  <default><geom density="500"/><default class="hinged"><joint axis="0 -1 0" pos="0.01 0 0"/>
    </default></default>
  <worldbody>
    <body name="base" pos="0.1 0.2 1" euler="0 20 0">
      <geom type="box" size="0.1 0.1 0.1"/>
      <body name="motor_arm" childclass="hinged" pos="0.02 0 0" axisangle="0 1 0 -30">
        <joint name="motor" ref="25"/>
        <geom type="capsule" fromto="0 0 0 0.08 0.01 0.03" size="0.01"/>
        <geom type="box" size="0.01 0.02 0.03" pos="0.02 0 0" quat="1 0.2 0.3 0"/>
        <body name="rod" pos="0.08 0.01 0" xyaxes="0 0 -1 0 1 0">
          <joint name="rod_joint" axis="0 1 0" pos="0 0 0"/>
          <geom type="cylinder" size="0.01 0.15" pos="0.15 0 0" zaxis="1 0 0"/>
          <geom type="ellipsoid" size="0.01 0.02 0.03" mass="0.2"/>
          <site name="rod_tip" pos="0.3 0 0"/>
        </body>
      </body>
      <frame pos="0 0 -0.25" euler="0 10 0">
        <body name="shank">
          <joint name="knee" axis="0 2 0"/>
          <inertial pos="0.1 0 0.1" mass="2" fullinertia="0.02 0.03 0.025 0.001 0.002 0.003"/>
          <geom type="sphere" size="0.1"/>
          <site name="lug" pos="0.15 0.01 0.05"/>
        </body>
      </frame>
    </body>
  </worldbody>
  <equality><connect name="pin" site1="rod_tip" site2="lug"/></equality>
</mujoco>
"""


@pytest.mark.parametrize(
    ('options', 'refused'),
    [
        ((), True),
        (('--gap', '0.001'), True),
        (('--gap', '0.1'), False),
        (('--at', 'knee=0'), False),
        (('--at', 'knee=0', '--gap', '0.001'), True),
    ],
)
def test_loops_that_are_open_as_given_need_a_gap_or_a_pose(options, refused, called, tmp_path):
    path, out = tmp_path / 'leg.urdf', tmp_path / 'leg.yaml'
    path.write_text(LEG.replace('<origin xyz="0 0 -0.3" rpy', '<origin xyz="0.026 0 -0.3" rpy'))
    code, _, error = called(import_tool, path, *CLOSE, '-o', out, *options)
    assert (code, out.exists()) == ((2, False) if refused else (0, True))
    assert ('0.026 m apart' in error) == refused


def test_mjcf_is_read_like_mujoco(tmp_path):
    path = tmp_path / 'leg.xml'
    path.write_text(MJCF)
    robot = read_robot(path)
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    data.qpos[:] = pose = 0.3, -0.4, 0.5
    names = 'motor', 'rod_joint', 'knee'
    mujoco.mj_forward(model, data)
    found = draw_robot(robot, Request('motor', at=dict(zip(names, pose, strict=True))))
    gap = data.site('rod_tip').xpos - data.site('lug').xpos
    assert found.gap == pytest.approx(math.hypot(gap[0], gap[2]), abs=1e-12)
    # The closed pose, and the torque in it, by MuJoCo's inverse dynamics of the open tree.
    solver = Solver(found.mechanism)
    state = solver.state(found.mechanism.drawn.position, 2.0, 3.0)
    rows = joints_of(found, solver, state)
    for number, name in enumerate(names):
        assert rows[name][0] == pytest.approx(found.closed[name], abs=1e-15)
        data.qpos[number], data.qvel[number], data.qacc[number] = rows[name]
    acceleration, efforts = data.qacc.copy(), np.zeros(model.nv)
    mujoco.mj_fwdPosition(model, data)
    mujoco.mj_fwdVelocity(model, data)
    data.qacc[:] = acceleration
    mujoco.mj_rne(model, data, 1, efforts)
    gap = data.site('rod_tip').xpos - data.site('lug').xpos
    assert math.hypot(gap[0], gap[2]) < 1e-12
    assert state.torque == pytest.approx(float(efforts @ data.qvel) / 2.0, rel=1e-12)


SDF = """<sdf version="1.7"><model name="made"><pose>1 2 3 0 0.3 0</pose>
  <link name="a"><pose relative_to="A0">0 0.1 0 0 0 0</pose><inertial><mass>2</mass>
    <inertia><ixx>1</ixx><iyy>0.02</iyy><izz>1</izz></inertia></inertial></link>
  <link name="b"><pose relative_to="a">0.3 0 0 0 0 0</pose></link>
  <link name="c"><pose degrees="true">1 0.1 0 0 90 0</pose></link>
  <frame name="A0"><pose>0 0 0 0 -1 0</pose></frame>
  <joint name="one" type="revolute"><parent>world</parent><child>
      a </child>
    <axis><xyz expressed_in="__model__">0 1 0</xyz></axis></joint>
  <joint name="two" type="revolute"><parent>a</parent><child>b</child>
    <axis><xyz>0 1 0</xyz></axis></joint>
  <joint name="four" type="revolute"><parent>world</parent><child>c</child>
    <axis><xyz>0 1 0</xyz></axis></joint>
  <joint name="three" type="revolute"><parent>b</parent><child>c</child>
    <pose rotation_format="quat_xyzw">-0.8 0 0 0 0 0 1</pose><axis><xyz>0 1 0</xyz></axis></joint>
</model></sdf>
"""


def test_sdf_closes_itself(run):
    values, _ = run(SDF, '--crank', 'one', name='made.sdf')
    assert values['crank.length'] == pytest.approx(0.3, abs=1e-14)
    assert values['frame.length'] == pytest.approx(1.0, abs=1e-14)
    assert values['rocker.length'] == pytest.approx(0.8, abs=1e-14)
    assert values['crank.mass'] == 2
    assert values['crank.inertia'] == 0.02
    assert values['coupler.mass'] == 1  # SDF's default
    # The other loop joints may be the crank as well, and the loop is then cut elsewhere.
    other, _ = run(SDF, '--crank', 'four', name='made.sdf')
    assert other['crank.length'] == pytest.approx(0.8, abs=1e-14)
    cut, _ = run(SDF, '--crank', 'three', '--frame', 'c', name='made.sdf')
    assert cut['frame.length'] == pytest.approx(0.8, abs=1e-14)


@pytest.mark.parametrize('word', ['1', 'True', ' true '])
def test_truth_values_of_sdf_are_its_own(word, run):
    expected, _ = run(SDF, '--crank', 'one', name='made.sdf')
    text = SDF.replace('degrees="true"', f'degrees="{word}"').replace('"1.7"', '"1.11"')
    assert run(text, '--crank', 'one', name='made.sdf')[0] == expected
    turned = SDF.replace(
        '<pose degrees="true">1 0.1 0 0 90 0', f'<pose degrees="False">1 0.1 0 0 {math.pi / 2} 0'
    )
    assert run(turned, '--crank', 'one', name='made.sdf')[0] == expected


def test_quaternion_of_urdf_is_its_roll_pitch_and_yaw(run):
    turned = LEG.replace(  # on the rod, whose joint and closure are on its axis
        '<origin xyz="0.06 0 0"/><axis', '<origin xyz="0.06 0 0" rpy="0 0.3 0"/><axis'
    )
    half = f'0 {math.sin(0.15)!r} 0 {math.cos(0.15)!r}'
    quaternion = turned.replace('rpy="0 0.3 0"', f'quat_xyzw="{half}"')
    quaternion = quaternion.replace('name="leg"', 'name="leg" version="1.1"')
    expected, _ = run(turned, *CLOSE)
    assert expected != run(LEG, *CLOSE)[0]
    values, _ = run(quaternion, *CLOSE)
    for name, value in expected.items():
        assert values[name] == pytest.approx(value, abs=1e-12)


def without(text, *pieces):
    for piece in pieces:
        assert piece in text
        text = text.replace(piece, '')
    return text


TILTED = LEG.replace('<axis xyz="0 1 0"/><mimic', '<axis xyz="0.003 1 0"/><mimic')
TWO_PARENTS = LEG.replace(
    '</robot>',
    """<joint name="extra" type="fixed"><parent link="base"/>
  <child link="foot"/></joint></robot>""",
)
SLIDING = LEG.replace('name="knee_motor" type="continuous"', 'name="knee_motor" type="prismatic"')
CYLINDER = LEG.replace('name="rod_joint" type="continuous"', 'name="rod_joint" type="prismatic"')
ON_CRANK = CYLINDER.replace(
    '<origin xyz="0.06 0 0"/><axis xyz="0 1 0"/>', '<origin xyz="0.06 0 0"/><axis xyz="1 0 0"/>'
)
BALL = LEG.replace('name="rod_joint" type="continuous"', 'name="rod_joint" type="floating"')
SHORT = LEG.replace('<origin xyz="0.06 0 0"/><axis', '<axis')
FAR = LEG.replace('xyz="0 0.03 -0.3"', 'xyz="0 0.03 -3"')
ACROSS = LEG.replace('<axis xyz="0 1 0"/><limit', '<axis xyz="1 0 0"/><limit', 1)
LIFTED = LEG.replace('name="hip" type="revolute"', 'name="hip" type="prismatic"')
WAIST = LEG.replace(
    '<link name="base"/>',
    """<link name="torso"/><link name="base"/><joint name="waist" type="continuous">
  <parent link="torso"/><child link="base"/><axis xyz="0 1 0"/></joint>""",
)
MESH = MJCF.replace('type="cylinder" size="0.01 0.15"', 'type="mesh" mesh="rod"')
OPEN_SDF = SDF.replace('<child>c</child>\n    <pose rot', '<child>d</child><pose rot')
HIDDEN = LEG.replace(
    '<link name="lug"/>',
    '<link name="lug"><inertial><mass value="-0.1"/><inertia ixx="0" iyy="0" izz="0"/>'
    '</inertial></link>',
)
ROD_INERTIA = '<mass value="0.1"/>\n    <inertia ixx="1e-4" iyy="2e-4" izz="3e-4"/>'
NO_INERTIA = LEG.replace(ROD_INERTIA, '<mass value="0.1"/>')
CIRCLE = LEG.replace(
    '</robot>',
    '<joint name="x" type="fixed"><parent link="foot"/><child link="base"/></joint></robot>',
)
TWO_NUMBERS = LEG.replace('xyz="0.06 0 0"/><axis', 'xyz="0.06 0"/><axis')
CRANK = '--crank', 'one'
IN_SDF = {  # what replaces a piece of SDF, and words of the error
    'degrees': ('degrees="true"', 'degrees="yes"', "'yes': must be true"),
    'degrees of a quaternion': ('rotation_format', 'degrees="1" rotation_format', 'quat_xyzw'),
    'format of a rotation': ('"quat_xyzw"', '"quat_wxyz"', 'quat_wxyz'),
    'attribute of a pose': ('<pose degrees', '<pose degres="1" degrees', "'degres'"),
    'quaternion without length': ('-0.8 0 0 0 0 0 1', '-0.8 0 0 0 0 0 0', 'length 0'),
    'frame of a pose': ('relative_to="A0"', 'relative_to=" A0"', "' A0' is missing"),
    'component of inertia': ('<izz>1</izz>', '<izZ>1</izZ>', 'izZ'),
    'mass given twice': ('<mass>2</mass>', '<mass>2</mass><mass>3</mass>', 'several <mass>'),
    'part of an inertial': ('<mass>2</mass>', '<mass>2</mass><pse/>', '<pse> of <inertial>'),
    'version': ('"1.7"', '"1.x"', "'1.x': must be numbers"),
}  # fmt: skip
IN_URDF = {  # the same of URDF
    'moment of inertia': ('izz="1e-4"', '', "link 'shank': <inertia> izz"),
    'component of inertia': ('izz="1e-4"', 'izz="1" izZ="1"', "'izZ'"),
    'mass given twice': ('<mass value="0.6"/>', 2 * '<mass value="0.6"/>', 'several <mass>'),
    'part of an inertial': ('<mass value="0.6"/>', '<mass value="0.6"/><orign/>', '<orign> of'),
    'unit of a mass': ('<mass value="0.6"/>', '<mass value="0.6" unit="g"/>', "'unit'"),
    'misspelt origin': ('<origin xyz="0 0.03 0"/>', '<origin xyx="0 0.03 0"/>', "'xyx'"),
    'attribute of an axis': ('<axis xyz="0 -1 0"', '<axis xyz="0 -1 0" rpy="0 1 0"', "'rpy'"),
    'attribute of a limit': ('lower="-1"', 'lower="-1" uper="1"', "'uper'"),
    'attribute of a mimic': ('multiplier="-1"', 'multiplyer="-1"', "'multiplyer'"),
    'quaternion of an old version': ('rpy="1 2 3"', 'quat_xyzw="0 0 0 1"', '1.1'),
}  # fmt: skip
REFUSED = {
    **{f'SDF, {x}': (SDF.replace(old, new), CRANK, words)
       for x, (old, new, words) in IN_SDF.items()},
    **{f'URDF, {x}': (LEG.replace(old, new), CLOSE, words)
       for x, (old, new, words) in IN_URDF.items()},
    'two rotations': (
        LEG.replace('name="leg"', 'name="leg" version="1.1"')
        .replace('rpy="1 2 3"', 'rpy="1 2 3" quat_xyzw="0 0 0 1"'), CLOSE, 'one of them',
    ),
    'a computed inertia': (SDF.replace('<inertial>', '<inertial auto="true">'), CRANK, 'auto'),
    'another file': (SDF.replace('<link name="b"', '<include/><link name="b"'), CRANK, 'include'),
    'a link without gravity': (
        SDF.replace('<link name="b">', '<link name="b"><gravity>0</gravity>'), CRANK, 'gravity',
    ),
    'a frame of placement': (
        SDF.replace('name="made"', 'name="made" placement_frame="A0"'), CRANK, 'placement_frame',
    ),
    'axes of another frame': (
        SDF.replace('<axis>', '<axis><use_parent_model_frame>1</use_parent_model_frame>'), CRANK,
        'use_parent_model_frame',
    ),
    'an old version': (SDF.replace('"1.7"', '"1.4"'), CRANK, 'at least 1.5'),
    'a frame of an old pose': (
        SDF.replace('<pose degrees', '<pose frame="a" degrees'), CRANK, 'frame of <pose>',
    ),
    'global coordinates': (
        MJCF.replace('angle="degree"', 'angle="degree" coordinate="global"'), ('--crank', 'motor'),
        'global',
    ),
    'too many bodies': (
        MJCF.replace('</worldbody>', '<replicate count="1000"><body/></replicate></worldbody>'),
        ('--crank', 'motor'), 'at most 1000',
    ),
    'a mesh that is a device': (
        MJCF.replace('<worldbody>', '<asset><mesh file="/dev/null"/></asset><worldbody>'),
        ('--crank', 'motor'), 'regular file',
    ),
    'an include that is a device': (
        MJCF.replace('</worldbody>', '</worldbody><include file="/dev/null"/>'),
        ('--crank', 'motor'), 'regular file',
    ),
    'a weld without links': (LEG, (*CLOSE[:2], '--weld'), '--weld needs --close'),
    'a slanted closure': (
        SDF.replace('0 0 1</pose><axis><xyz>0 1 0', '0 0 1</pose><axis><xyz>0 1 0.01'), CRANK,
        'off being parallel',
    ),
    'a constraint that couples joints': (
        MJCF.replace('<connect name="pin" site1="rod_tip" site2="lug"/>',
                     '<joint name="gear" joint1="motor" joint2="knee"/>'),
        ('--crank', 'motor'), "joint 'gear' is not a closure",
    ),
    **{f'{flag} that is disabled': (
        MJCF.replace('</mujoco>', f'<option><flag {flag}="disable"/></option></mujoco>'),
        ('--crank', 'motor'), "connect 'pin' is disabled",
    ) for flag in ('equality', 'constraint')},
    'a large height field': (
        MJCF.replace('<worldbody>', '<asset><hfield name="h" nrow="30000" ncol="30000" '
                     'size="1 1 1 1"/></asset><worldbody>'), ('--crank', 'motor'), '900000000 or',
    ),
    'many numbers of a user': (
        MJCF.replace('name="motor"', f'name="motor" user="{"1 " * 1001}"'), ('--crank', 'motor'),
        'user has 1001',
    ),
    'a constraint that is not active': (
        MJCF.replace('name="pin"', 'name="pin" active="false"'), ('--crank', 'motor'),
        "connect 'pin' is not active",
    ),
    'a closure of another loop': (
        MJCF.replace('site1="rod_tip"', 'body1="shank" body2="base" anchor="0 0 0"')
        .replace(' site2="lug"', ''), ('--crank', 'motor'), "connect 'pin' closes a loop of knee",
    ),
    'a file that includes itself': (
        MJCF.replace('</worldbody>', '</worldbody><include file="leg.urdf"/>'),
        ('--crank', 'motor'), 'MuJoCo',
    ),
    'bodies nested too deeply': (
        MJCF.replace('</worldbody>', 600 * '<body>' + 600 * '</body>' + '</worldbody>'),
        ('--crank', 'motor'), 'nested too deeply',
    ),
    'a misspelt crank': (LEG, ('--crank', 'knee_moter', *CLOSE[2:]), 'knee_motor, rod_joint'),
    'a link as crank': (LEG, ('--crank', 'thigh', *CLOSE[2:]), 'movable joint'),
    'a fixed joint as crank': (LEG, ('--crank', 'rod_end', *CLOSE[2:]), 'movable joint'),
    'no crank': (LEG, CLOSE[2:], '--crank'),
    'one link to close': (LEG, (*CLOSE[:2], '--close', 'lug'), 'expected 2'),
    'no closure': (LEG, CLOSE[:2], 'give --close'),
    'a misspelt link': (LEG, (*CLOSE[:4], 'lag'), 'rod_tip'),
    'a joint to close': (LEG, (*CLOSE[:4], 'lug_weld'), 'no such link'),
    'no loop': (LEG, (*CLOSE[:3], 'lug', 'lug'), 'must contain the crank'),
    'a loop without the crank': (LEG, ('--crank', 'hip', *CLOSE[2:]), 'must contain the crank'),
    'a loop that is too long': (LEG, (*CLOSE[:4], 'foot'), 'all pins of foot'),
    'a loop that is too short': (LEG, (*CLOSE[:3], 'rod_tip', 'thigh'), 'have 0 degrees'),
    'a crank off the frame': (LEG, ('--crank', 'rod_joint', *CLOSE[2:]), 'knee_motor and knee'),
    'a frame off the loop': (LEG, (*CLOSE, '--frame', 'foot'), 'not part of the loop'),
    'an unknown frame': (LEG, (*CLOSE, '--frame', 'tie'), 'no such link'),
    'a crank off the other frame': (LEG, (*CLOSE, '--frame', 'shank'), 'not on the frame'),
    'an unknown joint of the pose': (LEG, (*CLOSE, '--at', 'knie=1'), 'no such movable joint'),
    'no value': (LEG, (*CLOSE, '--at', 'knee'), 'JOINT=VALUE'),
    'a word as value': (LEG, (*CLOSE, '--at', 'knee=bent'), 'JOINT=VALUE'),
    'two values of a joint': (LEG, (*CLOSE, '--at', 'hip=1', '--at', 'hip=2'), 'twice'),
    'NaN as value': (LEG, (*CLOSE, '--at', 'knee=nan'), 'JOINT=VALUE'),
    'a pose out of reach': (FAR, CLOSE, 'cannot close'),
    'up without direction': (LEG, (*CLOSE, '--up', '0', '0', '0'), 'direction'),
    'a world that is the frame': (LEG, (*CLOSE, '--world', 'thigh'), 'fixed to the frame'),
    'a world beyond the loop': (LEG, (*CLOSE, '--world', 'foot'), 'the loop itself'),
    'an unknown world': (LEG, (*CLOSE, '--world', 'earth'), 'no such link'),
    'a hip across the plane': (ACROSS, (*CLOSE, '--world', 'base'), '1.5708 rad'),
    'a hip that slides': (LIFTED, (*CLOSE, '--world', 'base'), 'revolute joint'),
    'two joints above the frame': (WAIST, (*CLOSE, '--world', 'torso'), 'hip, waist'),
    'up as a word': (LEG, (*CLOSE, '--up', 'z', '0', '0'), 'finite number'),
    'a slanted axis': (TILTED, CLOSE, '0.00299999 rad'),
    'two parents': (TWO_PARENTS, CLOSE, 'two parent joints'),
    'a crank that slides across the plane': (SLIDING, CLOSE, '1.5708 rad'),
    'a cylinder across the plane': (CYLINDER, CLOSE, 'off being normal'),
    'a cylinder on the crank': (ON_CRANK, CLOSE, 'it is in no loop'),
    'a joint of another kind': (BALL, CLOSE, 'floating'),
    'a link without length': (SHORT, CLOSE, 'in one place'),
    'macros': (LEG.replace('</robot>', '<xacro:if value="1"/></robot>'), CLOSE, 'xacro'),
    'no XML': ('links: 3', CLOSE, 'not XML'),
    'another XML': ('<html/>', CLOSE, '<robot>'),
    'a link that is missing': (without(LEG, '<link name="base"/>'), CLOSE, "'base'"),
    'a word as mass': (LEG.replace('mass value="0.6"', 'mass value="much"'), CLOSE, 'much'),
    'an axis without length': (LEG.replace('"0 -1 0"', '"0 0 0"'), CLOSE, 'length 0'),
    'two numbers for three': (TWO_NUMBERS, CLOSE, "joint 'rod_joint': <origin> xyz"),
    'a geom without size': (MJCF.replace('0.01 0.15', '0.01'), ('--crank', 'motor'), 'positive'),
    'a word as size': (MJCF.replace('0.01 0.15', '0.01 x'), ('--crank', 'motor'), 'size'),
    'no gravity': (
        MJCF.replace('<worldbody>', '<option gravity="0 0 nan"/><worldbody>'),
        ('--crank', 'motor'), 'gravity',
    ),
    'no place': (
        MJCF.replace('<worldbody>', '<worldbody><body pos="0 -Inf 0"/>'),
        ('--crank', 'motor'), 'pos',
    ),
    'axes that do not exist': (MJCF.replace('zyx', 'zyw'), ('--crank', 'motor'), 'euler'),
    'the mass of a mesh': (MESH, ('--crank', 'motor'), 'mesh'),
    'joints with one name': (LEG.replace('name="ankle"', 'name="knee"'), CLOSE, 'two joints'),
    'a negative mass': (LEG.replace('value="0.1"', 'value="-0.1"'), CLOSE, 'mass of rod is -0.1'),
    'a hidden negative mass': (HIDDEN, CLOSE, 'mass of lug is -0.1'),
    'no mass': (without(LEG, '<mass value="0.6"/>'), CLOSE, "'shank': <inertial> has no <mass>"),
    'no inertia': (NO_INERTIA, CLOSE, "link 'rod': <inertial> has no <inertia>"),
    'a joint without name': (without(LEG, 'name="knee" '), CLOSE, 'no name'),
    'a circle': (CIRCLE, CLOSE, 'circle'),
    'two roots': (LEG.replace('</robot>', '<link name="box"/></robot>'), CLOSE, "'box'"),
    'a link that no joint holds': (OPEN_SDF, ('--crank', 'one'), "'d'"),
}  # fmt: skip


@pytest.mark.parametrize('case', REFUSED)
def test_wrong_use_gets_one_clear_line(case, run, tmp_path):
    model, arguments, words = REFUSED[case]
    assert_refused(*run(model, *arguments), words)
    assert not (tmp_path / 'leg.yaml').exists()


def test_model_is_kept(called, tmp_path):
    path = tmp_path / 'leg.urdf'
    path.write_text(LEG)
    assert_refused(*called(import_tool, path, *CLOSE, '-o', path, '--overwrite'), 'is the model')
    missing = tmp_path / 'no.urdf'
    assert_refused(*called(import_tool, missing, *CLOSE, '-o', tmp_path / 'x'), 'no.urdf')
    assert path.read_text() == LEG


def test_legs_are_appended_to_one_file_as_linkages_of_one_node(called, run, tmp_path):
    alone, _ = run(LEG, *CLOSE)
    out, model = tmp_path / 'robot.yaml', tmp_path / 'leg.urdf'
    for name in ('left', 'right'):
        own = [word.replace('knee_motor', f'{name}_motor') for word in CLOSE]
        legs = re.sub('joint name="', f'joint name="{name}_', LEG)
        model.write_text(legs.replace(f'{name}_knee_motor', f'{name}_motor'))
        code, printed, error = called(import_tool, model, *own, '-o', out, '--linkage', name)
        assert code == 0, error
        assert f'motion {out} --linkage {name}' in printed
        if name == 'left':
            out.write_text(out.read_text() + '    # my own words\n')
    assert '# my own words' in out.read_text()
    robot = load(str(out))
    assert [linkage.name for linkage in robot.linkages] == ['left', 'right']
    for linkage in robot.linkages:
        assert linkage.drive.is_measured
        found = flatten(linkage.mechanism)
        assert all(found[x] == alone[x] for x in found if x.endswith(('length', 'mass', 'center')))
        assert linkage.crank_joint == f'{linkage.name}_motor'
        assert linkage.session.plane.link == robot.session.plane.link
        # Linkages of one link may have different planes.
        assert linkage.session.frame_id == f'{linkage.name}_plane'
    before = out.read_bytes()
    rest = (*own, '-o', out, '--linkage')
    assert_refused(*called(import_tool, model, *rest, 'right'), 'give --overwrite to replace')
    assert_refused(*called(import_tool, model, *rest, 'third'), "each have a joint 'right_")
    assert_refused(*called(import_tool, model, *rest, 'crank'), "'crank' is a parameter")
    other = tmp_path / 'leg.yaml'  # of a linkage without a name
    assert_refused(*called(import_tool, model, *own, '-o', other, '--linkage', 'a'), 'leg.yaml')
    assert out.read_bytes() == before


def test_a_linkage_of_several_is_imported_again(called, tmp_path):
    out, model = tmp_path / 'robot.yaml', tmp_path / 'leg.urdf'

    def import_leg(name, text, *more):
        model.write_text(re.sub('joint name="', f'joint name="{name}_', text))
        own = [word.replace('knee_motor', f'{name}_knee_motor') for word in CLOSE]
        return called(import_tool, model, *own, '-o', out, '--linkage', name, *more)

    for name in ('left', 'middle', 'right'):
        assert import_leg(name, LEG)[0] == 0
    mine = '    # my own words\n    right:\n      follow_bandwidth: 7.0\n'
    written = out.read_text().replace('    right:\n', mine)
    heavier = re.sub('<mass value="[^"]*"', '<mass value="7.5"', LEG)
    for name, kept in (('middle', 'follow_bandwidth: 7.0'), ('left', ''), ('right', '')):
        out.write_text(written)
        before = load(str(out))
        assert_refused(*import_leg(name, heavier), 'give --overwrite to replace it')
        assert out.read_text() == written
        code, _, error = import_leg(name, heavier, '--overwrite')
        assert code == 0, error
        assert ('left out of' in error) == (name == 'right')
        assert 'right.follow_bandwidth' in error or name != 'right'
        text = out.read_text()
        assert '    # my own words\n' in text
        assert kept in text
        after = load(str(out))
        assert [one.name for one in after.linkages] == ['left', 'middle', 'right']
        for old, new in zip(before.linkages, after.linkages, strict=True):
            assert (old == new) == (old.name != name)
    out.write_text(text.replace('    left:\n', '    left: # mine\n'))
    assert_refused(*import_leg('left', LEG, '--overwrite'), 'it has no line left: alone')


def test_rounded_axis_is_taken_as_parallel_with_a_note(run):
    exact, printed = run(LEG, *CLOSE)
    assert ' off, but is taken as exact' not in printed
    tilted = LEG.replace('<axis xyz="0 1 0"/><mimic', '<axis xyz="3.7e-6 1 0"/><mimic')
    values, printed = run(tilted, *CLOSE)
    assert 'the axis of knee is 3.7e-06 rad' in printed
    assert '\nclosed, with a residual' in printed
    assert values['rocker.length'] == pytest.approx(exact['rocker.length'], rel=1e-10)
    worse = tilted.replace('3.7e-6', '1.5e-3').replace(
        '<origin xyz="0.06 0 0"/></joint>', '<origin xyz="0.06 0.2 0"/></joint>'
    )
    assert worse.count('0.06 0.2 0') == 1
    values, printed = run(worse, *CLOSE, '--at', 'knee_motor=0.5')
    assert 'the axis of knee is 0.0015 rad' in printed
    assert 'as nearly closed as' in printed
    assert values['rocker.length'] == pytest.approx(exact['rocker.length'], rel=1e-5)


@pytest.mark.parametrize(('error', 'is_refused'), [(1e-5, True), (1e-8, False)])
def test_loop_that_stays_open_is_refused(error, is_refused, run, monkeypatch):
    """As it would if a joint were read wrongly."""
    monkeypatch.setattr(artist, 'tidy', lambda number, _: number + error)
    longer = LEG.replace('xyz="0 0 -0.3" rpy', 'xyz="0 0 -0.31" rpy')  # no parallelogram
    told = run(longer, *CLOSE, '--at', 'knee_motor=0.7')
    if is_refused:
        assert_refused(*told, 'm apart at')
    else:
        assert len(told) == 2


# The leg without --close: Gazebo's joint, in the pose of LEG.
GAZEBO = """<gazebo><joint name="pin" type="{}"><parent>rod</parent><child>shank</child>
  <pose>0.06 0 0 0 0 0</pose><axis><xyz>0 1 0</xyz></axis></joint></gazebo></robot>"""


@pytest.mark.parametrize('kind', ['revolute', 'ball'])
def test_gazebo_joint_closes_the_loop_of_a_urdf(kind, run):
    expected, _ = run(LEG, *CLOSE)
    values, printed = run(LEG.replace('</robot>', GAZEBO.format(kind)), *CLOSE[:2])
    assert same_linkage(values, expected)
    assert 'drawing.pins.pin' in values
    assert 'pin closes the loop: its value is not published' in printed
    prismatic = GAZEBO.format('universal')
    assert_refused(*run(LEG.replace('</robot>', prismatic), *CLOSE[:2]), "'pin' is universal")


# A tip with a joint of its own, which is fixed to the lug.
JOINTED = LEG.replace(
    '<joint name="rod_end" type="fixed">', '<joint name="rod_end" type="continuous">'
).replace('<origin xyz="0 0 -0.3" rpy="1 2 3"/>', '<origin xyz="0 0 -0.3"/><axis xyz="0 1 0"/>')


def test_welded_links_close_a_loop_at_the_joint_before_them(run):
    expected, _ = run(LEG, *CLOSE)
    values, _ = run(JOINTED, *CLOSE, '--weld')
    assert same_linkage(values, expected)


def test_weld_of_mjcf_closes_a_loop(run):
    free = MJCF.replace(
        '<site name="rod_tip" pos="0.3 0 0"/>',
        '<body name="tip" pos="0.3 0 0"><joint name="tip_joint" axis="0 1 0" pos="0 0 0"/>'
        '<geom size="1e-3"/><site name="rod_tip"/></body>',
    )
    expected, _ = run(MJCF, '--crank', 'motor')
    values, _ = run(free.replace('<connect', '<weld'), '--crank', 'motor')
    for name in ('crank.length', 'coupler.length', 'rocker.length', 'frame.length'):
        assert values[name] == pytest.approx(expected[name], abs=1e-12)


BODIES = {
    'connect': '<connect body1="rod" body2="shank" anchor="0.3 0.01 0.02"/>',
    'weld': '<weld body1="tip" body2="shank" anchor="0.01 0.02 0.03" '
    'relpose="-0.15 -0.01 -0.05 0.9 0 0.3 0"/>',
}


@pytest.mark.parametrize('kind', BODIES)
def test_constraint_of_bodies_is_that_of_mujoco(kind, tmp_path):
    text = MJCF.replace(
        '<site name="rod_tip" pos="0.3 0 0"/>',
        '<body name="tip" pos="0.3 0 0"><joint name="tip_joint" axis="0 1 0" pos="0 0 0"/>'
        '<geom size="1e-3"/></body>',
    ).replace('<connect name="pin" site1="rod_tip" site2="lug"/>', BODIES[kind])
    path = tmp_path / 'leg.xml'
    path.write_text(text)
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    found = draw_robot(read_robot(path), Request('motor'))
    for name, value in found.closed.items():
        data.joint(name).qpos = value
    mujoco.mj_forward(model, data)
    if kind == 'weld':  # the joint at the tip, whose value follows from the orientation
        assert 'tip_joint closes the loop: its value is not published' in found.notes
        within = np.zeros(9)
        mujoco.mju_quat2Mat(within, model.eq_data[0][6:10])
        tip, shank = (data.body(name).xmat.reshape(3, 3) for name in ('tip', 'shank'))
        turn = tip.T @ shank @ within.reshape(3, 3).T
        data.joint('tip_joint').qpos = math.atan2(turn[0, 2], turn[0, 0])
    mujoco.mj_forward(model, data)
    x, y, *others = data.efc_pos[: 3 if kind == 'connect' else 6]
    assert abs(y) == pytest.approx(found.across, abs=1e-12)  # along the normal
    assert np.abs([x, *others]).max() < 1e-12


def test_properties_that_a_linkage_does_not_have_are_noted(run):
    heavy = MJCF.replace('ref="25"', 'ref="25" armature="0.01" damping="0.2" frictionloss="0.3"')
    _, printed = run(heavy, '--crank', 'motor')
    assert 'motor: armature = 0.01, damping = 0.2, frictionloss = 0.3' in printed
    misspelt = LEG.replace('<axis xyz="0 1 0"/><mimic', '<axis xyz="0 1 0"/><orign/><mimic')
    assert 'knee: <orign>: left out' in run(misspelt, *CLOSE)[1]
    text = SDF.replace('<xyz>', '<xzy/><xyz>')
    assert 'two: <xzy>: left out' in run(text, '--crank', 'one', name='made.sdf')[1]
    # The joint that closes the loop is not in the tree.
    three = '<xyz>0 1 0</xyz>', '<xyz>0 1 0</xyz><dynamics><damping>0.4</damping></dynamics>'
    _, printed = run(three[1].join(SDF.rsplit(three[0], 1)), '--crank', 'one', name='made.sdf')
    assert 'three: damping = 0.4' in printed
    damped = LEG.replace('<mimic', '<dynamics damping="0.5" friction="0"/><mimic')
    assert 'knee: damping = 0.5' in run(damped, *CLOSE)[1]
    _, printed = run(SDF, '--crank', 'one', name='made.sdf')
    assert 'b: no <inertial>' in printed
    _, printed = run(without(SDF, '<izz>1</izz>'), '--crank', 'one', name='made.sdf')
    assert 'a: no <izz>' in printed


SPRING = (
    '<tendon><spatial name="s" stiffness="3"><site site="lug"/><site site="w"/></spatial></tendon>'
)
PULLED = (
    '<tendon><fixed name="s"><joint joint="knee" coef="2"/></fixed></tendon><equality><tendon '
    'name="e" tendon1="s"/></equality><actuator><motor name="m" tendon="s" armature="1"/>'
    '</actuator>'
)
LEFT_OUT = {  # what is added to MJCF, and the words of the only further line
    'a fluid': ('<option density="1.2" viscosity="1e-5" wind="0 2 0"/>',
                'density = 1.2, viscosity = 1e-05, wind = 0 2 0: left out'),
    'a spring of a joint': (
        '<tendon><fixed name="s" stiffness="3"><joint joint="knee" coef="2"/></fixed></tendon>',
        "knee: tendon 's' (stiffness = 3): left out",
    ),
    'a spring to the frame': (
        f'<worldbody><site name="w"/></worldbody>{SPRING}',
        "lug: tendon 's' (stiffness = 3): left out",
    ),
    'a coupling': ('<equality><joint name="gear" joint1="motor"/></equality>',
                   "motor: constraint joint 'gear': left out"),
    'a motor': ('<actuator><motor name="m" joint="motor" armature="2" nsample="9"/></actuator>',
                "motor: actuator 'm' (armature = 2): left out"),
    'a motor without inertia': ('<actuator><motor joint="motor"/></actuator>', ''),
    'a string': ('<tendon><fixed><joint joint="knee" coef="2"/></fixed></tendon>', ''),
    'a constraint of a tendon, and its motor': (
        PULLED,
        "knee: tendon 's' (constraint tendon 'e', actuator 'm' (armature = 1)): left out",
    ),
    'two springs of a site': (
        '<worldbody><site name="w"/></worldbody>' + 2 * SPRING.replace(' name="s"', ''),
        'lug: tendon 0 (stiffness = 3), tendon 1 (stiffness = 3): left out',
    ),
    'wind without air': ('<option wind="0 2 0"/>', ''),
}  # fmt: skip


@pytest.mark.parametrize('case', LEFT_OUT)
def test_what_mjcf_adds_to_a_linkage_is_noted_once(case, run):
    addition, words = LEFT_OUT[case]
    values, plain = run(MJCF, '--crank', 'motor')
    noted, printed = run(MJCF.replace('</mujoco>', f'{addition}</mujoco>'), '--crank', 'motor')
    assert noted == values
    notes, before = (re.findall('^note: .*', x, re.MULTILINE) for x in (printed, plain))
    assert sorted(notes) == sorted([*before, *([f'note: {words}'] if words else [])])


def test_disabled_gravity_is_zero(run):
    option = '<option{}</mujoco>'
    floating, same = (
        run(MJCF.replace('</mujoco>', option.format(x)), '--crank', 'motor')
        for x in (' gravity="0 0 0"/>', '><flag gravity="disable"/></option>')
    )
    assert floating == same
    assert same[0]['gravity'] == [0.0, 0.0]


LARGE = {
    'textures': '<asset><texture name="t" type="2d" width="40000" height="40000" builtin="flat"/>'
    '<texture type="skybox" width="40000" height="40000" builtin="gradient"/>'
    '<texture name="f" type="2d" file="missing.png"/><material name="m" texture="t"/></asset>',
    'a field of a file': '<asset><hfield name="h" file="missing.png" size="1 1 1 1"/></asset>'
    '<worldbody><geom type="hfield" hfield="h"/></worldbody>',
    'sizes': '<size nuserdata="2000000000" nkey="100000000" nuser_body="1000000000"/>',
    'old sizes': '<size njmax="2000000000" nconmax="2000000000"/>',
    'sensors': '<sensor><user dim="1000000000"/></sensor>',
    'keys': '<keyframe><key qpos="0 0 0"/></keyframe>',
}


@pytest.mark.parametrize('case', LARGE)
def test_what_mechanics_do_not_need_is_not_compiled(case, run):
    expected = run(MJCF, '--crank', 'motor')
    limit = resource.getrlimit(resource.RLIMIT_AS)
    with Path('/proc/self/statm').open() as pages:
        used = int(pages.read().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + 500_000_000, limit[1]))
    try:
        text = MJCF.replace('<worldbody>', f'{LARGE[case]}<worldbody>', 1)
        assert run(text, '--crank', 'motor') == expected
    finally:
        resource.setrlimit(resource.RLIMIT_AS, limit)


@pytest.mark.parametrize('size', [1 << 24, (1 << 24) + 1])
def test_meshes_that_give_masses_have_a_limit(size, run, tmp_path):
    (tmp_path / 'parts').mkdir()
    (tmp_path / 'parts' / 'a.stl').write_bytes(bytes(size))
    model = MJCF.replace('type="cylinder" size="0.01 0.15"', 'type="mesh" mesh="a"')
    files = '<mesh name="a" file="a.stl"/>'
    model = model.replace('<worldbody>', f'<asset>{files}</asset><worldbody>')
    model = model.replace('<compiler ', '<compiler meshdir="parts" ')
    code, _, error = run(model, '--crank', 'motor', name='leg.xml')
    # MuJoCo refuses this file, too, which holds no triangles.
    assert (code, 'bytes of meshes' in error) == (2, size > 1 << 24)


def test_meshes_have_the_mass_of_mujoco_without_their_hulls():
    text = MJCF.replace(
        '<geom type="sphere" size="0.1"/>', '<geom type="mesh" mesh="m" name="g"/>'
    ).replace(
        '<inertial pos="0.1 0 0.1" mass="2" fullinertia="0.02 0.03 0.025 0.001 0.002 0.003"/>', ''
    )
    text = text.replace(
        '</mujoco>',
        '<asset><mesh name="m" builtin="sphere" params="2"/></asset>'
        '<contact><pair geom1="g" geom2="g2"/></contact></mujoco>',
    )
    text = text.replace('<geom type="box" size="0.1 0.1 0.1"/>', '<geom size="1" name="g2"/>')
    expected = mujoco.MjModel.from_xml_string(text)
    made = mjcf._compiled(mujoco.MjSpec.from_string(text), ())
    assert made.body_mass.tolist() == expected.body_mass.tolist()
    assert made.body_inertia.tolist() == expected.body_inertia.tolist()
    assert (expected.mesh_graphadr[0], made.mesh_graphadr[0]) == (0, -1)


def test_two_constraints_of_the_same_links_can_be_told_apart(run):
    one = '<connect name="{}" body1="rod" body2="shank" anchor="0.3 0.01 0.02"/>'
    pin = '<connect name="pin" site1="rod_tip" site2="lug"/>'
    alone, _ = run(MJCF.replace(pin, one.format('p')), '--crank', 'motor')
    both = MJCF.replace(pin, one.format('p') + pin)
    assert_refused(
        *run(both, '--crank', 'motor'), 'of (rod shank; rod_tip lug|rod_tip lug; rod shank)$'
    )
    chosen, _ = run(both, '--crank', 'motor', '--close', 'shank', 'rod')
    assert chosen == alone  # at the point of the constraint, not the links' origins
    twice = MJCF.replace(pin, one.format('p') + one.format('q'))
    assert same_linkage(run(twice, '--crank', 'motor')[0], alone)


def test_pose_where_all_links_are_in_line_names_the_crank(run):
    at = '--at', f'knee_motor={math.pi / 2}'
    assert_refused(*run(LEG, *CLOSE, *at), r'give --at knee_motor=VALUE, another value')


@pytest.mark.parametrize('model', ['urdf', 'sdf'])
def test_long_chains_are_read_in_linear_time(model, run):
    """A chain that is read in quadratic time would take minutes, or end in a recursion."""
    size = 4900
    if model == 'urdf':
        links = ''.join(
            f'<link name="n{i}"/><joint name="j{i}" type="fixed"><parent link="n{i + 1}"/>'
            f'<child link="n{i}"/></joint>'
            for i in range(size)
        )
        top = f'<joint name="x" type="fixed"><parent link="foot"/><child link="n{size}"/></joint>'
        text = LEG.replace('</robot>', f'{links}<link name="n{size}"/>{top}</robot>')
        assert run(text, *CLOSE)[0]['mechanism'] == 'drawing'
        return
    frames = ''.join(
        f'<frame name="f{i}" attached_to="a"><pose relative_to="f{i + 1}"/></frame>'
        for i in range(size)
    )
    frames += f'<frame name="f{size}" attached_to="a"/>'
    text = SDF.replace('</model>', f'{frames}</model>')
    assert run(text, '--crank', 'one', name='made.sdf')[0]['mechanism'] == 'drawing'


def test_a_model_with_too_many_links_is_refused(run):
    links = ''.join(
        f'<link name="n{i}"/><joint name="j{i}" type="fixed"><parent link="foot"/>'
        f'<child link="n{i}"/></joint>'
        for i in range(5001)
    )
    assert_refused(*run(LEG.replace('</robot>', f'{links}</robot>'), *CLOSE), 'at most 5000')
