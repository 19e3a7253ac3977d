# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A torque-driven quadrilateral as the plant, and a controller that keeps its speed.

ros2 launch linkage_ros controller.launch.py rpm:=600.0 feed_forward:=false log:=run.mcap
"""

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, Shutdown
from launch.events.process import ProcessExited
from launch_ros.actions import Node

from linkage_ros.parameters.launched import given, parameter_file
from linkage_ros.parameters.session import VIEWERS

# Name, default and meaning.
_ARGUMENTS = (
    ('rpm', '150.0', 'speed to keep'),
    ('feed_forward', 'true', 'add the exact torque'),
    ('namespace', '', 'namespace of both nodes, such as left'),
    ('use_sim_time', '', 'true: take the time from /clock'),
    ('joint_prefix', '', 'put before every joint and link name, such as left_'),
    ('log', '', '.mcap file to write'),
    ('log_overwrite', '', 'true: replace an existing log or .rrd file'),
    ('viewer', '', VIEWERS),
)


def start(context: LaunchContext) -> list:
    """Starts both; without one of them the other is of no use."""
    arguments = {name: context.launch_configurations[name] for name, _, _ in _ARGUMENTS}
    common, speed = given(arguments, ('use_sim_time', 'joint_prefix')), given(arguments, ['rpm'])
    plant = {
        'drive': 'torque',
        'rate_hz': 1000.0,
        'start_rpm': speed.get('rpm', 0.0),
        # The plant outlives a controller that is killed with its torque at the peak.
        'command_timeout': 0.02,
        'torque_limit': 400.0,
        **common,
        **given(arguments, ('log', 'log_overwrite', 'viewer')),
    }
    controller = {**common, **speed, **given(arguments, ['feed_forward'])}
    return [
        Node(
            package='linkage_ros',
            executable=name,
            namespace=arguments['namespace'],
            parameters=[parameter_file(values)],
            output='screen',
            on_exit=end,
        )
        for name, values in (('linkage_controller', controller), ('linkage_node', plant))
    ]


def end(event: ProcessExited, _: LaunchContext) -> list:
    """Ends the launch with a process.

    Args:
        event: The exit event of the process.

    Returns:
        What ends the launch.

    Raises:
        RuntimeError: The process failed; `ros2 launch` then ends with exit code 1.
    """
    if event.returncode:
        raise RuntimeError(f'{event.process_name} ended with exit code {event.returncode}')
    return [Shutdown(reason=f'{event.process_name} ended')]


def generate_launch_description() -> LaunchDescription:
    """What `ros2 launch` asks for."""
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=default, description=meaning)
                for name, default, meaning in _ARGUMENTS
            ),
            OpaqueFunction(function=start),
        ]
    )
