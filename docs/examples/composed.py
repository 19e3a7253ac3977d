# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Runs linkage_node and a node of your own in one process and one executor."""

import sys
import threading

import rclpy
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState

from linkage_ros.cli import Stop
from linkage_ros.node.linkage_node import LinkageNode


class Watcher(Node):  # type: ignore[misc]  # rclpy has no types
    """Logs the crank angle once a second."""

    def __init__(self) -> None:
        super().__init__('watcher')
        self._angle = 0.0
        self.create_subscription(JointState, 'joint_states', self._hear, 10)
        self.create_timer(1.0, self._log)

    def _hear(self, message: JointState) -> None:
        self._angle = message.position[0]

    def _log(self) -> None:
        self.get_logger().info(f'crank at {self._angle:.3f} rad')


def main() -> int:
    """Runs both nodes until Ctrl-C or SIGTERM; returns the exit code."""
    # rclpy's own signal handlers would end ROS before the torque.
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    stop, executor = Stop(), MultiThreadedExecutor()
    linkage = LinkageNode(stop)
    executor.add_node(linkage)
    executor.add_node(Watcher())
    thread = threading.Thread(target=executor.spin, daemon=True)
    thread.start()
    linkage.start()
    stop.wait()
    code = linkage.end()
    executor.shutdown()
    thread.join()
    rclpy.shutdown()
    return code


if __name__ == '__main__':
    sys.exit(main())
