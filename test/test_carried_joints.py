# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Dyads on every possible carrier: joints of messages close every loop of the URDF and the MJCF.

The reader of URDF follows its specification alone; MuJoCo reads the MJCF, mcap the log. Labels of
tables and arrows of loads follow the same carriers.
"""

import cmath
import math
import re
from dataclasses import replace
from typing import NamedTuple
from xml.etree import ElementTree as ET

import mujoco
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from mechanisms import FULL, PUMPS, cylinder, four_bar, slider_crank

from linkage_lab.mjcf import make_mjcf
from linkage_ros import Barrel, Body, Rod
from linkage_ros.log.tables import write_csv
from linkage_ros.mechanism.dyads import Dyad, DyadSlider
from linkage_ros.mechanism.loads.pins import Pins
from linkage_ros.messages.joints import joint_rows
from linkage_ros.messages.urdf import link_of, make_urdf
from linkage_ros.programs.record import record
from linkage_ros.quantities import flatten
from linkage_ros.run.states import Simulator
from linkage_ros.settings.configuration import configure
from linkage_ros.view.load_arrows import LoadArrows

LARGEST = 4.5  # m, of the links
BASES = {
    'four_bar': four_bar(FULL['crank_rocker']),
    'slider_crank': slider_crank(FULL['offset_right'], 0.4),
    'wind_pump': PUMPS['pump'],
    'cylinder': cylinder((1, 2.5, 0.7)),
    'driven_cylinder': replace(cylinder((1, 2.5, 0.7)), input='cylinder', assembly='open'),
}


def with_dyads(base, carrier):
    """Adds dyads a, b, i and j, which carry others, and dyads on a carrier and towards it."""
    body, at, end = Body(3.5, 1.0, 0.1), (0.2, -0.3), (3.5, -2.5)
    slider = DyadSlider(1.0, (1.0, 2.5), 0.7)
    on_carrier = DyadSlider(1.0, (0.4, -0.2), 0.5, carrier, 0.1, (0.1, -0.2))
    cylinder = {'barrel': Barrel(1.0, 0.1), 'rod': Rod(1.0, 0.1), 'offset': 0.3}
    dyads = [
        Dyad(
            name='a',
            from_='crank',
            from_at=(0.4, 0.2),
            first=body,
            second=body,
            to='frame',
            to_at=(3.0, 3.5),
        ),
        Dyad(name='b', from_='crank', from_at=(0.4, 0.2), first=body, slider=slider),
        Dyad(name='c', from_=carrier, from_at=at, first=body, second=body, to='frame', to_at=end),
        Dyad(
            name='d',
            from_=carrier,
            from_at=at,
            first=Body(LARGEST),
            slider=replace(slider, angle=1.2),
        ),
        Dyad(name='e', from_='frame', from_at=end, first=body, second=body, to=carrier, to_at=at),
        Dyad(name='f', from_='frame', from_at=end, first=Body(9.0, 1.0, 0.1), slider=on_carrier),
        Dyad(name='g', from_=carrier, from_at=at, to='frame', to_at=end, **cylinder),
        Dyad(name='h', from_='frame', from_at=end, to=carrier, to_at=at, **cylinder),
        Dyad(
            name='i',
            from_='frame',
            from_at=(0.1, -0.5),
            first=replace(body, length=3.0),
            slider=replace(on_carrier, on='crank', angle=1.0),
            assembly='crossed',
        ),
        Dyad(name='j', from_='crank', from_at=at, to='frame', to_at=(1.5, -2.0), **cylinder),
    ]
    return replace(base, dyads=tuple(dyads))


def carriers(base):
    own = (link.name for link in base.structure().links)
    added = 'a_first', 'a_second', 'b_first', 'b_slider', 'i_slider', 'j_barrel', 'j_rod'
    return [*own, *added]


def numbers(element, key):
    return [float(word) for word in element.get(key).split()]


class Frame(NamedTuple):
    """A link's origin with velocity and acceleration, and its direction, spin and the spin's rate.

    Vectors are x + iy.
    """

    place: complex = 0j
    velocity: complex = 0j
    acceleration: complex = 0j
    axes: complex = 1 + 0j
    spin: float = 0.0
    gain: float = 0.0

    def point(self, at):
        """Returns position, velocity and acceleration of a point in the axes of the link."""
        arm = at * self.axes
        return (
            self.place + arm,
            self.velocity + 1j * self.spin * arm,
            self.acceleration + (1j * self.gain - self.spin**2) * arm,
        )


def frames(urdf, joints, values, rates, changes):
    """Places the links of a URDF; `joints` gives zero, ratio and parent of mapped joints."""
    robot, placed = ET.fromstring(urdf), {'base_link': Frame()}
    for joint in robot.findall('joint'):
        name, kind = joint.get('name'), joint.get('type')
        above = placed[joint.find('parent').get('link')]
        x, y, _ = numbers(joint.find('origin'), 'xyz')
        yaw = numbers(joint.find('origin'), 'rpy')[2]
        here = Frame(*above.point(complex(x, y)), above.axes * cmath.rect(1.0, yaw), *above[4:])
        zero, ratio, parent = joints.get(name, (0.0, 1.0, None))
        value, rate, change = (row[name] / ratio for row in (values, rates, changes))
        value += zero
        if kind == 'prismatic':
            place, velocity, acceleration = here.point(value)
            velocity += rate * here.axes
            acceleration += (change + 2j * here.spin * rate) * here.axes
            here = Frame(place, velocity, acceleration, *here[3:])
        else:
            base = here
            if parent:
                base = placed['base_link' if parent == 'frame' else link_of(parent)]
            turned = base.axes * cmath.rect(1.0, value)
            here = Frame(*here[:3], turned, base.spin + rate, base.gain + change)
        placed[joint.find('child').get('link')] = here
    return placed


def ends(mechanism):
    """Returns the links that meet in each loop, each with a point on it."""
    names = [link.name for link in type(mechanism).structure(replace(mechanism, dyads=())).links]
    first, last = ('crank', 'rod') if 'barrel' in names else names[-2:]
    pairs = [(first, last), *(tuple(x.parts) for x in mechanism.dyads if not x.barrel)]
    slides = {link.name for link in mechanism.structure().links if link.slides}
    parts = mechanism.parts()
    found = [[(x, 0.0 if x in slides else parts[x].length) for x in pair] for pair in pairs]
    rods = (x for x in mechanism.dyads if x.barrel)
    return found + [[(x.from_, complex(*x.from_at)), (f'{x.name}_rod', 0.0)] for x in rods]


def name_in_urdf(link):
    return 'base_link' if link == 'frame' else link_of(link)


def recorded(configuration, path):
    """Returns positions, velocities and accelerations by joint of each state."""
    record(configuration, path, duration=0.3)
    joints, states = [], []
    with path.open('rb') as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, _, one in reader.iter_decoded_messages():
            if channel.topic == '/joint_states':
                joints.append([one.name, [*one.position], [*one.velocity]])
            if channel.topic == '/mechanism_state':
                (at,) = one.points
                rows = [[*x] for x in (at.positions, at.velocities, at.accelerations)]
                states.append([one.joint_names, *rows])
    assert joints == [one[:3] for one in states]
    return [[dict(zip(names, row, strict=True)) for row in rows] for names, *rows in states]


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


@pytest.mark.parametrize('name', BASES)
def test_recorded_joints_close_every_loop(name, tmp_path):
    for number, carrier in enumerate(carriers(BASES[name])):
        mechanism = with_dyads(BASES[name], carrier)
        mapped = {
            'c_first': (0.4, -2.0, carrier), 'd_first': (-0.3, 0.5, 'crank'),
            'c_second': (1.1, 3.0, carrier), 'd_slider': (0.2, -1.5, None),
            'e_first': (0.1, 1.0, carrier), 'e_second': (-0.2, 0.5, 'frame'),
            'f_first': (0.3, -1.0, carrier), 'g_barrel': (0.5, 2.0, carrier),
            'f_slider': (0.2, -1.5, carrier), 'h_rod': (0.1, 0.5, None),
        }  # fmt: skip
        for joints in ({}, mapped):
            configuration = configured(mechanism, joints)
            log = tmp_path / f'{number}_{len(joints)}.mcap'
            states = recorded(configuration, log)
            assert len(states) > 2
            assert_columns_name_carriers(log, joints, carrier)
            model = None
            if not joints:
                start = Simulator(configuration.only)
                text = make_mjcf(mechanism, start.state(start.begin(0).at(0)))
                model = mujoco.MjModel.from_xml_string(text)
            turning = [x.name for x in mechanism.structure().links[1:] if not x.slides]
            for values, rates, changes in states:
                for joint in turning:
                    ratio = joints[joint][1] if joint in joints else 1.0
                    assert abs(values[joint]) <= math.pi * abs(ratio)
                placed = frames(make_urdf(mechanism), joints, values, rates, changes)
                fastest, most = (max(map(abs, row.values())) for row in (rates, changes))
                scales = 1.0, fastest, fastest**2 + most
                for pair in ends(mechanism):
                    one, other = (placed[name_in_urdf(x)].point(at) for x, at in pair)
                    for scale, x, y in zip(scales, one, other, strict=True):
                        assert abs(x - y) <= 1e-12 * LARGEST * scale, (carrier, pair)
                if model is not None:
                    assert_closed_in_mujoco(model, values, rates, carrier)


def assert_columns_name_carriers(log, joints, carrier):
    """Checks that columns of a table name the link from which the joint is measured."""
    due = {'c_first': carrier, 'd_first': carrier, 'e_first': 'frame', 'e_second': carrier}
    due |= {joint: parent for joint, (*_, parent) in joints.items() if joint in due}
    write_csv(log, log.with_suffix('.csv'))
    head = log.with_suffix('.csv').read_text().splitlines()[0].split(',')
    for joint, above in due.items():
        origin = f' relative to {above}' if above != 'frame' else ''
        assert f'{joint}.position{origin} [rad]' in head, (carrier, joint)
        assert f'{joint}.velocity{origin} [rad/s]' in head
    assert 'd_slider.position [m]' in head


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


@pytest.mark.parametrize('name', BASES)
def test_arrows_of_torques_turn_about_the_first_pin_of_their_link(name):
    for carrier in carriers(BASES[name]):
        mechanism = replace(with_dyads(BASES[name], carrier), loads=(Pins(name='a', damping=0.3),))
        simulator, mark = Simulator(configured(mechanism, {}).only), 0.01
        state = simulator.state(simulator.begin(0).at(300_000_000))
        links = mechanism.structure().links
        names = [link.name for link in links]
        rows = joint_rows(links, state, state.position[0])
        moved = (dict(zip(names, map(float, row), strict=True)) for row in rows[:3])
        placed = frames(make_urdf(mechanism), {}, *moved)
        positions, rates = (np.array([row], float) for row in state[:2])
        drawn = LoadArrows(mechanism, mark, positions).lines(positions, rates)
        turning = [link.name for link in links if not link.slides]
        assert drawn.keys() >= set(turning)
        for link in turning:
            arms = drawn[link][0, :-3] - placed[link_of(link)].place
            assert arms[0] != arms[-1]
            assert abs(arms) == pytest.approx(abs(arms[0]), rel=1e-9), (carrier, link)
