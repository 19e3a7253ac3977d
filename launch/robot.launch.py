# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Publishes the passive joints, tf and driving torque of a closed loop in a robot's own URDF.

ros2 launch linkage_ros robot.launch.py urdf:=robot.urdf params:=leg.yaml
"""

from linkage_ros.node.launching import (
    FRAMES,
    MANAGED,
    NAMES,
    OUTPUTS,
    description,
    frame_publisher,
    program,
    robot,
)

# An empty argument leaves the value of the parameter file.
ARGUMENTS = {
    'urdf': (None, "the robot's URDF file"),
    'params': (None, 'parameter file that linkage_import made from it'),
    'measured': ('/joint_states', "the robot's topic with the measured joints"),
    'joint_states': ('linkage/joint_states', "the linkage's own topic"),
    'follow_bandwidth': ('', 'bandwidth of the filter, Hz'),
    'effort_command_topic': ('', 'topic of the driving torque for a controller'),
    'measurement_timeout': ('', 'time without a measurement after which the torque ends, s'),
    'lead_time': ('', 'time ahead of the stamp for which the torque is computed, s'),
    **FRAMES,
    'state_publisher': ('true', "false: the robot's own robot_state_publisher is running"),
    **NAMES,
    **MANAGED,
    **OUTPUTS,
}


def start(arguments: dict[str, str]) -> list:
    """Starts the node, and two robot_state_publishers if they are installed."""
    node, publishers = robot(arguments)
    remappings = [
        ('measured_joint_states', arguments['measured']),
        ('joint_states', arguments['joint_states']),
        ('robot_description', 'linkage/robot_description'),
    ]
    return [
        program('linkage_node', arguments, node, remappings),
        *publishers,
        *frame_publisher(arguments, node),
    ]


def generate_launch_description():  # noqa: ANN201, launch has no types
    """Makes the launch description; `ros2 launch` calls this function."""
    return description(ARGUMENTS, start)
