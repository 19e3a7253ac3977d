# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One linkage, and two, in a tf tree, which is built as robot_state_publisher does.

It reads robot_description and joint_states as subscribers get them: each joint of a URDF makes a
transform from its parent link to its child link, at the position that joint_states names. Where
the links have to be follows from the solver's angles and the mechanism's lengths alone.
"""

from __future__ import annotations

import cmath
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

from linkage_ros.parameters.configuration import configure, load
from linkage_ros.parameters.presets import preset_names
from linkage_ros.run.machine import Machine
from linkage_ros.wire.topics import COUPLER_POINT, JOINT_STATES, MECHANISM_STATE

STAMP = 123_456_789  # ns


def linkage(preset, stamp=STAMP, **values):
    """A machine and its messages at a stamp."""
    parameters = {k: v for k, v in load(preset).parameters().items() if v is not None}
    machine = Machine(configure({**parameters, **values}))
    return machine, machine.snapshot_at(machine.begin(0), stamp)


def message(machine, snapshot, topic, kind):
    return deserialize_message(snapshot.messages[machine.topics.index(topic)], kind)


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
        for machine, snapshot in linkages:
            states = message(machine, snapshot, JOINT_STATES, JointState)
            for name, position in zip(states.name, states.position, strict=True):
                assert name not in joints, f'two joints {name}'
                joints[name] = position
        for machine, _ in linkages:
            text = deserialize_message(machine.description, String).data
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
    assert axis == [0.0, 0.0, 1.0]
    return moved(complex(x, y), yaw + position)


def expected(machine, snapshot):
    """Each moving link's pose in the link that carries the pivots, by the joint's own name."""
    mechanism, angles = machine.configuration.mechanism, snapshot.state.position
    pin = mechanism.crank.length * cmath.exp(1j * angles[0])
    end = pin + mechanism.coupler.length * cmath.exp(1j * angles[1])
    poses = {'crank': moved(0j, angles[0]), 'coupler': moved(pin, angles[1])}
    kind = machine.configuration.kind.mechanism
    if kind == 'four_bar':
        pivot = mechanism.frame.length * cmath.exp(1j * mechanism.frame.angle)
        return {**poses, 'rocker': moved(pivot, angles[2])}
    if kind == 'slider_crank':
        return {**poses, 'slider': moved(end, mechanism.frame.angle)}
    return {**poses, 'rod': moved(end, angles[2]), 'slider': moved(complex(angles[3]))}


def assert_poses(tree, machine, snapshot):
    session = machine.configuration.session
    base = tree.pose(session.frame_id)
    for name, pose in expected(machine, snapshot).items():
        found = tree.pose(f'{session.joint_prefix}{name}_link')
        assert np.allclose(found, base @ pose, rtol=0, atol=1e-14)
    if COUPLER_POINT in machine.topics:
        message_ = message(machine, snapshot, COUPLER_POINT, PointStamped)
        assert message_.header.frame_id == session.frame_id
        point = message_.point
        along, across = machine.configuration.mechanism.coupler.point
        on_coupler = tree.pose(f'{session.joint_prefix}coupler_link') @ [along, across, 0.0, 1.0]
        assert np.allclose(base @ [point.x, point.y, point.z, 1.0], on_coupler, atol=1e-14)


@pytest.mark.parametrize('preset', preset_names())
@pytest.mark.parametrize('stamp', [0, STAMP, 777_777_777, 1_234_567_891])
def test_each_link_is_where_the_mechanism_has_it(preset, stamp):
    machine, snapshot = linkage(preset, stamp)
    tree = Tree([(machine, snapshot)])
    assert len(tree.edges) == len(machine.joints)
    assert_poses(tree, machine, snapshot)


@pytest.mark.parametrize(
    ('left', 'right'),
    [
        ({'joint_prefix': 'left_'}, {'joint_prefix': 'right_'}),
        ({'frame_id': 'arm/tool0'}, {'joint_prefix': 'b_', 'frame_id': 'arm/tool0'}),
        # Its pivots on a moving link of the other linkage.
        ({'joint_prefix': 'a_'}, {'joint_prefix': 'b_', 'frame_id': 'a_coupler_link'}),
    ],
    ids=['both prefixed', 'on a robot', 'one on the other'],
)
def test_two_linkages_are_one_tree_with_the_right_poses(left, right):
    linkages = [linkage('quadrilateral', **left), linkage('compressor', rpm=77.0, **right)]
    tree = Tree(linkages)
    assert tree.root == left.get('frame_id', 'base_link')
    assert len(tree.edges) == 6
    for machine, snapshot in linkages:
        assert_poses(tree, machine, snapshot)


def test_the_two_linkages_of_the_docs_are_one_tree():
    nodes = yaml.safe_load(block(read('docs/urdf.md'), 'ros__parameters'))
    names = [node['ros__parameters'] for node in nodes.values()]
    assert len(names) == 2
    linkages = [linkage('quadrilateral', **given) for given in names]
    tree = Tree(linkages)
    assert tree.root == 'base_link'
    for machine, snapshot in linkages:
        assert_poses(tree, machine, snapshot)


def test_states_name_the_same_joints_and_frame_in_every_message():
    machine, snapshot = linkage('quadrilateral', joint_prefix='left_', frame_id='tool0')
    states = message(machine, snapshot, JOINT_STATES, JointState)
    assert states.header.frame_id == 'tool0'
    assert states.name == ['left_crank', 'left_coupler', 'left_rocker'] == list(machine.joints)
    found = message(machine, snapshot, MECHANISM_STATE, JointTrajectory)
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
    machine, snapshot = linkage('quadrilateral', joint_prefix='left_')
    later = machine.snapshot_at(machine.begin(0), STAMP + 1)
    with pytest.raises(AssertionError):
        assert_poses(Tree([(machine, snapshot)]), machine, later)
