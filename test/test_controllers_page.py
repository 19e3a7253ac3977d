# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Runs the examples of ways 1 and 2 in docs/controllers.md; test_docs.py runs those of way 3."""

import itertools
import re
import shlex
import subprocess
import sys
import time

import numpy as np
from pages import ROOT, read
from ros_harness import (
    CODEC,
    PATIENCE,
    SteppedClock,
    environment,
    fresh_domain,
    stop,
    wait_for,
    watched,
)
from sensor_msgs.msg import JointState

PAGE = read('docs/controllers.md')
STATES, PLANT_STATES, COMMANDS = '/joint_states', '/plant/joint_states', '/joint_commands'
# The plant, and the plant next to ros2_control.
PLANT, BESIDE = map(shlex.split, re.findall(r'`linkage_node (--ros-args [^`]+)`', PAGE))
# The node that sends its torque to a controller.
(TORQUE,) = map(shlex.split, re.findall(r'\n    linkage_node (--ros-args [^\n]+)', PAGE))


def test_way_1_the_subscriber_turns_the_crank():
    script = ROOT / 'docs' / 'examples' / 'prototype.py'
    domain = fresh_domain()
    simulated = '-p', 'use_sim_time:=true'
    with watched([STATES, COMMANDS], *PLANT, *simulated, domain=domain) as (listener, node):
        prototype = subprocess.Popen(
            [sys.executable, script], env=environment(domain), stderr=subprocess.PIPE, text=True
        )
        others = listener.node.create_publisher(JointState, STATES, 10)
        clock, (states, commands) = SteppedClock(listener, 10**6), listener.received.values()

        def has_speed():
            others.publish(JointState(name=['wheel'], position=[1.0], velocity=[99.0]))
            others.publish(JointState(name=['crank'], position=[1.0]))
            answered = len(commands)
            clock.step(lambda _: len(commands) > answered)
            last = [data for data in states[-900:] if b'rocker' in data][-200:]
            speeds = [CODEC.decode(data)[1][3] for data in last]
            return len(speeds) == 200 and 10.0 < np.mean(speeds) < 20.0

        try:
            clock.await_controller()
            # The setpoint is 15.7 rad/s; under proportional control, gravity varies the speed.
            assert any(has_speed() for _ in range(5000))
            prototype.terminate()
            _, errors = prototype.communicate(timeout=PATIENCE)
        finally:
            prototype.kill()
            prototype.wait()
        stop(node)
    # Once in about 50 runs, the signal makes rclpy's own wait or publish fail.
    assert (prototype.returncode, errors) == (0, '') or 'rclpy._rclpy_pybind11.RCLError' in errors


def test_way_2_the_parameters_send_the_torque_to_the_controller():
    topics = {'/effort_controller/commands': 'std_msgs/msg/Float64MultiArray'}
    path = ROOT / 'docs/examples/ros2_control/torque.yaml'
    renamed = [word for word in TORQUE if ':=' in word]
    options = [option for name in renamed for option in ('-r', name)]
    with watched(topics, '--ros-args', '--params-file', path, *options) as (listener, node):
        (received,) = listener.received.values()
        publisher = listener.node.create_publisher(JointState, '/joint_states', 10)
        times = itertools.count(1)

        def measure():
            n = next(times)
            message = JointState(name=['crank'], position=[0.1 * n], velocity=[10.0])
            message.header.stamp.nanosec = n * 10**7
            publisher.publish(message)

        wait_for(lambda: measure() or len(received) > 20)
        stop(node)
    values = np.array([np.frombuffer(data[-8:], '<f8') for data in received])
    assert np.all(np.isfinite(values))
    assert np.ptp(values) > 0.0


def test_way_2_commands_move_the_plant_whose_topics_are_remapped():
    """The commands are sent as JointStateTopicSystem sends them."""
    with watched([PLANT_STATES], *BESIDE) as (listener, node):
        received = listener.received[PLANT_STATES]
        publisher = listener.node.create_publisher(JointState, '/joint_commands', 1)
        wait_for(lambda: publisher.get_subscription_count() and received)
        counts = [
            listener.node.count_publishers(name)
            for name in (STATES, '/robot_description', PLANT_STATES, '/plant/robot_description')
        ]
        assert counts == [0, 0, 1, 1]  # ros2_control's own topics remain free

        def acts(effort):
            message = JointState(name=['crank'], effort=[effort])
            message.header.stamp = listener.node.get_clock().now().to_msg()
            publisher.publish(message)
            time.sleep(0.001)
            found = [CODEC.decode(data)[1][6] for data in received[-5:]]
            return any(abs(one - effort) < 1e-12 for one in found)

        acts(float('nan'))  # the value sent before a controller is active
        wait_for(lambda: acts(0.75))
        wait_for(lambda: acts(-0.25))
        output = stop(node)
    assert 'are rejected: effort nan' in output
