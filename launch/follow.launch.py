"""A linkage whose crank is measured: its passive joints, and its torque for a controller.

ros2 launch linkage_ros follow.launch.py params:=linkage.yaml measured:=/joint_states
"""

from linkage_ros.parameters.launched import follow
from linkage_ros.ros.launching import NAMES, OUTPUTS, description, program

# An empty argument leaves the value of the parameter file.
ARGUMENTS = {
    'params': ('quadrilateral', 'parameter file or preset'),
    'measured': ('/joint_states', "the robot's topic with the crank"),
    'joint_states': ('linkage/joint_states', "the linkage's own topic"),
    'follow_bandwidth': ('', 'of the filter, Hz'),
    'effort_command_topic': ('', 'topic of the driving torque for a controller'),
    'lead_time': ('', 'time ahead of the stamp for which it is computed, s'),
    **NAMES,
    **OUTPUTS,
}


def start(arguments: dict[str, str]) -> list:
    """Starts the node."""
    remappings = [
        ('measured_joint_states', arguments['measured']),
        ('joint_states', arguments['joint_states']),
    ]
    return [program('linkage_node', arguments['namespace'], follow(arguments), remappings)]


def generate_launch_description():  # noqa: ANN201, launch has no types
    """Makes the launch description; `ros2 launch` calls this function."""
    return description(ARGUMENTS, start)
