# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads ROS 2 parameter files without ROS.

As in rcl, `1e2` is a float, `on` is a bool, all values of a list have one type, and a later
section for a node overrides an earlier one. Other spellings of numbers, such as hexadecimal ones,
are text. Lists such as [0, -9.81], which rcl refuses, are read as floats.
"""

import re
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TypeAlias, cast

import yaml
from yaml import CSafeLoader

from linkage_ros.errors import ConfigurationError, ParameterWarning, shortened
from linkage_ros.files import read_file
from linkage_ros.quantities import shown

_Scalar: TypeAlias = bool | int | float | str
ParameterValue: TypeAlias = _Scalar | list[bool] | list[int] | list[float] | list[str]
Parameters: TypeAlias = dict[str, ParameterValue]

_MAX_BYTES = 1 << 20
_MOST_LISTED = 6  # names that a note lists
_MAX_NAME = 255  # characters including all parents, which also limits the nesting depth
_TRUE, _FALSE = (
    'y|Y|yes|Yes|YES|true|True|TRUE|on|On|ON',
    'n|N|no|No|NO|false|False|FALSE|off|Off|OFF',
)
_WHOLE = r'0|[1-9][0-9]*'
_REAL = (
    rf'[-+]?(({_WHOLE})(\.[0-9]*)?|\.[0-9]+)([eE][-+]?[0-9]+)?|'
    r'[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)'
)
_VALUE = 'write a bool, integer, float or string, or a list of one of these'
_SECTION = 'ros__parameters'
_LOG = b'\x89MCAP0\r\n'
_DECIMAL_COMMA = r'(?<![\w.])([-+]?\d+),(\d+)(?![.\w])'
# Common mistakes: pattern of the line, and description.
_COMMON = {
    r'^ *\t': 'a tab; indent with spaces',
    r'(?<![\w/])([A-Za-z_]\w*):([-+.\w][^,}\s]*)': 'no space after the colon; write {0}: {1}',
    _DECIMAL_COMMA: 'a comma in a number; write {0}.{1}',
}
_LAYOUT = f'begin the file with /**:, indent {_SECTION}: below it, and the parameters below that'


def read_parameter_file(
    path: Path | str, node_name: str = 'linkage_node', *, for_ros: bool = False
) -> Parameters:
    """Reads the parameters that a file sets on a node.

    Args:
        path: Path of the YAML file.
        node_name: Name of the node with its namespace, such as left/linkage_node.
        for_ros: Whether rcl will read the file, too.

    Returns:
        The values by dotted name. If two sections set the same name, the later one wins.

    Warns:
        ParameterWarning: A section sets a name twice, of which the last value applies, as in rcl;
            or, unless rcl will read the file, a list mixes whole numbers with others.

    Raises:
        ConfigurationError: The file cannot be read or is not a parameter file, none of its
            sections applies to the node, which would then run with defaults, or rcl would refuse a
            list.
    """
    reader, node = _Reader(path, 'parameter', _LAYOUT), f'/{node_name.strip("/")}'
    values, sections = Parameters(), list[str]()
    for section, name, value in reader.parameters():
        sections.append(section)
        if _matches(section, node):
            values[name] = value
    if reader.mixed:
        words = reader.words_on_mixed()
        if for_ros:
            raise ConfigurationError(words)
        warnings.warn(words, ParameterWarning, stacklevel=2)
    if not values:
        others = shortened(', '.join(dict.fromkeys(sections)), 200)
        raise ConfigurationError(
            f'{reader.file} has no parameters of {node}{f", only of {others}" if others else ""}: '
            f'write /** or {node} above {_SECTION}'
        )
    return values


def shared_names(path: Path | str, node_name: str) -> set[str]:
    """Returns the names that a valid file sets on a node only by its section of all nodes, /**."""
    reader, shared, own = _Reader(path, 'parameter', _LAYOUT), set[str](), set[str]()
    for section, name, _ in reader.parameters():
        if section.strip('/') == '**':
            shared.add(name)
        elif _matches(section, f'/{node_name.strip("/")}'):
            own.add(name)
    return shared - own


def read_yaml(path: Path | str, kind: str) -> Parameters:
    """Reads YAML with the syntax of a parameter file below `ros__parameters`.

    Args:
        path: Path of the YAML file.
        kind: Kind of the file, such as 'study', for error messages.

    Returns:
        The values by dotted name.

    Warns:
        ParameterWarning: A name is given twice; the last value applies.

    Raises:
        ConfigurationError: The file cannot be read, or has another syntax.
    """
    reader = _Reader(path, kind, 'write "name: value"')
    return {'.'.join(names): value for names, value in reader.values()}


class _Reader:
    """Reads a file in one pass over its YAML events."""

    def __init__(self, path: Path | str, kind: str, layout: str) -> None:
        self.file = str(path) if str(path).isprintable() else repr(str(path))
        self.layout, self.line, self.kind = layout, 1, kind
        # Lists that mix whole numbers with others, each by its name and line, as floats.
        self.mixed: dict[tuple[str, int], list[float]] = {}
        try:
            self.data = read_file(path, _MAX_BYTES)
        except OSError as error:
            raise ConfigurationError(
                f'{self.file}: {error.strerror or error}; give the path of a {kind} file'
            ) from error
        if self.data.startswith(_LOG):
            raise ConfigurationError(
                f'{self.file} is a log, not a {kind} file: linkage_replay shows it, and '
                'linkage_log info prints the parameters of its run'
            )
        if b'\0' in self.data and not self.data.startswith((b'\xff\xfe', b'\xfe\xff')):  # UTF-16
            raise ConfigurationError(
                f'{self.file} is not a text file: give the path of a {kind} file'
            )
        self.events = yaml.parse(self.data, Loader=CSafeLoader)

    def values(self) -> Iterator[tuple[tuple[str, ...], ParameterValue]]:
        """Yields the names of each value, from the outermost, and the value."""
        lines, repeated = dict[str, int](), dict[str, tuple[int, int]]()
        while not isinstance(event := self.next(), yaml.StreamEndEvent):
            if isinstance(event, yaml.MappingStartEvent):
                for names, value in self.mapping(()):
                    name = '.'.join(names)
                    if name in lines:
                        repeated[name] = lines[name], self.line
                    lines[name] = self.line
                    yield names, value
            elif isinstance(event, yaml.NodeEvent):
                raise self.syntax_error(f'{_show(event)} instead of a mapping; {self.layout}')
        if repeated:
            self.note_repeated(repeated)

    def parameters(self) -> Iterator[tuple[str, str, ParameterValue]]:
        """Yields the section, the dotted name and the value of each parameter of a node."""
        for names, value in self.values():
            if _SECTION not in names[1:-1]:
                raise self.syntax_error(f'{names[-1]!r} is not below {_SECTION}; {_LAYOUT}')
            depth = names.index(_SECTION)
            yield '/'.join(names[:depth]), '.'.join(names[depth + 1 :]), value

    def note_repeated(self, repeated: Mapping[str, tuple[int, int]]) -> None:
        """Warns of names that are given more than once, with the last two lines of each."""
        words = (
            f'{shown(name.rpartition(f"{_SECTION}.")[2])} (lines {first} and {last})'
            for name, (first, last) in repeated.items()
        )
        warnings.warn(
            f'{self.file}: given more than once: {listed(words)}; the last value applies: '
            'remove the others',
            ParameterWarning,
            stacklevel=2,
        )

    def words_on_mixed(self) -> str:
        """Returns one line on lists that rcl refuses, with what to write instead."""
        words = (f'line {line}: {name}: {shown(row)}' for (name, line), row in self.mixed.items())
        return (
            f'{self.file}: ROS refuses lists that mix whole numbers with others; for ROS, write '
            f'{listed(words, "; ")}'
        )

    def mapping(self, names: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], ParameterValue]]:
        """Yields the names and values in a mapping with given names."""
        while not isinstance(key := self.next(), yaml.MappingEndEvent):
            if not isinstance(key, yaml.ScalarEvent) or not key.value:
                raise self.error(f'{_show(key)} is not a name; write "name: value"')
            path = (*names, key.value)
            full_name = '.'.join(path)
            if len(full_name) > _MAX_NAME:
                raise self.error(
                    f'{_show(key)} makes a name of over {_MAX_NAME} characters; shorten it'
                )
            event = self.next()
            if isinstance(event, yaml.MappingStartEvent):
                yield from self.mapping(path)
            else:
                parameter = full_name.rpartition(f'{_SECTION}.')[2]
                yield path, self.value(parameter, event)

    def value(self, name: str, event: yaml.Event) -> ParameterValue:
        """Reads the value of a name, which begins with an event."""
        if isinstance(event, yaml.ScalarEvent):
            return self.scalar(name, event)
        items, texts = list[_Scalar](), list[str]()
        while not isinstance(event := self.next(), yaml.SequenceEndEvent):
            if not isinstance(event, yaml.ScalarEvent):
                raise self.error(f'{name!r} holds {_show(event)}; {_VALUE}')
            items.append(self.scalar(name, event))
            texts.append(event.value)
            self._require_one_type(name, items, texts)
        if not items:
            raise self.error(f'{name!r} is an empty list; {_VALUE}')
        is_mixed = len({*map(type, items)}) > 1
        if is_mixed:
            text = self.data.decode(errors='replace').split('\n')[self.line - 1]
            if ', ' in text and re.search(_DECIMAL_COMMA, text):
                raise self.syntax_error(f'{name!r} has a comma in a number')
            items = [*map(float, items)]
            self.mixed[name, self.line] = cast('list[float]', items)
        return cast('ParameterValue', items)

    def _require_one_type(self, name: str, items: Sequence[_Scalar], texts: Sequence[str]) -> None:
        """Rejects the last item of a list unless its type is that of the first.

        Raises:
            ConfigurationError: The types differ, and are not int and float.
        """
        first, last = items[0], items[-1]
        types = {type(first), type(last)}
        if types == {bool, str}:
            text = texts[-1] if isinstance(last, bool) else texts[0]
            raise self.syntax_error(
                f'{name!r}: ROS reads {text} as a boolean; choose another name, or quote it '
                'if it is not a name'
            )
        if len(types) > 1 and types != {int, float}:
            raise self.syntax_error(
                f'{name!r} mixes types, {shown(first)} and {shown(last)}; give one, as in '
                '[0.0, -9.81] or [10deg, 85deg]'
            )

    def scalar(self, name: str, event: yaml.ScalarEvent) -> _Scalar:
        if event.style:
            return event.value
        if not event.value:
            raise self.syntax_error(f'{name!r} has no value; {_VALUE}')
        return read_scalar(event.value)

    def next(self) -> yaml.Event:
        try:
            event = next(self.events)
        except yaml.reader.ReaderError as error:
            self.line = self.data.count(b'\n', 0, error.position) + 1
            raise self.not_yaml(error.reason) from error
        except yaml.MarkedYAMLError as error:
            if error.problem_mark is not None:
                self.line = error.problem_mark.line + 1
            raise self.not_yaml(error.problem or str(error)) from error
        self.line = getattr(event.start_mark, 'line', 0) + 1
        if isinstance(event, yaml.AliasEvent):
            raise self.error(
                f'ROS rejects aliases (*{shortened(str(event.anchor), 40)}); write the value'
            )
        if isinstance(event, yaml.ScalarEvent) and re.search('[\0\ud800-\udfff]', event.value):
            raise self.error(f'{_show(event)} contains a NUL or a surrogate; remove it')
        return event

    def not_yaml(self, reason: str) -> ConfigurationError:
        """Returns an error for the reason of a YAML parser."""
        if not self.file.endswith(('.yaml', '.yml')):
            return ConfigurationError(
                f'{self.file}: line {self.line} is not YAML ({reason}); is it a {self.kind} file?'
            )
        is_indented_wrongly = 'expected key' in reason
        cure = 'check the indentation of' if is_indented_wrongly else 'correct'
        return self.syntax_error(f'not YAML in UTF-8 ({reason}); {cure} this line')

    def syntax_error(self, problem: str) -> ConfigurationError:
        """Returns an error with all lines that have a common mistake, or else the problem."""
        mistakes = []
        text = self.data.decode(errors='replace')
        for number, line in enumerate(text.split('\n'), 1):
            code = re.sub(r'"[^"]*"|\'[^\']*\'|(^|\s)#.*', '', line)  # without texts and comments
            if number != self.line:
                # In a list, numbers may be separated by a comma without a space.
                code = re.sub(r'\[[^][]*\]', '', code)
            for pattern, mistake in _COMMON.items():
                if match := re.search(pattern, code):
                    mistakes.append(f'line {number}: {mistake.format(*match.groups())}')
        if not mistakes:
            return self.error(problem)
        return ConfigurationError(f'{self.file}, {shortened("; ".join(mistakes), 400)}')

    def error(self, problem: str) -> ConfigurationError:
        return ConfigurationError(f'{self.file}, line {self.line}: {problem}')


def _matches(section: str, node: str) -> bool:
    """Returns whether a section applies to a node; '*' matches one name, '**' any number."""
    wildcards = {'**': '(/[^/]+)*', '*': '/[^/]+'}
    section = re.sub(r'\*\*(/+\*\*)+', '**', section)  # matching repeated ** would be slow
    parts = [wildcards.get(part, f'/{re.escape(part)}') for part in section.split('/') if part]
    return re.fullmatch(''.join(parts), f'/{node.strip("/")}') is not None


def listed(words: Iterable[str], separator: str = ', ') -> str:
    """Returns the first words of a list, and how many there are more."""
    words = [*words]
    more = [f'and {len(words) - _MOST_LISTED} more'] * (len(words) > _MOST_LISTED)
    return separator.join([*words[:_MOST_LISTED], *more])


def _show(event: yaml.Event) -> str:
    other = 'a mapping' if isinstance(event, yaml.MappingStartEvent) else 'a list'
    return shown(event.value) if isinstance(event, yaml.ScalarEvent) else other


def read_scalar(text: str) -> _Scalar:
    """Parses an unquoted scalar: a bool, a decimal number, or else text."""
    if re.fullmatch(f'{_TRUE}|{_FALSE}', text):
        return re.fullmatch(_TRUE, text) is not None
    if len(text) < 19 and re.fullmatch(f'[-+]?({_WHOLE})', text):
        return int(text)
    return float(re.sub(r'\.([iInN])', r'\1', text)) if re.fullmatch(_REAL, text) else text
