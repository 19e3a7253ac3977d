# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Starts a torque-driven quadrilateral as the plant, and a controller that keeps its speed.

ros2 launch linkage_ros controller.launch.py rpm:=600.0 feed_forward:=false log:=run.mcap
"""

from linkage_ros.node.launching import NAMES, OUTPUTS, description, given, program

ARGUMENTS = {
    'rpm': ('150.0', 'speed to keep'),
    'feed_forward': ('true', 'add the exact torque'),
    **NAMES,
    **OUTPUTS,
}


def start(arguments: dict[str, str]) -> list:
    """Starts both; without one of them the other is of no use."""
    common, speed = given(arguments, ('use_sim_time', 'joint_prefix')), given(arguments, ['rpm'])
    plant = {
        'drive': 'torque',
        'rate_hz': 1000.0,
        'start_rpm': speed.get('rpm', 0.0),
        # The plant outlives a controller that is killed with its torque at the peak.
        'command_timeout': 0.02,
        'torque_limit': 400.0,
        **common,
        **given(arguments, OUTPUTS),
    }
    controller = {**common, **speed, **given(arguments, ['feed_forward'])}
    return [
        program('linkage_controller', arguments['namespace'], controller),
        program('linkage_node', arguments['namespace'], plant),
    ]


def generate_launch_description():  # noqa: ANN201, launch has no types
    """Makes the launch description; `ros2 launch` calls this function."""
    return description(ARGUMENTS, start)
