# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Starts the node and robot_state_publisher, which puts the linkage into tf.

ros2 launch linkage_ros demo.launch.py params:=quadrilateral log:=run.mcap rviz:=true
"""

from pathlib import Path

from linkage_ros.node.launching import (
    FRAMES,
    MANAGED,
    NAMES,
    OUTPUTS,
    demo,
    description,
    frame_publisher,
    is_asked_for,
    program,
    ros_node,
    rviz_file,
    state_publisher,
    where_installed,
)

# An empty argument leaves the value of the parameter file.
ARGUMENTS = {
    'params': ('quadrilateral', 'parameter file or preset'),
    'rpm': ('', 'crank speed'),
    **FRAMES,
    **NAMES,
    **MANAGED,
    **OUTPUTS,
    'rviz': ('false', 'true: open RViz as well'),
}


def start(arguments: dict[str, str]) -> list:
    """Starts the node, and what is installed of robot_state_publisher and RViz."""
    node, publisher = demo(arguments)
    actions = [
        program('linkage_node', arguments, node),
        *state_publisher(arguments, publisher),
        *frame_publisher(arguments, node),
    ]
    if is_asked_for(arguments, 'rviz'):
        template = Path(__file__).parents[1] / 'rviz' / 'linkage.rviz'
        rviz = ros_node(
            arguments,
            package='rviz2',
            executable='rviz2',
            arguments=['-d', rviz_file(template, node, arguments['frame_prefix'])],
            parameters=[{'use_sim_time': publisher['use_sim_time']}],
        )
        actions.append(where_installed('rviz2', 'picture in RViz', rviz))
    return actions


def generate_launch_description():  # noqa: ANN201, launch has no types
    """Makes the launch description; `ros2 launch` calls this function."""
    return description(ARGUMENTS, start)
