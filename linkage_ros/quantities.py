# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Dataclass fields with a meaning, a unit and a range, which are checked.

`quantity` declares the fields of mechanisms, drives, session and controller settings. The ROS
parameters, their descriptors, checks and error messages all come from these declarations.
"""

from __future__ import annotations

import dataclasses
import math
import re
import typing
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import MISSING, dataclass
from decimal import Decimal
from numbers import Real
from typing import Any, NamedTuple, TypeVar

from linkage_ros.errors import ConfigurationError, shortened

_T = TypeVar('_T')
_LONGEST = 80  # characters of a value in an error


@dataclass(frozen=True)
class Quantity:
    """The kind, meaning and range of a field.

    Attributes:
        kind: 'number', 'whole', 'pair', 'list', 'choice', 'text' or 'switch'.
        meaning: One line for people.
        unit: SI unit; empty where there is none.
        low: Smallest valid value, inclusive (numbers, whole ones too, and pairs).
        high: Largest valid value, inclusive.
        choices: The valid words of a choice.
        pattern: Regular expression of valid text; empty: any text is valid.
        live: Whether the value may be changed while the node runs.
    """

    kind: str
    meaning: str
    unit: str = ''
    low: float = -math.inf
    high: float = math.inf
    choices: Collection[str] = ()
    pattern: str = ''
    live: bool = False

    @property
    def span(self) -> str:
        """The range with its unit, of numbers, whole numbers and pairs."""
        return f'{self.low:g} to {self.high:g} {self.unit}'.rstrip()

    @property
    def valid(self) -> str:
        """The valid values in words."""
        return {
            'number': f'a number from {self.span}',
            'whole': f'a whole number from {self.span}',
            'pair': f'two numbers, each from {self.span}',
            'list': f'a list of numbers from {self.span}',
            'choice': 'one of ' + ', '.join(self.choices),
            'text': f'text of the form {self.pattern}' if self.pattern else 'text',
            'switch': 'true or false',
        }[self.kind]

    def clean(self, name: str, value: object) -> object:
        """Returns the value in its field's type.

        Args:
            name: Name of the field in error messages.
            value: The value; whole numbers are accepted as numbers, and lists as pairs.

        Returns:
            The value as float, int, tuple of floats, str or bool.

        Raises:
            ConfigurationError: The value is of the wrong type or outside its range.
        """
        cleaned = getattr(self, f'_{self.kind}')(value)
        if cleaned is None:
            raise ConfigurationError(f'{name} = {shown(value)}: must be {self.valid}')
        return cleaned

    def _number(self, value: object) -> float | None:
        if isinstance(value, bool) or not isinstance(value, (Real, Decimal)):
            return None
        try:
            number = float(value)
        except (OverflowError, ValueError):  # 10**400, Decimal('sNaN')
            return None
        # Adding 0.0 turns -0.0 into 0.0, so that equal settings give equal bytes.
        return number + 0.0 if self.low <= number <= self.high else None

    def _whole(self, value: object) -> int | None:
        return value if isinstance(value, int) and self._number(value) is not None else None

    def _pair(self, value: object) -> tuple[float | None, ...] | None:
        numbers = self._list(value)
        return numbers if numbers is not None and len(numbers) == 2 else None

    def _list(self, value: object) -> tuple[float | None, ...] | None:
        items = value.tolist() if hasattr(value, 'tolist') else value
        if not isinstance(items, (list, tuple)) or not items:
            return None
        numbers = tuple(map(self._number, items))
        return None if None in numbers else numbers

    def _choice(self, value: object) -> str | None:
        return value if isinstance(value, str) and value in self.choices else None

    def _text(self, value: object) -> str | None:
        if not isinstance(value, str) or (self.pattern and not re.fullmatch(self.pattern, value)):
            return None
        return value

    def _switch(self, value: object) -> bool | None:
        return value if isinstance(value, bool) else None


def shown(value: object) -> str:
    """Formats a value for an error message, shortened."""
    try:
        return shortened(' '.join(repr(value).split()), _LONGEST)
    except ValueError:  # Python writes no whole number of thousands of digits
        return 'a number of thousands of digits'
    except RecursionError:
        return 'lists nested deeper than Python goes'


def quantity(
    kind: str,
    meaning: str,
    unit: str = '',
    *,
    span: tuple[float, float] = (-math.inf, math.inf),
    choices: Collection[str] = (),
    pattern: str = '',
    live: bool = False,
    default: Any = MISSING,
) -> Any:
    """Declares a dataclass field that holds a `Quantity`; without default it is required."""
    described = Quantity(kind, meaning, unit, *span, choices, pattern, live)
    return dataclasses.field(default=default, metadata={'quantity': described})


def groups(base: type, kinds: Sequence[Any]) -> Any:
    """Declares a dataclass field that holds a tuple of dataclasses of quantities.

    Args:
        base: Base class of all that it may hold.
        kinds: Such classes. Each has the name of its group of parameters in `group`, or '' for
            none. A parameter file may set one of each group.

    Returns:
        The field; empty by default.
    """
    valid = f'{", ".join(kind.__name__ for kind in kinds)} or another {base.__name__}'
    named = {kind.group: kind for kind in kinds if kind.group}
    return dataclasses.field(default=(), metadata={'groups': named, 'base': base, 'valid': valid})


class Checked:
    """Base of frozen dataclasses of quantities, which checks them on creation."""

    def __post_init__(self) -> None:
        hints = typing.get_type_hints(type(self))
        for field in dataclasses.fields(typing.cast('Any', self)):
            value = getattr(self, field.name)
            described = field.metadata.get('quantity')
            if 'groups' in field.metadata:
                self._check_group(field, value)
            elif described is None:
                kind = hints[field.name]
                if not isinstance(value, kind):
                    raise ConfigurationError(
                        f'{field.name} = {shown(value)}: must be a {kind.__name__}'
                    )
            elif not (value is None and field.default is None):
                object.__setattr__(self, field.name, described.clean(field.name, value))

    def _check_group(self, field: dataclasses.Field[Any], value: object) -> None:
        members = tuple(value) if isinstance(value, (list, tuple)) else (value,)
        for member in members:
            if not isinstance(member, field.metadata['base']):
                raise ConfigurationError(
                    f'{field.name} holds {shown(member)}: each must be a {field.metadata["valid"]}'
                )
        object.__setattr__(self, field.name, members)


class Leaf(NamedTuple):
    """One quantity of a dataclass or of the dataclasses nested in it.

    Attributes:
        name: Dotted path, such as 'crank.length'.
        quantity: Its kind, meaning and range.
        default: Its default; `MISSING` if it is required.
    """

    name: str
    quantity: Quantity
    default: object


def leaves(cls: type) -> tuple[Leaf, ...]:
    """All quantities of a dataclass, nested ones with dotted names, in order of declaration."""
    return tuple(_walk(cls, ''))


def _walk(cls: type, prefix: str) -> Iterator[Leaf]:
    hints = typing.get_type_hints(cls)
    for field in dataclasses.fields(cls):
        described = field.metadata.get('quantity')
        if described is not None:
            yield Leaf(prefix + field.name, described, field.default)
        elif 'groups' in field.metadata:
            for name, kind in field.metadata['groups'].items():
                for leaf in _walk(kind, f'{prefix}{name}.'):
                    # Required only where the group is there.
                    yield leaf._replace(default=None) if leaf.default is MISSING else leaf
        else:
            yield from _walk(hints[field.name], f'{prefix}{field.name}.')


def build(cls: type[_T], values: Mapping[str, object], prefix: str = '') -> _T:
    """Makes a dataclass from flat dotted names, the inverse of `flatten`.

    Args:
        cls: A dataclass of quantities and of such dataclasses.
        values: Values by dotted name; names that cls does not have are ignored.
        prefix: Prepended to the names of cls.

    Returns:
        The object; missing fields have their defaults.

    Raises:
        ConfigurationError: A value is bad; the message starts with its dotted name.
    """
    hints = typing.get_type_hints(cls)
    arguments: dict[str, object] = {}
    for field in dataclasses.fields(typing.cast('Any', cls)):
        name = prefix + field.name
        described = field.metadata.get('quantity')
        if 'groups' in field.metadata:
            arguments[field.name] = tuple(
                build(kind, values, f'{prefix}{group}.')
                for group, kind in field.metadata['groups'].items()
                if any(given.startswith(f'{prefix}{group}.') for given in values)
            )
        elif described is None:
            arguments[field.name] = build(hints[field.name], values, name + '.')
        elif name in values:
            arguments[field.name] = described.clean(name, values[name])
        elif field.default is MISSING:
            raise ConfigurationError(f'{name} is missing: must be {described.valid}')
    return cls(**arguments)


def flatten(instance: object, prefix: str = '') -> dict[str, object]:
    """The quantities of an object by dotted name; those that are None are left out."""
    flat: dict[str, object] = {}
    for field in dataclasses.fields(typing.cast('Any', instance)):
        value = getattr(instance, field.name)
        if 'groups' in field.metadata:
            for group, member in _by_group(field, value).items():
                flat.update(flatten(member, f'{prefix}{group}.'))
        elif field.metadata.get('quantity') is None:
            flat.update(flatten(value, f'{prefix}{field.name}.'))
        elif value is not None:
            flat[prefix + field.name] = value
    return flat


def _by_group(field: dataclasses.Field[Any], members: tuple[object, ...]) -> dict[str, object]:
    """The members of a field by the names of their groups.

    Raises:
        ConfigurationError: Parameters cannot express them: two of one kind, or a user's own kind.
    """
    names = {kind: name for name, kind in field.metadata['groups'].items()}
    found: dict[str, object] = {}
    for member in members:
        name = names.get(type(member))
        if name is None or name in found:
            raise ConfigurationError(
                f'{field.name} holds {shown(member)}: parameters can say one of each: '
                f'{", ".join(names.values())}'
            )
        found[name] = member
    return found
