"""The node and robot_state_publisher, for a parameter file or a preset: the linkage in tf.

ros2 launch linkage_ros demo.launch.py params:=quadrilateral log:=run.mcap rviz:=true
"""

from pathlib import Path

from launch.actions import LogInfo
from launch_ros.actions import Node

from linkage_ros.parameters.launched import (
    demo,
    how_to_install,
    is_installed,
    parameter_file,
    rviz_file,
)
from linkage_ros.ros.launching import NAMES, OUTPUTS, description, program

# An empty argument leaves the value of the parameter file.
ARGUMENTS = {
    'params': ('quadrilateral', 'parameter file or preset'),
    'rpm': ('', 'crank speed'),
    'frame_prefix': ('', 'put before every tf frame, such as left/'),
    **NAMES,
    **OUTPUTS,
    'rviz': ('false', 'true: open RViz as well'),
}


def start(arguments: dict[str, str]) -> list:
    """Starts the node, and what is installed of robot_state_publisher and RViz."""
    run, namespace = demo(arguments), arguments['namespace']
    publisher = Node(
        package='robot_state_publisher',
        executable='robot_state_publisher',
        namespace=namespace,
        parameters=[parameter_file(run.publisher)],
        # Both would publish it, latched; the node's is the one that belongs to the log.
        remappings=[('robot_description', 'robot_state_publisher/robot_description')],
    )
    others = [('robot_state_publisher', 'tf', publisher)]
    if run.rviz:
        template = Path(__file__).parents[1] / 'rviz' / 'linkage.rviz'
        rviz = Node(
            package='rviz2',
            executable='rviz2',
            namespace=namespace,
            arguments=['-d', rviz_file(template, run.fixed_frame, arguments['frame_prefix'])],
            parameters=[{'use_sim_time': run.publisher['use_sim_time']}],
        )
        others.append(('rviz2', 'picture in RViz', rviz))
    return [
        program('linkage_node', namespace, run.node),
        *(
            action if is_installed(package) else LogInfo(msg=how_to_install(package, feature))
            for package, feature, action in others
        ),
    ]


def generate_launch_description():  # noqa: ANN201, launch has no types
    """Makes the launch description; `ros2 launch` calls this function."""
    return description(ARGUMENTS, start)
