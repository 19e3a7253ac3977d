# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads a ROS 2 parameter file in the same way as a node, without ROS.

A node gets its parameters from rcl, which interprets YAML differently from PyYAML: `1e2` is a
float, `on` is a bool, `010` is 8, and `[0, -9.81]` is rejected. To read the same values, this
reader interprets the events of PyYAML like rcl_yaml_param_parser/src/parse.c. It rejects files
that rcl rejects, and also files that rcl silently reads incompletely or incorrectly.
"""

import itertools
import re
from collections.abc import Iterator
from pathlib import Path
from typing import TypeAlias, cast

import yaml
from yaml import CSafeLoader  # of libyaml, which rcl also uses

from linkage_ros.errors import ConfigurationError, shortened
from linkage_ros.files import open_file
from linkage_ros.quantities import shown

_Scalar: TypeAlias = bool | int | float | str
ParameterValue: TypeAlias = _Scalar | list[bool] | list[int] | list[float] | list[str]
Parameters: TypeAlias = dict[str, ParameterValue]

_MAX_BYTES = 1 << 20
_MAX_NAME = 255  # characters including all parents, which also limits the nesting depth
_NODE = re.compile(r'/?((\*\*?|[A-Za-z_]\w{0,243})/)*(\*\*?|[A-Za-z_]\w*)', re.ASCII)
_BOOL = re.compile('([yY]|[yY]es|YES|[tT]rue|TRUE|[oO]n|ON)|[nN]o?|NO|[fF]alse|FALSE|[oO]ff|OFF')
_VALUE = 'write a bool, integer, float or string, or a list of one of these'
_SECTION = 'ros__parameters'
_LOG = b'\x89MCAP0\r\n'
# Common mistakes: pattern of the line, and description.
_COMMON = {
    r'^ *\t': 'a tab; indent with spaces',
    r'(?<![\w/])([A-Za-z_]\w*):([-+.\w][^,}\s]*)': 'no space after the colon; write {0}: {1}',
    r'(?<![\w.])([-+]?\d+),(\d+)(?![.\w])': 'a comma in a number; write {0}.{1}',
}
_LAYOUT = f'begin the file with /**:, indent {_SECTION}: below it, and the parameters below that'


def read_parameter_file(path: Path | str, node_name: str = 'linkage_node') -> Parameters:
    """Reads the parameters that a file sets on a node.

    Args:
        path: Path of the YAML file.
        node_name: Name of the node with its namespace, such as left/linkage_node. Sections for
            other nodes are checked but not returned.

    Returns:
        The values by dotted name. If two sections set the same name, the later one wins.

    Raises:
        ConfigurationError: The file cannot be read, rcl would reject it or read it incorrectly, or
            none of its sections applies to the node, which would then run with defaults.
    """
    reader, node = _Reader(path, 'parameter', node_name, _LAYOUT), f'/{node_name.strip("/")}'
    values = reader.read(())
    if not any(_matches(section, node) for section in reader.nodes):
        others = shortened(', '.join(dict.fromkeys(reader.nodes)), 200)
        raise ConfigurationError(
            f'{reader.file} has no parameters of {node}{f", only of {others}" if others else ""}: '
            f'write /** or {node} above {_SECTION}'
        )
    return values


def read_yaml(path: Path | str, kind: str) -> Parameters:
    """Reads YAML with the syntax of a parameter file below `ros__parameters`.

    Args:
        path: Path of the YAML file.
        kind: Kind of the file, such as 'study', for error messages.

    Returns:
        The values by dotted name.

    Raises:
        ConfigurationError: The file cannot be read, or has another syntax.
    """
    return _Reader(path, kind, kind, 'write "name: value"').read((kind, _SECTION))


class _Reader:
    """Reads a file in one pass over its YAML events."""

    def __init__(self, path: Path | str, kind: str, node_name: str, layout: str) -> None:
        self.file = str(path) if str(path).isprintable() else repr(str(path))
        self.node_name, self.layout, self.line = node_name, layout, 1
        try:
            with open_file(path) as stream:
                self.data = stream.read(_MAX_BYTES + 1)
        except OSError as error:
            raise ConfigurationError(
                f'{self.file}: {error.strerror or error}; give the path of a {kind} file'
            ) from error
        if len(self.data) > _MAX_BYTES:
            raise ConfigurationError(f'{self.file}: over {_MAX_BYTES} bytes; give a {kind} file')
        if self.data.startswith(_LOG):
            raise ConfigurationError(
                f'{self.file} is a log, not a {kind} file: linkage_replay shows it, and '
                'linkage_log info prints the parameters of its run'
            )
        self.events = yaml.parse(self.data, Loader=CSafeLoader)
        self.sections: dict[str, Parameters] = {}
        self.nodes: list[str] = []  # the node names of all sections, also of other nodes

    def read(self, path: tuple[str, ...]) -> Parameters:
        """Reads the file as if all its names were nested below a path of names."""
        while not isinstance(event := self.next(), yaml.StreamEndEvent):
            if isinstance(event, yaml.MappingStartEvent):
                for names, value in self.leaves(path):
                    self.take(names, value)
            elif isinstance(event, yaml.NodeEvent):
                raise self.syntax_error(f'{_show(event)} instead of a mapping; {self.layout}')
        return {name: value for own in self.sections.values() for name, value in own.items()}

    def leaves(self, path: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], yaml.Event]]:
        """Yields the path of names and the first event of each value in a mapping."""
        key, section = '', _section(path)
        if section is not None and section == len(path) - 1:
            self.nodes.append('/'.join(path[:section]))
        while following := self.key(path if section is None else path[section + 1 :]):
            if section is None and key.startswith(_SECTION):
                raise self.error(f'{following!r} follows ros__parameters; move it before')
            key = following
            event = self.next()
            if not isinstance(event, yaml.MappingStartEvent):
                yield (*path, key), event
                continue
            # If a nested name is a path, rcl assigns wrong names to the following parameters.
            if path and section != len(path) - 1 and ('/' if section is None else '.') in key:
                raise self.error(f'{key!r} is a path; write its parts one below the other')
            yield from self.leaves((*path, key))
        if section is not None and section < len(path) - 1 and not key:
            raise self.error(f'{path[-1]!r} is an empty group; remove it')

    def take(self, path: tuple[str, ...], event: yaml.Event) -> None:
        """Stores a value if its section applies to this node."""
        section = _section(path)
        if section is None or section == len(path) - 1:
            raise self.syntax_error(f'{_show(event)} instead of a mapping; {self.layout}')
        node, name = '/'.join(path[:section]), '.'.join(path[section + 1 :])
        if section > 1:
            node = node.replace('//', '/')
        if not _NODE.fullmatch(node):
            raise self.error(f'{node!r} before ros__parameters is not a node; {self.layout}')
        value = self.value(name, event)
        if not _matches(node, self.node_name):
            return
        values = self.sections.setdefault(node, {})
        if value == []:
            raise self.error(f'{name!r} is an empty list; {_VALUE}')
        # rcl loses a value with the name of a group; which of two values it keeps depends on their
        # types and the spelling of the name.
        groups = itertools.accumulate(path[section + 1 : -1], '{}.{}'.format)
        is_twice = '.' in path[-1] or _types(value) != _types(values.get(name, value))
        if not values.keys().isdisjoint(groups) or (name in values and is_twice):
            raise self.error(f'{name!r} is set twice, in two ways; remove one')
        values[name] = value

    def value(self, name: str, event: yaml.Event) -> ParameterValue:
        if isinstance(event, yaml.ScalarEvent):
            return self.scalar(name, event)
        items: list[_Scalar] = []
        while not isinstance(event := self.next(), yaml.SequenceEndEvent):
            if not isinstance(event, yaml.ScalarEvent):
                raise self.error(f'{name!r} holds {_show(event)}; {_VALUE}')
            items.append(self.scalar(name, event))
            if type(items[0]) is not type(items[-1]):
                mix = f'{shown(items[0])} and {shown(items[-1])}'
                raise self.syntax_error(
                    f'{name!r} mixes types, {mix}; give one, as in [0.0, -9.81]'
                )
        return cast('ParameterValue', items)

    def scalar(self, name: str, event: yaml.ScalarEvent) -> _Scalar:
        if event.style in {'"', "'"} or (event.value and event.tag == 'tag:yaml.org,2002:str'):
            return event.value
        if not event.value:
            raise self.syntax_error(f'{name!r} has no value; {_VALUE}')
        return read_scalar(event.value)

    def key(self, path: tuple[str, ...]) -> str:
        """Reads the next key of the mapping at a path of names; returns '' at its end."""
        event = self.next()
        if isinstance(event, yaml.MappingEndEvent):
            return ''
        if not isinstance(event, yaml.ScalarEvent) or not event.value:
            raise self.error(f'{_show(event)} is not a name; write "name: value"')
        if len('.'.join((*path, event.value))) > _MAX_NAME:
            raise self.error(
                f'{_show(event)} makes a name of over {_MAX_NAME} characters; shorten it'
            )
        return event.value

    def next(self) -> yaml.Event:
        try:
            event = next(self.events)
        except yaml.YAMLError as error:
            if isinstance(error, yaml.reader.ReaderError):  # has a position instead of a mark
                self.line = self.data.count(b'\n', 0, error.position) + 1
            self.line = getattr(getattr(error, 'problem_mark', None), 'line', self.line - 1) + 1
            reason = getattr(error, 'problem', None) or getattr(error, 'reason', error)
            cure = 'correct' if 'expected key' not in str(reason) else 'check the indentation of'
            raise self.syntax_error(f'not YAML in UTF-8 ({reason}); {cure} this line') from error
        self.line = getattr(event.start_mark, 'line', 0) + 1
        if isinstance(event, yaml.AliasEvent):
            raise self.error(
                f'ROS rejects aliases (*{shortened(str(event.anchor), 40)}); write the value'
            )
        if isinstance(event, yaml.ScalarEvent) and re.search('[\0\ud800-\udfff]', event.value):
            raise self.error(f'{_show(event)} contains a NUL or a surrogate; remove it')
        return event

    def syntax_error(self, problem: str) -> ConfigurationError:
        """Returns an error with all lines that have a common mistake, or else with the problem."""
        found = []
        text = self.data.decode(errors='replace')
        for number, line in enumerate(text.split('\n'), 1):
            bare = re.sub(r'"[^"]*"|\'[^\']*\'|(^|\s)#.*', '', line)
            # In a list, numbers may be separated by a comma without a space.
            single = bare if number == self.line else re.sub(r'\[[^]]*\]', '', bare)
            for pattern, mistake in _COMMON.items():
                if match := re.search(pattern, single):
                    found.append(f'line {number}: {mistake.format(*match.groups())}')
        if not found:
            return self.error(problem)
        return ConfigurationError(f'{self.file}, {shortened("; ".join(found), 400)}')

    def error(self, problem: str) -> ConfigurationError:
        return ConfigurationError(f'{self.file}, line {self.line}: {problem}')


def _section(path: tuple[str, ...]) -> int | None:
    """Returns the index of `ros__parameters` in a path of names; None if it is missing."""
    # Like rcl, accept any name that starts with `ros__parameters`.
    return next((i for i, key in enumerate(path) if key.startswith(_SECTION)), None)


def _matches(section: str, node: str) -> bool:
    """Returns whether a section applies to a node; '*' matches one name, '**' any number."""
    wildcards = {'**': '(/[^/]+)*', '*': '/[^/]+'}
    section = re.sub(r'\*\*(/+\*\*)+', '**', section)  # matching repeated ** would be slow
    parts = [wildcards.get(part, f'/{re.escape(part)}') for part in section.split('/') if part]
    return re.fullmatch(''.join(parts), f'/{node.strip("/")}') is not None


def _show(event: yaml.Event) -> str:
    other = 'a mapping' if isinstance(event, yaml.MappingStartEvent) else 'a list'
    return shown(event.value) if isinstance(event, yaml.ScalarEvent) else other


def _types(value: ParameterValue) -> list[type]:
    return [type(item) for item in (value, *(value[:1] if isinstance(value, list) else ()))]


def read_scalar(text: str) -> _Scalar:
    """Parses an unquoted scalar: a bool, a number as read by strtoll or strtod, or a string."""
    if match := _BOOL.fullmatch(text):
        return match[1] is not None
    if re.fullmatch(r'[+-]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)', text):
        return float(text.replace('.', ''))
    number = text.lstrip(' \t\n\v\f\r')
    if match := re.fullmatch('([+-]?)(0[xX][0-9a-fA-F]+|0[0-7]*|[1-9][0-9]{0,18})', number):
        base = 10 if match[2][0] != '0' else 16 if match[2][1:2] in {'x', 'X'} else 8
        if -(2**63) <= (whole := int(match[1] + match[2], base)) < 2**63:
            return whole
    number = re.sub(r'(?<=nan)\([a-z0-9_]*\)\Z', '', number.lower())
    try:
        real = float.fromhex(number) if 'x' in number else float(number)
    except (ValueError, OverflowError):
        return text
    # float() accepts more than strtod, and rcl reads numbers out of strtod's range as strings.
    lost = abs(real) in {0, float('inf')} and re.match('[^ex]*[1-9]|[^p]*x[^p]*[1-9a-f]', number)
    return text if lost or not re.fullmatch('[-+.0-9a-z]+', number) else real
