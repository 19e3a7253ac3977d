# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Names of loads before version 2.0, and the loads that replace them.

Such names are refused in parameter files, but converted in logs.
"""

import json
import re
from collections.abc import Mapping
from typing import Any, NamedTuple, TypeAlias

from linkage_ros.errors import ConfigurationError, shortened
from linkage_ros.mechanism.loads.base import LOAD_NAME

Loads: TypeAlias = dict[str, dict[str, Any]]  # parameters of loads by name


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
_ACTING = 'force', 'damping', 'stiffness'  # without these, a load of kind link is 0
_FIRST = 'A_'  # begins names that must sort before usual names
_LONGEST = 200  # characters of the list of old names
# Words that YAML or rcl read as something other than text.
_NO_TEXT = {'y', 'n', 'yes', 'no', 'on', 'off', 'true', 'false', 'null'}


def has_old_names(values: Mapping[str, object]) -> bool:
    """Returns whether parameters contain names that version 2.0 replaced."""
    return any(_old_load(name) for name in values)


def with_new_names(values: Mapping[str, object]) -> dict[str, object]:
    """Replaces old names of loads.

    Args:
        values: Values by dotted parameter name.

    Returns:
        The values with the same loads, whose forces are added in the same order.
    """
    kept = {name: value for name, value in values.items() if not _old_load(name)}
    return kept | {
        f'loads.{name}.{parameter}': value
        for name, load in _converted(values).items()
        for parameter, value in load.items()
    }


def refuse_old_names(values: Mapping[str, object]) -> None:
    """Rejects parameters with old names of loads.

    Args:
        values: Values by dotted parameter name.

    Raises:
        ConfigurationError: There is an old name. The error ends with the lines to write instead.
    """
    old = [name for name in values if _old_load(name)]
    if not old:
        return
    present = _present_loads(values)
    loads, names = _converted(values) | present, shortened(', '.join(old), _LONGEST)
    if not loads:
        raise ConfigurationError(f'{names}: version 2.0 has no such parameters; leave them out')
    section = ' and the section loads' if present else ''
    error = ConfigurationError(
        f'{names}: since version 2.0, each load is below loads, by a name of your own; replace '
        f'these parameters{section} with the lines below (the order of the names is the order in '
        'which forces are added)'
    )
    error.lines = _as_yaml(loads)
    raise error


def new_name(name: str) -> str:
    """Returns the present name of a parameter, in which NAME stands for the name of a load.

    Returns:
        The name; empty if it has not changed.
    """
    if not (found := _old_load(name)):
        return ''
    old, match = found
    return f'loads.NAME.{old.parameters.get(match["parameter"], match["parameter"])}'


def _old_load(name: str) -> tuple[_OldLoad, re.Match[str]] | None:
    """Returns the old load to which a parameter belongs."""
    for old in _OLD_LOADS:
        if match := re.fullmatch(old.pattern, name):
            return old, match
    return None


def _converted(values: Mapping[str, object]) -> Loads:
    """Returns the loads that replace old names, by names that keep their order in sums."""
    found = Loads()
    for old in _OLD_LOADS:
        for name, value in values.items():
            if match := re.fullmatch(old.pattern, name):
                link, parameter = match.groupdict().get('link', ''), match['parameter']
                own = {'kind': old.kind} | ({'link': link} if link else {})
                load = found.setdefault(old.name.format(link=link), own)
                load[old.parameters.get(parameter, parameter)] = value
    found = {name: load for name, load in found.items() if _acts(load)}
    names = [*found, *sorted(_present_loads(values))]
    summed = [name for name in names if name != 'friction']  # friction acts in joints
    if summed != sorted(summed) or len({*names}) < len(names):
        return {f'{_FIRST}{name}': load for name, load in found.items()}
    return found


def _present_loads(values: Mapping[str, object]) -> Loads:
    """Returns the loads with present names."""
    found = Loads()
    for key, value in values.items():
        section, *parts = key.split('.', 2)
        if section == 'loads' and len(parts) == 2:
            name, parameter = parts
            found.setdefault(name, {})[parameter] = value
    return found


def _acts(load: Mapping[str, Any]) -> bool:
    """Returns whether a load may differ from 0."""
    return load['kind'] != 'link' or any(load.get(name) for name in _ACTING)


def _text(value: Any) -> str:
    """Writes a value as YAML."""
    if hasattr(value, 'tolist'):
        value = value.tolist()
    is_word = isinstance(value, str) and re.fullmatch(LOAD_NAME, value)
    return str(value) if is_word and value.lower() not in _NO_TEXT else json.dumps(value)


def _as_yaml(loads: Loads) -> str:
    """Writes loads as a section of a parameter file, indented as below `ros__parameters`."""
    rows = (
        f'      {name}: {{{", ".join(f"{x}: {_text(y)}" for x, y in load.items())}}}'
        for name, load in sorted(loads.items())
    )
    return '\n'.join(('    loads:', *rows))
