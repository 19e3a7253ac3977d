# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Publishes the passive joints, tf and driving torque of a linkage whose crank is measured.

ros2 launch linkage_ros follow.launch.py params:=linkage.yaml measured:=/joint_states
"""

from linkage_ros.node.launching import (
    FRAMES,
    MANAGED,
    NAMES,
    OUTPUTS,
    description,
    follow,
    program,
    state_publisher,
)

# An empty argument leaves the value of the parameter file.
ARGUMENTS = {
    'params': (None, 'parameter file or preset'),  # whose torque a controller may get
    'measured': ('/joint_states', "the robot's topic with the crank"),
    'joint_states': ('linkage/joint_states', "the linkage's own topic"),
    'crank_joint': ('', "the robot's name for the crank"),
    'frame_id': ('', "the robot's link that carries the fixed pivots"),
    'follow_bandwidth': ('', 'bandwidth of the filter, Hz'),
    'effort_command_topic': ('', 'topic of the driving torque for a controller'),
    'measurement_timeout': ('', 'time without a measurement after which the torque ends, s'),
    'lead_time': ('', 'time ahead of the stamp for which the torque is computed, s'),
    **FRAMES,
    **NAMES,
    **MANAGED,
    **OUTPUTS,
}


def start(arguments: dict[str, str]) -> list:
    """Starts the node, and robot_state_publisher if it is installed."""
    node, publisher = follow(arguments)
    own = 'joint_states', arguments['joint_states']
    remappings = [
        ('measured_joint_states', arguments['measured']),
        own,
        # The robot has a robot_description as well, which is not this one.
        ('robot_description', 'linkage/robot_description'),
    ]
    return [
        program('linkage_node', arguments, node, remappings),
        *state_publisher(arguments, publisher, [own]),
    ]


def generate_launch_description():  # noqa: ANN201, launch has no types
    """Makes the launch description; `ros2 launch` calls this function."""
    return description(ARGUMENTS, start)
