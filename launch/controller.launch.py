# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Starts a torque-driven linkage as the plant, and a controller that keeps its speed.

ros2 launch linkage_ros controller.launch.py params:=quadrilateral rpm:=600.0 log:=run.mcap
"""

from linkage_ros.messages.topics import prefix_of
from linkage_ros.node.launching import (
    NAMES,
    OUTPUTS,
    description,
    given,
    plant,
    program,
)

ARGUMENTS = {
    'params': ('quadrilateral', 'parameter file or preset of the plant'),
    'linkage': ('', 'the linkage to control, if the plant has several'),
    'rpm': ('150.0', 'speed to keep'),
    'feed_forward': ('true', 'add the exact torque'),
    'torque_limit': ('400.0', 'largest torque on the plant, N m'),
    **NAMES,
    **OUTPUTS,
}


def start(arguments: dict[str, str]) -> list:
    """Starts both; without one of them the other is of no use."""
    common, speed = given(arguments, ('use_sim_time', 'joint_prefix')), given(arguments, ['rpm'])
    node = {
        # The plant outlives a controller that is killed with its torque at the peak.
        'command_timeout': 0.02,
        **plant(arguments),
        'rate_hz': 1000.0,
        f'{prefix_of(arguments["linkage"], ".")}start_rpm': speed.get('rpm', 0.0),
        **common,
        **given(arguments, ('torque_limit', *OUTPUTS)),
    }
    own = {'plant': arguments['params'], **given(arguments, ['linkage', 'feed_forward'])}
    return [
        program('linkage_controller', arguments, {**common, **speed, **own}),
        program('linkage_node', arguments, node),
    ]


def generate_launch_description():  # noqa: ANN201, launch has no types
    """Makes the launch description; `ros2 launch` calls this function."""
    return description(ARGUMENTS, start)
