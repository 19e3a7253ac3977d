# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Publishes one torque command again and again.

Usage: python commander.py HZ EFFORT. It publishes on joint_commands until SIGINT.
"""

import sys
import time

import rclpy
from rclpy.serialization import serialize_message
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState

from linkage_ros import cli


def main() -> None:
    """Publishes until SIGINT."""
    rate, effort = map(float, sys.argv[1:])
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    publisher = rclpy.create_node('commander').create_publisher(JointState, 'joint_commands', 10)
    command = serialize_message(JointState(name=['crank'], effort=[effort]))
    stop, due = cli.Stop(), time.monotonic()
    while not stop.is_set():
        publisher.publish(command)
        due += 1 / rate
        time.sleep(max(0.0, due - time.monotonic()))


if __name__ == '__main__':
    main()
