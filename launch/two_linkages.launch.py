# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Starts two linkages on one shaft in one node, which publishes one joint_states and one tf tree.

ros2 launch linkage_ros two_linkages.launch.py left:=quadrilateral right:=wiper rpm:=60.0
"""

from linkage_ros.node.launching import (
    FRAMES,
    MANAGED,
    NAMES,
    OUTPUTS,
    description,
    frame_publisher,
    program,
    side_by_side,
    state_publisher,
)

ARGUMENTS = {
    'left': ('quadrilateral', 'parameter file or preset of one linkage'),
    'right': ('slider_crank', 'parameter file or preset of the other linkage'),
    'rpm': ('', 'crank speed of both'),
    **FRAMES,
    **{name: NAMES[name] for name in ('namespace', 'use_sim_time', 'log_level')},
    **MANAGED,
    **OUTPUTS,
}


def start(arguments: dict[str, str]) -> list:
    """Starts the node and, if it is installed, robot_state_publisher."""
    node, publisher = side_by_side(('left', 'right'), arguments)
    return [
        program('linkage_node', arguments, node),
        *state_publisher(arguments, publisher),
        *frame_publisher(arguments, node),
    ]


def generate_launch_description():  # noqa: ANN201, launch has no types
    """Makes the launch description; `ros2 launch` calls this function."""
    return description(ARGUMENTS, start)
