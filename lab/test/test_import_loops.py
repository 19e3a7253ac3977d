# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Robots with several loops on one motor, compared with MuJoCo's own kinematics and dynamics.

A model is made from a random mechanism with dyads: its bodies have random frames in a tilted plane,
its tree is random, and each joint has a `ref`.
"""

import cmath
import random as python_random
from dataclasses import replace
from typing import NamedTuple
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from robots import pose, random_rotation, rotated
from ros_harness import assert_refused
from test_drawing import place_of, random_machine
from test_import_random import compare_with_mujoco, numbers, placed

from linkage_lab.robots import import_tool
from linkage_lab.robots.import_tool import read_robot
from linkage_lab.robots.loops import Request
from linkage_lab.robots.robot_drawing import draw_robot
from linkage_ros import Conditions, ConfigurationError, SliderCrank, Solver
from linkage_ros.mechanism.axes import axes_of

SEEDS = 40  # 600 were tried once
UP = np.array((0.0, 0.0, 1.0))
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
        ET.SubElement(
            element, 'inertial', pos=numbers(center), mass=repr(mass), fullinertia=six
        )
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


def machine(seed):
    """Returns a random mechanism with at most three dyads, and a position."""
    mechanism, q, *_ = random_machine(seed)
    mechanism = replace(mechanism, dyads=mechanism.dyads[:3], points=())
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
def test_loops_that_share_links_have_pose_and_torque_of_mujoco(seed, tmp_path):
    random = np.random.default_rng(seed)
    model = made(*machine(seed), random)
    path = tmp_path / 'robot.xml'
    path.write_text(model.text)
    near = seed % 2 * 0.02  # else the given pose is closed
    at = {name: value + near * random.uniform(-1, 1) for name, value in model.at.items()}
    at[model.driven] = model.at[model.driven]
    found = draw_robot(read_robot(path), Request(model.driven, at=at))
    compare_with_mujoco(path, model.closes, model.driven, found)
    origin, x, y, normal = found.axes
    places = [
        origin + value[0] * x + value[1] * y
        for name, value in found.values.items() if name.startswith('drawing.pins.')
    ]  # fmt: skip
    for pin in model.pins:
        apart = [pin - place for place in places]
        assert min(np.linalg.norm(z - (z @ normal) * normal) for z in apart) < 1e-9
