# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A torque-driven quadrilateral as the plant, and a controller that keeps its speed.

ros2 launch linkage_ros controller.launch.py rpm:=600.0 feed_forward:=false log:=run.mcap
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from linkage_ros.parameters.viewers import VIEWERS

_ARGUMENTS = (
    ('rpm', float, '150.0', 'speed to keep'),
    ('feed_forward', bool, 'true', 'add the exact torque'),
    ('log', str, '', '.mcap file to write'),
    ('viewer', str, '', VIEWERS),
)


def generate_launch_description() -> LaunchDescription:
    """What `ros2 launch` asks for."""
    given = {
        name: ParameterValue(LaunchConfiguration(name), value_type=kind)
        for name, kind, _, _ in _ARGUMENTS
    }
    plant = {
        'drive': 'torque',
        'rate_hz': 1000.0,
        'start_rpm': given['rpm'],
        # The plant outlives a controller that is killed with its torque at the peak.
        'command_timeout': 0.02,
        'torque_limit': 400.0,
        'log': given['log'],
        'viewer': given['viewer'],
    }
    controller = {name: given[name] for name in ('rpm', 'feed_forward')}
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=default, description=meaning)
                for name, _, default, meaning in _ARGUMENTS
            ),
            *(
                Node(package='linkage_ros', executable=name, parameters=[values], output='screen')
                for name, values in (('linkage_controller', controller), ('linkage_node', plant))
            ),
        ]
    )
