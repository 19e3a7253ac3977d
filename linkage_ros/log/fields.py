# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Names the values in a message's bytes, by the definition of its type: for people, not fast."""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator

from linkage_ros.wire.interfaces import Interface

_ENCAPSULATION = 4
_FORMATS = {
    'float64': 'd', 'float32': 'f', 'int64': 'q', 'uint64': 'Q', 'int32': 'i', 'uint32': 'I',
    'int16': 'h', 'uint16': 'H', 'int8': 'b', 'uint8': 'B', 'byte': 'B', 'bool': '?',
}  # fmt: skip
_NAMES = ('name', 'joint_names')  # of the joints that the other arrays of the message belong to

Value = float | int | str
_Types = dict[str, list[tuple[str, str]]]


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
        values = dict(_Cursor(data).read(types, '', ''))
    except (struct.error, UnicodeDecodeError) as error:
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


class _Cursor:
    """A place in CDR bytes."""

    def __init__(self, data: bytes) -> None:
        self._data, self._at = data, _ENCAPSULATION

    def read(self, types: _Types, kind: str, path: str) -> Iterator[tuple[str, Value]]:
        """Reads a value of some type and yields its parts by path."""
        if array := re.fullmatch(r'(.+)\[(\d*)\]', kind):
            for index in range(int(array[2]) if array[2] else self._count()):
                yield from self.read(types, array[1], f'{path}[{index}]')
        elif kind == 'string':
            yield path, self._text()
        elif kind in _FORMATS:
            yield path, self._number(_FORMATS[kind])
        else:
            for part, name in types[kind.rpartition('/')[2]]:
                yield from self.read(types, part, f'{path}.{name}' if path else name)

    def _number(self, code: str) -> float:
        size = struct.calcsize(code)
        self._at += -(self._at - _ENCAPSULATION) % size
        (value,) = struct.unpack_from(f'<{code}', self._data, self._at)
        self._at += size
        number: float = value
        return number

    def _count(self) -> int:
        count = int(self._number('I'))
        if count > len(self._data):
            raise struct.error(f'{count} elements in {len(self._data)} bytes')
        return count

    def _text(self) -> str:
        size = self._count()
        self._at += size
        return self._data[self._at - size : self._at].rstrip(b'\0').decode()
