# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The node and robot_state_publisher, for a parameter file or a preset: the linkage in tf.

ros2 launch linkage_ros demo.launch.py params:=quadrilateral log:=run.mcap rviz:=true
"""

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

from linkage_ros.parameters.configuration import load
from linkage_ros.parameters.presets import find_file
from linkage_ros.parameters.viewers import VIEWERS
from linkage_ros.wire.urdf import make_urdf


def start(context: LaunchContext) -> list[Node]:
    """Starts both with the same description."""
    params, log, viewer = (
        LaunchConfiguration(name).perform(context) for name in ('params', 'log', 'viewer')
    )
    # An argument that was not given must not hide what the parameter file says.
    given = {name: text for name, text in (('log', log), ('viewer', viewer)) if text}
    configuration = load(params)
    names = configuration.session
    description = make_urdf(configuration.mechanism, names.joint_prefix, names.frame_id)
    return [
        Node(
            package='linkage_ros',
            executable='linkage_node',
            parameters=[str(find_file(params)), given] if given else [str(find_file(params))],
            output='screen',
        ),
        Node(
            package='robot_state_publisher',
            executable='robot_state_publisher',
            parameters=[{'robot_description': description}],
            # Both would publish it, latched; the node's is the one that belongs to the log.
            remappings=[('robot_description', 'robot_state_publisher/robot_description')],
        ),
    ]


def generate_launch_description() -> LaunchDescription:
    """What `ros2 launch` asks for."""
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                'params', default_value='quadrilateral', description='parameter file or preset'
            ),
            DeclareLaunchArgument('log', default_value='', description='.mcap file to write'),
            DeclareLaunchArgument('viewer', default_value='', description=VIEWERS),
            DeclareLaunchArgument('rviz', default_value='false', description='open RViz as well'),
            OpaqueFunction(function=start),
            Node(
                package='rviz2',
                executable='rviz2',
                arguments=[
                    '-d',
                    PathJoinSubstitution(
                        [FindPackageShare('linkage_ros'), 'rviz', 'linkage.rviz']
                    ),
                ],
                condition=IfCondition(LaunchConfiguration('rviz')),
            ),
        ]
    )
