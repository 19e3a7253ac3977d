# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Starts two linkages on one shaft, in one tf tree; the right one follows the left one's crank.

ros2 launch linkage_ros two_linkages.launch.py left:=quadrilateral right:=wiper rpm:=60.0
"""

from pathlib import Path

from launch.actions import GroupAction, IncludeLaunchDescription
from launch_ros.actions import Node

from linkage_ros.node.launching import description, where_installed

ARGUMENTS = {
    'left': ('quadrilateral', 'parameter file or preset of the linkage that turns'),
    'right': ('slider_crank', 'parameter file or preset of the linkage that follows'),
    'rpm': ('', 'crank speed'),
    'rviz': ('false', 'true: open RViz as well'),
}


def start(arguments: dict[str, str]) -> list:
    """Starts both, each in a namespace of its own, with a prefix to its tf frames."""
    turns = {key: arguments[key] for key in ('rpm', 'rviz')}
    follows = {'measured': '/left/joint_states', 'joint_states': 'joint_states'}
    return [
        *linkage('left', 'demo', {'params': arguments['left'], **turns}, ('0', '0', '0')),
        *linkage('right', 'follow', {'params': arguments['right'], **follows}, ('0', '0', '0.1')),
    ]


def linkage(name: str, file: str, arguments: dict[str, str], place: tuple[str, str, str]) -> list:
    """Starts one of them, and puts it on the robot's base_link at x, y and z, m."""
    path = str(Path(__file__).with_name(f'{file}.launch.py'))
    given = {**arguments, 'namespace': name, 'frame_prefix': f'{name}/'}
    include = IncludeLaunchDescription(path, launch_arguments=list(given.items()))
    frames = ('--frame-id', 'base_link', '--child-frame-id', f'{name}/base_link')
    options = zip(('--x', '--y', '--z'), place, strict=True)
    mount = Node(
        package='tf2_ros',
        executable='static_transform_publisher',
        namespace=name,
        arguments=[*frames, *(word for option in options for word in option)],
    )
    return [
        GroupAction([include], forwarding=False),  # neither sees the arguments of the other
        where_installed('tf2_ros', f'place of {name}/base_link in tf', mount),
    ]


def generate_launch_description():  # noqa: ANN201, launch has no types
    """Makes the launch description; `ros2 launch` calls this function."""
    return description(ARGUMENTS, start)
