# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Dyads on every possible carrier: recorded joints close every loop of the URDF and the MJCF.

The reader of URDF follows its specification alone; MuJoCo reads the MJCF, mcap the log.
"""

import cmath
import re
from dataclasses import replace
from xml.etree import ElementTree as ET

import mujoco
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from mechanisms import FULL, PUMPS, cylinder, four_bar, slider_crank

from linkage_lab.charts.mjcf import make_mjcf
from linkage_ros import Body
from linkage_ros.mechanism.dyads import Dyad, DyadSlider
from linkage_ros.messages.urdf import link_of, make_urdf
from linkage_ros.programs.record import record
from linkage_ros.quantities import flatten
from linkage_ros.run.states import Simulator
from linkage_ros.settings.configuration import configure

LARGEST = 150.0  # m, of the links
BASES = {
    'four_bar': four_bar(FULL['crank_rocker']),
    'slider_crank': slider_crank(FULL['offset_right'], 0.4),
    'wind_pump': PUMPS['pump'],
    'cylinder': cylinder((1, 2.5, 0.7)),
    'driven_cylinder': replace(cylinder((1, 2.5, 0.7)), input='cylinder', assembly='open'),
}


def with_dyads(base, carrier):
    """Adds dyads a and b, which carry others, and dyads c and d on a carrier and e towards it."""
    body, at = Body(45.0, 1.0, 0.1), (0.2, -0.3)
    far, slider = (40.0, 30.0), DyadSlider(1.0, (3.0, 8.0), 0.7)
    dyads = [
        Dyad(name='a', from_='crank', first=body, second=body, to='frame', to_at=far),
        Dyad(name='b', from_='crank', first=Body(60.0), slider=slider),
        Dyad(
            name='c', from_=carrier, from_at=at, first=Body(60.0), second=Body(60.0), to='frame',
            to_at=(70.0, -50.0),
        ),
        Dyad(name='d', from_=carrier, from_at=at, first=Body(150.0), slider=slider),
        Dyad(
            name='e', from_='frame', from_at=(70.0, -50.0), first=Body(60.0), second=Body(60.0),
            to=carrier, to_at=at,
        ),
    ]  # fmt: skip
    return replace(base, dyads=tuple(dyads))


def carriers(base):
    own = (link.name for link in base.structure().links)
    return [*own, 'a_first', 'a_second', 'b_first', 'b_slider']


def numbers(element, key):
    return [float(word) for word in element.get(key).split()]


def frames(urdf, joints, values, rates):
    """Places the links of a URDF.

    `joints` gives zero, ratio and parent of mapped joints. Returns the origin, the direction, the
    origin's velocity and the spin of each link.
    """
    robot, placed = ET.fromstring(urdf), {'base_link': (0j, 1 + 0j, 0j, 0.0)}
    for joint in robot.findall('joint'):
        name, kind = joint.get('name'), joint.get('type')
        place, axes, velocity, spin = placed[joint.find('parent').get('link')]
        x, y, _ = numbers(joint.find('origin'), 'xyz')
        yaw = numbers(joint.find('origin'), 'rpy')[2]
        zero, ratio, parent = joints.get(name, (0.0, 1.0, None))
        value, rate = values[name] / ratio + zero, rates[name] / ratio
        arm = complex(x, y) * axes
        place, velocity = place + arm, velocity + 1j * spin * arm
        axes *= cmath.rect(1.0, yaw)
        if kind == 'prismatic':
            slid = value * axes
            place, velocity = place + slid, velocity + rate * axes + 1j * spin * slid
        else:
            if parent:
                _, axes, _, spin = placed['base_link' if parent == 'frame' else link_of(parent)]
            axes, spin = axes * cmath.rect(1.0, value), spin + rate
        placed[joint.find('child').get('link')] = place, axes, velocity, spin
    return placed


def ends(mechanism):
    """Returns the links that meet in each loop, each with its length; 0 for a sliding link."""
    names = [link.name for link in type(mechanism).structure(replace(mechanism, dyads=())).links]
    first, last = ('crank', 'rod') if 'barrel' in names else names[-2:]
    added = [(x.name, 'second' if x.second else 'slider') for x in mechanism.dyads]
    pairs = [(first, last), *((f'{name}_first', f'{name}_{end}') for name, end in added)]
    slides = {link.name for link in mechanism.structure().links if link.slides}
    parts = mechanism.parts()
    return [[(x, 0.0 if x in slides else parts[x].length) for x in pair] for pair in pairs]


def recorded(configuration, path):
    """Returns positions and velocities by joint of each joint state."""
    record(configuration, path, duration=0.6)
    with path.open('rb') as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        return [
            (dict(zip(one.name, one.position, strict=True)),
             dict(zip(one.name, one.velocity, strict=True)))
            for _, channel, _, one in reader.iter_decoded_messages()
            if channel.topic.endswith('joint_states')
        ]  # fmt: skip


def configured(mechanism, joints):
    kind = re.sub(r'(?<!^)(?=[A-Z])', '_', type(mechanism).__name__).lower()
    values = {'mechanism': kind, **flatten(mechanism), 'rate_hz': 10.0, 'rpm': 20.0}
    if kind == 'wind_pump':
        del values['rpm']
    if values.get('input') == 'crank':
        del values['assembly']
    if mechanism.structure().driven_link.slides:
        del values['rpm']
        values |= {'drive': 'motion', 'motion.times': [0.0, 1.0], 'motion.positions': [2.0, 2.8]}
    for link, (zero, ratio, parent) in joints.items():
        values |= {f'joints.{link}.zero': zero, f'joints.{link}.ratio': ratio}
        values |= {f'joints.{link}.parent': parent} if parent else {}
    return configure(values)


@pytest.mark.parametrize('is_mapped', [False, True])
@pytest.mark.parametrize('name', BASES)
def test_recorded_joints_close_every_loop(name, is_mapped, tmp_path):
    for number, carrier in enumerate(carriers(BASES[name])):
        mechanism = with_dyads(BASES[name], carrier)
        joints = {}
        if is_mapped:
            joints = {
                'c_first': (0.4, -2.0, carrier), 'd_first': (-0.3, 0.5, 'frame'),
                'c_second': (1.1, 3.0, carrier), 'd_slider': (0.2, -1.5, None),
            }  # fmt: skip
        configuration = configured(mechanism, joints)
        states = recorded(configuration, tmp_path / f'{number}.mcap')
        assert len(states) > 2
        start = Simulator(configuration)
        model = None
        if not is_mapped:
            text = make_mjcf(mechanism, start.state(start.begin(0).at(0)))
            model = mujoco.MjModel.from_xml_string(text)
        for values, rates in states:
            placed = frames(make_urdf(mechanism), joints, values, rates)
            for pair in ends(mechanism):
                (one, speed), (other, its) = (
                    (place + length * axes, velocity + 1j * spin * length * axes)
                    for x, length in pair
                    for place, axes, velocity, spin in [placed[link_of(x)]]
                )
                assert abs(one - other) <= 1e-12 * LARGEST, (carrier, pair)
                assert abs(speed - its) <= 1e-12 * LARGEST * max(map(abs, rates.values())), pair
            if model is not None:
                assert_closed_in_mujoco(model, values, rates, carrier)


def assert_closed_in_mujoco(model, values, rates, carrier):
    data = mujoco.MjData(model)
    for joint, value in values.items():
        data.joint(joint).qpos[0], data.joint(joint).qvel[0] = value, rates[joint]
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    jacobian = np.zeros((2, 3, model.nv))
    for pair in zip(model.eq_obj1id, model.eq_obj2id, strict=True):
        gap = data.site_xpos[pair[0]] - data.site_xpos[pair[1]]
        assert np.hypot(*gap[:2]) <= 1e-12 * LARGEST, carrier
        for site, rows in zip(pair, jacobian, strict=True):
            mujoco.mj_jacSite(model, data, rows, None, site)
        apart = (jacobian[0] - jacobian[1])[:2] @ data.qvel
        assert np.hypot(*apart) <= 1e-12 * LARGEST * max(map(abs, rates.values())), carrier
