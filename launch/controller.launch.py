# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A torque-driven quadrilateral as the plant, and a controller that keeps its speed.

ros2 launch linkage_ros controller.launch.py rpm:=600.0 feed_forward:=false log:=run.mcap
"""

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node


def start(context: LaunchContext) -> list[Node]:
    """Starts both."""
    rpm, feed_forward, log, viewer = (
        LaunchConfiguration(name).perform(context)
        for name in ('rpm', 'feed_forward', 'log', 'viewer')
    )
    speed = float(rpm)
    return [
        Node(
            package='linkage_ros',
            executable='linkage_controller',
            parameters=[{'rpm': speed, 'feed_forward': feed_forward == 'true'}],
            output='screen',
        ),
        Node(
            package='linkage_ros',
            executable='linkage_node',
            parameters=[
                {
                    'drive': 'torque',
                    'start_rpm': speed,
                    'rate_hz': 1000.0,
                    'log': log,
                    'viewer': viewer,
                }
            ],
            output='screen',
        ),
    ]


def generate_launch_description() -> LaunchDescription:
    """What `ros2 launch` asks for."""
    return LaunchDescription(
        [
            DeclareLaunchArgument('rpm', default_value='150.0', description='speed to keep'),
            DeclareLaunchArgument(
                'feed_forward', default_value='true', description='add the exact torque'
            ),
            DeclareLaunchArgument('log', default_value='', description='.mcap file to write'),
            DeclareLaunchArgument(
                'viewer', default_value='', description='spawn, web, URL or .rrd'
            ),
            OpaqueFunction(function=start),
        ]
    )
