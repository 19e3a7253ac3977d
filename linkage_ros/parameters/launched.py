# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Converts launch arguments to parameters of the nodes started by a launch file.

This file does not import launch, so that it can be tested without ROS.
"""

import json
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

from linkage_ros.parameters.configuration import (
    MechanismAndDrive,
    configure,
    parameter_leaves,
    read_values,
)
from linkage_ros.parameters.parameter_file import read_scalar
from linkage_ros.quantities import Quantity
from linkage_ros.wire.codecs import ROOT_FRAME
from linkage_ros.wire.urdf import make_urdf

# Arguments that are strings even if they look like numbers.
_TEXTS = ('log', 'viewer', 'joint_prefix', 'effort_command_topic')
_COMMON = ('use_sim_time', 'joint_prefix', 'log', 'log_overwrite', 'viewer')


class Linkage(NamedTuple):
    """The parameters of a node and its robot_state_publisher.

    Attributes:
        node: Parameters of linkage_node.
        publisher: Parameters of robot_state_publisher.
        fixed_frame: Name of the tf frame of the link that carries the fixed pivots.
    """

    node: dict[str, object]
    publisher: dict[str, object]
    fixed_frame: str


def given(arguments: Mapping[str, str], names: Iterable[str]) -> dict[str, object]:
    """Returns the parameters set by launch arguments.

    Args:
        arguments: Argument strings by name; empty strings set no parameter.
        names: Names of the arguments that are parameters.

    Returns:
        The values by name, with the same types as with `-p NAME:=VALUE`.
    """
    texts = {name: arguments[name] for name in names if arguments[name]}
    return {name: text if name in _TEXTS else read_scalar(text) for name, text in texts.items()}


def follow(arguments: Mapping[str, str]) -> Linkage:
    """Returns the parameters of a node that follows a measured crank.

    Args:
        arguments: All arguments of follow.launch.py.

    Returns:
        The parameters, without those of the file that do not apply to a measured crank.

    Raises:
        ConfigurationError: The file or a value cannot be used.
    """
    names = ('follow_bandwidth', 'effort_command_topic', 'lead_time', *_COMMON)
    file = read_values(arguments['params'], arguments['namespace'])
    configure(file)
    # A preset defines the motion of its crank, which is measured here.
    kind = MechanismAndDrive.of({'mechanism': 'four_bar', **file, 'drive': 'follow'})
    known = {leaf.name for leaf in parameter_leaves(kind)}
    kept = {name: value for name, value in file.items() if name in known}
    return _linkage({**kept, 'drive': 'follow', **given(arguments, names)}, arguments)


def demo(arguments: Mapping[str, str]) -> Linkage:
    """Returns the parameters of the demo: values of the file, overridden by arguments.

    Args:
        arguments: All arguments of demo.launch.py.

    Returns:
        The parameters. They are passed to the node instead of the file, because in rcl the order
        decides whether a section of the file or an argument takes precedence.

    Raises:
        ConfigurationError: The file or a value cannot be used.
    """
    file = read_values(arguments['params'], arguments['namespace'])
    return _linkage({**file, **given(arguments, ('rpm', *_COMMON))}, arguments)


def _linkage(values: dict[str, object], arguments: Mapping[str, str]) -> Linkage:
    configuration = configure(values)
    session, prefix = configuration.session, arguments['frame_prefix']
    fixed_frame = prefix + session.frame_id
    publisher = {
        'robot_description': make_urdf(
            configuration.mechanism, session.joint_prefix, session.frame_id
        ),
        'frame_prefix': prefix,
        'use_sim_time': values.get('use_sim_time', False),
    }
    return Linkage({**values, 'frame_id': fixed_frame}, publisher, fixed_frame)


def is_asked_for(arguments: Mapping[str, str], name: str) -> bool:
    """Returns whether a launch switch, such as rviz, is on.

    Raises:
        ConfigurationError: The value is neither true nor false.
    """
    switch = Quantity('switch', name)
    return switch.clean(name, given(arguments, [name]).get(name, False)) is True


def parameter_file(values: Mapping[str, object]) -> str:
    """Writes parameters to a file, because launch_ros would convert the string 1e3 to a number.

    Args:
        values: Values by dotted name, for any node.

    Returns:
        Path of the file, which exists until this process ends.
    """
    return _file_in_memory(json.dumps({'/**': {'ros__parameters': values}}))


def rviz_file(template: Path, fixed_frame: str, frame_prefix: str) -> str:
    """Adapts the RViz configuration to the frames of a launch.

    Args:
        template: RViz configuration for a linkage without prefixes.
        fixed_frame: See `Linkage.fixed_frame`.
        frame_prefix: Frame prefix of robot_state_publisher. A trailing '/' is removed, because
            RViz adds one.

    Returns:
        Path of the template if it needs no change, otherwise of a file in memory.
    """
    if fixed_frame == ROOT_FRAME:
        return str(template)
    text = template.read_text(encoding='utf-8').replace(ROOT_FRAME, fixed_frame)
    return _file_in_memory(
        text.replace("TF Prefix: ''", f"TF Prefix: '{frame_prefix.removesuffix('/')}'")
    )


def _file_in_memory(text: str) -> str:
    """Writes text to a file in memory that exists until this process ends; returns its path."""
    descriptor = os.memfd_create('linkage_ros')
    os.write(descriptor, text.encode())
    return f'/proc/{os.getpid()}/fd/{descriptor}'


def how_to_install(package: str, feature: str) -> str:
    """Explains how to install a ROS package that is missing.

    Args:
        package: Name of the package.
        feature: The feature that requires the package.

    Returns:
        One line of advice; empty if a sourced workspace has the package.
    """
    prefixes = os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)
    index = Path('share', 'ament_index', 'resource_index', 'packages', package)
    if any(Path(prefix, index).is_file() for prefix in prefixes if prefix):
        return ''
    debian = f'ros-jazzy-{package.replace("_", "-")}'
    return f'{package} is not installed, so there is no {feature}: sudo apt install {debian}'
