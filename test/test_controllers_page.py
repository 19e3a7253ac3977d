# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""docs/controllers.md: its ways in, run as they stand there; the third is in test_docs.py."""

from __future__ import annotations

import itertools
import re
import shlex
import signal
import subprocess
import sys
import time
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from pages import block, read
from ros_harness import Listener, environment, fresh_domain, running, wait_for
from sensor_msgs.msg import JointState
from test_node import stop

from linkage_ros.wire.codecs import JointStateCodec

PAGE = read('docs/controllers.md')
CODEC = JointStateCodec(('crank', 'coupler', 'rocker'))
STATES = {'/joint_states': 'sensor_msgs/msg/JointState'}
# The node beside ros2_control, as a launch file has it.
BESIDE = eval(block(PAGE, 'Node('), {'Node': dict})


def beside_ros2_control(*, remapped=True):
    parameters = [f'{name}:={value}' for name, value in BESIDE['parameters'][0].items()]
    remaps = [f'{old}:={new}' for old, new in BESIDE['remappings'] if remapped]
    words = [*zip(itertools.repeat('-p'), parameters), *zip(itertools.repeat('-r'), remaps)]
    return ['--ros-args', *itertools.chain.from_iterable(words)]


def test_way_1_the_subscriber_turns_the_crank(tmp_path):
    script = tmp_path / 'prototype.py'
    script.write_text(block(PAGE, 'from contextlib'))
    assert len(script.read_text().splitlines()) <= 16
    (plant,) = re.findall(r'`linkage_node (--ros-args [^`]+)`', PAGE)
    domain = fresh_domain()
    with (
        Listener(domain, STATES) as listener,
        running('node', *shlex.split(plant), domain=domain) as node,
    ):
        prototype = subprocess.Popen(
            [sys.executable, script], env=environment(domain), stderr=subprocess.PIPE, text=True
        )
        others = listener.node.create_publisher(JointState, '/joint_states', 10)
        try:

            def speed():
                others.publish(JointState(name=['wheel'], position=[1.0], velocity=[99.0]))
                others.publish(JointState(name=['crank'], position=[1.0]))
                last = [data for data in listener.received['/joint_states'] if b'rocker' in data]
                speeds = [CODEC.decode(data)[1][3] for data in last[-500:]]
                return np.mean(speeds) if speeds else 0.0

            # It asks for 15.7 rad/s; gravity makes a proportional law swing about it.
            wait_for(lambda: speed() > 10.0)
            assert speed() < 20.0
            # Without messages on the way: rclpy's own take and publish fail when a signal comes.
            code, output = stop(node)
            prototype.send_signal(signal.SIGTERM)
            _, said = prototype.communicate(timeout=60)
            assert (prototype.returncode, said) == (0, '')
        finally:
            prototype.kill()
            prototype.wait()
    assert code == 0, output


def test_way_2_the_parameters_send_the_torque_to_the_controller(tmp_path):
    path = tmp_path / 'parameters.yaml'
    path.write_text(block(PAGE, 'controller_manager:'))
    topic, domain = '/effort_controller/commands', fresh_domain()
    with (
        Listener(domain, {topic: 'std_msgs/msg/Float64MultiArray'}) as listener,
        running('node', '--ros-args', '--params-file', path, domain=domain) as node,
    ):
        wait_for(lambda: len(listener.received[topic]) > 20)
        code, output = stop(node)
    assert code == 0, output
    values = np.array([np.frombuffer(data[-8:], '<f8') for data in listener.received[topic]])
    assert np.all(np.isfinite(values))
    assert np.ptp(values) > 0.0


def test_way_2_the_tag_names_what_the_node_has():
    tag = ET.fromstring(block(PAGE, '<ros2_control'))
    parameters = {element.get('name'): element.text for element in tag.iter('param')}
    assert parameters['joint_commands_topic'] == '/joint_commands'
    assert parameters['joint_states_topic'] == f'/{dict(BESIDE["remappings"])["joint_states"]}'
    # JointStateTopicSystem names every joint of the tag in its commands, and gives an effort for
    # those alone that have the interface: with one more joint each command would be refused.
    (joint,) = tag.iter('joint')
    assert joint.get('name') == 'crank'
    assert [i.get('name') for i in joint.iter('command_interface')] == ['effort']


@pytest.mark.parametrize('remapped', [True, False])
def test_way_2_the_remaps_leave_ros2_controls_topics_to_it(remapped):
    topic = '/plant/joint_states' if remapped else '/joint_states'
    domain, states = fresh_domain(), {topic: 'sensor_msgs/msg/JointState'}
    arguments = beside_ros2_control(remapped=remapped)
    with Listener(domain, states) as listener, running('node', *arguments, domain=domain) as node:
        wait_for(lambda: listener.received[topic])
        publishers = [
            listener.node.count_publishers(name)
            for name in ('/joint_states', '/robot_description')
        ]
        code, output = stop(node)
    assert code == 0, output
    assert publishers == ([0, 0] if remapped else [1, 1])


def test_way_2_commands_as_joint_state_topic_system_sends_them_move_the_plant():
    domain, topic = fresh_domain(), '/plant/joint_states'
    states, arguments = {topic: 'sensor_msgs/msg/JointState'}, beside_ros2_control()
    with Listener(domain, states) as listener, running('node', *arguments, domain=domain) as node:
        publisher = listener.node.create_publisher(JointState, '/joint_commands', 1)
        wait_for(lambda: publisher.get_subscription_count() and listener.received[topic])

        def efforts():
            return {CODEC.decode(data)[1][6] for data in listener.received[topic][-5:]}

        def send(effort):
            message = JointState(name=['crank'], effort=[effort])
            message.header.stamp = listener.node.get_clock().now().to_msg()
            publisher.publish(message)
            time.sleep(0.001)

        def acts(effort):
            send(effort)
            return any(abs(one - effort) < 1e-12 for one in efforts())

        send(float('nan'))  # what it sends before a controller is active
        wait_for(lambda: acts(0.75))
        wait_for(lambda: acts(-0.25))
        code, output = stop(node)
    assert code == 0, output
    assert 'is refused: effort nan' in output
