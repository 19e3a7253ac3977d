# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The URDF, read by an XML parser, and the tf tree that robot_state_publisher makes of it.

It reads robot_description and joint_states as subscribers get them: each joint of a URDF makes a
transform from its parent link to its child link, at the position that joint_states names. Where
the links have to be follows from the solver's angles and the mechanism's lengths alone.
"""

import cmath
from itertools import pairwise
from xml.etree import ElementTree as ET

import numpy as np
import pytest
import yaml
from geometry_msgs.msg import PointStamped
from pages import block, read
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory

from linkage_ros import Body, Coupler, FourBar, Frame
from linkage_ros.parameters.configuration import configure, load
from linkage_ros.parameters.presets import preset_names
from linkage_ros.run.simulator import Simulator
from linkage_ros.wire.topics import COUPLER_POINT, JOINT_STATES, MECHANISM_STATE
from linkage_ros.wire.urdf import make_urdf

STAMP = 123_456_789  # ns
DOCUMENTED = yaml.safe_load(block(read('docs/urdf.md'), 'ros__parameters'))


def linkage(preset, stamp=STAMP, **values):
    """A simulator and its messages at a stamp."""
    parameters = {k: v for k, v in load(preset).parameters().items() if v is not None}
    simulator = Simulator(configure({**parameters, **values}))
    return simulator, simulator.snapshot_at(simulator.begin(0), stamp)


def message(simulator, snapshot, topic, kind):
    return deserialize_message(snapshot.messages[simulator.topics.index(topic)], kind)


def moved(place, angle=0.0):
    """Homogeneous transform to x + iy, m, turned about z, rad."""
    turn = cmath.exp(1j * angle)
    matrix = np.eye(4)
    matrix[:2, :2] = [[turn.real, -turn.imag], [turn.imag, turn.real]]
    matrix[:2, 3] = place.real, place.imag
    return matrix


def numbers(element, key):
    return [float(word) for word in element.get(key).split()]


class Tree:
    """A tf tree: transforms by child frame, each with its parent frame."""

    def __init__(self, linkages):
        """Takes descriptions and joint states; one publisher of joint_states for all."""
        joints, self.edges, frames = {}, {}, set()
        for simulator, snapshot in linkages:
            states = message(simulator, snapshot, JOINT_STATES, JointState)
            for name, position in zip(states.name, states.position, strict=True):
                assert name not in joints, f'two joints {name}'
                joints[name] = position
        for simulator, _ in linkages:
            text = deserialize_message(simulator.description, String).data
            robot = ET.fromstring(text.encode())
            for joint in robot.iterfind('joint'):
                child = joint.find('child').get('link')
                assert child not in self.edges, f'two parents of {child}'
                parent = joint.find('parent').get('link')
                self.edges[child] = parent, transform(joint, joints[joint.get('name')])
            frames |= {link.get('name') for link in robot.iterfind('link')}
        (self.root,) = frames - set(self.edges)  # one frame without a parent: one tree

    def pose(self, frame):
        """The frame in the root."""
        if frame == self.root:
            return np.eye(4)
        parent, step = self.edges[frame]
        return self.pose(parent) @ step


def transform(joint, position):
    """From a joint's parent link to its child link."""
    origin, axis = joint.find('origin'), numbers(joint.find('axis'), 'xyz')
    x, y, z = numbers(origin, 'xyz')
    roll, pitch, yaw = numbers(origin, 'rpy')
    assert (z, roll, pitch) == (0.0, 0.0, 0.0)
    if joint.get('type') == 'prismatic':
        assert axis == [1.0, 0.0, 0.0]
        return moved(complex(x, y), yaw) @ moved(complex(position))
    assert (joint.get('type'), axis) == ('continuous', [0.0, 0.0, 1.0])
    assert joint.find('limit') is None
    return moved(complex(x, y), yaw + position)


def expected(simulator, snapshot):
    """Each moving link's pose in the link that carries the pivots, by the joint's own name."""
    mechanism, angles = simulator.configuration.mechanism, snapshot.state.position
    pin = mechanism.crank.length * cmath.exp(1j * angles[0])
    end = pin + mechanism.coupler.length * cmath.exp(1j * angles[1])
    poses = {'crank': moved(0j, angles[0]), 'coupler': moved(pin, angles[1])}
    kind = simulator.configuration.kind.mechanism
    if kind == 'four_bar':
        pivot = mechanism.frame.length * cmath.exp(1j * mechanism.frame.angle)
        return {**poses, 'rocker': moved(pivot, angles[2])}
    if kind == 'slider_crank':
        return {**poses, 'slider': moved(end, mechanism.frame.angle)}
    return {**poses, 'rod': moved(end, angles[2]), 'slider': moved(complex(angles[3]))}


def assert_poses(tree, simulator, snapshot):
    session = simulator.configuration.session
    base = tree.pose(session.frame_id)
    for name, pose in expected(simulator, snapshot).items():
        found = tree.pose(f'{session.joint_prefix}{name}_link')
        assert np.allclose(found, base @ pose, rtol=0, atol=1e-14)
    if COUPLER_POINT in simulator.topics:
        message_ = message(simulator, snapshot, COUPLER_POINT, PointStamped)
        assert message_.header.frame_id == session.frame_id
        point = message_.point
        along, across = simulator.configuration.mechanism.coupler.point
        on_coupler = tree.pose(f'{session.joint_prefix}coupler_link') @ [along, across, 0.0, 1.0]
        assert np.allclose(base @ [point.x, point.y, point.z, 1.0], on_coupler, atol=1e-14)


@pytest.mark.parametrize('preset', preset_names())
@pytest.mark.parametrize('stamp', [0, STAMP, 777_777_777, 1_234_567_891])
def test_each_link_is_where_the_mechanism_has_it(preset, stamp):
    simulator, snapshot = linkage(preset, stamp)
    tree = Tree([(simulator, snapshot)])
    assert len(tree.edges) == len(simulator.joints)
    assert_poses(tree, simulator, snapshot)


@pytest.mark.parametrize(
    ('left', 'right'),
    [
        ({'joint_prefix': 'left_'}, {'joint_prefix': 'right_'}),
        ({'frame_id': 'arm/tool0'}, {'joint_prefix': 'b_', 'frame_id': 'arm/tool0'}),
        # Its pivots on a moving link of the other linkage.
        [node['ros__parameters'] for node in DOCUMENTED.values()],
    ],
    ids=['both prefixed', 'on a robot', 'of the docs'],
)
def test_two_linkages_are_one_tree_with_the_right_poses(left, right):
    linkages = [linkage('quadrilateral', **left), linkage('compressor', rpm=77.0, **right)]
    tree = Tree(linkages)
    assert tree.root == left.get('frame_id', 'base_link')
    assert len(tree.edges) == 6
    for simulator, snapshot in linkages:
        assert_poses(tree, simulator, snapshot)


def test_states_name_the_same_joints_and_frame_in_every_message():
    simulator, snapshot = linkage('quadrilateral', joint_prefix='left_', frame_id='tool0')
    states = message(simulator, snapshot, JOINT_STATES, JointState)
    assert states.header.frame_id == 'tool0'
    assert states.name == ['left_crank', 'left_coupler', 'left_rocker'] == list(simulator.joints)
    found = message(simulator, snapshot, MECHANISM_STATE, JointTrajectory)
    assert (found.header.frame_id, found.joint_names) == ('tool0', states.name)


@pytest.mark.parametrize(
    ('right', 'error', 'words'),
    [
        ({}, AssertionError, 'two joints crank'),
        ({'joint_prefix': 'b_', 'frame_id': 'other'}, ValueError, 'too many values'),
    ],
    ids=['same names', 'two roots'],
)
def test_names_that_make_no_tree_are_noticed(right, error, words):
    linkages = [linkage('quadrilateral'), linkage('quadrilateral', **right)]
    with pytest.raises(error, match=words):
        Tree(linkages)


def test_wrong_poses_are_noticed():
    simulator, snapshot = linkage('quadrilateral', joint_prefix='left_')
    later = simulator.snapshot_at(simulator.begin(0), STAMP + 1)
    with pytest.raises(AssertionError):
        assert_poses(Tree([(simulator, snapshot)]), simulator, later)


# ---------------------------------------------------------------- the text

JOINTS = ('crank', 'coupler', 'rocker')


class Robot:
    """The links and joints of a URDF by name."""

    def __init__(self, text):
        self.robot = ET.fromstring(text)
        self.joints = {joint.get('name'): joint for joint in self.robot.iterfind('joint')}
        self.links = {link.get('name'): link for link in self.robot.iterfind('link')}


def make(lengths=(1.0, 3.0, 2.5, 2.0), angle=0.0, **bodies):
    crank, coupler, rocker, frame = lengths
    return FourBar(
        Frame(frame, angle),
        Body(crank, **bodies.get('crank', {})),
        Coupler(coupler, **bodies.get('coupler', {})),
        Body(rocker, **bodies.get('rocker', {})),
    )


@pytest.mark.parametrize('preset', ['compressor', 'slider_crank'])
def test_a_slider_is_a_prismatic_joint_along_its_guide(preset):
    mechanism = load(preset).mechanism
    tree = Robot(make_urdf(mechanism))
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
    tree = Robot(make_urdf(make(**bodies)))
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
    assert Robot(text).links['base_link'].find('inertial') is None  # it does not move


@pytest.mark.parametrize('scale', [1e-9, 1e-3, 1.0, 1e8])
def test_bars_reach_from_pin_to_pin_and_lie_one_above_the_other(scale):
    lengths = [scale * length for length in (1.0, 3.0, 2.5, 2.0)]
    tree = Robot(make_urdf(make(lengths)))
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
