# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Names the values in a message's bytes, by the definition of its type: for people, not fast."""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from typing import TypeAlias

from linkage_ros.wire.cdr import CdrReader
from linkage_ros.wire.interfaces import Interface

_FORMATS = {
    'float64': 'd', 'float32': 'f', 'int64': 'q', 'uint64': 'Q', 'int32': 'i', 'uint32': 'I',
    'int16': 'h', 'uint16': 'H', 'int8': 'b', 'uint8': 'B', 'byte': 'B', 'bool': '?',
}  # fmt: skip
_NAMES = ('name', 'joint_names')  # of the joints that the other arrays of the message belong to

Value: TypeAlias = float | int | str
_Types: TypeAlias = dict[str, list[tuple[str, str]]]


def read_fields(interface: Interface, data: bytes) -> dict[str, Value]:
    """The values in a message.

    Args:
        interface: Its type.
        data: Its CDR bytes, little endian.

    Returns:
        Values by name, such as 'velocity[coupler]'.

    Raises:
        ValueError: The bytes are no such message.
    """
    types = _parse(interface.definition)
    try:
        values = dict(_values(CdrReader(data), types, '', ''))
    except (struct.error, ValueError) as error:
        raise ValueError(f'not a {interface.name}: {error}') from error
    joints = [value for path, value in values.items() if path.partition('[')[0] in _NAMES]
    return {_named(path, joints): value for path, value in values.items()}


def _named(path: str, joints: list[Value]) -> str:
    """A path whose last index, where it counts joints, is the joint's name."""
    found = re.fullmatch(r'(.+)\[(\d+)\]', path)
    if not found or found[1] in _NAMES or int(found[2]) >= len(joints):
        return path
    return f'{found[1]}[{joints[int(found[2])]}]'


def _parse(definition: str) -> _Types:
    """Fields as (type, name), by the name of the type that has them; '' is the message itself."""
    types: _Types = {}
    for part in definition.split('=' * 80 + '\n'):
        title, _, rest = part.partition('\n') if part.startswith('MSG: ') else ('', '', part)
        lines = (line.split('#')[0].split() for line in rest.splitlines())
        fields = [(words[0], words[1]) for words in lines if len(words) == 2]
        types[title.rpartition('/')[2]] = [field for field in fields if '=' not in field[1]]
    return types


def _values(reader: CdrReader, types: _Types, kind: str, path: str) -> Iterator[tuple[str, Value]]:
    """Reads a value of some type; its parts by path."""
    if array := re.fullmatch(r'(.+)\[(\d*)\]', kind):
        for index in range(int(array[2]) if array[2] else reader.count()):
            yield from _values(reader, types, array[1], f'{path}[{index}]')
    elif kind == 'string':
        yield path, reader.text()
    elif kind in _FORMATS:
        yield path, reader.number(_FORMATS[kind])
    else:
        for part, name in types[kind.rpartition('/')[2]]:
            yield from _values(reader, types, part, f'{path}.{name}' if path else name)
