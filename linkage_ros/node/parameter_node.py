# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Declares quantities as parameters of an rclpy node: descriptors, checks, live changes."""

import functools
import itertools
import sys
from array import array
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from typing import Any

from rcl_interfaces.msg import (
    FloatingPointRange,
    ParameterDescriptor,
    ParameterType,
    SetParametersResult,
)
from rclpy.node import Node
from rclpy.parameter import Parameter

from linkage_ros.errors import ConfigurationError
from linkage_ros.messages.topics import SIMULATED_CLOCK
from linkage_ros.node.process import rclpy_internals, reported_as_configuration
from linkage_ros.quantities import Leaf, Quantity, shown
from linkage_ros.settings.configuration import with_files, without_ros_parameters
from linkage_ros.settings.package_names import names_of_others
from linkage_ros.settings.yaml_file import read_parameter_file, read_scalar
from linkage_ros.units import NS_PER_S, TIME_END

_TYPES = {
    'number': ParameterType.PARAMETER_DOUBLE,
    'whole': ParameterType.PARAMETER_INTEGER,
    'pair': ParameterType.PARAMETER_DOUBLE_ARRAY,
    'list': ParameterType.PARAMETER_DOUBLE_ARRAY,
    'choice': ParameterType.PARAMETER_STRING,
    'text': ParameterType.PARAMETER_STRING,
    'names': ParameterType.PARAMETER_STRING_ARRAY,
    'switch': ParameterType.PARAMETER_BOOL,
}


_NUMBERS = {'number', 'pair', 'list'}  # kinds whose values are floats
_ARRAYS = {
    Parameter.Type.DOUBLE_ARRAY,
    Parameter.Type.INTEGER_ARRAY,
    Parameter.Type.STRING_ARRAY,
}


# Parameters that are read before the node exists.
_READ_AT_START = ('use_sim_time', 'managed')


def given_values(node: Node, arguments: Iterable[str] = ()) -> dict[str, object]:
    """Returns the node's own parameters that command line and parameter files set, by name.

    Files that a parameter file names are relative to it. The arguments follow those of the command
    line.

    Raises:
        ConfigurationError: A parameter file hides a value of the command line.
    """
    with rclpy_internals():
        # The public automatic declaration refuses empty lists and accepts use_sim_time: 7.
        overrides = node._parameter_overrides  # noqa: SLF001
    values = without_ros_parameters({name: p.value for name, p in overrides.items()})
    pairs = [*itertools.pairwise((*sys.argv, *arguments))]
    texts = (rule for option, rule in pairs if option in {'-p', '--param'} and ':=' in rule)
    rules = dict(rule.split(':=', 1) for rule in texts)
    _require_no_hidden(values, rules)
    node_name = node.get_fully_qualified_name()
    for path in [path for option, path in pairs if option == '--params-file']:
        in_file = read_parameter_file(path, node_name)
        for name in {*names_of_others(in_file, path, node_name)} - {*rules}:
            values.pop(name, None)
        for name, value in with_files(in_file, path).items():
            if values.get(name) == in_file[name]:
                values[name] = value
    return values


def _require_no_hidden(values: Mapping[str, Any], rules: Mapping[str, str]) -> None:
    """Rejects values of the command line that rcl ignores.

    If a parameter file gives a whole number, rcl ignores a later -p with another number or text;
    if it gives a float, a later text. `values` are those that rcl gives, `rules` the texts of the
    command line.

    Raises:
        ConfigurationError: There is such a value.
    """
    for name, text in rules.items():
        value = values.get(name)
        of_file = value[0] if isinstance(value, list | array) and value else value
        first_text = text.strip('[] ').partition(',')[0]
        of_rule = read_scalar(first_text)
        is_float = isinstance(of_rule, float) and not first_text.lstrip('+-').isdigit()
        is_in_degrees = isinstance(of_rule, str) and 'deg' in of_rule
        hides_float = type(of_file) is int and is_float
        hides_text = type(of_file) in {int, float} and is_in_degrees
        if hides_float or hides_text:
            raise ConfigurationError(
                f'{name} = {shown(value)} of a parameter file hides -p {name}:={text}, because '
                f'ROS ignores a value of another type: take {name} out of the file'
            )


def _set_clock(set_clock: Callable[[Any], None], message: Any) -> None:
    """Sets a node's clock, unless the time is out of range, which rclpy or a stamp refuses."""
    if 0 <= message.clock.sec * NS_PER_S + message.clock.nanosec < TIME_END:
        set_clock(message)


class ParameterNode(Node):  # type: ignore[misc]  # rclpy has no types
    """A node whose parameters are quantities.

    A read-only parameter may be set to its current value, so that `ros2 param load` accepts the
    output of `ros2 param dump`.

    Attributes:
        given: Values given for the node, by name; those set later replace them.
    """

    def __init__(self, name: str, **options: Any) -> None:
        """Creates the node, with the options of `rclpy.node.Node`."""
        with reported_as_configuration():
            super().__init__(name, **options)
        clock = self.resolve_topic_name(SIMULATED_CLOCK.name)
        for subscription in self.subscriptions:  # with use_sim_time, rclpy's own of /clock
            if subscription.topic_name == clock:
                subscription.callback = functools.partial(_set_clock, subscription.callback)
        self._quantities: dict[str, Quantity] = {}
        self._is_open = False  # see `open_parameters`
        self.given = given_values(self, options.get('cli_args') or ())

    def set_live(self, name: str, value: Any) -> None:
        """Handles a change of a live parameter to a checked value; subclasses override this."""

    def show_value(self, name: str, value: Any) -> None:
        """Sets a declared parameter to a value that another parameter has set."""
        super().set_parameters_atomically([Parameter(name, value=value)])

    def declare(self, parameters: Iterable[Leaf], values: Mapping[str, object]) -> None:
        """Declares parameters with checked values, which include the overrides of the node."""
        was_open, self._is_open = self._is_open, False
        for name in self.given if was_open else ():
            self.undeclare_parameter(name)
        for name, quantity, _ in parameters:
            # A parameter that is None has no value, and rclpy cannot dump it.
            if name in values:
                # The overrides are in the values; rclpy would refuse 60 for 60.0.
                descriptor = _descriptor(name, quantity)
                # rclpy cannot undeclare what is read-only.
                descriptor.read_only = not (quantity.live or was_open)
                self.declare_parameter(name, values[name], descriptor, ignore_override=True)
                self._quantities[name] = quantity

    def open_parameters(self) -> None:
        """Declares only the given values; until `declare`, others may be set, added or deleted."""
        if self._is_open:
            return
        for name in self._quantities:
            self.undeclare_parameter(name)
        self._quantities, self._is_open = {}, True
        for name, value in self.given.items():
            self._declare_any(name, value)

    def _declare_any(self, name: str, value: object) -> None:
        descriptor = ParameterDescriptor(name=name, dynamic_typing=True)
        self.declare_parameter(name, value, descriptor, ignore_override=True)

    def set_parameters(self, parameter_list: list[Parameter]) -> list[SetParametersResult]:
        """Sets parameters one by one; rclpy would not call `set_parameters_atomically`."""
        return [self.set_parameters_atomically([parameter]) for parameter in parameter_list]

    def set_parameters_atomically(self, parameter_list: list[Parameter]) -> SetParametersResult:
        """Sets all parameters or none; all services that set parameters call this method.

        Those that would not change are ignored.
        """
        given = (_with_numbers(x, self._quantities.get(x.name)) for x in parameter_list)
        changed = [parameter for parameter in given if self._changes(parameter)]
        if reason := next(filter(None, map(self._refusal, changed)), ''):
            return SetParametersResult(successful=False, reason=reason)
        if self._is_open:
            return self._give(changed)
        live = {name: quantity for name, quantity in self._quantities.items() if quantity.live}
        try:  # rclpy accepts numbers just beyond a range, and does not check those of an array
            checked = {
                x.name: live[x.name].clean(x.name, _plain(x))
                for x in changed
                if x.name in live and x.value is not None
            }
        except ConfigurationError as error:
            return SetParametersResult(successful=False, reason=str(error))
        result = super().set_parameters_atomically(changed)
        if result.successful:
            self.given |= checked
            for name, value in checked.items():
                self.set_live(name, value)
        return result

    def _changes(self, parameter: Parameter) -> bool:
        """Returns whether a parameter differs from its current value."""
        if not self.has_parameter(parameter.name):
            return True
        current = self.get_parameter(parameter.name)
        return bool(parameter.get_parameter_value() != current.get_parameter_value())

    def _refusal(self, changed: Parameter) -> str:
        """Returns why a parameter cannot be changed now; empty if it can."""
        name = changed.name
        if name in _READ_AT_START:
            return f'{name} is read when the node starts: start it again'
        quantity = self._quantities.get(name)
        if not (self._is_open or self.has_parameter(name)):
            of_linkages = [x for x in self._quantities if x.endswith(f'.{name}')]
            advice = f': set {" or ".join(of_linkages)}' if of_linkages else ''
            return f'this node has no parameter {name}{advice}'
        if quantity and not (quantity.live or self.describe_parameter(name).read_only):
            return f'{name} is read when the node is configured: clean it up first'
        return ''

    def _give(self, changed: list[Parameter]) -> SetParametersResult:
        """Sets, adds or deletes given values, which are checked later."""
        for new in changed:
            if new.type_ is not Parameter.Type.NOT_SET and not self.has_parameter(new.name):
                self._declare_any(new.name, new.value)
        result = super().set_parameters_atomically(changed)
        for new in changed if result.successful else ():
            if self.has_parameter(new.name):
                self.given[new.name] = _plain(new)
            else:
                self.given.pop(new.name, None)
        return result


def _plain(parameter: Parameter) -> object:
    """Returns the value of a parameter, with a list for an array of numbers."""
    return list(parameter.value) if parameter.type_ in _ARRAYS else parameter.value


def _with_numbers(parameter: Parameter, quantity: Quantity | None) -> Parameter:
    """Converts whole numbers to floats, and angles in degrees to rad, if they are valid."""
    value = _plain(parameter)
    items = value if isinstance(value, list) else [value]
    if quantity is None or quantity.kind not in _NUMBERS:
        return parameter
    if not all(type(x) in {int, str} for x in items):
        return parameter
    with suppress(ConfigurationError):
        return Parameter(parameter.name, value=quantity.clean(parameter.name, value))
    return parameter


def _descriptor(name: str, quantity: Quantity) -> ParameterDescriptor:
    """Makes the descriptor for `ros2 param describe`: meaning, unit, range, and read-only flag."""
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
