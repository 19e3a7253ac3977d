# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The node and robot_state_publisher, for a parameter file or a preset: the linkage in tf.

ros2 launch linkage_ros demo.launch.py params:=quadrilateral log:=run.mcap rviz:=true
"""

from pathlib import Path

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, LogInfo, OpaqueFunction, Shutdown
from launch.events.process import ProcessExited
from launch_ros.actions import Node

from linkage_ros.parameters.launched import (
    demo,
    how_to_install,
    is_installed,
    parameter_file,
    rviz_file,
)
from linkage_ros.parameters.session import VIEWERS

# Name, default and meaning. An empty argument leaves the value of the parameter file.
_ARGUMENTS = (
    ('params', 'quadrilateral', 'parameter file or preset'),
    ('rpm', '', 'crank speed'),
    ('namespace', '', 'namespace of all nodes, such as left'),
    ('use_sim_time', '', 'true: take the time from /clock'),
    ('frame_prefix', '', 'put before every tf frame, such as left/'),
    ('joint_prefix', '', 'put before every joint and link name, such as left_'),
    ('log', '', '.mcap file to write'),
    ('log_overwrite', '', 'true: replace an existing log or .rrd file'),
    ('viewer', '', VIEWERS),
    ('rviz', 'false', 'true: open RViz as well'),
)


def start(context: LaunchContext) -> list:
    """Starts the node, and what is installed of robot_state_publisher and RViz."""
    arguments = {name: context.launch_configurations[name] for name, _, _ in _ARGUMENTS}
    run, namespace = demo(arguments), arguments['namespace']
    actions = [
        Node(
            package='linkage_ros',
            executable='linkage_node',
            namespace=namespace,
            parameters=[parameter_file(run.node)],
            output='screen',
            on_exit=end,
        )
    ]
    if is_installed('robot_state_publisher'):
        publisher = Node(
            package='robot_state_publisher',
            executable='robot_state_publisher',
            namespace=namespace,
            parameters=[parameter_file(run.publisher)],
            # Both would publish it, latched; the node's is the one that belongs to the log.
            remappings=[('robot_description', 'robot_state_publisher/robot_description')],
        )
        actions.append(publisher)
    else:
        actions.append(LogInfo(msg=how_to_install('robot_state_publisher', 'tf')))
    if run.rviz:
        template = Path(__file__).parents[1] / 'rviz' / 'linkage.rviz'
        file = rviz_file(template, run.fixed_frame, arguments['frame_prefix'])
        if is_installed('rviz2'):
            rviz = Node(
                package='rviz2',
                executable='rviz2',
                namespace=namespace,
                arguments=['-d', file],
                parameters=[{'use_sim_time': run.publisher['use_sim_time']}],
            )
            actions.append(rviz)
        else:
            actions.append(LogInfo(msg=how_to_install('rviz2', 'picture in RViz')))
    return actions


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
