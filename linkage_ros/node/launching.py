# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Shared code of the launch files: arguments, parameters, and actions that start programs.

`arguments` are the texts of all arguments of a launch file, by name; `values` are parameters of a
node, by dotted name; `remappings` are topic names and their replacements.
"""

import json
import os
import re
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, LogInfo, OpaqueFunction, Shutdown
from launch_ros.actions import Node
from scipy.spatial.transform import Rotation

from linkage_ros.errors import ConfigurationError, in_file
from linkage_ros.messages.templates import ROOT_FRAME
from linkage_ros.messages.topics import point_topic, prefix_of, topic_of_linkage
from linkage_ros.messages.urdf import make_urdf, merged_urdf
from linkage_ros.quantities import Quantity, shown
from linkage_ros.settings.configuration import configure, read_values
from linkage_ros.settings.linkages import LINKAGES, linkage_names, split
from linkage_ros.settings.parameters import (
    OF_THE_RUN,
    VIEWERS,
    MechanismAndDrive,
    parameter_leaves,
)
from linkage_ros.settings.plane import Plane
from linkage_ros.settings.yaml_file import read_scalar
from linkage_ros.xml_file import read_xml

Values = dict[str, object]  # parameters of a node, by dotted name
# Default and meaning of launch arguments, by name; an argument without default must be given.
Arguments = dict[str, tuple[str | None, str]]

# Arguments of every launch file. An empty argument leaves the parameter unchanged.
NAMES: Arguments = {
    'namespace': ('', 'namespace of all nodes, such as left'),
    'use_sim_time': ('', 'true: take the time from /clock'),
    'log_level': ('', 'debug, info, warn, error or fatal, for all programs'),
    'joint_prefix': ('', 'prefix of every joint and link name, such as left_'),
}
# Arguments of launch files that start robot_state_publisher.
FRAMES: Arguments = {
    'frame_prefix': ('', 'prefix of every tf frame, such as left/'),
    'state_publisher': ('true', 'false: do not start robot_state_publisher'),
}
# An argument of launch files whose linkage_node may be a lifecycle node.
MANAGED: Arguments = {
    'managed': ('', 'true: a lifecycle node, which waits for configure and activate'),
}
OUTPUTS: Arguments = {
    'log': ('', '.mcap file to write'),
    'log_overwrite': ('', 'true: replace an existing log or .rrd file'),
    'viewer': ('', VIEWERS),
}
# Arguments that are strings even if they look like numbers.
_TEXTS = (
    'log', 'viewer', 'joint_prefix', 'effort_command_topic', 'crank_joint', 'frame_id', 'linkage',
)  # fmt: skip
_COMMON = ('use_sim_time', 'joint_prefix', *MANAGED, *OUTPUTS)
# Limit of the rate of tf, Hz. At the default of 20 Hz, a crank at 150 rpm turns by 45 deg between
# two transforms.
_TF_RATE = 200.0
# The display of a point in the RViz configuration.
_RVIZ_POINT = re.compile(r'    - Class: rviz_default_plugins/PointStamped\n(?:      .*\n)+')


def description(arguments: Arguments, start: Callable[[dict[str, str]], list[Any]]) -> Any:
    """Builds the launch description; `start` returns the actions, given the arguments."""

    def begin(context: LaunchContext) -> list[Any]:
        _require_known(arguments, Path(start.__code__.co_filename).name)
        return start({name: context.launch_configurations[name] for name in arguments})

    declared = (
        DeclareLaunchArgument(name, default_value=default, description=meaning)
        for name, (default, meaning) in arguments.items()
    )
    return LaunchDescription([*declared, OpaqueFunction(function=begin)])


def _require_known(arguments: Arguments, file: str) -> None:
    """Rejects misspelt launch arguments, which `ros2 launch` ignores.

    If another launch file includes `file`, the command line is for that.

    Raises:
        ConfigurationError: The command line of `ros2 launch` has an unknown argument.
    """
    names = [word.partition(':=')[0] for word in sys.argv if ':=' in word]
    unknown = [name for name in names if name not in arguments]
    if unknown and file in [Path(word).name for word in sys.argv]:
        raise ConfigurationError(
            f'{shown(unknown[0])} is not an argument of {file}, which has {", ".join(arguments)}'
        )


def given(arguments: Mapping[str, str], names: Iterable[str]) -> Values:
    """Returns the parameters that arguments of these names set, typed as by `-p NAME:=VALUE`.

    An empty argument, and one that the launch file lacks, sets none.
    """
    texts = {name: text for name in names if (text := arguments.get(name))}
    return {name: text if name in _TEXTS else read_scalar(text) for name, text in texts.items()}


def is_asked_for(arguments: Mapping[str, str], name: str) -> bool:
    """Returns whether a launch switch, such as rviz, is on.

    Raises:
        ConfigurationError: The value is neither true nor false.
    """
    switch = Quantity('switch', name)
    return switch.clean(name, given(arguments, [name]).get(name, False)) is True


def follow(arguments: Mapping[str, str]) -> tuple[Values, Values]:
    """Returns the parameters of a node that follows a measured crank, as `demo` does.

    Parameters of the file that do not apply to a measured crank are left out, because a preset
    defines the motion of its crank.
    """
    return _described(_followed(arguments), arguments)


def _followed(arguments: Mapping[str, str]) -> Values:
    """Returns the parameters of a node that follows measured cranks."""
    names = (
        'follow_bandwidth', 'effort_command_topic', 'lead_time', 'measurement_timeout',
        'crank_joint', 'frame_id', *_COMMON,
    )  # fmt: skip
    return {**_with_drive('follow', arguments), **given(arguments, names)}


def plant(arguments: Mapping[str, str]) -> Values:
    """Returns the parameters of linkages that a torque drives, without others of their file.

    Raises:
        ConfigurationError: The file cannot be used, or has several linkages and none is chosen.
    """
    values = _with_drive('torque', arguments)
    with in_file(arguments['params']):
        configure(values).linkage(arguments['linkage'])
    return values


def _with_drive(drive: str, arguments: Mapping[str, str]) -> Values:
    """Returns the parameters of the file that apply to a drive, with that drive."""
    file = read_values(arguments['params'], arguments['namespace'])
    with in_file(arguments['params']):
        configure(file)
    names = linkage_names(file)
    top, own = split(file, names)
    applicable = dict[str, set[str]]()  # names of parameters by linkage
    for name in names:
        given = {**top, **own[name]}
        kind = MechanismAndDrive.of({'mechanism': 'four_bar', **given, 'drive': drive})
        applicable[name] = {leaf.name for leaf in parameter_leaves(kind, given)}
    for_all = set.intersection(*applicable.values())
    parameters = {parameter: value for parameter, value in top.items() if parameter in for_all}
    for name in filter(None, names):
        for parameter, value in own[name].items():
            if parameter in applicable[name]:
                parameters[f'{name}.{parameter}'] = value
    if LINKAGES in file:
        parameters[LINKAGES] = file[LINKAGES]
    return {**parameters, 'drive': drive}


def robot(arguments: Mapping[str, str]) -> tuple[Values, list[Any]]:
    """Returns the parameters of a node that follows a robot, and the robot_state_publishers.

    A robot_state_publisher reads one topic. The first one reads the measured joints, the second
    one the passive joints of the linkage, so that each joint has one publisher.

    Raises:
        ConfigurationError: The URDF, the file or a value cannot be used.
    """
    values, publisher = _in_tf(_followed(arguments), arguments)
    linkages = configure(values).linkages
    joints = [joint.name for x in linkages for joint in x.robot_joints if joint.name]
    cranks = [x.robot_joints[x.mechanism.structure().driven].name for x in linkages]
    measured_urdf, passive_urdf = _robot_urdfs(arguments, joints, cranks)
    # The limit of publish_frequency would drop other messages in one than in the other.
    publisher['ignore_timestamp'] = True
    own = [
        ('joint_states', arguments['joint_states']),
        ('robot_description', 'linkage/robot_description'),
    ]
    passive = {**publisher, 'robot_description': passive_urdf}
    actions = [_state_publisher(arguments, 'linkage_state_publisher', passive, own)]
    if is_asked_for(arguments, 'state_publisher'):
        measured = {**publisher, 'robot_description': measured_urdf}
        renamed = [('joint_states', arguments['measured'])]
        actions.append(_state_publisher(arguments, 'robot_state_publisher', measured, renamed))
    return values, actions


def _robot_urdfs(
    arguments: Mapping[str, str], joints: Sequence[str], cranks: Sequence[str]
) -> tuple[str, str]:
    """Reads the URDF of a robot, without the mimic tags of the linkages' joints.

    Returns:
        The URDF; and the same with other names of the driven joints, `cranks`, for the publisher
        of the linkages' joints: their messages repeat the crank, which another one publishes.

    Raises:
        ConfigurationError: The file is not a URDF with these joints.
    """
    path = Path(arguments['urdf'])
    root = read_xml(path)
    missing = {*joints} - {joint.get('name') for joint in root.iter('joint')}
    if root.tag != 'robot' or missing:
        raise ConfigurationError(
            f'urdf = {path}: must be a URDF with the joints {", ".join(joints)} of params = '
            f'{arguments["params"]}, which linkage_import writes'
        )
    for joint in root.iter('joint'):
        mimic = joint.find('mimic')
        if mimic is not None and joint.get('name') in joints:
            joint.remove(mimic)
    urdf = ET.tostring(root, encoding='unicode')
    for element in (*root.iter('joint'), *root.iter('mimic')):
        attribute = 'joint' if element.tag == 'mimic' else 'name'
        if element.get(attribute) in cranks:
            element.set(attribute, f'{element.get(attribute)}, measured')
    return urdf, ET.tostring(root, encoding='unicode')


def frame_publisher(arguments: Mapping[str, str], values: Mapping[str, object]) -> list[Any]:
    """Returns actions that publish where the frame of each linkage with a plane is on a robot."""
    sessions = [linkage.session for linkage in configure(values).linkages]
    planes = {session.frame_id: session.plane for session in sessions if session.plane}
    return [_frame_publisher(arguments, frame, plane) for frame, plane in planes.items()]


def _frame_publisher(arguments: Mapping[str, str], frame_id: str, plane: Plane) -> Any:
    """Returns an action that publishes where a frame is in a link of the robot."""
    turn = Rotation.from_matrix(plane.axes()).as_quat()
    numbers = zip(('x', 'y', 'z', 'qx', 'qy', 'qz', 'qw'), (*plane.origin, *turn), strict=True)
    options = [word for name, value in numbers for word in (f'--{name}', repr(float(value)))]
    frames = ('--frame-id', arguments['frame_prefix'] + plane.link)
    publisher = ros_node(
        arguments,
        package='tf2_ros',
        executable='static_transform_publisher',
        arguments=[*frames, '--child-frame-id', frame_id, *options],
    )
    return where_installed('tf2_ros', f'place of {frame_id} in tf', publisher)


def demo(arguments: Mapping[str, str]) -> tuple[Values, Values]:
    """Returns the parameters of the demo: values of the file, overridden by arguments.

    They are passed to the node instead of the file, because in rcl the precedence of file sections
    and arguments depends on their order.

    Returns:
        The parameters of linkage_node and those of robot_state_publisher.

    Raises:
        ConfigurationError: The file or a value cannot be used.
    """
    file = read_values(arguments['params'], arguments['namespace'])
    return _described({**file, **given(arguments, ('rpm', *_COMMON))}, arguments)


def side_by_side(names: Sequence[str], arguments: Mapping[str, str]) -> tuple[Values, Values]:
    """Returns the parameters of one node with several linkages, as `demo` does.

    The argument with the name of each linkage is its file.
    """
    over = given(arguments, ('rpm', *_COMMON))
    values: Values = {LINKAGES: [*names]}
    for linkage in names:
        for name, value in read_values(arguments[linkage], arguments['namespace']).items():
            if name not in over:
                values[name if name in OF_THE_RUN else f'{linkage}.{name}'] = value
    return _described({**values, **over}, arguments)


def _in_tf(values: Values, arguments: Mapping[str, str]) -> tuple[Values, Values]:
    """Returns parameters with tf's names of frames, and some of robot_state_publisher."""
    linkages, prefix = configure(values).linkages, arguments['frame_prefix']
    publisher = {
        'frame_prefix': prefix,
        'publish_frequency': _TF_RATE,
        'use_sim_time': values.get('use_sim_time', False),
    }
    frames = {f'{prefix_of(x.name, ".")}frame_id': prefix + x.session.frame_id for x in linkages}
    return {**values, **frames}, publisher


def _described(values: Values, arguments: Mapping[str, str]) -> tuple[Values, Values]:
    """Returns the same as `_in_tf`, with the linkages' own robot_description.

    Raises:
        ConfigurationError: Their fixed pivots are on different links.
    """
    parameters, publisher = _in_tf(values, arguments)
    description = merged_urdf(
        [
            make_urdf(x.mechanism, x.session.joint_prefix, x.session.frame_id)
            for x in configure(values).linkages
        ]
    )
    return parameters, {'robot_description': description, **publisher}


def program(
    name: str,
    arguments: Mapping[str, str],
    values: Mapping[str, object],
    remappings: Sequence[tuple[str, str]] = (),
) -> Any:
    """Returns an action that starts a program of this package; its exit ends the launch."""
    return ros_node(
        arguments,
        package='linkage_ros',
        executable=name,
        parameters=[parameter_file(values)],
        remappings=list(remappings),
        output='screen',
        on_exit=_end,
    )


def ros_node(given_to_launch: Mapping[str, str], /, **options: Any) -> Any:
    """Returns an action that starts a node in the namespace of a launch, with its log level.

    The options are those of `launch_ros.actions.Node`.
    """
    level = given_to_launch['log_level']
    words = ['--log-level', level] if level else []
    return Node(namespace=given_to_launch['namespace'], ros_arguments=words, **options)


def state_publisher(
    arguments: Mapping[str, str],
    values: Mapping[str, object],
    remappings: Sequence[tuple[str, str]] = (),
) -> list[Any]:
    """Returns the start of robot_state_publisher if it is installed and not switched off."""
    if not is_asked_for(arguments, 'state_publisher'):
        return []
    # Otherwise both nodes would publish robot_description as latched messages; the log contains
    # that of linkage_node.
    own = 'robot_description', 'robot_state_publisher/robot_description'
    return [_state_publisher(arguments, 'robot_state_publisher', values, [own, *remappings])]


def _state_publisher(
    arguments: Mapping[str, str],
    name: str,
    values: Mapping[str, object],
    remappings: Sequence[tuple[str, str]],
) -> Any:
    """Returns a robot_state_publisher with parameters."""
    publisher = ros_node(
        arguments,
        package='robot_state_publisher',
        executable='robot_state_publisher',
        name=name,
        parameters=[parameter_file(values)],
        remappings=list(remappings),
    )
    return where_installed('robot_state_publisher', 'tf', publisher)


def where_installed(package: str, feature: str, action: Any) -> Any:
    """Returns an action, or one that says what to install if the ROS package is missing."""
    prefixes = filter(None, os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep))
    index = Path('share', 'ament_index', 'resource_index', 'packages', package)
    if any(Path(prefix, index).is_file() for prefix in prefixes):
        return action
    debian = f'ros-jazzy-{package.replace("_", "-")}'
    words = f'{package} is not installed, so there is no {feature}: sudo apt install {debian}'
    return LogInfo(msg=words)


def parameter_file(values: Mapping[str, object]) -> str:
    """Writes parameters of any node to a file, which exists until this process ends.

    Otherwise, launch_ros would convert the string 1e3 to a number.
    """
    return _file_in_memory(json.dumps({'/**': {'ros__parameters': values}}))


def rviz_file(template: Path, values: Mapping[str, object], frame_prefix: str) -> str:
    """Adapts the RViz configuration to the frames and points of a launch.

    Args:
        template: RViz configuration for a linkage without prefixes, with the point coupler_point.
        values: Parameters of linkage_node, whose frame_id is the tf frame of the link that carries
            the fixed pivots.
        frame_prefix: Frame prefix of robot_state_publisher. A trailing '/' is removed, because
            RViz adds one.

    Returns:
        Path of a file, which exists until this process ends.
    """
    linkages = configure(values).linkages
    topics = [
        topic_of_linkage(point_topic(point), linkage.name).name
        for linkage in linkages
        for point in linkage.mechanism.structure().traced
    ]

    def displays(of_template: re.Match[str]) -> str:
        """Returns a display for each point, like that of the template."""
        return ''.join(_display_of(topic, of_template[0]) for topic in topics)

    text = template.read_text(encoding='utf-8').replace(ROOT_FRAME, linkages[0].session.frame_id)
    text = _RVIZ_POINT.sub(displays, text)
    prefix = f"TF Prefix: '{frame_prefix.removesuffix('/')}'"
    return _file_in_memory(text.replace("TF Prefix: ''", prefix))


def _display_of(topic: str, template: str) -> str:
    """Returns the display of a point in an RViz configuration; the template has coupler_point."""
    name = topic.replace('points/', '')
    named = template.replace('Name: coupler_point', f'Name: {name}')
    return named.replace('Value: points/coupler_point', f'Value: {topic}')


def _file_in_memory(text: str) -> str:
    descriptor = os.memfd_create('linkage_ros')
    os.write(descriptor, text.encode())
    return f'/proc/{os.getpid()}/fd/{descriptor}'


def _end(event: Any, _: LaunchContext) -> list[Any]:
    """Ends the launch when a process ends.

    Raises:
        RuntimeError: The process failed; `ros2 launch` then ends with exit code 1.
    """
    if event.returncode:
        raise RuntimeError(f'{event.process_name} ended with exit code {event.returncode}')
    return [Shutdown(reason=f'{event.process_name} ended')]
