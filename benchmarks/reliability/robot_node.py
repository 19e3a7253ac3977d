# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Publishes the joint states of a robot of 20 joints, of which the cranks turn.

Usage: python robot_node.py HZ OUT.npy CRANK [CRANK ...]. It publishes on joint_states; on SIGINT
it writes the stamps, ns, to OUT.npy. It packs the bytes itself, so that it takes little of the
processors, as a driver in C++ would. It skips periods that have passed.
"""

import math
import sys
import time

import numpy as np
import rclpy
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState

from linkage_ros import cli
from linkage_ros.messages.fields import Template
from linkage_ros.messages.templates import joint_state
from linkage_ros.units import NS_PER_S, radians_per_second

JOINTS, RPM = 20, 150.0


def main() -> None:
    """Publishes until SIGINT."""
    rate, path, *cranks = sys.argv[1:]
    period, speed = 1 / float(rate), radians_per_second(RPM)
    others = [f'joint{number}' for number in range(JOINTS - len(cranks))]
    template = Template(joint_state([*cranks, *others], ''))
    still = [0.0] * len(others)
    rates = [speed] * len(cranks) + still
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    publisher = rclpy.create_node('robot').create_publisher(JointState, 'joint_states', 10)
    stamps, stop, start = list[int](), cli.Stop(), time.monotonic()
    due = start
    while not stop.is_set():
        angle = math.remainder(speed * (due - start), math.tau)
        stamp = time.time_ns()
        numbers = *[angle] * len(cranks), *still, *rates, *[0.0] * JOINTS
        publisher.publish(template.pack(*divmod(stamp, NS_PER_S), *numbers))
        stamps.append(stamp)
        now = time.monotonic()
        due += period * max(1, math.ceil((now - due) / period))
        time.sleep(due - now)
    np.save(path, np.array(stamps, dtype=np.int64))


if __name__ == '__main__':
    main()
