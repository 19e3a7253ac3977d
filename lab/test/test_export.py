# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_export urdf: the node's URDF as a file."""

import re
from xml.etree import ElementTree as ET

import mujoco  # required by this test: without it it must fail, not be skipped
import pytest
from ros_harness import assert_refused

from linkage_lab import export
from linkage_ros.messages.urdf import make_urdf
from linkage_ros.settings.configuration import load


def test_urdf_equals_that_of_the_node_beside_the_tag_of_ros2_control(tmp_path, called):
    out, configuration = tmp_path / 'linkage.urdf', load('slider_crank')
    assert called(export, 'urdf', 'slider_crank', out)[0] == 0
    assert out.read_text() == make_urdf(configuration.mechanism)
    words = ('--joint-prefix', 'left_', '--ros2-control', '--overwrite')
    assert called(export, 'urdf', 'slider_crank', out, *words)[0] == 0
    robot = ET.fromstring(out.read_bytes())
    tag = robot.find('ros2_control')
    robot.remove(tag)
    plain = ET.fromstring(make_urdf(configuration.mechanism, 'left_').encode())
    assert canonical(robot) == canonical(plain)
    parameters = {element.get('name'): element.text for element in tag.iter('param')}
    assert parameters['joint_commands_topic'] == '/joint_commands'
    assert parameters['joint_states_topic'] == '/plant/joint_states'
    # JointStateTopicSystem names every joint of the tag in its commands, but gives efforts only
    # for joints with that interface, so with another joint each command would be refused.
    (joint,) = tag.iter('joint')
    assert joint.get('name') == 'left_crank'
    assert [i.get('name') for i in joint.iter('command_interface')] == ['effort']
    mujoco.MjModel.from_xml_path(str(out))  # ignores the tag


def canonical(element):
    return ET.canonicalize(ET.tostring(element), strip_text=True)


@pytest.mark.parametrize(
    ('words', 'said'),
    [
        (('urdf', 'quadrilateral', 'linkage.urdf'), 'linkage.urdf already exists: '),
        (('urdf', 'quadrilateral', 'linkage.yaml', '--overwrite'), 'must end with .urdf'),
        (('urdf', 'quadrilateral', 'a.urdf', '--joint-prefix', 'a b'), "joint_prefix = 'a b'"),
        (('urdf', 'triangle', 'a.urdf'), "no preset 'triangle': choose one of"),
        (('sdf', 'quadrilateral', 'a.sdf'), "invalid choice: 'sdf'"),
        (('mjcf', 'quadrilateral', 'a.urdf'), 'must end with .xml'),
    ],
)
def test_failed_export_gives_one_line(tmp_path, monkeypatch, called, words, said):
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'linkage.urdf').write_text('mine')
    assert_refused(*called(export, *words), re.escape(said))
    assert [path.name for path in tmp_path.iterdir()] == ['linkage.urdf']
    assert (tmp_path / 'linkage.urdf').read_text() == 'mine'
