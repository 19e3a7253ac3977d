# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Names of loads and of the coupler point before version 2.0, and what replaces them.

Such names are refused in parameter files, but converted in logs.
"""

import json
import re
from collections.abc import Mapping
from typing import Any, NamedTuple, TypeAlias

from linkage_ros.errors import ConfigurationError, shortened
from linkage_ros.quantities import BOOLEANS, NAME

Members: TypeAlias = dict[str, dict[str, Any]]  # parameters of loads or points by name


class _OldLoad(NamedTuple):
    """A load of version 1.

    Attributes:
        pattern: Pattern of its parameters; the groups are `link` and `parameter`.
        kind: Kind of the load that replaces it.
        name: Name of that load; {link} is replaced.
        parameters: New names of parameters; others keep their names.
    """

    pattern: str
    kind: str
    name: str
    parameters: Mapping[str, str] = {}


# In the order in which version 1 added their forces.
_OLD_LOADS = (
    _OldLoad(
        r'(?P<link>crank|rocker|rod|slider)\.'
        r'(?P<parameter>torque|force|damping|stiffness|rest_angle|rest_position)',
        'link',
        '{link}',
        {'torque': 'force', 'rest_angle': 'rest', 'rest_position': 'rest'},
    ),
    _OldLoad(r'load\.(?P<parameter>\w+)', 'curve', 'work'),
    _OldLoad(r'friction\.(?P<parameter>\w+)', 'friction', 'friction'),
)
_OLD_POINT = 'coupler.point'
_POINT = 'coupler_point'  # name of the traced point that replaces it
_ACTING = 'force', 'damping', 'stiffness'  # without these, a load of kind link is 0
_FIRST = 'A_'  # begins names that must sort before usual names
_LONGEST = 200  # characters of the list of old names
# Words that YAML or rcl read as something other than text.
_NO_TEXT = BOOLEANS | {'null'}


def has_old_names(values: Mapping[str, object]) -> bool:
    """Returns whether parameters contain names that version 2.0 replaced."""
    return any(map(_is_old, values))


def with_new_names(values: Mapping[str, object]) -> dict[str, object]:
    """Replaces old names; points and loads, and the order in which forces are added, are kept."""
    renamed = {name: value for name, value in values.items() if not _is_old(name)}
    for section, members in _converted(values).items():
        for name, member in members.items():
            for parameter, value in member.items():
                renamed[f'{section}.{name}.{parameter}'] = value
    return renamed


def refuse_old_names(values: Mapping[str, object]) -> None:
    """Rejects parameters with old names.

    Raises:
        ConfigurationError: There is an old name. The error ends with the lines to write instead.
    """
    old = [name for name in values if _is_old(name)]
    if not old:
        return
    names = shortened(', '.join(old), _LONGEST)
    changed = {section: members for section, members in _converted(values).items() if members}
    if not changed:
        raise ConfigurationError(f'{names}: version 2.0 has no such parameters; leave them out')
    present = {section: _present(section, values) for section in changed}
    replaced = ''.join(f' and the section {x}' for x, members in present.items() if members)
    words = {'loads': 'each load is below loads', 'points': 'each traced point is below points'}
    order = ' (the order of the names is the order in which forces are added)'
    error = ConfigurationError(
        f'{names}: since version 2.0, {" and ".join(words[x] for x in changed)}, by a name of '
        f'your own; replace these parameters{replaced} with the lines below'
        f'{order if "loads" in changed else ""}'
    )
    error.lines = '\n'.join(_as_yaml(x, members | present[x]) for x, members in changed.items())
    raise error


def _converted(values: Mapping[str, object]) -> dict[str, Members]:
    """Returns the loads and points that replace old names, by section."""
    has_point = _OLD_POINT in values
    points = {_POINT: {'link': 'coupler', 'at': values[_OLD_POINT]}} if has_point else {}
    return {'loads': _converted_loads(values), 'points': points}


def new_name(name: str) -> str:
    """Returns the present name of a parameter, in which NAME stands for a name of a user.

    Returns:
        The name; empty if it has not changed.
    """
    if name.startswith(_OLD_POINT):
        return name.replace(_OLD_POINT, 'points.NAME.at')
    if not (old_load := _old_load(name)):
        return ''
    old, match = old_load
    return f'loads.NAME.{old.parameters.get(match["parameter"], match["parameter"])}'


def _is_old(name: str) -> bool:
    return name == _OLD_POINT or _old_load(name) is not None


def _old_load(name: str) -> tuple[_OldLoad, re.Match[str]] | None:
    """Returns the old load to which a parameter belongs."""
    for old in _OLD_LOADS:
        if match := re.fullmatch(old.pattern, name):
            return old, match
    return None


def _converted_loads(values: Mapping[str, object]) -> Members:
    """Returns the loads that replace old names, by names that keep their order in sums."""
    loads = Members()
    for old in _OLD_LOADS:
        for name, value in values.items():
            match = re.fullmatch(old.pattern, name)
            if not match:
                continue
            link, parameter = match.groupdict().get('link', ''), match['parameter']
            new_name = old.name.format(link=link)
            if new_name not in loads:
                loads[new_name] = {'kind': old.kind, 'link': link} if link else {'kind': old.kind}
            loads[new_name][old.parameters.get(parameter, parameter)] = value
    loads = {name: load for name, load in loads.items() if _acts(load)}
    names = [*loads, *sorted(_present('loads', values))]
    summed = [name for name in names if name != 'friction']  # friction acts in joints
    keeps_order, is_unique = summed == sorted(summed), len({*names}) == len(names)
    if keeps_order and is_unique:
        return loads
    return {f'{_FIRST}{name}': load for name, load in loads.items()}


def _present(section: str, values: Mapping[str, object]) -> Members:
    """Returns the loads or points with present names."""
    members = Members()
    for key, value in values.items():
        first, *parts = key.split('.', 2)
        if first == section and len(parts) == 2:
            name, parameter = parts
            members.setdefault(name, {})[parameter] = value
    return members


def _acts(load: Mapping[str, Any]) -> bool:
    """Returns whether a load may differ from 0."""
    return load['kind'] != 'link' or any(load.get(name) for name in _ACTING)


def _text(value: Any) -> str:
    """Writes a value as YAML."""
    if hasattr(value, 'tolist'):
        value = value.tolist()
    is_word = isinstance(value, str) and re.fullmatch(NAME, value)
    return str(value) if is_word and value.lower() not in _NO_TEXT else json.dumps(value)


def _as_yaml(section: str, members: Members) -> str:
    """Writes a section of a parameter file, indented as below `ros__parameters`."""
    rows = (
        f'      {name}: {{{", ".join(f"{x}: {_text(y)}" for x, y in load.items())}}}'
        for name, load in sorted(members.items())
    )
    return '\n'.join((f'    {section}:', *rows))
