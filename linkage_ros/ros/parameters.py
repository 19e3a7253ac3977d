# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The configuration as parameters of an rclpy node: descriptors, checks, live changes."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

from rcl_interfaces.msg import (
    FloatingPointRange,
    ParameterDescriptor,
    ParameterType,
    SetParametersResult,
)
from rclpy.node import Node
from rclpy.parameter import Parameter

from linkage_ros.errors import ConfigurationError
from linkage_ros.files import path_exists
from linkage_ros.parameters.configuration import Configuration, parameter_leaves
from linkage_ros.parameters.parameter_file import read_parameter_file
from linkage_ros.parameters.presets import preset_names, preset_path
from linkage_ros.quantities import Leaf, Quantity

_TYPES = {
    'number': ParameterType.PARAMETER_DOUBLE,
    'pair': ParameterType.PARAMETER_DOUBLE_ARRAY,
    'list': ParameterType.PARAMETER_DOUBLE_ARRAY,
    'choice': ParameterType.PARAMETER_STRING,
    'text': ParameterType.PARAMETER_STRING,
    'switch': ParameterType.PARAMETER_BOOL,
}


class ParameterNode(Node):  # type: ignore[misc]  # rclpy has no types
    """A node that accepts a read-only parameter set to its current value.

    This way `ros2 param load` accepts the output of `ros2 param dump`.
    """

    def set_parameters_atomically(self, parameter_list: list[Parameter]) -> SetParametersResult:
        """Sets parameters, all or none; all services that set parameters call this.

        Args:
            parameter_list: The parameters; those that would not change are left out.

        Returns:
            The result for all of them.
        """
        changed = [
            parameter
            for parameter in parameter_list
            if not self.has_parameter(parameter.name)
            or parameter.get_parameter_value()
            != self.get_parameter(parameter.name).get_parameter_value()
        ]
        if not changed:
            return SetParametersResult(successful=True)
        return super().set_parameters_atomically(changed)


def describe(name: str, quantity: Quantity) -> ParameterDescriptor:
    """The descriptor of a parameter: meaning, unit, range, and whether it may be set live.

    Args:
        name: Name of the parameter.
        quantity: Its meaning, unit and range.

    Returns:
        The descriptor that `ros2 param describe` shows.
    """
    unit = f' [{quantity.unit}]' if quantity.unit else ''
    is_number = quantity.kind == 'number'
    span = FloatingPointRange(from_value=quantity.low, to_value=quantity.high)
    return ParameterDescriptor(
        name=name,
        type=_TYPES[quantity.kind],
        description=quantity.meaning + unit,
        additional_constraints='' if is_number or quantity.valid == 'text' else quantity.valid,
        read_only=not quantity.live,
        floating_point_range=[span] if is_number else [],
    )


def given_values(node: Node) -> dict[str, object]:
    """The parameters that a node was started with, by command line and files."""
    return {name: p.value for name, p in node._parameter_overrides.items()}  # noqa: SLF001, no other tells


def declare_values(node: Node, parameters: Iterable[Leaf], values: Mapping[str, object]) -> None:
    """Declares parameters with their current values.

    Args:
        node: The node.
        parameters: Names and quantities.
        values: Already checked; the node's own overrides are part of them.
    """
    for name, quantity, _ in parameters:
        # What means "none" where it is left out has no value to show; rclpy fails to dump such.
        if name in values:
            # The overrides are in the values; rclpy would refuse 60 for 60.0.
            descriptor = describe(name, quantity)
            node.declare_parameter(name, values[name], descriptor, ignore_override=True)


def declare(
    node: Node, configuration: Configuration, set_live: Callable[[str, float], None]
) -> None:
    """Declares every parameter of a configuration, and listens to those that may be set live.

    Args:
        node: The node.
        configuration: Already checked; the node's own overrides are part of it.
        set_live: Called with name and value of a parameter that was set while the node runs.
    """
    parameters = parameter_leaves(configuration.kind)
    values = configuration.parameters()
    values.setdefault('start_rpm', values.get('rpm'))  # which is in force where it was left out
    declare_values(node, parameters, values)
    live = [leaf.name for leaf in parameters if leaf.quantity.live]

    def take_whole_numbers(parameters: list[Parameter]) -> list[Parameter]:
        return [
            Parameter(parameter.name, value=float(parameter.value))
            if parameter.name in live and parameter.type_ == Parameter.Type.INTEGER
            else parameter
            for parameter in parameters
        ]

    def apply(parameters: list[Parameter]) -> None:
        for parameter in parameters:
            if parameter.name in live:
                set_live(parameter.name, parameter.value)

    node.add_pre_set_parameters_callback(take_whole_numbers)
    node.add_on_set_parameters_callback(_check)
    node.add_post_set_parameters_callback(apply)


def _check(parameters: list[Parameter]) -> SetParametersResult:
    """Refuses changes that rclpy would accept; it has checked types and ranges itself."""
    if any(parameter.name == 'use_sim_time' for parameter in parameters):
        reason = 'use_sim_time is read when the node starts: start it again'
        return SetParametersResult(successful=False, reason=reason)
    return SetParametersResult(successful=True)


def check_parameter_files(arguments: list[str], node: str) -> None:
    """Reads parameter files before rcl does, to give clearer errors than rcl.

    Args:
        arguments: Arguments of the command line.
        node: Name of the node, where they give no other.

    Raises:
        ConfigurationError: A file has an error, or a preset is given instead of a path.
    """
    given = dict(text.split(':=', 1) for text in arguments if re.match('__.*:=', text))
    name = given.get('__node') or given.get('__name') or node
    for option, path in itertools.pairwise(arguments):
        if option == '--params-file':
            if path in preset_names() and not path_exists(path):
                raise ConfigurationError(
                    f'{path} is a preset, and --params-file takes a path: {preset_path(path)}'
                )
            # Of a pipe, rcl would read, or wait for, what is read here.
            if path_exists(path) and not Path(path).is_file():
                raise ConfigurationError(f'{path} is no file: give the path of a parameter file')
            read_parameter_file(path, f'{given.get("__ns", "")}/{name}')
