# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Shared code of the launch files: arguments, and actions that start and end programs."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeAlias

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, LogInfo, OpaqueFunction, Shutdown
from launch.events.process import ProcessExited
from launch_ros.actions import Node

from linkage_ros.parameters.launched import how_to_install, parameter_file
from linkage_ros.parameters.session import VIEWERS

# Default and meaning of launch arguments, by name.
Arguments: TypeAlias = dict[str, tuple[str, str]]

# Arguments of every launch file. An empty argument leaves the parameter unchanged.
NAMES: Arguments = {
    'namespace': ('', 'namespace of all nodes, such as left'),
    'use_sim_time': ('', 'true: take the time from /clock'),
    'joint_prefix': ('', 'put before every joint and link name, such as left_'),
}
# Arguments of launch files that start robot_state_publisher.
FRAMES: Arguments = {'frame_prefix': ('', 'put before every tf frame, such as left/')}
OUTPUTS: Arguments = {
    'log': ('', '.mcap file to write'),
    'log_overwrite': ('', 'true: replace an existing log or .rrd file'),
    'viewer': ('', VIEWERS),
}


def description(arguments: Arguments, start: Callable[[dict[str, str]], list[Any]]) -> Any:
    """Builds the launch description of a launch file.

    Args:
        arguments: Arguments of the launch file.
        start: Function that takes the values of the arguments by name and returns the actions.

    Returns:
        The launch description.
    """

    def begin(context: LaunchContext) -> list[Any]:
        return start({name: context.launch_configurations[name] for name in arguments})

    declared = (
        DeclareLaunchArgument(name, default_value=default, description=meaning)
        for name, (default, meaning) in arguments.items()
    )
    return LaunchDescription([*declared, OpaqueFunction(function=begin)])


def program(
    name: str,
    namespace: str,
    values: Mapping[str, object],
    remappings: Sequence[tuple[str, str]] = (),
) -> Any:
    """Returns an action that starts a program of this package, and ends the launch with it.

    Args:
        name: Name of the executable.
        namespace: Namespace of its node.
        values: Parameters of the node.
        remappings: Topic names and their replacements.

    Returns:
        The action.
    """
    return Node(
        package='linkage_ros',
        executable=name,
        namespace=namespace,
        parameters=[parameter_file(values)],
        remappings=list(remappings),
        output='screen',
        on_exit=_end,
    )


def state_publisher(
    namespace: str,
    values: Mapping[str, object],
    remappings: Sequence[tuple[str, str]] = (),
) -> Any:
    """Returns an action that starts robot_state_publisher if it is installed.

    Args:
        namespace: Namespace of its node.
        values: Parameters of the node.
        remappings: Topic names and their replacements.

    Returns:
        The action.
    """
    # Otherwise both nodes would publish robot_description as latched messages; the log contains
    # that of linkage_node.
    own = 'robot_description', 'robot_state_publisher/robot_description'
    publisher = Node(
        package='robot_state_publisher',
        executable='robot_state_publisher',
        namespace=namespace,
        parameters=[parameter_file(values)],
        remappings=[own, *remappings],
    )
    return where_installed('robot_state_publisher', 'tf', publisher)


def where_installed(package: str, feature: str, action: Any) -> Any:
    """Replaces an action by a message if the ROS package that it needs is missing.

    Args:
        package: Name of the package.
        feature: The feature that needs the package.
        action: Action that needs the package.

    Returns:
        The action, or one that prints what to install.
    """
    cure = how_to_install(package, feature)
    return LogInfo(msg=cure) if cure else action


def _end(event: ProcessExited, _: LaunchContext) -> list[Any]:
    """Ends the launch when a process ends.

    Raises:
        RuntimeError: The process failed; `ros2 launch` then ends with exit code 1.
    """
    if event.returncode:
        raise RuntimeError(f'{event.process_name} ended with exit code {event.returncode}')
    return [Shutdown(reason=f'{event.process_name} ended')]
