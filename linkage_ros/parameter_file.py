# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads a ROS 2 parameter file as a node would, without ROS.

A node gets its parameters from rcl, whose YAML is not PyYAML's: `1e2` is a float, `on` a bool,
`010` is 8, and `[0, -9.81]` is refused. A tool that resolved the same file in another way would
compute another mechanism than the node runs. Therefore this module takes only the events of the
YAML parser and does what rcl_yaml_param_parser/src/parse.c does with them, including its way of
naming things. What rcl refuses is refused; so is what rcl takes but turns into something else
than is written, or into nothing.
"""

from __future__ import annotations

import math
import re
import reprlib
import sys
from bisect import insort
from pathlib import Path
from typing import TypeAlias, cast

import yaml

from linkage_ros.errors import ConfigurationError

_Scalar: TypeAlias = bool | int | float | str
ParameterValue: TypeAlias = _Scalar | list[bool] | list[int] | list[float] | list[str]

# rcl parses with libyaml, and so does PyYAML where it was built with it.
_LOADER = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)
_MAX_BYTES = 1 << 20
_MAX_DEPTH = 50
_VALID = 'a bool, integer, float or string, or a list of one of these'
_KEY = 'ros__parameters'
_SECTION = re.compile(
    r'/?(?:(?:\*\*?|[A-Za-z_][A-Za-z0-9_]{0,243})/)*(?:\*\*?|[A-Za-z_][A-Za-z0-9_]{0,254})'
)
_BOOLS = {
    word: value
    for value, words in ((True, 'y yes true on'), (False, 'n no false off'))
    for lower in words.split()
    for word in (lower, lower.capitalize(), lower.upper())
}
_INTEGER = re.compile(r'([+-]?)(0[xX][0-9a-fA-F]+|0[0-7]*|[1-9][0-9]{0,18})')
_DECIMAL = re.compile(r'[+-]?([0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?')
_HEXADECIMAL = re.compile(
    r'[+-]?0[xX]([0-9a-fA-F]+(?:\.[0-9a-fA-F]*)?|\.[0-9a-fA-F]+)(?:[pP][+-]?[0-9]+)?'
)
_YAML_WORD = re.compile(r'[+-]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)')
_C_WORD = re.compile(r'([+-]?(?:inf|infinity|nan))(?:(?<=nan)\([a-z0-9_]*\))?', re.IGNORECASE)

_SHORT = reprlib.Repr()
_SHORT.maxstring = 80


def read_parameter_file(
    path: Path | str, node_name: str = 'linkage_node'
) -> dict[str, ParameterValue]:
    """Reads the parameters that a file sets on a node.

    Args:
        path: The YAML file.
        node_name: The node, in the root name space. Sections of other nodes are checked as rcl
            checks them, but not returned.

    Returns:
        The values by dotted name; where sections set the same name, that of the later section.

    Raises:
        ConfigurationError: The file cannot be read, or rcl refuses or misreads it.
    """
    file = str(path) if str(path).isprintable() else repr(str(path))
    try:
        with Path(path).open('rb') as stream:
            data = stream.read(_MAX_BYTES + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, 'strerror', None) or error
        raise ConfigurationError(
            f'{file}: cannot read the parameter file ({reason}); give the path of a YAML file'
        ) from error
    if len(data) > _MAX_BYTES:
        raise ConfigurationError(
            f'{file}: is larger than {_MAX_BYTES} bytes; give the path of a parameter file'
        )
    reader = _Reader(file, data)
    reader.read()
    return reader.values(node_name)


class _Slot:
    """A parameter, under the name that rcl has given it so far."""

    def __init__(self, name: str, line: int) -> None:
        self.name = name
        self.line = line
        self.value: ParameterValue | None = None
        self.problem = f'has no value; write {_VALID}'

    def set(self, value: ParameterValue, line: int) -> None:
        self.line = line
        if value == []:
            self.problem = f'is an empty list, which has no type; write {_VALID}'
        elif self.value is None:
            self.problem = ''
        elif _type(value) != _type(self.value):
            self.problem = 'is set twice, with two types; keep one of the two'
        self.value = value


class _Section:
    """The parameters under one node name, in the order in which rcl keeps them."""

    def __init__(self) -> None:
        self.slots: list[_Slot] = []
        self.named: dict[str, list[int]] = {}

    def slot(self, group: str, key: str, line: int) -> _Slot:
        """The slot for a key. rcl makes a group by renaming the slot that bears its name."""
        indices = self.named.setdefault(group or key, [])
        if not indices:
            indices.append(len(self.slots))
            self.slots.append(_Slot(group or key, line))
        slot = self.slots[indices[0]]
        if group:
            slot.name = f'{group}.{key}'
            if slot.value is not None:
                slot.problem = f'takes the value of {_show(group)} away; give them two names'
            insort(self.named.setdefault(slot.name, []), indices.pop(0))
        return slot


class _Reader:
    """One pass over the events of a file; the methods follow its nesting."""

    def __init__(self, file: str, data: bytes) -> None:
        self.file = file
        self.data = data
        self.events = yaml.parse(data, Loader=_LOADER)
        self.sections: dict[str, _Section] = {}
        self.line = 1
        self.depth = 0

    def error(self, problem: str, line: int | None = None) -> ConfigurationError:
        return ConfigurationError(f'{self.file}, line {line or self.line}: {problem}')

    def next(self) -> yaml.Event:
        try:
            event = next(self.events)
        except yaml.YAMLError as error:
            raise self.syntax_error(error) from error
        except (ValueError, OverflowError) as error:  # PyYAML's own scanner: "\UFFFFFFFF"
            raise self.error(f'not valid YAML ({error}); correct the number') from error
        self.line = event.start_mark.line + 1
        if isinstance(event, yaml.CollectionStartEvent):
            self.depth += 1
        elif isinstance(event, yaml.CollectionEndEvent):
            self.depth -= 1
        if self.depth > _MAX_DEPTH:
            raise self.error(f'nested more than {_MAX_DEPTH} deep; use fewer levels')
        if isinstance(event, yaml.AliasEvent):
            raise self.error(f'alias {_show("*" + event.anchor)}; ROS takes none, write it out')
        if isinstance(event, yaml.ScalarEvent) and '\0' in event.value:
            raise self.error(f'{_show(event.value)} holds a NUL, where ROS cuts it; remove it')
        return event

    def syntax_error(self, error: yaml.YAMLError) -> ConfigurationError:
        if isinstance(error, yaml.reader.ReaderError):
            line = self.data.count(b'\n', 0, error.position) + 1
            return self.error(f'{error.reason}; save the file as UTF-8 text', line)
        mark, problem = getattr(error, 'problem_mark', None), getattr(error, 'problem', None)
        return self.error(
            f'not valid YAML ({problem or "syntax"}); correct the indentation, quotes or brackets',
            mark.line + 1 if mark else None,
        )

    def read(self) -> None:
        while not isinstance(event := self.next(), yaml.StreamEndEvent):
            if isinstance(event, yaml.MappingStartEvent):
                self.nodes('', 0)
            elif isinstance(event, yaml.NodeEvent):
                raise self.error(f'{_show(event)} where "node_name:" belongs; write {_LAYOUT}')

    def key(self) -> str | None:
        event = self.next()
        if isinstance(event, yaml.MappingEndEvent):
            return None
        if not isinstance(event, yaml.ScalarEvent) or not event.value:
            raise self.error('key is empty or not a word; write "name: value"')
        return cast('str', event.value)
