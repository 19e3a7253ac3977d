# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Random robots in MJCF, with a `ref` on each joint, compared with MuJoCo's own kinematics."""

import math
from contextlib import suppress
from xml.etree import ElementTree as ET

import mujoco  # required by these tests: without it they must fail, not be skipped
import numpy as np
import pytest
from robots import Tree, make_robot
from test_import import joints_of, pose_of, random_values

from linkage_lab.robots.import_tool import read_robot
from linkage_lab.robots.loops import Request
from linkage_lab.robots.robot_drawing import draw_robot
from linkage_ros import ConfigurationError
from linkage_ros.mechanism.solver import Solver

SEEDS = 60  # 300 were tried once, and 299 robots in URDF against Pinocchio 4.1


def numbers(values):
    return ' '.join(repr(float(x)) for x in np.ravel(values))


def placed(element, made):
    """Sets position and axes of an element; MJCF writes axes as columns x and y."""
    element.set('pos', numbers(made[:3, 3]))
    element.set('xyaxes', numbers(made[:3, :2].T))


def mjcf_of(text, random, refs, close):
    """Returns a URDF as MJCF with random inertias.

    Its joints have the value `refs` where those of the URDF are 0.
    """
    tree = Tree(text)
    root = ET.Element('mujoco')
    ET.SubElement(root, 'compiler', angle='radian')
    bodies = {'root': ET.SubElement(root, 'worldbody')}
    waiting = list(tree.joints)
    while waiting:
        name, kind, parent, child, inside, axis = joint = waiting.pop(0)
        if parent not in bodies:
            waiting.append(joint)
            continue
        body = bodies[child] = ET.SubElement(bodies[parent], 'body', name=child)
        placed(body, inside)
        if kind != 'fixed':
            ET.SubElement(
                body, 'joint', name=name, type='slide' if kind == 'prismatic' else 'hinge',
                axis=numbers(axis), ref=repr(refs[name]),
            )  # fmt: skip
        if child in close:
            ET.SubElement(body, 'site', name=f'{child}_site')
        if child in tree.inertials:
            pose, mass, _ = tree.inertials[child]
            points = random.normal(size=(4, 3)) * 0.05
            I = mass * (np.sum(points**2) * np.eye(3) - points.T @ points)
            six = numbers([I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2]])
            ET.SubElement(
                body, 'inertial', pos=numbers(pose[:3, 3]), mass=repr(mass), fullinertia=six
            )
    sites = {f'site{i}': f'{link}_site' for i, link in enumerate(close, 1)}
    ET.SubElement(ET.SubElement(root, 'equality'), 'connect', name='end', **sites)
    return ET.tostring(root, encoding='unicode')


def cylinder_values(random):
    """Returns parameters of a random cylinder or slotted lever."""
    r, d = random.uniform(0.2, 1.0, size=2)
    values = {
        'mechanism': 'inverted_slider_crank', 'crank.length': r, 'frame.length': d,
        'offset': random.uniform(-0.2, 0.2) * abs(d - r), 'stroke': (r + d) / 2,
        'frame.angle': random.uniform(-3, 3),
    }  # fmt: skip
    for link in ('crank', 'rod', 'barrel'):
        values[f'{link}.mass'], values[f'{link}.inertia'] = random.uniform(0.1, 3), 0.1
        values[f'{link}.center'] = tuple(random.normal(size=2) * 0.1)
    return values


def imported(random, seed, tmp_path):
    """Returns a random MJCF file, the ends of its loop, the driven joint and the linkage found."""
    is_cylinder = seed % 3 == 0
    if is_cylinder:
        values, cuts = cylinder_values(random), ('A', 'B0', 'A0')
    else:
        values, own = random_values(random)
        cuts = ('A', 'B', 'B0') if 'rocker.length' in values else ('A', 'B')
    cut = str(random.choice(cuts))
    made = make_robot(values, random, cut)
    refs = {name: float(random.normal()) for name, *_ in made.joints.values()}
    path = tmp_path / 'robot.xml'
    path.write_text(mjcf_of(made.text, random, refs, made.close))
    robot = read_robot(path)
    if not is_cylinder:
        pose = {name: value + refs[name] for name, value in pose_of(made, own).items()}
        driven = 'crank_motor'
        if 'slider' in made.joints and random.integers(2):
            driven = made.joints['slider'][0]
        return path, made.close, driven, draw_robot(robot, Request(driven, at=pose))
    driven = made.joints['rod' if cut == 'A0' or random.integers(2) else 'crank'][0]
    for _ in range(200):  # until the loop closes
        at = {name: random.uniform(-3, 3) for name in refs}
        if driven == made.joints['rod'][0]:
            at[driven] = refs[driven] + random.uniform(-0.3, 0.3) * values['stroke']
        with suppress(ConfigurationError):
            return path, made.close, driven, draw_robot(robot, Request(driven, at=at))
    return pytest.fail('the loop never closes')


@pytest.mark.parametrize('seed', range(SEEDS))
def test_random_mjcf_has_the_pose_and_torque_of_mujoco(seed, tmp_path):
    path, close, name, found = imported(np.random.default_rng(seed), seed, tmp_path)
    compare_with_mujoco(path, [close], name, found)


def compare_with_mujoco(path, closes, name, found, rate=2.0, change=3.0):
    """Compares pose and torque as drawn with those of MuJoCo's tree.

    Args:
        path: The model.
        closes: Pairs of links with sites named after them, which meet.
        name: Name of the driven joint.
        found: The imported drawing.
        rate: Rate of the driven link, rad/s or m/s.
        change: Acceleration of the driven link, rad/s^2 or m/s^2.
    """
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
