# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads a ROS 2 parameter file as a node would, without ROS.

A node gets its parameters from rcl, whose YAML is not PyYAML's: `1e2` is a float, `on` a bool,
`010` is 8 and `[0, -9.81]` is refused. A tool that resolves the same file in another way works
on another mechanism than the node. So this module takes only the events of the YAML parser and
gives them the meaning that rcl_yaml_param_parser/src/parse.c gives them. It refuses what rcl
refuses, and in the sections of the node also what rcl drops or garbles without a word.
"""

from __future__ import annotations

import math
import re
import sys
from pathlib import Path
from typing import TypeAlias, cast

import yaml

from linkage_ros.errors import ConfigurationError

_Scalar: TypeAlias = bool | int | float | str
ParameterValue: TypeAlias = _Scalar | list[bool] | list[int] | list[float] | list[str]

_LOADER = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)  # libyaml, as in rcl, if it is there
_MAX_BYTES = 1 << 20
_MAX_NAME = 255  # bounds the depth of nesting as well
_NODE = re.compile(r'/?((\*\*?|[A-Za-z_]\w{0,243})/)*(\*\*?|[A-Za-z_]\w*)', re.ASCII)
_BOOL = re.compile(
    '(y|Y|yes|Yes|YES|true|True|TRUE|on|On|ON)|n|N|no|No|NO|false|False|FALSE|off|Off|OFF'
)
_INTEGER = re.compile('([+-]?)(0[xX][0-9a-fA-F]+|0[0-7]*|[1-9][0-9]{0,18})')
_YAML_WORD = re.compile(r'[+-]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)')
_NAN_PAYLOAD = re.compile(r'(?<=nan)\([a-z0-9_]*\)\Z', re.IGNORECASE)
_VALUE = 'write a bool, integer, float or string, or a list of one of these'
_LAYOUT = 'lay the file out as node name, ros__parameters, parameters'


def read_parameter_file(
    path: Path | str, node_name: str = 'linkage_node'
) -> dict[str, ParameterValue]:
    """Reads the parameters that a file sets on a node.

    Args:
        path: The YAML file.
        node_name: A node in the root name space. The sections of other nodes have to be valid,
            because rcl reads them as well, but are not returned.

    Returns:
        The values by dotted name. Where two sections set the same name, the later one wins.

    Raises:
        ConfigurationError: The file cannot be read, or rcl refuses or garbles it.
    """
    file = str(path) if str(path).isprintable() else repr(str(path))
    try:
        with Path(path).open('rb') as stream:
            data = stream.read(_MAX_BYTES + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, 'strerror', None) or error
        raise ConfigurationError(f'{file}: {reason}; give the path of a parameter file') from error
    if len(data) > _MAX_BYTES:
        raise ConfigurationError(f'{file}: over {_MAX_BYTES} bytes; give a parameter file')
    return _Reader(file, data).read(node_name)


class _Reader:
    """One pass over the events of a file; a method for each level of its nesting."""

    def __init__(self, file: str, data: bytes) -> None:
        self.file = file
        self.line = 1
        self.events = yaml.parse(data, Loader=_LOADER)
        self.sections: dict[str, dict[str, ParameterValue]] = {}
        self.doubts: dict[str, ConfigurationError] = {}

    def read(self, node_name: str) -> dict[str, ParameterValue]:
        while not isinstance(event := self.next(), yaml.StreamEndEvent):
            if isinstance(event, yaml.MappingStartEvent):
                self.nodes('', 0)
            elif isinstance(event, yaml.NodeEvent):
                raise self.error(f'{_show(event)} is no mapping; {_LAYOUT}')
        result: dict[str, ParameterValue] = {}
        for name, values in self.sections.items():
            # '**' stands for any number of names and '*' for one; a node at the root has one.
            pattern = [part for part in name.split('/') if part not in {'', '**'}]
            if pattern in ([], ['*'], [node_name]):
                if name in self.doubts:
                    raise self.doubts[name]
                result.update(values)
        return result

    def nodes(self, name: str, depth: int) -> str:
        """Reads a mapping of node names; returns the name that rcl goes on with after it."""
        while key := self.key(name):
            is_section = key.startswith('ros__parameters')  # rcl compares no further
            if is_section and not (depth and _NODE.fullmatch(name)):
                raise self.error(f'{_show(name)} before ros__parameters is no node; {_LAYOUT}')
            if not isinstance(event := self.next(), yaml.MappingStartEvent):
                raise self.error(f'{_show(event)} is not below ros__parameters; {_LAYOUT}')
            if is_section:
                self.sections.setdefault(name, {})
                self.parameters(name, '', 0)
                if key := self.key(name):
                    raise self.error(f'{_show(key)} follows ros__parameters; move it before')
                break
            separator = '' if not depth or name.endswith('/') else '/'
            name = self.nodes(name + separator + key, depth + 1)
        return name.rpartition('/')[0] if depth > 1 else ''

    def parameters(self, section: str, group: str, depth: int) -> str:
        """Reads a mapping of parameters; returns the group that rcl goes on with after it."""
        empty = depth > 0
        while key := self.key(group):
            empty = False
            if depth and group in self.sections[section]:
                self.doubt(section, f'{_show(group)} is a value and a group; rename one')
            name = f'{group}.{key}' if depth else key
            if isinstance(event := self.next(), yaml.MappingStartEvent):
                group = self.parameters(section, name, depth + 1)
            else:
                self.set(section, name, self.value(name, event), flat=not depth)
        if empty:
            raise self.error(f'{_show(group)} is an empty group; remove it')
        return group.rpartition('.')[0] if depth > 1 else ''

    def set(self, section: str, name: str, value: ParameterValue, *, flat: bool) -> None:
        values = self.sections[section]
        if value == []:
            self.doubt(section, f'{_show(name)} is an empty list; {_VALUE}')
        # Which of two values rcl keeps depends on their types, and on their spelling.
        elif name in values and (_kind(value) != _kind(values[name]) or (flat and '.' in name)):
            self.doubt(section, f'{_show(name)} is set twice, in two ways; remove one')
        values[name] = value

    def value(self, name: str, event: yaml.Event) -> ParameterValue:
        if isinstance(event, yaml.ScalarEvent):
            return self.scalar(name, event)
        items: list[_Scalar] = []
        while not isinstance(event := self.next(), yaml.SequenceEndEvent):
            if not isinstance(event, yaml.ScalarEvent):
                raise self.error(f'{_show(name)} holds {_show(event)}; {_VALUE}')
            items.append(self.scalar(name, event))
            if _kind(items[0]) != _kind(items[-1]):
                mix = ' and '.join(f'{_kind(item)} {item!r:.40}' for item in (items[0], items[-1]))
                raise self.error(f'{_show(name)} mixes {mix}; give one type, as in [0.0, -9.81]')
        return cast('ParameterValue', items)

    def scalar(self, name: str, event: yaml.ScalarEvent) -> _Scalar:
        if event.style in {'"', "'"}:
            return event.value
        if not event.value:
            raise self.error(f'{_show(name)} has no value; {_VALUE}')
        if event.tag == 'tag:yaml.org,2002:str':
            return event.value
        value = _resolve(event.value)
        if isinstance(value, float) and 0 < abs(value) <= sys.float_info.min:
            raise self.error(f'{_show(name)} is {value}, too near to 0 for ROS; write 0.0')
        return value

    def key(self, group: str) -> str:
        """The next key of a mapping; empty at its end."""
        event = self.next()
        if isinstance(event, yaml.MappingEndEvent):
            return ''
        if not isinstance(event, yaml.ScalarEvent) or not event.value:
            raise self.error(f'{_show(event)} is no name; write "name: value"')
        if len(group) + len(event.value) > _MAX_NAME:
            raise self.error(f'{_show(event)} makes a name of over {_MAX_NAME}; shorten it')
        return event.value

    def next(self) -> yaml.Event:
        try:
            event = next(self.events)
        except (yaml.YAMLError, ValueError, OverflowError) as error:
            self.line = getattr(getattr(error, 'problem_mark', None), 'line', self.line - 1) + 1
            reason = getattr(error, 'problem', None) or getattr(error, 'reason', error)
            raise self.error(f'no YAML in UTF-8 ({reason}); correct the file there') from error
        self.line = event.start_mark.line + 1 if event.start_mark else self.line
        if isinstance(event, yaml.AliasEvent):
            raise self.error(f'ROS takes no alias (*{event.anchor:.40}); write the value')
        if isinstance(event, yaml.ScalarEvent) and re.search('[\0\ud800-\udfff]', event.value):
            raise self.error(f'{_show(event)} holds a NUL or half a character; remove it')
        return event

    def doubt(self, section: str, problem: str) -> None:
        self.doubts.setdefault(section, self.error(problem))

    def error(self, problem: str) -> ConfigurationError:
        return ConfigurationError(f'{self.file}, line {self.line}: {problem}')


def _show(shown: str | yaml.Event) -> str:
    if isinstance(shown, yaml.CollectionStartEvent):
        return 'a mapping' if isinstance(shown, yaml.MappingStartEvent) else 'a list'
    return f'{getattr(shown, "value", shown)!r:.80}'


def _kind(value: ParameterValue) -> str:
    if isinstance(value, list):
        return f'list of {"".join(_kind(item) for item in value[:1])}'
    return type(value).__name__


def _resolve(text: str) -> _Scalar:
    """The value of an unquoted scalar: a bool, what strtoll or strtod take, or text."""
    if match := _BOOL.fullmatch(text):
        return match[1] is not None
    number = _NAN_PAYLOAD.sub('', text.lstrip(' \t\n\v\f\r'))
    if match := _INTEGER.fullmatch(number):
        base = 10 if match[2][0] != '0' else 16 if match[2][1:2] in {'x', 'X'} else 8
        whole = int(match[1] + match[2], base)
        if -(2**63) <= whole < 2**63:
            return whole
    if _YAML_WORD.fullmatch(text):
        return float(text.replace('.', ''))
    # What float() takes beyond strtod.
    if '_' in number or not number.isascii() or number.split() != [number]:
        return text
    parse, exponent = (float.fromhex, 'p') if 'x' in number.lower() else (float, 'e')
    try:
        real = parse(number)
    except (ValueError, OverflowError):
        return text
    # Where strtod reports a result out of range, rcl takes the number for text.
    mantissa = number.lower().partition(exponent)[0]
    lost = real in {0.0, math.inf, -math.inf} and re.search('[1-9]|x.*[a-f]', mantissa)
    return text if lost else real
