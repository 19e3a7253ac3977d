# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Subscribes to joint states, and records stamps and times of arrival.

Usage: python listener.py OUT.npy TOPIC. On SIGINT the program writes OUT.npy and ends; each row
holds stamp and time of arrival, ns on the wall clock. It prints 'heard' at the first message, and
at the first message after each pause of more than a second.
"""

import array
import gc
import sys
import time

import numpy as np
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState

from linkage_ros import cli
from linkage_ros.messages.cdr import stamp_of


def main() -> None:
    """Records messages until SIGINT."""
    path, topic = sys.argv[1:]
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node('listener')
    times = array.array('q')

    def hear(data: bytes) -> None:
        now = time.time_ns()
        if not times or now > times[-1] + 10**9:
            print('heard', flush=True)
        times.extend((stamp_of(data), now))

    node.create_subscription(JointState, topic, hear, QoSProfile(depth=2000), raw=True)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    gc.freeze()
    stop = cli.Stop()
    print('listening', flush=True)
    while not stop.is_set():
        executor.spin_once(timeout_sec=0.1)
    np.save(path, np.array(times, dtype=np.int64).reshape(-1, 2))


if __name__ == '__main__':
    main()
