# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Starts a reference, a plant and ros2_control, which adds the reference's torque to PD control.

Run it in a folder with linkage.urdf and controllers.yaml; see docs/controllers.md.
"""

from pathlib import Path

from launch import LaunchDescription
from launch.actions import ExecuteProcess, RegisterEventHandler
from launch.event_handlers import OnProcessExit
from launch_ros.actions import Node

from linkage_ros.settings.presets import preset_path


def generate_launch_description() -> LaunchDescription:
    """Describes the four nodes, and the spawner that starts after the plant's first state."""
    urdf = Path('linkage.urdf').read_text()
    plant = {'drive': 'torque', 'rate_hz': 1000.0, 'torque_limit': 20.0}
    reference = {
        'rate_hz': 1000.0,
        'trajectory_command_topic': '/crank_controller/joint_trajectory',
    }
    first_state = ExecuteProcess(
        cmd=[
            *('ros2', 'topic', 'echo', '--once'),
            *('/plant/joint_states', 'sensor_msgs/msg/JointState'),
        ]
    )
    return LaunchDescription(
        [
            Node(
                package='linkage_ros',
                executable='linkage_node',
                namespace='plant',
                parameters=[plant],
                remappings=[('joint_commands', '/joint_commands')],
            ),
            Node(
                package='linkage_ros',
                executable='linkage_node',
                namespace='reference',
                parameters=[preset_path('quadrilateral'), reference],
            ),
            Node(
                package='robot_state_publisher',
                executable='robot_state_publisher',
                parameters=[{'robot_description': urdf, 'publish_frequency': 200.0}],
                remappings=[('joint_states', 'plant/joint_states')],
            ),
            Node(
                package='controller_manager',
                executable='ros2_control_node',
                parameters=['controllers.yaml'],
            ),
            first_state,
            RegisterEventHandler(
                OnProcessExit(
                    target_action=first_state,
                    on_exit=[
                        Node(
                            package='controller_manager',
                            executable='spawner',
                            arguments=[
                                'joint_state_broadcaster',
                                'crank_controller',
                                '--param-file',
                                'controllers.yaml',
                            ],
                        )
                    ],
                )
            ),
        ]
    )
