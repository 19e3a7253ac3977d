# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Turns launch arguments into parameters of the nodes that a launch file starts.

This file does not import launch, so that it can be tested without ROS.
"""

from __future__ import annotations

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

# Arguments that are text even if they look like a number; empty arguments count as not given.
_TEXTS = ('log', 'viewer', 'joint_prefix', 'effort_command_topic')
_COMMON = ('use_sim_time', 'joint_prefix', 'log', 'log_overwrite', 'viewer')


class Linkage(NamedTuple):
    """The parameters of a node and its robot_state_publisher.

    Attributes:
        node: Parameters of linkage_node.
        publisher: Parameters of robot_state_publisher.
        fixed_frame: Name in tf of the link that carries the fixed pivots.
    """

    node: dict[str, object]
    publisher: dict[str, object]
    fixed_frame: str


def given(arguments: Mapping[str, str], names: Iterable[str]) -> dict[str, object]:
    """Returns the parameters that launch arguments set.

    Args:
        arguments: Texts by name; an empty text sets nothing.
        names: Names of the arguments that are parameters.

    Returns:
        Values by name, with the types that `-p NAME:=VALUE` would give them.
    """
    texts = {name: arguments[name] for name in names if arguments[name]}
    return {name: text if name in _TEXTS else read_scalar(text) for name, text in texts.items()}


def follow(arguments: Mapping[str, str]) -> Linkage:
    """Returns the parameters of a node that follows a measured crank.

    Args:
        arguments: All arguments of follow.launch.py.

    Returns:
        The parameters; values of the file that such a node does not have are left out.

    Raises:
        ConfigurationError: The file or a value cannot be used.
    """
    names = ('follow_bandwidth', 'effort_command_topic', 'lead_time', *_COMMON)
    file = read_values(arguments['params'], arguments['namespace'])
    configure(file)
    # A preset sets the motion of its crank; here the crank is measured.
    kind = MechanismAndDrive.of({'mechanism': 'four_bar', **file, 'drive': 'follow'})
    known = {leaf.name for leaf in parameter_leaves(kind)}
    kept = {name: value for name, value in file.items() if name in known}
    return _linkage({**kept, 'drive': 'follow', **given(arguments, names)}, arguments)


def demo(arguments: Mapping[str, str]) -> Linkage:
    """Returns the parameters of the demo: values of the file, overridden by arguments.

    Args:
        arguments: All arguments of demo.launch.py.

    Returns:
        The parameters. The node gets these values instead of the file, because rcl's choice
        between two sections of a file and an argument depends on their order.

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
    """Returns whether a switch such as rviz is on.

    Raises:
        ConfigurationError: The value is neither true nor false.
    """
    switch = Quantity('switch', name)
    return switch.clean(name, given(arguments, [name]).get(name, False)) is True


def parameter_file(values: Mapping[str, object]) -> str:
    """Writes parameters to a file, because launch_ros would convert the text 1e3 to a number.

    Args:
        values: Values by dotted name, for any node.

    Returns:
        Path of the file.
    """
    return _file_in_memory(json.dumps({'/**': {'ros__parameters': values}}))


def rviz_file(template: Path, fixed_frame: str, frame_prefix: str) -> str:
    """Writes RViz's configuration for the frames of a launch.

    Args:
        template: RViz's configuration for a linkage without prefixes.
        fixed_frame: As in `Linkage`.
        frame_prefix: Frame prefix of robot_state_publisher. RViz adds a '/' to its own prefix.

    Returns:
        Path of the template, or of a file in memory.
    """
    if fixed_frame == ROOT_FRAME:
        return str(template)
    text = template.read_text(encoding='utf-8').replace(ROOT_FRAME, fixed_frame)
    return _file_in_memory(
        text.replace("TF Prefix: ''", f"TF Prefix: '{frame_prefix.removesuffix('/')}'")
    )


def _file_in_memory(text: str) -> str:
    """Writes a text to a file in memory, which exists until this process ends."""
    descriptor = os.memfd_create('linkage_ros')
    os.write(descriptor, text.encode())
    return f'/proc/{os.getpid()}/fd/{descriptor}'


def how_to_install(package: str, feature: str) -> str:
    """Advises how to install a ROS package that is missing.

    Args:
        package: Name of the package.
        feature: The feature that is missing without the package.

    Returns:
        One line; empty if a sourced workspace has the package.
    """
    prefixes = os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)
    index = Path('share', 'ament_index', 'resource_index', 'packages', package)
    if any(Path(prefix, index).is_file() for prefix in prefixes if prefix):
        return ''
    debian = f'ros-jazzy-{package.replace("_", "-")}'
    return f'{package} is not installed, so there is no {feature}: sudo apt install {debian}'
