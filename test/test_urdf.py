# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The URDF, read by an XML parser, and the tf tree that robot_state_publisher makes of it.

The tests use robot_description and joint_states as received by subscribers. Each joint of the URDF
gives a transform from its parent link to its child link, at its position in joint_states. The
expected poses come only from the solver's angles and the mechanism's lengths.
"""

import cmath
import math
from itertools import pairwise
from xml.etree import ElementTree as ET

import mujoco
import numpy as np
import pytest
import yaml
from geometry_msgs.msg import PointStamped
from one_linkage import templates_of
from pages import block, read
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from state_messages import messages_at
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory

from linkage_ros import Body, Coupler, FourBar, Frame
from linkage_ros.mechanism.registry import MECHANISMS
from linkage_ros.messages.topics import JOINT_STATES, MECHANISM_STATE, point_topic
from linkage_ros.messages.urdf import make_urdf
from linkage_ros.run.states import Simulator
from linkage_ros.settings.configuration import configure, load
from linkage_ros.settings.presets import preset_names

STAMP = 123_456_789  # ns
DOCUMENTED = yaml.safe_load(block(read('docs/urdf.md'), 'ros__parameters'))


def linkage(preset, stamp=STAMP, **values):
    """Returns a simulator and its messages at a stamp."""
    parameters = {k: v for k, v in load(preset).parameters().items() if v is not None}
    simulator = Simulator(configure({**parameters, **values}).only)
    return simulator, messages_at(simulator, simulator.begin(0), stamp)


def message(simulator, made, topic, kind):
    return deserialize_message(made.messages[templates_of(simulator).topics.index(topic)], kind)


def numbers(element, key):
    return [float(word) for word in element.get(key).split()]


def posed(linkages):
    """Loads the linkages into MuJoCo as one robot, with the joints at their published positions.

    The linkages share one publisher of joint_states. A link that occurs in two URDFs carries the
    pivots in one of them.
    """
    robot, known, positions = ET.Element('robot', name='linkages'), {}, []
    for simulator, made in linkages:
        states = message(simulator, made, JOINT_STATES, JointState)
        positions += zip(states.name, states.position, strict=True)
        text = deserialize_message(simulator.description, String).data
        for part in ET.fromstring(text.encode()):
            if part.tag == 'link' and not len(part):
                known[part.get('name')] = part
            else:
                robot.append(part)
    moving = {link.get('name') for link in robot.iterfind('link')}
    robot.extend(part for name, part in known.items() if name not in moving)
    model = mujoco.MjModel.from_xml_string(ET.tostring(robot, encoding='unicode'))
    data = mujoco.MjData(model)
    for name, position in positions:
        data.joint(name).qpos = position
    mujoco.mj_kinematics(model, data)
    return data


def pose(data, frame):
    """Returns position, m, and axes of a frame; MuJoCo merges the fixed root with its world."""
    names = {data.body(number).name for number in range(data.model.nbody)}
    body = data.body(frame if frame in names else 'world')
    return body.xpos, body.xmat.reshape(3, 3)


def expected(simulator, made):
    """Returns position, x + iy, and direction of each moving link, in the link with the pivots."""
    mechanism, angles = simulator.linkage.mechanism, made.state.position
    pin = mechanism.crank.length * cmath.exp(1j * angles[0])
    kind = next(name for name, cls in MECHANISMS.items() if type(mechanism) is cls)
    if kind == 'inverted_slider_crank':
        pivot = mechanism.frame.length * cmath.exp(1j * mechanism.frame.angle)
        return {'crank': (0j, angles[0]), 'barrel': (pivot, angles[1]), 'rod': (pin, angles[1])}
    end = pin + mechanism.coupler.length * cmath.exp(1j * angles[1])
    poses = {'crank': (0j, angles[0]), 'coupler': (pin, angles[1])}
    if kind == 'four_bar':
        pivot = mechanism.frame.length * cmath.exp(1j * mechanism.frame.angle)
        return {**poses, 'rocker': (pivot, angles[2])}
    if kind == 'slider_crank':
        return {**poses, 'slider': (end, mechanism.frame.angle)}
    return {**poses, 'rod': (end, angles[2]), 'slider': (complex(angles[3]), 0.0)}


def assert_poses(data, simulator, made):
    session = simulator.linkage.session
    place, axes = pose(data, session.frame_id)
    for name, (pin, angle) in expected(simulator, made).items():
        found, turned = pose(data, f'{session.joint_prefix}{name}_link')
        due = place + axes @ [pin.real, pin.imag, 0.0]
        assert np.allclose(found, due, rtol=0, atol=1e-14)
        assert np.allclose(turned[:, 0], axes @ [math.cos(angle), math.sin(angle), 0], atol=1e-14)
    for traced in simulator.linkage.mechanism.points:
        message_ = message(simulator, made, point_topic(traced.name), PointStamped)
        assert message_.header.frame_id == session.frame_id
        found, turned = pose(data, f'{session.joint_prefix}{traced.link}_link')
        on_link = found + turned @ [*traced.at, 0.0]
        point = message_.point
        assert np.allclose(place + axes @ [point.x, point.y, point.z], on_link, atol=1e-14)


@pytest.mark.parametrize('preset', preset_names())
@pytest.mark.parametrize('stamp', [0, STAMP, 777_777_777, 1_234_567_891])
def test_each_link_has_the_pose_of_the_mechanism(preset, stamp):
    simulator, made = linkage(preset, stamp)
    data = posed([(simulator, made)])
    assert data.model.njnt == len(simulator.joints)
    assert_poses(data, simulator, made)


@pytest.mark.parametrize(
    ('left', 'right'),
    [
        ({'joint_prefix': 'left_'}, {'joint_prefix': 'right_'}),
        ({'frame_id': 'arm/tool0'}, {'joint_prefix': 'b_', 'frame_id': 'arm/tool0'}),
        # Its pivots are on a moving link of the other linkage.
        [node['ros__parameters'] for node in DOCUMENTED.values()],
    ],
    ids=['both prefixed', 'on a robot', 'of the docs'],
)
def test_two_linkages_are_one_tree_with_the_right_poses(left, right):
    linkages = [linkage('quadrilateral', **left), linkage('compressor', rpm=77.0, **right)]
    data = posed(linkages)
    assert data.model.njnt == 6
    for simulator, made in linkages:
        assert_poses(data, simulator, made)


def test_states_name_the_same_joints_and_frame_in_every_message():
    simulator, made = linkage('quadrilateral', joint_prefix='left_', frame_id='tool0')
    states = message(simulator, made, JOINT_STATES, JointState)
    assert states.header.frame_id == 'tool0'
    assert states.name == ['left_crank', 'left_coupler', 'left_rocker'] == list(simulator.joints)
    found = message(simulator, made, MECHANISM_STATE, JointTrajectory)
    assert (found.header.frame_id, found.joint_names) == ('tool0', states.name)


def test_equal_names_and_wrong_poses_are_detected():
    with pytest.raises(ValueError, match='repeated'):
        posed([linkage('quadrilateral'), linkage('quadrilateral')])
    simulator, made = linkage('quadrilateral', joint_prefix='left_')
    later = messages_at(simulator, simulator.begin(0), STAMP + 1)
    with pytest.raises(AssertionError):
        assert_poses(posed([(simulator, made)]), simulator, later)


# ---------------------------------------------------------------- text of the URDF

JOINTS = ('crank', 'coupler', 'rocker')


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
    robot = ET.fromstring(make_urdf(mechanism))
    joint = robot.find("joint[@name='slider']")
    assert (joint.get('type'), joint.find('parent').get('link')) == ('prismatic', 'base_link')
    limit = {name: float(value) for name, value in joint.find('limit').items()}
    reach = mechanism.crank.length + mechanism.coupler.length
    assert (limit['lower'], limit['upper']) == (-reach, reach)
    inertial = robot.find("link[@name='slider_link']/inertial")
    assert float(inertial.find('mass').get('value')) == mechanism.slider.mass
    assert float(inertial.find('inertia').get('izz')) > 0  # simulators require a mass
    block = numbers(robot.find("link[@name='slider_link']/visual/geometry/box"), 'size')
    assert 0 < max(block) < min(mechanism.crank.length, mechanism.coupler.length)


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
    assert robot.find("link[@name='base_link']/inertial") is None  # it does not move


@pytest.mark.parametrize('scale', [1e-9, 1e-3, 1.0, 1e8])
def test_bars_reach_from_pin_to_pin_and_lie_one_above_the_other(scale):
    lengths = [scale * length for length in (1.0, 3.0, 2.5, 2.0)]
    robot = ET.fromstring(make_urdf(make(lengths)))
    spans = []
    for name, length in zip(JOINTS, lengths, strict=False):
        visual = robot.find(f"link[@name='{name}_link']/visual")
        x, y, z = numbers(visual.find('origin'), 'xyz')
        size = numbers(visual.find('geometry/box'), 'size')
        assert size[0] == length
        assert (x, y) == (pytest.approx(length / 2, rel=1e-15), 0.0)
        assert all(0 < side < min(lengths) for side in size[1:])
        spans.append((z - size[2] / 2, z + size[2] / 2))
    for below, above in pairwise(sorted(spans)):
        assert below[1] <= above[0] * (1 + 1e-12)
