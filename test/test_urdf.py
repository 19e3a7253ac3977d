# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The URDF, read by an XML parser. Where its joints carry the links is in test_tf_tree.py."""

from __future__ import annotations

import math
from itertools import pairwise
from xml.etree import ElementTree as ET

import pytest

from linkage_ros import Body, Coupler, FourBar, Frame
from linkage_ros.parameters.configuration import load
from linkage_ros.parameters.presets import preset_names
from linkage_ros.wire.urdf import make_urdf

JOINTS = ('crank', 'coupler', 'rocker')


class Tree:
    """The links and joints of a URDF by name."""

    def __init__(self, text):
        self.robot = ET.fromstring(text)
        self.joints = {joint.get('name'): joint for joint in self.robot.iterfind('joint')}
        self.links = {link.get('name'): link for link in self.robot.iterfind('link')}


def numbers(element, key):
    return [float(word) for word in element.get(key).split()]


def make(lengths=(1.0, 3.0, 2.5, 2.0), angle=0.0, **bodies):
    crank, coupler, rocker, frame = lengths
    return FourBar(
        Frame(frame, angle),
        Body(crank, **bodies.get('crank', {})),
        Coupler(coupler, **bodies.get('coupler', {})),
        Body(rocker, **bodies.get('rocker', {})),
    )


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
    assert numbers(joint.find('origin'), 'rpy') == [0.0, 0.0, mechanism.frame.angle]
    inertial = tree.links['slider_link'].find('inertial')
    assert float(inertial.find('mass').get('value')) == mechanism.slider.mass
    assert float(inertial.find('inertia').get('izz')) > 0  # simulators want some


def test_masses_centres_and_inertias_are_the_mechanisms():
    bodies = {
        'crank': {'mass': 1.25, 'inertia': 0.0245, 'center': (0.01, -0.02)},
        'coupler': {'mass': 2.0, 'inertia': 1 / 3, 'center': (0.1575, 0.1)},
        'rocker': {'mass': 3.5, 'inertia': 0.066, 'center': (0.25, 0.0)},
    }
    tree = Tree(make_urdf(make(**bodies)))
    for name, body in bodies.items():
        inertial = tree.links[f'{name}_link'].find('inertial')
        assert numbers(inertial.find('origin'), 'xyz') == [*body['center'], 0.0]
        assert float(inertial.find('mass').get('value')) == body['mass']
        terms = {key: float(text) for key, text in inertial.find('inertia').attrib.items()}
        assert terms['izz'] == body['inertia']
        assert terms['ixy'] == terms['ixz'] == terms['iyz'] == 0.0
        # A body can have these moments: no axis' exceeds the other two's sum.
        assert 0 < terms['ixx'] <= terms['iyy'] + terms['izz']
        assert 0 < terms['iyy'] <= terms['ixx'] + terms['izz']
        assert terms['izz'] <= terms['ixx'] + terms['iyy']


def test_zero_mass_or_inertia_becomes_small_and_a_comment_says_so():
    text = make_urdf(make(coupler={'inertia': 0.25}, rocker={'mass': 3.0}))
    parser = ET.XMLParser(target=ET.TreeBuilder(insert_comments=True))
    robot = ET.fromstring(text, parser)
    for name, zeros, mass, inertia in (
        ('crank', 'mass and inertia', 3e-6, 3e-6 / 12),
        ('coupler', 'mass', 3e-6, 0.25),
        ('rocker', 'inertia', 3.0, 3e-6 * 2.5**2 / 12),
    ):
        link = robot.find(f"link[@name='{name}_link']")
        (comment,) = [part.text for part in link if part.tag is ET.Comment]
        assert f' {zeros} 0 in the parameters; simulators refuse 0, so small here' in comment
        assert float(link.find('inertial/mass').get('value')) == pytest.approx(mass)
        assert float(link.find('inertial/inertia').get('izz')) == pytest.approx(inertia)
    whole = {name: {'mass': 1.0, 'inertia': 1.0} for name in JOINTS}
    assert '<!--' not in make_urdf(make(**whole))
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
        x, y, z = numbers(visual.find('origin'), 'xyz')
        size = numbers(visual.find('geometry/box'), 'size')
        assert size[0] == length
        assert (x, y) == (pytest.approx(length / 2, rel=1e-15), 0.0)
        assert all(0 < side < min(lengths) for side in size[1:])
        spans.append((z - size[2] / 2, z + size[2] / 2))
        colour = numbers(visual.find('material/color'), 'rgba')
        assert len(colour) == 4
        assert all(0 <= part <= 1 for part in colour)
    for below, above in pairwise(sorted(spans)):
        assert below[1] <= above[0] * (1 + 1e-12)


def test_every_number_in_the_text_is_one_that_urdf_reads():
    """No nan, no inf, and floats written so that they come back bit for bit."""
    mechanism = make((1 / 3, 3.0, 2.5, 2.0), angle=1e-17, crank={'mass': 1e-300})
    text = make_urdf(mechanism)
    assert text.startswith('<?xml version=')
    tree = Tree(text)
    for element in tree.robot.iter():
        for key in ('xyz', 'rpy', 'size', 'value', 'rgba', 'izz', 'ixx', 'iyy'):
            assert all(map(math.isfinite, map(float, element.get(key, '0').split())))
    box = tree.links['crank_link'].find('visual/geometry/box')
    assert numbers(box, 'size')[0] == 1 / 3
