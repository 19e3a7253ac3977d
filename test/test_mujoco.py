# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The driving torque against an independent engine, MuJoCo, on random mechanisms.

MuJoCo closes loops softly, so it is given the open tree, cut at the pin B. Its inverse dynamics
tells which forces the tree's joints need for a motion; its own Jacobians of the two points that
meet at B tell how much of them the crank has to bring once the loop is closed. Nothing but the
motion (places, rates, accelerations) comes from linkage_ros, and the engine has to find that the
loop stays closed under it.
"""

from __future__ import annotations

import math
from dataclasses import replace
from xml.etree import ElementTree as ET

import mujoco  # the proof rests on it: without it this file fails, it does not skip
import numpy as np
import pytest

from linkage_ros import (
    Body,
    Coupler,
    FourBar,
    Frame,
    Guide,
    Slider,
    SliderCrank,
    Solver,
)
from linkage_ros.parameters.configuration import load
from linkage_ros.parameters.presets import preset_names
from linkage_ros.units import radians_per_second
from linkage_ros.wire.urdf import make_urdf

# What the project promises of the torque, and ten times what is seen: both as a part of the
# largest torque over the turn.
PROMISED = 1e-9
TORQUE = 5e-14
# The loop's gap at B: as a part of the lengths, and of those times speed and acceleration.
CLOSED = 2e-14
COUNT = 8
CRANKS = 2 * math.pi * (np.arange(12) + 0.3) / 12 - 5.0


# ---------------------------------------------------------------- random mechanisms


def four_bar(random):
    """Crank-rockers and double-cranks, not too close to a change point."""
    while True:
        lengths = random.uniform(0.3, 3.0, 4)
        short, middle, long, longest = sorted(lengths)
        crank, coupler, rocker, frame = lengths
        if short + longest < 0.97 * (middle + long) and short in {crank, frame}:
            break
    unit = 10 ** random.uniform(-2, 1)
    crank, coupler, rocker, frame = (unit * lengths).tolist()
    return FourBar(
        Frame(frame, random.uniform(-7, 7)),
        body(random, Body, crank),
        body(random, Coupler, coupler),
        body(random, Body, rocker),
        assembly(random),
        gravity(random),
    )


def slider_crank(random):
    """The crank turns fully, the guide lies on either side of its pivot, in any direction."""
    unit = 10 ** random.uniform(-2, 1)
    crank, offset = unit * random.uniform(0.3, 2), unit * random.uniform(-2, 2)
    coupler = (crank + abs(offset)) * random.uniform(1.03, 3)
    return SliderCrank(
        body(random, Body, crank),
        body(random, Coupler, coupler),
        Slider(
            offset,
            random.uniform(0.1, 5),
            random.uniform(-50, 50) * unit,
            random.uniform(0.1, 10),
        ),
        Guide(random.uniform(-7, 7)),
        assembly(random),
        gravity(random),
    )


def body(random, cls, length):
    mass = random.uniform(0.1, 5)
    center = tuple((length * random.uniform(-1, 1, 2)).tolist())
    return cls(length, mass, mass * length**2 * random.uniform(0.02, 0.5), center)


def assembly(random):
    return ('open', 'crossed')[random.integers(2)]


def gravity(random):
    pull, angle = random.uniform(1, 20), random.uniform(0, 2 * math.pi)
    return pull * math.cos(angle), pull * math.sin(angle)


KINDS = {'four_bar': four_bar, 'slider_crank': slider_crank}


def draw(kind, number):
    """A mechanism and the speed and acceleration of its crank."""
    random = np.random.default_rng([sorted(KINDS).index(kind), number])
    mechanism = KINDS[kind](random)
    direction = random.choice([-1, 1])
    return mechanism, direction * random.uniform(3, 30), random.uniform(-200, 200)


# ---------------------------------------------------------------- as the engine reads them


def mjcf(mechanism):
    """The open tree in MuJoCo's own language, written from the mechanism's numbers alone."""
    root = ET.Element('mujoco')
    ET.SubElement(root, 'compiler', angle='radian')
    ET.SubElement(root, 'option', gravity=text(*mechanism.gravity, 0.0))
    world = ET.SubElement(root, 'worldbody')
    hinge = {'type': 'hinge', 'axis': '0 0 1'}
    crank = add_body(world, 'crank', mechanism.crank, (0.0, 0.0), hinge)
    add_body(crank, 'coupler', mechanism.coupler, (mechanism.crank.length, 0.0), hinge)
    angle = mechanism.frame.angle
    if isinstance(mechanism, FourBar):
        length = mechanism.frame.length
        pivot = length * math.cos(angle), length * math.sin(angle)
        add_body(world, 'rocker', mechanism.rocker, pivot, hinge)
    else:
        slider = mechanism.slider
        foot = -slider.offset * math.sin(angle), slider.offset * math.cos(angle)
        slide = {'type': 'slide', 'axis': '1 0 0', 'damping': text(slider.damping)}
        # It does not turn: its moment of inertia is any that the engine takes.
        block = Body(1.0, slider.mass, slider.mass)
        add_body(world, 'slider', block, foot, slide).set('euler', text(0.0, 0.0, angle))
    return ET.tostring(root, encoding='unicode')


def add_body(parent, name, body, place, joint):
    element = ET.SubElement(parent, 'body', name=name, pos=text(*place, 0.0))
    ET.SubElement(element, 'joint', joint, name=name)
    inertia = body.inertia / 2, body.inertia / 2, body.inertia
    numbers = {'mass': text(body.mass), 'diaginertia': text(*inertia)}
    ET.SubElement(element, 'inertial', numbers, pos=text(*body.center, 0.0))
    return element


def text(*numbers):
    return ' '.join(repr(float(number)) for number in numbers)


def urdf(mechanism):
    """Our URDF, with what URDF does not say and the engine has to know."""
    robot = ET.fromstring(make_urdf(mechanism))
    if isinstance(mechanism, SliderCrank):
        joint = robot.find("joint[@name='slider']")
        ET.SubElement(joint, 'dynamics', damping=text(mechanism.slider.damping))
    extension = ET.SubElement(robot, 'mujoco')
    ET.SubElement(extension, 'option', gravity=text(*mechanism.gravity, 0.0))
    return ET.tostring(robot, encoding='unicode')


SOURCES = {'mjcf': mjcf, 'urdf': urdf}


class Engine:
    """A mechanism in MuJoCo."""

    def __init__(self, mechanism, source):
        self.model = mujoco.MjModel.from_xml_string(SOURCES[source](mechanism))
        self.data = mujoco.MjData(self.model)
        self.force = np.zeros(3)
        if isinstance(mechanism, SliderCrank):
            angle, self.output, reach = mechanism.frame.angle, 'slider', 0.0
            self.force[:2] = math.cos(angle), math.sin(angle)
            self.force *= mechanism.slider.force
        else:
            self.output, reach = 'rocker', mechanism.rocker.length
        self.ends = {'coupler': mechanism.coupler.length, self.output: reach}
        names = [self.model.joint(number).name for number in range(self.model.njnt)]
        assert names == ['crank', 'coupler', self.output]
        assert self.model.nv == self.model.nq == 3

    def inverse(self, position, velocity, acceleration):
        """The driving torque for a motion of the closed loop, and the gaps between the two B.

        Returns:
            N m; m, m/s and m/s^2.
        """
        model, data = self.model, self.data
        for mine, given in (
            (data.qpos, position), (data.qvel, velocity), (data.qacc, acceleration),
        ):  # fmt: skip
            mine[:] = given
            mine[1] -= given[0]  # the joint between crank and coupler
        mujoco.mj_inverse(model, data)
        # What the joints need, less what the external force on the slider brings.
        output, pushed = model.joint(self.output).bodyid[0], np.zeros(3)
        center = data.xipos[output]
        mujoco.mj_applyFT(model, data, self.force, np.zeros(3), center, output, pushed)
        needed = data.qfrc_inverse - pushed
        (here, jacobian, drift), (there, other, other_drift) = map(self._end, self.ends)
        loop, drift = (jacobian - other)[:2], (drift - other_drift)[:2]
        # The joints' rates per crank speed that keep the loop closed, and their virtual power.
        rates = np.array([1.0, *np.linalg.solve(loop[:, 1:], -loop[:, 0])])
        gaps = (here - there)[:2], loop @ data.qvel, loop @ data.qacc + drift @ data.qvel
        return rates @ needed, [np.hypot(*gap) for gap in gaps]

    def _end(self, name):
        """Where B is on a body, its Jacobian and the Jacobian's rate."""
        model, data, number = self.model, self.data, self.model.joint(name).bodyid[0]
        jacobian, rate = np.zeros((2, 3, 3))
        turned = data.xmat[number].reshape(3, 3)
        point = data.xpos[number] + turned @ [self.ends[name], 0.0, 0.0]
        mujoco.mj_jac(model, data, jacobian, None, point, number)
        mujoco.mj_jacDot(model, data, rate, None, point, number)
        return point, jacobian, rate


def compare(mechanism, told, source, speed, acceleration):
    """Compares torques over the turn, and sees whether the loop stays closed.

    Args:
        mechanism: What linkage_ros solves.
        told: What the engine is told: the same, but for deliberate slips.
        source: 'mjcf' or 'urdf'.
        speed: Of the crank, rad/s.
        acceleration: Of the crank, rad/s^2.

    Returns:
        The largest difference in torque as a part of the largest torque over the turn; the
        largest gaps in position, velocity and acceleration as parts of `scales`.
    """
    engine, solver = Engine(told, source), Solver(mechanism)
    turn = solver.state(np.linspace(0, 2 * math.pi, 361), speed, acceleration)
    largest = np.max(np.abs(turn.torque))
    error, gap = 0.0, np.zeros(3)
    for crank in CRANKS.tolist():
        state = solver.state(crank, speed, acceleration)
        torque, gaps = engine.inverse(*state[:3])
        error = max(error, abs(torque - state.torque) / largest)
        gap = np.maximum(gap, gaps / scales(mechanism, speed, acceleration))
    return error, gap


def scales(mechanism, speed, acceleration):
    """What gaps in position, velocity and acceleration are compared with."""
    size = mechanism.crank.length + mechanism.coupler.length
    return size * np.array([1, abs(speed), speed**2 + abs(acceleration)])


def slipped(instance, name, part):
    """A mechanism with one number too large by a part of itself; its dotted name says which."""
    first, _, rest = name.partition('.')
    value = getattr(instance, first)
    if rest:
        changed = slipped(value, rest, part)
    elif isinstance(value, tuple):
        changed = value[0], value[1] * (1 + part)
    else:
        changed = value * (1 + part)
    return replace(instance, **{first: changed})


# ---------------------------------------------------------------- the proof


@pytest.mark.parametrize('source', SOURCES)
@pytest.mark.parametrize('number', range(COUNT))
@pytest.mark.parametrize('kind', KINDS)
def test_torque_is_the_engines(kind, number, source):
    mechanism, speed, acceleration = draw(kind, number)
    error, gap = compare(mechanism, mechanism, source, speed, acceleration)
    assert np.all(gap < CLOSED)
    assert error < TORQUE < PROMISED


def test_mechanisms_are_of_every_sort():
    for kind in KINDS:
        mechanisms, speeds, accelerations = zip(
            *(draw(kind, n) for n in range(COUNT)), strict=True
        )
        classes = {Solver(mechanism).mobility.grashof for mechanism in mechanisms}
        if kind == 'four_bar':
            assert classes == {'crank-rocker', 'double-crank'}
        else:
            assert classes == {'crank-slider'}
            for name in ('offset', 'force'):
                assert len({getattr(m.slider, name) > 0 for m in mechanisms}) == 2
        assert {mechanism.assembly for mechanism in mechanisms} == {'open', 'crossed'}
        for values in (speeds, accelerations, *zip(*(m.gravity for m in mechanisms), strict=True)):
            assert min(values) < 0 < max(values)
        for direction in (math.cos, math.sin):
            angles = [direction(mechanism.frame.angle) for mechanism in mechanisms]
            assert min(angles) < -0.5 < 0.5 < max(angles)


# ---------------------------------------------------------------- that it would notice


@pytest.mark.parametrize('source', SOURCES)
@pytest.mark.parametrize('kind', KINDS)
def test_slip_of_1e_7_in_a_mass_breaks_the_promise(kind, source):
    for number in range(COUNT):
        mechanism, speed, acceleration = draw(kind, number)
        wrong = slipped(mechanism, 'coupler.mass', 1e-7)
        error, gap = compare(mechanism, wrong, source, speed, acceleration)
        assert error > PROMISED
        assert np.all(gap < CLOSED)


BODY = ['mass', 'inertia', 'center']
LOADS = [f'{body}.{what}' for body in ('crank', 'coupler') for what in BODY] + ['gravity']
ROCKER = [f'rocker.{what}' for what in BODY]
SLIDER = ['slider.mass', 'slider.force', 'slider.damping']
LENGTHS = ['crank.length', 'coupler.length', 'frame.angle']


@pytest.mark.parametrize('source', SOURCES)
@pytest.mark.parametrize(
    ('kind', 'name'),
    [('four_bar', name) for name in LOADS + ROCKER]
    + [('slider_crank', name) for name in LOADS + SLIDER],
)
def test_slip_of_1e_9_in_any_load_is_seen(kind, name, source):
    mechanism, speed, acceleration = draw(kind, 1)
    wrong = slipped(mechanism, name, 1e-9)
    error, gap = compare(mechanism, wrong, source, speed, acceleration)
    assert error > TORQUE
    assert np.all(gap < CLOSED)


@pytest.mark.parametrize('source', SOURCES)
@pytest.mark.parametrize(
    ('kind', 'name'),
    [('four_bar', name) for name in [*LENGTHS, 'rocker.length', 'frame.length']]
    + [('slider_crank', name) for name in [*LENGTHS, 'slider.offset']],
)
def test_slip_of_1e_11_in_any_length_opens_the_loop(kind, name, source):
    mechanism, speed, acceleration = draw(kind, 1)
    wrong = slipped(mechanism, name, 1e-11)
    _, gap = compare(mechanism, wrong, source, speed, acceleration)
    assert gap[0] > CLOSED


@pytest.mark.parametrize('link', [1, 2])
@pytest.mark.parametrize('order', [0, 1, 2], ids=['position', 'velocity', 'acceleration'])
@pytest.mark.parametrize('kind', KINDS)
def test_slip_of_1e_12_in_the_motion_opens_the_loop(kind, order, link):
    mechanism, speed, acceleration = draw(kind, 1)
    engine, scale = Engine(mechanism, 'mjcf'), scales(mechanism, speed, acceleration)
    motion = [list(row) for row in Solver(mechanism).state(0.7, speed, acceleration)[:3]]
    assert np.all(engine.inverse(*motion)[1] / scale < CLOSED)
    size = scale[0] if isinstance(mechanism, SliderCrank) and link == 2 else 1.0
    motion[order][link] += 1e-12 * scale[order] / scale[0] * size
    assert engine.inverse(*motion)[1][order] / scale[order] > CLOSED


# ---------------------------------------------------------------- the presets' URDF as it is


@pytest.mark.parametrize('prefix', ['', 'left_'])
@pytest.mark.parametrize('preset', preset_names())
def test_the_urdf_of_every_preset_loads(preset, prefix):
    mechanism = load(preset).mechanism
    model = mujoco.MjModel.from_xml_string(make_urdf(mechanism, prefix))
    joints = [model.joint(number).name for number in range(model.njnt)]
    assert joints == [f'{prefix}{joint.name}' for joint in mechanism.structure().links]
    bodies = {model.body(number).name for number in range(1, model.nbody)}
    assert bodies == {f'{joint}_link' for joint in joints}


@pytest.mark.parametrize('preset', [name for name in preset_names() if name != 'wind_pump'])
def test_small_masses_for_zeros_change_torques_by_less_than_a_millionth(preset):
    configuration = load(preset)
    mechanism, drive = configuration.mechanism, configuration.drive
    speed = radians_per_second(drive.rpm)
    error, gap = compare(mechanism, mechanism, 'urdf', speed, drive.crank_acceleration)
    assert error < 1e-6
    assert np.all(gap < CLOSED)


def test_the_engine_refuses_a_link_without_inertial():
    robot = ET.fromstring(make_urdf(load('slider_crank').mechanism))
    link = robot.find("link[@name='crank_link']")
    link.remove(link.find('inertial'))
    with pytest.raises(ValueError, match='mass and inertia of moving bodies must be larger'):
        mujoco.MjModel.from_xml_string(ET.tostring(robot, encoding='unicode'))
