# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Compares the driving torque with an independent engine, MuJoCo, which reads our URDF.

MuJoCo closes loops with soft constraints, so it simulates the open tree, cut at the pin B. Its
inverse dynamics gives the joint forces that the tree needs for a motion. With its own Jacobians of
the two points that meet at B, these forces are projected on the crank. Only the URDF and the
motion (positions, rates, accelerations) come from linkage_ros, and the engine must find that the
loop stays closed during this motion.
"""

import math
from dataclasses import replace
from xml.etree import ElementTree as ET

import mujoco  # required by these tests: without it they must fail, not be skipped
import numpy as np
import pytest
from mechanisms import ALL, coordinates, longest

from linkage_ros import InvertedSliderCrank, LinkLoad, SliderCrank, Solver
from linkage_ros.messages.joints import carrier_axes
from linkage_ros.messages.urdf import make_urdf
from linkage_ros.motion.drives.speed import SpeedDrive
from linkage_ros.quantities import build, flatten
from linkage_ros.settings.configuration import load
from linkage_ros.settings.presets import preset_names
from linkage_ros.units import radians_per_second

# Promised accuracy of the torque, and ten times the measured error, both relative to the largest
# torque in the turn.
PROMISED = 1e-9
TORQUE = 5e-14
# The loop's gap at B, relative to the lengths, and to the lengths times speed and acceleration.
CLOSED = 2e-14
CRANKS = 2 * math.pi * (np.arange(12) + 0.3) / 12 - 5.0
NAMES = (
    'crank_rocker',
    'double_crank',
    'antiparallelogram',
    'offset_right',
    'centric',
    'document_4',
    'swinging_barrel',
    'turning_barrel',
    'swinging_barrel_driven',
    'turning_barrel_driven',
    'guide_on_coupler',
    'guide_on_slider',
    'guide_on_barrel',
    'guide_on_rod_of_driven_cylinder',
    'guide_on_moving_slider',
    'guide_on_slider_on_slider',
    'guide_on_barrel_of_dyad',
    'guide_on_rod_of_dyad',
    'barrel_on_coupler',
    'barrel_between_slider_and_coupler',
    'barrel_on_moving_slider',
)
MOTION = -11.0, 90.0


def own_load(mechanism):
    """Returns the load of the mechanism, or one that is 0."""
    return next(iter(mechanism.loads), LinkLoad('crank'))


def urdf(mechanism):
    """Returns our URDF with additional data that the engine requires."""
    robot = ET.fromstring(make_urdf(mechanism))
    for name in ('slider', 'rod'):
        if getattr(mechanism, name, None) is not None:
            joint = robot.find(f"joint[@name='{name}']")
            ET.SubElement(joint, 'dynamics', damping=repr(own_load(mechanism).damping))
    extension = ET.SubElement(robot, 'mujoco')
    ET.SubElement(extension, 'option', gravity='{} {} 0'.format(*mechanism.gravity))
    return ET.tostring(robot, encoding='unicode')


class Engine:
    """A mechanism in MuJoCo."""

    def __init__(self, mechanism):
        self.model = mujoco.MjModel.from_xml_string(urdf(mechanism))
        self.data = mujoco.MjData(self.model)
        self.force = np.zeros(3)
        if isinstance(mechanism, SliderCrank):
            angle, self.output, reach = mechanism.frame.angle, 'slider', 0.0
            self.force[:2] = math.cos(angle), math.sin(angle)
            self.force *= own_load(mechanism).force
        elif isinstance(mechanism, InvertedSliderCrank):
            self.output, reach = 'rod', 0.0
        else:
            self.output, reach = 'rocker', mechanism.rocker.length
        self.along, middle = 0.0, 'coupler'
        if self.output == 'rod':  # the loop is cut at A
            self.along, middle = own_load(mechanism).force, 'barrel'
            self.ends = [('crank', mechanism.crank.length), ('rod', 0.0)]
        else:
            self.ends = [('coupler', mechanism.coupler.length), (self.output, reach)]
        added = [name for dyad in mechanism.dyads for name in dyad.parts]
        for dyad in mechanism.dyads:
            if dyad.rod:
                self.ends += [(dyad.from_, complex(*dyad.from_at)), (f'{dyad.name}_rod', 0.0)]
            else:
                parts = dyad.parts.items()
                self.ends += [(x, getattr(part, 'length', 0.0)) for x, part in parts]
        # The engine has the joints in the order of its tree.
        self.joints = [self.model.joint(x).id for x in ('crank', middle, self.output, *added)]
        self.driven = self.joints[mechanism.structure().driven]
        assert self.model.nv == self.model.nq == 3 + len(added)
        # Each turning link that another carries is measured from it.
        links = mechanism.structure().links
        self.axes = [carrier_axes(links, link) for link in links]

    def inverse(self, position, velocity, acceleration):
        """Computes the driving torque for a motion of the closed loop, and the gaps at B.

        Returns:
            The torque, N m; the gaps in position, m, velocity, m/s, and acceleration, m/s^2.
        """
        model, data = self.model, self.data
        for mine, given in (
            (data.qpos, position), (data.qvel, velocity), (data.qacc, acceleration),
        ):  # fmt: skip
            mine[self.joints] = given
            for joint, (parent, guide) in zip(self.joints, self.axes, strict=True):
                mine[joint] -= 0.0 if parent is None else given[parent]
                mine[joint] -= guide if guide and given is position else 0.0
        mujoco.mj_inverse(model, data)
        # Forces that the joints need, minus the external force on the slider.
        output, pushed = model.joint(self.output).bodyid[0], np.zeros(model.nv)
        center = data.xipos[output]
        mujoco.mj_applyFT(model, data, self.force, np.zeros(3), center, output, pushed)
        needed = data.qfrc_inverse - pushed
        needed[self.joints[2]] -= self.along
        apart, loop, drift = map(np.concatenate, zip(*self._apart(), strict=True))
        # Rates per rate of the driven joint that keep the loop closed, for the virtual power.
        others = np.delete(loop, self.driven, axis=1)
        rates = np.insert(np.linalg.solve(others, -loop[:, self.driven]), self.driven, 1.0)
        gaps = apart, loop @ data.qvel, loop @ data.qacc + drift @ data.qvel
        return rates @ needed, [np.hypot(*gap.reshape(-1, 2).T).max() for gap in gaps]

    def _apart(self):
        """Yields the distance of the two ends of each loop, its Jacobian and that one's rate."""
        ends = [self._end(*end) for end in self.ends]
        for one, other in zip(ends[::2], ends[1::2], strict=True):
            yield [(x - y)[:2] for x, y in zip(one, other, strict=True)]

    def _end(self, name, at):
        """Computes the position of a point on a body, its Jacobian and the Jacobian's rate."""
        model, data = self.model, self.data
        number = 0 if name == 'frame' else model.joint(name).bodyid[0]
        jacobian, rate = np.zeros((2, 3, model.nv))
        turned = data.xmat[number].reshape(3, 3)
        point = data.xpos[number] + turned @ [at.real, at.imag, 0.0]
        mujoco.mj_jac(model, data, jacobian, None, point, number)
        mujoco.mj_jacDot(model, data, rate, None, point, number)
        return point, jacobian, rate


def compare(mechanism, told, speed, acceleration):
    """Compares torques over a turn, and the gaps of the loop.

    Args:
        mechanism: Mechanism that linkage_ros solves.
        told: Mechanism that the engine simulates: equal, except for deliberate errors.
        speed: Crank speed, rad/s.
        acceleration: Crank acceleration, rad/s^2.

    Returns:
        The largest torque difference, relative to the largest torque; the largest gaps in
        position, velocity and acceleration, relative to typical values.
    """
    engine, solver = Engine(told), Solver(mechanism)
    size = longest(mechanism)
    scales = size * np.array([1, abs(speed), speed**2 + abs(acceleration)])
    (places,) = coordinates(mechanism, CRANKS)
    states = [solver.state(place, speed, acceleration) for place in places.tolist()]
    found = [engine.inverse(*state[:3]) for state in states]
    errors = [abs(torque - x.torque) for (torque, _), x in zip(found, states, strict=True)]
    gap = np.max([gaps for _, gaps in found], axis=0) / scales
    return max(errors) / max(abs(state.torque) for state in states), gap


def slipped(mechanism, name, part):
    """Returns a mechanism in which the number with a dotted name is increased by a fraction."""
    values = flatten(mechanism)
    number = np.multiply(values[name], 1 + part).tolist()
    return build(type(mechanism), {**values, name: number})


# ---------------------------------------------------------------- comparison


@pytest.mark.parametrize('name', NAMES)
def test_torque_agrees_with_mujoco(name):
    error, gap = compare(ALL[name], ALL[name], *MOTION)
    assert np.all(gap < CLOSED)
    assert error < TORQUE < PROMISED


BODIES = {'crank', 'coupler'}
WHAT = 'mass', 'inertia', 'center'
OTHERS = {
    'double_crank': (['rocker.mass', 'rocker.inertia', 'rocker.center'],
                     ['rocker.length', 'frame.length']),
    'swinging_barrel': (
        ['barrel.mass', 'barrel.inertia', 'barrel.center', 'rod.mass', 'rod.inertia',
         'rod.center', 'loads.link_1.force', 'loads.link_1.damping'],
        ['offset', 'frame.length'],
    ),
    'offset_right': (
        ['slider.mass', 'loads.link_1.force', 'loads.link_1.damping'], ['slider.offset'],
    ),
}  # fmt: skip


@pytest.mark.parametrize('name', OTHERS)
def test_errors_in_any_number_are_detected(name):
    """Negative control: a relative error of 1e-9 in a mass or load, or 1e-11 in a length."""
    loads, lengths = OTHERS[name]
    bodies = sorted(BODIES & vars(ALL[name]).keys())
    common = [f'{body}.{what}' for body in bodies for what in WHAT]
    for number in (*common, 'gravity', *loads):
        error, gap = compare(ALL[name], slipped(ALL[name], number, 1e-9), *MOTION)
        assert error > TORQUE, number
        assert np.all(gap < CLOSED)
    links = [f'{body}.length' for body in bodies]
    for number in (*links, 'frame.angle', *lengths):
        _, gap = compare(ALL[name], slipped(ALL[name], number, 1e-11), *MOTION)
        assert gap[0] > CLOSED, number


# ---------------------------------------------------------------- unmodified URDF of the presets


@pytest.mark.parametrize('preset', [name for name in preset_names() if name != 'wind_pump'])
def test_small_masses_in_place_of_zero_change_torques_by_less_than_a_millionth(preset):
    configuration = load(preset)
    # The engine has no loads.
    mechanism, drive = replace(configuration.mechanism, loads=()), configuration.drive
    speed, acceleration = 0.2, 0.3  # m/s, m/s^2
    if isinstance(drive, SpeedDrive):
        speed, acceleration = radians_per_second(drive.rpm), drive.crank_acceleration
    error, gap = compare(mechanism, mechanism, speed, acceleration)
    assert error < 1e-6
    assert np.all(gap < CLOSED)


def test_the_engine_refuses_a_link_without_inertial():
    robot = ET.fromstring(make_urdf(load('slider_crank').mechanism))
    link = robot.find("link[@name='crank_link']")
    link.remove(link.find('inertial'))
    with pytest.raises(ValueError, match='mass and inertia of moving bodies must be larger'):
        mujoco.MjModel.from_xml_string(ET.tostring(robot, encoding='unicode'))
