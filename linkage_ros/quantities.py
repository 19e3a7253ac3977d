# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Validated dataclass fields with a meaning, a unit and a range.

`quantity` declares the fields of mechanisms, drives, session and controller settings. These
declarations also define the ROS parameters, their descriptors, checks and error messages.
Angles may be texts in degrees, such as '85deg'.

Public: other packages may import this module.
"""

import dataclasses
import decimal
import difflib
import functools
import math
import re
import typing
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import MISSING, dataclass
from numbers import Real
from typing import Any, ClassVar, NamedTuple, TypeVar

from linkage_ros.errors import ConfigurationError, Mistakes, shortened

_T = TypeVar('_T')
_SUGGESTED = 3  # most names that are suggested
_ABOUT_EQUAL = 0.04  # difference of two resemblances, between 0 and 1
_LONGEST = 80  # largest length of a value in an error message, characters
NAME = '[A-Za-z_][A-Za-z0-9_]*'  # regular expression of the names in `groups`
# Texts that ROS reads as booleans, whatever the case of their letters.
BOOLEANS = frozenset({'y', 'n', 'yes', 'no', 'on', 'off', 'true', 'false'})
_ANY = '(?s).*'  # pattern that matches any string
_RAD, _RAD_OR_M = 'rad', 'rad or m'  # units of quantities that may be given in degrees
_DECIMAL = r'[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]{1,3})?'
_DEGREES = re.compile(f'({_DECIMAL})deg')
_MISSPELT_DEGREES = re.compile(
    rf'\s*({_DECIMAL})\s*(?:deg|degrees?|\N{{DEGREE SIGN}})\s*', re.IGNORECASE
)
_WITH_UNIT = re.compile(rf'\s*({_DECIMAL})\s*[a-zA-Z][a-zA-Z0-9/^ ]*')
_DIGITS = decimal.Context(prec=60)
_PI = decimal.Decimal('3.14159265358979323846264338327950288419716939937510582097494459')


class _Unknown:
    """The type of `UNKNOWN`."""

    def __repr__(self) -> str:
        return 'UNKNOWN'


# Value of a field that was rejected, in an object in which further mistakes are sought.
UNKNOWN: Any = _Unknown()


class Angle(float):
    """An angle, rad, given in degrees as the value of a quantity in rad or m.

    `refuse_angles` rejects it if the quantity turns out to be a position.
    """


@dataclass(frozen=True)
class Quantity:
    """The kind, meaning and range of a field.

    Attributes:
        kind: 'number', 'whole', 'pair', 'list', 'choice', 'text', 'names' or 'switch'.
        meaning: One-line description for users.
        unit: Unit of the value; empty for dimensionless and non-numeric values.
        low: Smallest valid number, inclusive; also applies to each number of a pair or list.
        high: Largest valid number, inclusive; also applies to each number of a pair or list.
        choices: Valid values if the kind is 'choice'.
        pattern: Regular expression that valid text, or each name, matches; empty if any is valid.
        live: Whether the value may change while the node runs.
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
        """The range with its unit as text, for numbers, whole numbers, pairs and lists."""
        return f'{self.low:g} to {self.high:g} {self.unit}'.rstrip()

    @property
    def valid(self) -> str:
        """The valid values in words, for help and error messages."""
        return {
            'number': f'a number from {self.span}',
            'whole': f'a whole number from {self.span}',
            'pair': f'two numbers, each from {self.span}',
            'list': f'a list of numbers from {self.span}',
            'choice': 'one of ' + ', '.join(self.choices),
            'text': f'text of the form {self.pattern}' if self.pattern else 'text',
            'names': 'a list of names',
            'switch': 'true or false',
        }[self.kind]

    def clean(self, name: str, value: object) -> object:
        """Validates a value and converts it to the type of its field.

        Args:
            name: Name of the field in error messages.
            value: Value to convert; integers are accepted as numbers, lists as pairs, and texts
                such as '85deg' as angles.

        Returns:
            The value as float, int, tuple of floats, str, tuple of str or bool. An angle in
            degrees is converted to rad and rounded once; 'rad or m' gives an `Angle`.

        Raises:
            ConfigurationError: The value is of the wrong type or outside its range.
        """
        if type(value) is float and self.kind == 'number' and self.low <= value <= self.high:
            return value + 0.0  # the common case, as in `_number`
        if value is UNKNOWN:  # rejected before
            return value
        cleaned = self._read(value)
        if cleaned is None:
            items = value if isinstance(value, (list, tuple)) else ()
            are_two_numbers = len(items) == 2 and all(isinstance(x, (int, float)) for x in items)
            is_no_pair = self.kind == 'pair' and not are_two_numbers
            wanted = self.wanted if is_no_pair else self.valid
            raise ConfigurationError(
                f'{name} = {shown(value)}: must be {wanted}{self._hint(value)}'
            )
        return cleaned

    @property
    def wanted(self) -> str:
        """The valid values and their meaning in words, for error messages."""
        if self.kind == 'pair':
            return f'two numbers, the {self.meaning}{", " * bool(self.unit)}{self.unit}'
        return f'{self.valid}, the {self.meaning}'

    @property
    def _is_angle(self) -> bool:
        return self.unit in {_RAD, _RAD_OR_M}

    def _hint(self, value: object) -> str:
        """Suggests how to write a number, for an error message."""
        is_list = isinstance(value, (list, tuple))
        items: Any = value if is_list else (value,)
        texts = [x for x in items if isinstance(x, str) and self._number(x) is None]
        if self.kind in {'text', 'names'} and any(isinstance(x, bool) for x in items):
            return '; ROS reads y, n, yes, no, on and off as booleans: choose another name'
        if self.kind == 'names' and isinstance(value, str):
            return f'; write [{", ".join(re.findall(r"[^][, ]+", value))}]'
        if self.kind == 'text' and is_list:
            return ', not a list: only one can be given'
        if self.kind == 'choice':
            return did_you_mean(str(value), self.choices)
        if self.kind not in {'number', 'whole', 'pair', 'list'} or not texts:
            return ''
        text = texts[0]
        if re.fullmatch(r'[-+]?\d+,\d+', text) and (self.kind == 'number' or is_list):
            return f'; write {text.replace(",", ".")}, with a point instead of a comma'
        if self.kind in {'pair', 'list'} and text.startswith('['):  # as of `ros2 param set`
            return '; do not mix whole numbers with others: [0.0, -9.81]'
        return self._hint_on_number(text)

    def _hint_on_number(self, text: str) -> str:
        """Suggests how to write a text as a number."""
        if re.fullmatch(_DECIMAL, text):
            degrees_too = f'; in degrees, write {text}deg' if self._is_angle else ''
            return f'; write {text} without quotes{degrees_too}'
        degrees, with_unit = _MISSPELT_DEGREES.fullmatch(text), _WITH_UNIT.fullmatch(text)
        if not self._is_angle and degrees:
            return '; only angles in rad may be given in degrees'
        if not self._is_angle:
            return f'; write {with_unit[1]}, without a unit' if with_unit else ''
        if (angle := _radians(text)) is not None:
            return f'; {text} is {angle:g} rad'
        return f'; in degrees, write {degrees[1] if degrees else 85}deg'

    def _read(self, value: object) -> object:
        """Converts a value to the type of the field; returns None if the value is invalid."""
        if self.kind == 'number':
            return self._number(value)
        if self.kind in {'pair', 'list'}:
            items = value.tolist() if hasattr(value, 'tolist') else value
            if not isinstance(items, (list, tuple)) or not items:
                return None
            numbers = tuple(map(self._number, items))
            is_valid = None not in numbers and (self.kind == 'list' or len(numbers) == 2)
            return numbers if is_valid else None
        if self.kind == 'names':
            items = value if isinstance(value, (list, tuple)) else ()
            is_valid = all(isinstance(x, str) and self._fits(x) for x in items)
            return tuple(items) if items and is_valid else None
        if self.kind == 'switch':
            is_valid = isinstance(value, bool)
        elif self.kind == 'whole':
            is_valid = isinstance(value, int) and self._number(value) is not None
        elif self.kind == 'choice':
            is_valid = isinstance(value, str) and value in self.choices
        else:
            is_valid = isinstance(value, str) and self._fits(value)
        return value if is_valid else None

    def _fits(self, text: str) -> bool:
        return re.fullmatch(self.pattern or _ANY, text) is not None

    def _number(self, value: object) -> float | None:
        """Converts a value to a valid number; returns None if it is none."""
        if isinstance(value, str):
            angle = _radians(value) if self._is_angle else None
            if angle is None or not self.low <= angle <= self.high:
                return None
            return Angle(angle) if self.unit == _RAD_OR_M else angle
        if isinstance(value, Angle) and self.unit == _RAD_OR_M:
            return value if self.low <= value <= self.high else None
        if not isinstance(value, float):
            if isinstance(value, bool) or not isinstance(value, Real):
                return None
            try:
                value = float(value)
            except OverflowError:  # 10**400
                return None
        # Adding 0.0 converts -0.0 to 0.0, so that equal settings give equal bytes.
        return float(value) + 0.0 if self.low <= value <= self.high else None


def _radians(text: str) -> float | None:
    """Converts a text such as '85deg' to rad, rounded once; returns None for other texts."""
    match = _DEGREES.fullmatch(text)
    if match is None:
        return None
    degrees = decimal.Decimal(match[1])
    return float(_DIGITS.divide(_DIGITS.multiply(degrees, _PI), decimal.Decimal(180))) + 0.0


def refuse_angles(name: str, value: object, what: str) -> None:
    """Rejects angles in degrees as positions.

    Args:
        name: Name of the parameter, for the error message.
        value: Cleaned value of a quantity in rad or m; a number, a tuple of numbers, or None.
        what: Name of the part that slides.

    Raises:
        ConfigurationError: A number was given in degrees.
    """
    for number in value if isinstance(value, tuple) else (value,):
        if isinstance(number, Angle):
            raise ConfigurationError(
                f'{name} = {math.degrees(number):.9g}deg: must be in m, because {what} slides'
            )


def shown(value: object) -> str:
    """Formats a value for an error message, with at most 80 characters."""
    return shortened(' '.join(repr(value).split()), _LONGEST)


def did_you_mean(given: str, valid: Iterable[str]) -> str:
    """Returns '; did you mean NAME?' if a name resembles a valid one, otherwise ''."""
    found = _resembling_names(given, valid)
    return f'; did you mean {" or ".join(found)}?' if found else ''


def resembling(given: str, valid: Iterable[str]) -> str:
    """Returns the valid name that a name resembles most, or ''.

    Capital letters, and `-` or a space for `_`, do not count.
    """
    return next(iter(_resembling_names(given, valid)), '')


def _resembling_names(given: str, valid: Iterable[str]) -> list[str]:
    """Returns the valid names that a name resembles most, and nearly as much, the best first."""
    names, plain = {_plain(name): name for name in valid}, _plain(given[:_LONGEST])
    found = [name for name in names if sorted(name) == sorted(plain)]  # letters are exchanged
    found = found or [name for name in names if plain == 2 * name]  # AA for A
    if not found:
        near = difflib.get_close_matches(plain, names, n=_SUGGESTED, cutoff=0.75)
        likeness = [difflib.SequenceMatcher(None, name, plain).ratio() for name in near]
        found = [x for x, y in zip(near, likeness, strict=True) if y > likeness[0] - _ABOUT_EQUAL]
    return [names[name] for name in found]


def _plain(name: str) -> str:
    return name.lower().replace('-', '_').replace(' ', '_')


def require_name(what: str, name: str) -> None:
    """Rejects a name that parameters cannot hold.

    Args:
        what: What has the name, for the error message.
        name: Name of an object in `groups`.

    Raises:
        ConfigurationError: The name has other characters than letters, digits and underscores,
            or begins with a digit.
    """
    if not isinstance(name, str) or not re.fullmatch(NAME, name):
        raise ConfigurationError(
            f'{what} {shown(name)}: its name must be letters, digits and underscores, and not '
            'begin with a digit'
        )


def counted(number: int, noun: str) -> str:
    """Formats a number with a noun, such as '1 state' or '2 states'."""
    return f'{number} {noun}{"" if number == 1 else "s"}'


def unknown_name(name: str, owner: str, valid: Collection[str], where: str) -> tuple[str, str]:
    """Returns the error message for an unknown name of a parameter, and what is meant or ''.

    Args:
        name: The unknown name.
        owner: Description of the object without such a parameter.
        valid: The names of its parameters, in which NAME stands for any name.
        where: Command that lists them.
    """
    if single := _value_above(name, valid):
        return f'{single} is one value, without names below it: write {single}: VALUE', single
    mistake, all_names = f'{shown(name)} is not a parameter of {owner}', f'{where} lists all'
    group, members = name, _below(name, valid)
    while group and not members:
        group = group.rpartition('.')[0]
        members = _below(group, valid)
    if members and group == name:
        words = f'{mistake}; write {name}: {{{members[0]}: ...}}; {all_names}'
        return words, f'{name}.{members[0]}'
    meant = _resembling_parameter(name, valid)
    if name.endswith('.weight') and 'mass' in members:
        return f'{mistake}; give mass, in kg; {all_names}', meant
    if meant not in {'', name}:
        return f'{mistake}; did you mean {meant}?', meant
    hint = f'; {group} has {", ".join(members)}' if members else ''
    return f'{mistake}{hint}; {all_names}', meant


def _below(group: str, valid: Iterable[str]) -> list[str]:
    """Returns the next parts of the parameters in a group; NAME stands for any name."""
    parts = group.split('.') if group else []
    names = [x.split('.') for x in valid]
    inside = [x for x in names if len(x) > len(parts) and _fits(parts, x)] if parts else []
    next_parts = [*dict.fromkeys(x[len(parts)] for x in inside)]
    return [x for x in next_parts if x != 'NAME'] or next_parts


def _fits(parts: Sequence[str], pattern: Sequence[str]) -> bool:
    return all(y in {x, 'NAME'} for x, y in zip(parts, pattern, strict=False))


def _value_above(name: str, valid: Iterable[str]) -> str:
    """Returns the parameter below whose name a name is given, although it is no group; or ''."""
    parts = name.split('.')
    lengths = {len(x) for leaf in valid if _fits(parts, x := leaf.split('.'))}
    return next(('.'.join(parts[:n]) for n in sorted(lengths) if n <= len(parts)), '')


def _resembling_parameter(name: str, valid: Iterable[str]) -> str:
    """Returns the parameter or group of parameters that a name resembles most, or ''."""
    valid = [*valid]
    # The names whose first parts fit those of the name so far, as they are meant.
    candidates, meant_parts = [x.split('.') for x in valid], list[str]()
    for i, part in enumerate(name.split('.')):
        candidates = [x for x in candidates if len(x) > i]
        known = {x[i] for x in candidates}
        meant = part if known & {part, 'NAME'} else resembling(part, known)
        candidates = [x for x in candidates if x[i] in {meant, 'NAME'}]
        meant_parts.append(meant)
    if all(meant_parts):
        return '.'.join(meant_parts)
    return '' if '.' in name else resembling(name, valid)


# Pattern of the name of a topic, which may be empty.
TOPIC_NAME = '(/?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*)?'


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
    """Declares a dataclass field with a `Quantity`; the field is required if it has no default."""
    described = Quantity(kind, meaning, unit, *span, choices, pattern, live)
    return dataclasses.field(default=default, metadata={'quantity': described})


def groups(base: type, kinds: Mapping[str, Any]) -> Any:
    """Declares a dataclass field for a tuple of objects with names of their own.

    In parameters, the names of an object x begin with the name of the field and x. One of its
    parameters is its kind, unless all objects have one class.

    Args:
        base: Base class of the valid objects, whose attribute `name` holds an object's name.
        kinds: Classes by kind. It may grow until it is used. The kind of the only class may be ''.

    Returns:
        The field, whose default is an empty tuple.
    """
    return dataclasses.field(default=(), metadata={'quantity': _Group(base, kinds)})


def named(kind: str, meaning: str, **options: Any) -> Any:
    """Declares a dataclass field for a mapping from names to values of one quantity.

    In parameters, the name of a value is that of the field, a dot, and its own. The arguments are
    those of `quantity`.
    """
    value = quantity(kind, meaning, **options).metadata['quantity']
    return dataclasses.field(default_factory=dict, metadata={'quantity': _Named(value)})


def unlisted(default: Any) -> Any:
    """Declares a dataclass field that is not a parameter."""
    return dataclasses.field(default=default, metadata={'quantity': None})


def required() -> Any:
    """Declares a dataclass field without a default that is not a parameter."""
    return dataclasses.field(metadata={'quantity': None})


class _Part(NamedTuple):
    """A field whose value is a dataclass of quantities.

    Attributes:
        base: The class.
        is_optional: Whether the value may be None.
    """

    base: Any
    is_optional: bool


class _Named(NamedTuple):
    """A field whose value is a mapping from names to values; see `named`.

    Attributes:
        value: The quantity of each value.
    """

    value: Quantity

    def names(self, prefix: str, values: Mapping[str, object]) -> list[str]:
        """Returns the names in parameters after a prefix, in increasing order."""
        found = (name.removeprefix(prefix) for name in values if name.startswith(prefix))
        return sorted(name for name in found if '.' not in name)


class _Group(NamedTuple):
    """A field whose value is a tuple of named dataclasses of quantities; see `groups`.

    Attributes:
        base: Base class of the valid objects.
        kinds: Their classes, by kind.
    """

    base: Any
    kinds: Mapping[str, Any]

    @property
    def kind(self) -> Quantity:
        """The kind of an object, as a parameter."""
        return Quantity('choice', 'kind', choices=self.kinds.keys())

    @property
    def has_kinds(self) -> bool:
        """Whether the kind is a parameter."""
        return '' not in self.kinds

    def members(self, prefix: str, values: Mapping[str, object]) -> dict[str, Any]:
        """Returns the classes of the objects in parameters, by name in increasing order.

        Raises:
            ConfigurationError: An object has no kind, or an unknown one.
        """
        parts = (
            name.removeprefix(prefix).split('.') for name in values if name.startswith(prefix)
        )
        classes = {}
        for name in sorted({part[0] for part in parts if len(part) > 1}):
            kind, key = '', f'{prefix}{name}.kind'
            if self.has_kinds:
                if key not in values:
                    raise ConfigurationError(f'{key} is missing: must be {self.kind.valid}')
                kind = str(self.kind.clean(key, values[key]))
            classes[name] = self.kinds[kind]
        return classes

    def kind_of(self, field: str, member: Any) -> str:
        """Returns the kind of an object in a field of this name.

        Raises:
            ConfigurationError: Parameters cannot express the object.
        """
        for kind, cls in self.kinds.items():
            if type(member) is cls and member.name:
                return kind
        raise ConfigurationError(
            f'{field} holds {shown(member)}: parameters can hold any number of '
            f'{", ".join(self.kinds)}, each with a name'
        )


def _read_parts(cls: Any) -> tuple[tuple[dataclasses.Field[Any], Any], ...]:
    """Returns each field of a dataclass with its `Quantity`, `_Named`, `_Part` or `_Group`.

    They are in the order of the constructor's arguments, so that those which a base class declares
    by keyword only follow those of the class itself.
    """
    hints = typing.get_type_hints(cls)
    parts = []
    for field in sorted(dataclasses.fields(cls), key=lambda field: bool(field.kw_only)):
        kind = hints[field.name]
        # The class of a part that may be None.
        inner = next((x for x in typing.get_args(kind) if dataclasses.is_dataclass(x)), kind)
        part = field.metadata.get('quantity', _Part(inner, is_optional=inner is not kind))
        if part is not None:
            parts.append((field, part))
    return tuple(parts)


def _parameter(field: dataclasses.Field[Any]) -> str:
    """Returns the name of a field in parameters; `from_` is the field of `from`."""
    return field.name.rstrip('_')


_parts: Callable[[Any], Any] = functools.cache(_read_parts)  # type hints are slow to resolve


class Checked:
    """Base class of frozen dataclasses of quantities; validates the fields on creation.

    Attributes:
        allows_unknown: Whether `build` creates an object with rejected fields, which are UNKNOWN,
            to find further mistakes; `build` then raises all, so that nobody else sees UNKNOWN.
    """

    allows_unknown: ClassVar[bool] = False

    def __post_init__(self) -> None:
        for field, part in _parts(type(self)):
            value = getattr(self, field.name)
            if value is not UNKNOWN:
                object.__setattr__(self, field.name, _cleaned(field, part, value))


class Leaf(NamedTuple):
    """A quantity of a dataclass or of its nested dataclasses.

    Attributes:
        name: Dotted path, such as 'crank.length'.
        quantity: Kind, meaning and range.
        default: Default value; `MISSING` if the quantity is required.
    """

    name: str
    quantity: Quantity
    default: object


def leaves(
    cls: type, prefix: str = '', values: Mapping[str, object] | None = None
) -> tuple[Leaf, ...]:
    """Returns the quantities of a dataclass, including nested ones, in order of declaration.

    Args:
        cls: Dataclass whose fields are quantities or nested dataclasses of this kind.
        prefix: Prefix of all names.
        values: Values by dotted name, whose objects in `groups` and names in `named` add
            quantities; by default, those of one kind of object are listed once, with NAME.

    Raises:
        ConfigurationError: The values give no kind of such an object.
    """
    all_leaves: list[Leaf] = []
    for field, part in _parts(cls):
        start = f'{prefix}{field.name}.'
        if isinstance(part, Quantity):
            all_leaves.append(Leaf(prefix + _parameter(field), part, field.default))
        elif isinstance(part, _Named):
            names = ['NAME'] if values is None else part.names(start, values)
            all_leaves += (Leaf(start + name, part.value, MISSING) for name in names)
        elif isinstance(part, _Group):
            all_leaves += _leaves_of_group(part, start, values)
        elif not part.is_optional:
            all_leaves += leaves(part.base, start, values)
        elif values is None or _names(values, prefix + field.name):
            # Required only if the part is present.
            for leaf in leaves(part.base, start, values):
                is_required = leaf.default is MISSING
                all_leaves.append(leaf._replace(default=None) if is_required else leaf)
    return tuple(all_leaves)


def _leaves_of_group(
    group: _Group, start: str, values: Mapping[str, object] | None
) -> Iterator[Leaf]:
    """Yields the quantities of the objects in a group; see `leaves`."""
    if values is None and not group.has_kinds:
        yield from leaves(group.kinds[''], f'{start}NAME.')
        return
    for name, kind in group.members(start, values or {}).items():
        if group.has_kinds:
            yield Leaf(f'{start}{name}.kind', group.kind, MISSING)
        yield from leaves(kind, f'{start}{name}.', values)


def _cleaned(field: Any, part: Any, value: Any) -> Any:
    """Validates the value of a field, and converts it to the type of the field.

    Raises:
        ConfigurationError: The value is invalid.
    """
    if isinstance(part, Quantity):
        is_left_out = value is None and field.default is None
        return None if is_left_out else part.clean(_parameter(field), value)
    if isinstance(part, _Named):
        return {
            name: x if x is UNKNOWN else part.value.clean(f'{field.name}.{name}', x)
            for name, x in value.items()
        }
    is_group = isinstance(part, _Group)
    if value is None and not is_group and part.is_optional:
        return None
    members = tuple(value) if isinstance(value, (list, tuple)) else (value,)
    for member in members:
        if not isinstance(member, part.base):
            raise ConfigurationError(
                f'{field.name} = {shown(member)}: must be of type {part.base.__name__}'
            )
    return members if is_group else value


def _names(values: Mapping[str, object], group: str) -> bool:
    """Returns whether any of the names belongs to a group."""
    return any(name.startswith(f'{group}.') for name in values)


def build(cls: type[_T], values: Mapping[str, object], prefix: str = '', **others: object) -> _T:
    """Builds an instance of a dataclass from values by dotted name; inverts `flatten`.

    Args:
        cls: Dataclass whose fields are quantities or nested dataclasses of this kind.
        values: Values by dotted name; other names are ignored.
        prefix: Prefix of the names in `values`.
        **others: Values of fields that are not parameters.

    Returns:
        The instance; fields without a value have their defaults.

    Raises:
        ConfigurationError: A value is missing or invalid. The message starts with its dotted name.
    """
    mistakes = Mistakes()
    made = _filled(cls, values, prefix, mistakes, others)
    mistakes.check()
    return typing.cast('_T', made)


def _filled(
    cls: Any, values: Mapping[str, object], prefix: str, mistakes: Mistakes,
    others: Mapping[str, object],
) -> Any:  # fmt: skip
    """Builds an instance as `build` does, but collects the mistakes.

    Returns:
        The instance; after a mistake UNKNOWN, or, of a class that allows it, one with mistakes.
    """
    arguments = dict(others)
    for field, part in _parts(cls):
        value = UNKNOWN
        with mistakes:
            value = _built(field, part, values, prefix, mistakes)
        if isinstance(value, tuple) and cls.allows_unknown:
            value = tuple(x for x in value if x is not UNKNOWN)
        if value is not MISSING:
            arguments[field.name] = value
    if not cls.allows_unknown and any(map(_is_unknown, arguments.values())):
        return UNKNOWN
    made = cls.__new__(cls)
    with mistakes:
        cls.__init__(made, **arguments)
        return made
    return made if cls.allows_unknown else UNKNOWN


def _is_unknown(value: object) -> bool:
    return value is UNKNOWN or (isinstance(value, tuple) and any(x is UNKNOWN for x in value))


def _built(
    field: Any, part: Any, values: Mapping[str, object], prefix: str, mistakes: Mistakes
) -> object:
    """Builds the value of a field, whose parts with mistakes are UNKNOWN; see `build`.

    Returns:
        The value; `MISSING` for the default of the field.

    Raises:
        ConfigurationError: The value is missing or invalid.
    """
    name = prefix + _parameter(field)
    if isinstance(part, _Part):
        if part.is_optional and not _names(values, name):
            return MISSING
        return _filled(part.base, values, f'{name}.', mistakes, {})
    if isinstance(part, _Group):
        return tuple(
            _filled(kind, values, f'{name}.{key}.', mistakes, {'name': key})
            for key, kind in part.members(f'{name}.', values).items()
        )
    if isinstance(part, _Named):
        items: dict[str, object] = {}
        for key in part.names(f'{name}.', values):
            items[key] = UNKNOWN
            with mistakes:
                items[key] = part.value.clean(f'{name}.{key}', values[f'{name}.{key}'])
        return items
    if name in values:
        return part.clean(name, values[name])
    if field.default is MISSING:
        raise ConfigurationError(f'{name} is missing: must be {part.wanted}')
    return MISSING


def changed(instance: _T, values: Mapping[str, object], prefix: str = '') -> _T:
    """Returns a copy of an object with other values; unlike `build`, it keeps unlisted fields.

    The new values are given by dotted name, after the prefix.
    """
    changes: dict[str, object] = {}
    for field, part in _parts(type(instance)):
        value, name = getattr(instance, field.name), prefix + _parameter(field)
        if isinstance(part, _Group):
            changes[field.name] = tuple(
                changed(member, values, f'{name}.{member.name}.') for member in value
            )
        elif isinstance(part, _Part) and value is not None:
            changes[field.name] = changed(value, values, f'{name}.')
        elif name in values:
            changes[field.name] = values[name]
    return typing.cast('_T', dataclasses.replace(typing.cast('Any', instance), **changes))


def flatten(instance: object, prefix: str = '') -> dict[str, object]:
    """Returns the values of an object by dotted name, without None values.

    Raises:
        ConfigurationError: Parameters cannot express the object, because it contains an object
            without a name, or of an unknown kind.
    """
    flat: dict[str, object] = {}
    for field, part in _parts(type(instance)):
        value, name = getattr(instance, field.name), prefix + _parameter(field)
        if isinstance(part, _Group):
            for member in value:
                kind, start = part.kind_of(field.name, member), f'{name}.{member.name}.'
                if part.has_kinds:
                    flat[f'{start}kind'] = kind
                flat.update(flatten(member, start))
        elif isinstance(part, _Named):
            flat.update({f'{name}.{x}': y for x, y in value.items()})
        elif isinstance(part, Quantity) and value is not None:
            flat[name] = value
        elif value is not None:
            flat.update(flatten(value, f'{name}.'))
    return flat
