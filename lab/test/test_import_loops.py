# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Robots with one or several loops on one motor, compared with MuJoCo's kinematics and dynamics.

A model is made from a random mechanism, with up to three dyads: its bodies have random frames in a
tilted plane, its tree is random, and each joint has a `ref`.
"""

import cmath
import math
import re
from dataclasses import replace
from typing import NamedTuple
from xml.etree import ElementTree as ET

import mujoco  # required by these tests: without it they must fail, not be skipped
import numpy as np
import pytest
from robots import Tree, numbers, pose, random_rotation
from ros_harness import assert_refused, verified
from test_drawing import place_of, random_machine
from test_import import joints_of

from linkage_lab.robots import import_tool
from linkage_lab.robots.import_tool import read_robot
from linkage_lab.robots.loops import Request
from linkage_lab.robots.robot_drawing import draw_robot
from linkage_ros import Conditions, ConfigurationError, SliderCrank, Solver, load, read_log
from linkage_ros.mechanism.axes import axes_of
from linkage_ros.programs.record import record
from linkage_ros.settings.yaml_file import read_parameter_file

SEEDS = 40  # 480 were tried once
# Names that parameters cannot have.
NAMES = 'y', 'world', '3rd', 'left-knee', 'a__b', 'off', 'frame', 'Пята', '_', 'left/knee'


class Model(NamedTuple):
    """A model in MJCF.

    Attributes:
        text: The model.
        driven: Name of the driven joint.
        at: Joint values at which the loops are closed.
        closes: Names of the bodies that each closure joins.
        pins: Places of the pins in the world, shape (n, 3).
    """

    text: str
    driven: str
    at: dict
    closes: list
    pins: np.ndarray


def connections(solver, q):
    """Returns name, bodies, place and direction of each joint; the direction of a pin is None."""
    structure, found = solver.structure, []
    state, links = solver.state(q), solver.structure.links
    for pin in structure.pins:
        place = place_of(solver, q, structure.points[pin.name])
        found.append((pin.name, pin.first, pin.second, place, None))
    for j, link in enumerate(links):
        if link.slides:
            spin, angle = axes_of(links, j)
            way = cmath.rect(1.0, (angle or 0.0) + (0.0 if spin is None else state.position[spin]))
            place = next(x[3] for x in found if j in x[1:3])
            found.append((f'{link.name} slide', link.parent, j, place, way))
    return found


def made(mechanism, q, random):
    """Returns a model of a mechanism at a position."""
    solver = Solver(mechanism)
    structure, links = solver.structure, solver.structure.links
    joints = connections(solver, q)
    driven = next(
        x for x in joints
        if structure.driven in x[1:3] and (x[4] is not None) == structure.driven_link.slides
        and (None in x[1:3] or structure.driven_link.slides)
    )  # fmt: skip
    order = [joints[i] for i in random.permutation(len(joints))]
    order.sort(key=lambda x: (x is not driven, x[4] is None))
    top, tree, closures = {}, [], []

    def root(body):
        while body in top:
            body = top[body]
        return body

    for joint in order:
        one, other = (root(body) for body in joint[1:3])
        (tree if one != other else closures).append(joint)
        if one != other:
            top[other] = one
    plane = pose(random_rotation(random), random.normal(size=3))

    def space(place):
        return (plane @ (place.real, place.imag, 0.3, 1.0))[:3]

    names = [f'{NAMES[j % len(NAMES)]} {j}' if j % 3 else NAMES[j] for j in range(len(links))]
    model = ET.Element('mujoco')
    ET.SubElement(model, 'compiler', angle='radian')
    bodies = {None: (ET.SubElement(model, 'worldbody'), np.eye(4))}
    at = {}
    while tree:
        joint = next(x for x in tree if len({x[1], x[2]} & {*bodies}) == 1)
        tree.remove(joint)
        name, near, far, place, way = joint
        near, far = (near, far) if near in bodies else (far, near)
        own = pose(random_rotation(random), space(place) + random.normal(size=3))
        element = ET.SubElement(bodies[near][0], 'body', name=names[far])
        placed(element, np.linalg.inv(bodies[near][1]) @ own)
        bodies[far] = element, own
        axis = plane[:3, 2] if way is None else space(way) - space(0j)
        at[name] = float(random.normal())
        ET.SubElement(
            element, 'joint', name=name, type='hinge' if way is None else 'slide',
            axis=numbers(own[:3, :3].T @ axis * random.choice((-1, 1))), ref=repr(at[name]),
            pos=numbers((np.linalg.inv(own) @ (*space(place), 1.0))[:3]),
        )  # fmt: skip
        points = random.normal(size=(4, 3)) * 0.05
        mass = float(random.uniform(0.1, 3))
        I = mass * (np.sum(points**2) * np.eye(3) - points.T @ points)
        six = numbers([I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2]])
        center = random.normal(size=3) * 0.1
        if links[far].is_guided:  # in its pin, as torque does not depend on it
            center = (np.linalg.inv(own) @ (*space(place), 1.0))[:3]
        ET.SubElement(element, 'inertial', pos=numbers(center), mass=repr(mass), fullinertia=six)
    equality, closes = ET.SubElement(model, 'equality'), []
    for name, one, other, place, _ in closures:
        ends = f'{name} one', f'{name} other'
        for end, body in zip(ends, (one, other), strict=True):
            element, own = bodies[body]
            inside = (np.linalg.inv(own) @ (*space(place), 1.0))[:3]
            ET.SubElement(element, 'site', name=f'{end}_site', pos=numbers(inside))
        ET.SubElement(
            equality, 'connect', name=name, site1=f'{ends[0]}_site', site2=f'{ends[1]}_site'
        )
        closes.append(ends)
    pins = np.array([space(x[3]) for x in joints if x[4] is None])
    return Model(ET.tostring(model, encoding='unicode'), driven[0], at, closes, pins)


def placed(element, made):
    """Sets position and axes of an element; MJCF writes axes as columns x and y."""
    element.set('pos', numbers(made[:3, 3]))
    element.set('xyaxes', numbers(made[:3, :2].T.ravel()))


def machine(seed):
    """Returns a random mechanism with at most three dyads, and a position."""
    mechanism, q, *_ = random_machine(seed)
    mechanism = replace(mechanism, dyads=mechanism.dyads[: seed % 4], points=())
    if isinstance(mechanism, SliderCrank) and seed % 2:
        state = Solver(mechanism).state(q)
        mechanisms = [replace(mechanism, input='slider', assembly=x) for x in ('open', 'crossed')]
        q = state.position[2]
        mechanism = next(
            x for x in mechanisms
            if abs(Solver(replace(x, dyads=())).state(q).position[0] - state.position[0]) < 1e-6
        )  # fmt: skip
    return mechanism, q


@pytest.mark.parametrize('seed', range(SEEDS))
def test_random_loops_have_the_pose_and_torque_of_mujoco(seed, tmp_path):
    random = np.random.default_rng(seed)
    model = made(*machine(seed), random)
    path = tmp_path / 'robot.xml'
    path.write_text(model.text)
    near = seed % 2 * 0.02  # else the given pose is closed
    at = {name: value + near * random.uniform(-1, 1) for name, value in model.at.items()}
    at[model.driven] = model.at[model.driven]
    found = draw_robot(read_robot(path), Request(model.driven, at=at))
    compare_with_mujoco(path, model.closes, found)
    origin, x, y, normal = found.axes
    places = [
        origin + value[0] * x + value[1] * y
        for name, value in found.values.items() if name.startswith('drawing.pins.')
    ]  # fmt: skip
    for pin in model.pins:
        apart = [pin - place for place in places]
        assert min(np.linalg.norm(z - (z @ normal) * normal) for z in apart) < 1e-9


def compare_with_mujoco(path, closes, found):
    """Compares pose and torque as drawn with those of MuJoCo's tree.

    Args:
        path: The model.
        closes: Pairs of links with sites named after them, which meet.
        found: The imported drawing.
    """
    rate, change = 2.0, 3.0  # of the driven link
    solver = Solver(found.mechanism)
    state = solver.state(found.mechanism.drawn.position, rate, change)
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    rows = joints_of(found, solver, state)
    for joint, values in rows.items():
        at = model.joint(joint)
        data.qpos[at.qposadr], data.qvel[at.dofadr], data.qacc[at.dofadr] = values
    acceleration, efforts = data.qacc.copy(), np.zeros(model.nv)
    mujoco.mj_fwdPosition(model, data)
    mujoco.mj_fwdVelocity(model, data)
    data.qacc[:] = acceleration
    for close in closes:
        gap = data.site(f'{close[0]}_site').xpos - data.site(f'{close[1]}_site').xpos
        assert math.hypot(*gap) < 1e-9 * found.size
    mujoco.mj_rne(model, data, 1, efforts)
    powers = efforts * data.qvel
    error = abs(state.torque - powers.sum() / rate)
    assert error < 1e-9 * max(abs(powers) / rate)


# ---------------------------------------------------------------- two loops of a leg

ZEROS = 'ixy="0" ixz="0" iyz="0"'
LINKS = {  # place of the joint in the parent, mass, and centre
    'motor-arm': ('root', 'knee motor', '0 0 0', 0.15, '0.025 0 0'),
    'rod_1': ('motor-arm', 'y', '0.05 0.01 0', 0.1, '0.05 0 -0.04'),
    'thigh': ('root', 'thigh_joint', '0.12 0.02 -0.02', 1.0, '0 0 -0.15'),
    'rod_2': ('root', 'rod_2_joint', '0.06 0.03 -0.04', 0.12, '0 0 -0.14'),
    'shank': ('thigh', 'knee', '0 0 -0.3', 0.6, '0 0 -0.15'),
    'toe': ('shank', 'toe_joint', '0 0 -0.3', 0.05, '0 0 0'),
}
FIXED = {  # links without a joint of their own: parent and place
    'rod_1_tip': ('rod_1', '0.09 0 -0.08'), 'thigh_lug': ('thigh', '0.02 -0.01 -0.06'),
    'rod_2_tip': ('rod_2', '0.01 0 -0.27'), 'shank_lug': ('shank', '-0.05 0 0.01'),
    'sensor': ('rod_1', '0.01 0 0'),
}  # fmt: skip


def leg(**changes):
    """Returns a URDF of a leg with two loops; `changes` replace joints by other kinds."""
    parts = ['<link name="root"/>']
    for link, (parent, name, place, mass, center) in LINKS.items():
        kind = changes.get(name, 'continuous')
        parts.append(
            f'<link name="{link}"><inertial><origin xyz="{center}"/><mass value="{mass}"/>'
            f'<inertia ixx="1e-3" iyy="{mass / 100}" izz="1e-3" {ZEROS}/></inertial></link>'
            f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{link}"/>'
            f'<origin xyz="{place}"/><axis xyz="0 1 0"/></joint>'
        )
    for link, (parent, place) in FIXED.items():
        parts.append(
            f'<link name="{link}"><inertial><mass value="0.02"/><inertia ixx="1e-6" iyy="1e-6" '
            f'izz="1e-6" {ZEROS}/></inertial></link><joint name="{link}_weld" type="fixed">'
            f'<parent link="{parent}"/><child link="{link}"/><origin xyz="{place}"/></joint>'
        )
    return f'<robot name="leg">{"".join(parts)}</robot>'


FIRST, SECOND = ('rod_1_tip', 'thigh_lug'), ('rod_2_tip', 'shank_lug')
BOTH = '--close', *FIRST, '--close', *SECOND


@pytest.fixture
def run(called, tmp_path):
    """Imports the leg; returns the parameters and the output, or exit code and messages."""

    def start(*arguments, text=None, name='leg.urdf'):
        path, out = tmp_path / name, tmp_path / 'leg.yaml'
        path.write_text(text or leg())
        code, printed, error = called(import_tool, path, '-o', out, '--overwrite', *arguments)
        return (read_parameter_file(out), printed + error) if code == 0 else (code, printed, error)

    return start


def test_two_loops_on_a_swinging_hip_have_the_torque_of_the_whole_robot(tmp_path):
    text = leg().replace('"root"', '"pelvis"').replace(
        '<link name="pelvis"/>',
        '<link name="root"/><link name="pelvis"/><joint name="hip" type="continuous"><parent '
        'link="root"/><child link="pelvis"/><origin xyz="0.3 0 0.5"/><axis xyz="0 -1 0"/></joint>',
    )  # fmt: skip
    path = tmp_path / 'leg.urdf'
    path.write_text(text)
    request = Request('knee motor', [FIRST, SECOND], world='root')
    found, tree, hip = draw_robot(read_robot(path), request), Tree(text), (0.7, 5.0, 40.0)
    tree.inertials.pop('toe')  # beyond a joint that is in no loop
    solver = Solver(found.mechanism, pivot=found.values['frame_joint.pivot'])
    turned = tuple(found.values['frame_joint.ratio'] * x for x in hip)
    under = Conditions(frame=turned)
    for move in np.linspace(-1, 1, 9):
        state = solver.state(found.mechanism.drawn.position + move, 2.0, 30.0, under=under)
        rows = joints_of(found, solver, state) | {'hip': hip}
        q, u, a = (dict(zip(rows, row, strict=True)) for row in zip(*rows.values(), strict=True))
        for close in (FIRST, SECOND):
            assert flat_gap(tree, q, close) < 1e-12
        power = tree.power(q, u, a, along={**u, 'hip': 0.0})
        assert state.torque == pytest.approx(power / 2.0, rel=1e-11)


def flat_gap(tree, q, close):
    """Returns the distance of two links in the plane, m."""
    places = [tree.moving(q)[link][0][:3, 3] for link in close]
    return float(np.linalg.norm((places[0] - places[1])[[0, 2]]))


def test_names_that_parameters_cannot_have_are_replaced_and_kept_as_names_of_joints(run):
    values, _ = run('--crank', 'knee motor', *BOTH)
    assert values['drawing.input'] == 'motor_arm'
    assert values['joints.motor_arm.name'] == 'knee motor'
    assert values['joints.rod_1.name'] == 'y'
    assert {'drawing.pins.knee_motor', 'drawing.pins.pin_y'} <= values.keys()


def test_a_branch_is_lumped_if_it_is_fixed_and_left_out_with_a_note_if_it_moves(run):
    values, printed = run('--crank', 'knee motor', *BOTH)
    assert values['drawing.links.rod_1.mass'] == pytest.approx(0.14)  # with tip and sensor
    assert values['drawing.links.shank.mass'] == pytest.approx(0.62)
    assert 'toe_joint moves relative to shank, but is in no loop' in printed
    fixed, printed = run('--crank', 'knee motor', *BOTH, text=leg(toe_joint='fixed'))
    assert fixed['drawing.links.shank.mass'] == pytest.approx(0.67)
    assert 'toe_joint' not in printed


def test_a_loop_that_another_drives_may_be_left_out(run):
    values, printed = run('--crank', 'knee motor', '--close', *FIRST)
    assert 'drawing.links.shank.mass' not in values
    assert 'knee moves relative to thigh, but is in no loop' in printed


def test_loops_of_two_motors_are_refused(run):
    five = 'rod_1_tip', 'shank_lug'  # with the thigh: a five-bar
    assert_refused(*run('--crank', 'knee motor', '--close', *five), 'have 2 .* cannot be imported')
    assert_refused(
        *run('--crank', 'knee motor', '--close', *FIRST, '--close', 'rod_2_tip', 'root'),
        'of rod_2_joint: it shares no joint .* write two files',
    )
    assert_refused(*run('--crank', 'toe_joint', *BOTH), 'must contain the crank')


def test_a_closure_too_many_is_refused_with_those_to_choose_from(run):
    third = '--close', 'sensor', 'shank'
    assert_refused(*run('--crank', 'knee motor', *BOTH, *third), 'have -1 .*sensor shank')


def test_a_written_file_records_and_verifies(run, tmp_path):
    run('--crank', 'knee motor', *BOTH)
    file, log = tmp_path / 'leg.yaml', tmp_path / 'leg.mcap'
    with pytest.raises(ConfigurationError) as error:
        record(load(str(file)), str(log))
    (law,) = re.findall('motion: {.*}', str(error.value))
    text = file.read_text()
    file.write_text(text.replace('drive: "follow"', f'drive: motion\n    {law}'))
    record(load(str(file)), str(log), duration=1.0)
    assert verified(log).ulp == 0
    assert 'knee motor.position' in read_log(log)['/joint_states']
