# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Publishes the joint states of linkage_node from an rclpy timer, for comparison.

Usage: python timer_node.py HZ NAME. On SIGINT it prints the number of messages and the time that
they took, s, and on the last line its lateness, us: p50, p99, maximum. If NAME contains 'events',
the timer runs in rclpy's EventsExecutor instead of the default executor.
"""

import sys

import numpy as np
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState

from linkage_ros import cli
from linkage_ros.messages.joints import joint_rows
from linkage_ros.node.endpoints import wait_for_subscribers
from linkage_ros.run.states import Simulator
from linkage_ros.settings.configuration import load


def main() -> None:
    """Publishes until SIGINT."""
    period = 1.0 / float(sys.argv[1])
    simulator = Simulator(load('quadrilateral').only)
    late: list[int] = []
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node('timer_node')
    publisher = node.create_publisher(JointState, 'joint_states', 10)

    def tick() -> None:
        stamp = node.get_clock().now()
        # rclpy skips missed calls: each call is due at the last multiple of the period.
        late.append(round((stamp.nanoseconds - origin) % (period * 1e9)))
        coordinates = motion.at(stamp.nanoseconds)
        state = simulator.solver.state(*coordinates.q, *coordinates.u, *coordinates.a)
        position, velocity, _, effort = joint_rows(
            simulator.solver.structure.links, state, coordinates.unwrapped
        )
        message = JointState(
            name=simulator.joints, position=position, velocity=velocity, effort=effort
        )
        message.header.stamp = stamp.to_msg()
        message.header.frame_id = 'base_link'
        publisher.publish(message)

    wait_for_subscribers([publisher])  # as linkage_node does
    node.create_timer(period, tick)
    origin = node.get_clock().now().nanoseconds
    motion = simulator.begin(origin)
    executor = EventsExecutor() if 'events' in sys.argv[-1] else SingleThreadedExecutor()
    executor.add_node(node)
    # A KeyboardInterrupt might be raised in a finalizer, where Python ignores it.
    stop = cli.Stop()
    while not stop.is_set():  # spin() of the EventsExecutor does not call timers
        executor.spin_once(timeout_sec=0.1)
    print(len(late), (node.get_clock().now().nanoseconds - origin) * 1e-9)
    print(*(np.quantile(late, (0.5, 0.99, 1.0)) * 1e-3).round(1))


if __name__ == '__main__':
    main()
