# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The URDF, read by an XML parser and moved as robot_state_publisher would: the loop must close.

The forward kinematics here knows nothing of linkages. It chains the origins and rotations that
stand in the file, at the joint positions that stand in the messages.
"""

from __future__ import annotations

import cmath
import math
import random
from itertools import pairwise
from typing import NamedTuple
from xml.etree import ElementTree as ET

import pytest

from linkage_ros import Body, Coupler, FourBar, Frame, Solver
from linkage_ros.motion.drives import SpeedDrive
from linkage_ros.motion.speed_driven import SpeedMotion
from linkage_ros.parameters.configuration import load
from linkage_ros.parameters.presets import preset_names
from linkage_ros.wire.codecs import joint_rows
from linkage_ros.wire.urdf import make_urdf

JOINTS = ('crank', 'coupler', 'rocker')


class Pose(NamedTuple):
    """A link's frame in base_link: where its origin is, and how far it is turned, rad."""

    place: complex
    angle: float

    def point(self, along, across=0.0):
        return self.place + complex(along, across) * cmath.exp(1j * self.angle)


class Tree:
    """The links and joints of a URDF whose joints all turn about z."""

    def __init__(self, text):
        self.robot = ET.fromstring(text)
        self.joints = {joint.get('name'): joint for joint in self.robot.iterfind('joint')}
        self.links = {link.get('name'): link for link in self.robot.iterfind('link')}

    def poses(self, positions):
        """Every link's pose, by name."""
        poses = {'base_link': Pose(0j, 0.0)}
        waiting = dict(self.joints)
        while waiting:
            name, joint = next(
                (name, joint)
                for name, joint in waiting.items()
                if joint.find('parent').get('link') in poses
            )
            del waiting[name]
            parent = poses[joint.find('parent').get('link')]
            origin = joint.find('origin')
            x, y, z = map(float, origin.get('xyz').split())
            roll, pitch, yaw = map(float, origin.get('rpy').split())
            assert (z, roll, pitch) == (0.0, 0.0, 0.0)
            angle = parent.angle + yaw + positions[name]
            poses[joint.find('child').get('link')] = Pose(parent.point(x, y), angle)
        return poses


def make(lengths, assembly='open', angle=0.0, **bodies):
    crank, coupler, rocker, frame = lengths
    return FourBar(
        Frame(frame, angle),
        Body(crank, **bodies.get('crank', {})),
        Coupler(coupler, **bodies.get('coupler', {})),
        Body(rocker, **bodies.get('rocker', {})),
        assembly,
    )


def random_mechanisms():
    """Crank-rockers, double-cranks and a change-point linkage, in every direction and size."""
    rng = random.Random(11)
    for number in range(10):
        short, rest = 1.0, sorted(rng.uniform(1.2, 3.0) for _ in range(3))
        rest[-1] = min(rest[-1], rest[0] + rest[1] - short)  # Grashof
        rng.shuffle(rest)
        scale = 10.0 ** rng.uniform(-3, 2)
        lengths = [short, *rest] if number % 2 else [*rest, short]
        angle = rng.uniform(-10, 10)
        yield tuple(scale * length for length in lengths), angle
    yield (1.0, 2.0, 1.0, 2.0), 0.4  # parallelogram: passes change points
    yield (1.0, 3.0, 2.0, 2.0), -0.7  # change point at theta = pi: period two turns


def positions_at(mechanism, stamp, motion):
    q, u, a, crank = motion.at(stamp)
    solver = Solver(mechanism)
    position, *_ = joint_rows(solver.structure.links, solver.state(q, u, a), crank)
    return dict(zip(JOINTS, position, strict=True))


# One turn a second, watched over two turns, at stamps that are not round.
MOTION = SpeedMotion.begin(SpeedDrive(60.0, crank_angle=0.1), 0)
STAMPS = [2 * 10**9 * i // 360 + 1 for i in range(360)]


def worst_gap(mechanism, convention=None):
    """The largest distance of coupler end and rocker end over two turns, in longest links."""
    tree, worst = Tree(make_urdf(mechanism)), 0.0
    size = max(mechanism.crank.length, mechanism.coupler.length, mechanism.rocker.length)
    for stamp in STAMPS:
        positions = positions_at(mechanism, stamp, MOTION)
        if convention is not None:
            positions = convention(positions)
        poses = tree.poses(positions)
        coupler_end = poses['coupler_link'].point(mechanism.coupler.length)
        rocker_end = poses['rocker_link'].point(mechanism.rocker.length)
        worst = max(worst, abs(coupler_end - rocker_end) / size)
    return worst


@pytest.mark.parametrize('assembly', ['open', 'crossed'])
@pytest.mark.parametrize(('lengths', 'angle'), list(random_mechanisms()))
def test_the_loop_closes_at_every_joint_position(lengths, angle, assembly):
    assert worst_gap(make(lengths, assembly, angle)) < 1e-14


def test_the_loop_of_the_preset_closes():
    assert worst_gap(load('quadrilateral').mechanism) < 1e-14


@pytest.mark.parametrize(
    'convention',
    [
        lambda p: {**p, 'coupler': p['coupler'] + p['crank']},  # the coupler's own direction
        lambda p: {**p, 'rocker': p['rocker'] - p['crank']},
        lambda p: {**p, 'coupler': -p['coupler']},
        lambda p: {**p, 'crank': p['crank'] + 1e-9},
    ],
    ids=['absolute coupler', 'relative rocker', 'clockwise coupler', 'a nanoradian'],
)
def test_the_loop_does_not_close_under_another_convention(convention):
    assert worst_gap(load('quadrilateral').mechanism, convention) > 1e-11


def test_the_pins_are_where_the_mechanism_has_them():
    mechanism = make((1.0, 3.0, 2.5, 2.0), angle=0.3)
    tree = Tree(make_urdf(mechanism))
    for stamp in STAMPS[::20]:
        positions = positions_at(mechanism, stamp, MOTION)
        poses = tree.poses(positions)
        alpha = MOTION.at(stamp).unwrapped
        assert poses['crank_link'] == Pose(0j, alpha)
        assert abs(poses['coupler_link'].place - cmath.exp(1j * alpha)) < 1e-13
        assert abs(poses['rocker_link'].place - 2.0 * cmath.exp(0.3j)) < 1e-15
        # Open: the pin lies left of the line from the crank pin to the rocker pivot.
        diagonal = poses['rocker_link'].place - poses['coupler_link'].place
        pin = poses['coupler_link'].point(3.0) - poses['coupler_link'].place
        assert (diagonal.conjugate() * pin).imag > 0


def test_the_second_turn_is_not_the_first_where_a_change_point_is_passed():
    mechanism = make((1.0, 3.0, 2.0, 2.0), angle=-0.7)
    first = positions_at(mechanism, 10**8, MOTION)
    second = positions_at(mechanism, 10**8 + 10**9, MOTION)
    third = positions_at(mechanism, 10**8 + 2 * 10**9, MOTION)
    assert abs(second['rocker'] - first['rocker']) > 0.1
    assert (third['coupler'], third['rocker']) == (first['coupler'], first['rocker'])


def test_the_tree_has_these_links_and_joints():
    tree = Tree(make_urdf(load('quadrilateral').mechanism))
    assert tree.robot.tag == 'robot'
    assert tree.robot.get('name') == 'linkage'
    assert list(tree.links) == ['base_link', 'crank_link', 'coupler_link', 'rocker_link']
    joined = {
        name: (joint.find('parent').get('link'), joint.find('child').get('link'))
        for name, joint in tree.joints.items()
    }
    assert joined == {
        'crank': ('base_link', 'crank_link'),
        'coupler': ('crank_link', 'coupler_link'),
        'rocker': ('base_link', 'rocker_link'),
    }
    for joint in tree.joints.values():
        assert joint.get('type') == 'continuous'
        assert joint.find('axis').get('xyz').split() == ['0', '0', '1']
        assert joint.find('limit') is None


@pytest.mark.parametrize('preset', ['compressor', 'slider_crank'])
def test_a_slider_is_a_prismatic_joint_along_its_guide(preset):
    mechanism = load(preset).mechanism
    tree = Tree(make_urdf(mechanism))
    joint = tree.joints['slider']
    assert (joint.get('type'), joint.find('axis').get('xyz')) == ('prismatic', '1 0 0')
    assert joint.find('parent').get('link') == 'base_link'
    limit = {name: float(value) for name, value in joint.find('limit').items()}
    reach = mechanism.crank.length + mechanism.coupler.length
    assert (limit['lower'], limit['upper']) == (-reach, reach)
    origin = joint.find('origin')
    x, y, z = map(float, origin.get('xyz').split())
    roll, pitch, yaw = map(float, origin.get('rpy').split())
    assert (z, roll, pitch, yaw) == (0.0, 0.0, 0.0, mechanism.frame.angle)
    solver = Solver(mechanism)
    for stamp in STAMPS[::20]:
        q, u, a, crank = MOTION.at(stamp)
        position, *_ = joint_rows(solver.structure.links, solver.state(q, u, a), crank)
        # The coupler's end, by way of the two turning joints, is the slider's origin.
        a = mechanism.crank.length * cmath.exp(1j * position[0])
        end = a + mechanism.coupler.length * cmath.exp(1j * (position[0] + position[1]))
        slider = complex(x, y) + position[2] * cmath.exp(1j * yaw)
        assert abs(end - slider) < 1e-14 * reach
    inertial = tree.links['slider_link'].find('inertial')
    assert float(inertial.find('mass').get('value')) == mechanism.slider.mass
    assert float(inertial.find('inertia').get('izz')) > 0  # simulators want some


def test_masses_centres_and_inertias_are_the_mechanisms():
    bodies = {
        'crank': {'mass': 1.25, 'inertia': 0.0245, 'center': (0.01, -0.02)},
        'coupler': {'mass': 2.0, 'inertia': 1 / 3, 'center': (0.1575, 0.1)},
        'rocker': {'mass': 3.5, 'inertia': 0.066, 'center': (0.25, 0.0)},
    }
    tree = Tree(make_urdf(make((1.0, 3.0, 2.5, 2.0), **bodies)))
    for name, body in bodies.items():
        inertial = tree.links[f'{name}_link'].find('inertial')
        x, y, z = map(float, inertial.find('origin').get('xyz').split())
        assert ((x, y), z) == (body['center'], 0.0)
        assert float(inertial.find('mass').get('value')) == body['mass']
        terms = {key: float(text) for key, text in inertial.find('inertia').attrib.items()}
        assert terms['izz'] == body['inertia']
        assert terms['ixy'] == terms['ixz'] == terms['iyz'] == 0.0
        # A body can have these moments: no axis' exceeds the other two's sum.
        assert 0 < terms['ixx'] <= terms['iyy'] + terms['izz']
        assert 0 < terms['iyy'] <= terms['ixx'] + terms['izz']
        assert terms['izz'] <= terms['ixx'] + terms['iyy']


def inertial_of(text, link):
    """Mass, inertia about z and the comment on them."""
    parser = ET.XMLParser(target=ET.TreeBuilder(insert_comments=True))
    element = ET.fromstring(text, parser).find(f"link[@name='{link}']")
    comments = [part.text for part in element if part.tag is ET.Comment]
    inertial = element.find('inertial')
    values = (inertial.find('mass').get('value'), inertial.find('inertia').get('izz'))
    return *map(float, values), ''.join(comments)


def test_zero_mass_or_inertia_becomes_small_and_a_comment_says_so():
    bodies = {'coupler': {'inertia': 0.25}, 'rocker': {'mass': 3.0}}
    text = make_urdf(make((1.0, 3.0, 2.5, 2.0), **bodies))
    said = '{} 0 in the parameters; simulators refuse 0, so small here'
    mass, inertia, comment = inertial_of(text, 'crank_link')
    assert (mass, inertia) == (pytest.approx(3e-6), pytest.approx(3e-6 / 12))
    assert said.format('mass and inertia') in comment
    mass, inertia, comment = inertial_of(text, 'coupler_link')
    assert (mass, inertia) == (pytest.approx(3e-6), 0.25)
    assert said.format('mass') in comment
    mass, inertia, comment = inertial_of(text, 'rocker_link')
    assert (mass, inertia) == (3.0, pytest.approx(3e-6 * 2.5**2 / 12))
    assert said.format('inertia') in comment
    whole = {name: {'mass': 1.0, 'inertia': 1.0} for name in JOINTS}
    assert '<!--' not in make_urdf(make((1.0, 3.0, 2.5, 2.0), **whole))
    assert Tree(text).links['base_link'].find('inertial') is None  # it does not move


@pytest.mark.parametrize(('prefix', 'frame'), [('', 'base_link'), ('left_', 'arm/tool0')])
@pytest.mark.parametrize('preset', preset_names())
def test_no_two_links_and_joints_share_a_name(preset, prefix, frame):
    tree = Tree(make_urdf(load(preset).mechanism, prefix, frame))
    names = [*(link.get('name') for link in tree.robot.iterfind('link')), *tree.joints]
    assert len(set(names)) == len(names) == 2 * len(tree.joints) + 1
    assert names[0] == frame
    assert all(name.startswith(f'{prefix}') for name in names[1:])
    for name, joint in tree.joints.items():
        assert joint.find('child').get('link') == f'{name}_link'
    materials = {material.get('name') for material in tree.robot.iter('material')}
    assert materials == set(tree.joints)


@pytest.mark.parametrize('scale', [1e-9, 1e-3, 1.0, 1e8])
def test_bars_reach_from_pin_to_pin_and_lie_one_above_the_other(scale):
    lengths = [scale * length for length in (1.0, 3.0, 2.5, 2.0)]
    tree = Tree(make_urdf(make(lengths)))
    spans = []
    for name, length in zip(JOINTS, lengths, strict=False):
        visual = tree.links[f'{name}_link'].find('visual')
        x, y, z = map(float, visual.find('origin').get('xyz').split())
        size = [float(text) for text in visual.find('geometry/box').get('size').split()]
        assert size[0] == length
        assert math.isclose(x, length / 2, rel_tol=1e-15)
        assert y == 0.0
        assert all(0 < side < min(lengths) for side in size[1:])
        spans.append((z - size[2] / 2, z + size[2] / 2))
        colour = [float(text) for text in visual.find('material/color').get('rgba').split()]
        assert len(colour) == 4
        assert all(0 <= part <= 1 for part in colour)
    for below, above in pairwise(sorted(spans)):
        assert below[1] <= above[0] * (1 + 1e-12)


def test_the_text_is_xml_and_the_same_every_time():
    mechanism = load('quadrilateral').mechanism
    text = make_urdf(mechanism)
    assert text.startswith('<?xml version=')
    assert text.endswith('</robot>\n')
    assert make_urdf(mechanism) == text
    assert ET.canonicalize(text, strip_text=True) == ET.canonicalize(
        ET.tostring(ET.fromstring(text), encoding='unicode'), strip_text=True
    )


def test_every_number_in_the_text_is_one_that_urdf_reads():
    """No nan, no inf, and floats written so that they come back bit for bit."""
    mechanism = make((1 / 3, 3.0, 2.5, 2.0), angle=1e-17, crank={'mass': 1e-300})
    tree = Tree(make_urdf(mechanism))
    for element in tree.robot.iter():
        for key in ('xyz', 'rpy', 'size', 'value', 'rgba', 'izz', 'ixx', 'iyy'):
            assert all(map(math.isfinite, map(float, element.get(key, '0').split())))
    assert (
        float(tree.links['crank_link'].find('visual/geometry/box').get('size').split()[0]) == 1 / 3
    )
