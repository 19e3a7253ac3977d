# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Several linkages in one set of parameters: their names, and which values belong to each.

The parameters of a linkage are those at the top, overlaid by those below its name. Here,
parameters are values by dotted name.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from typing import TypeAlias, cast

from linkage_ros.errors import ConfigurationError
from linkage_ros.mechanism.registry import MECHANISMS
from linkage_ros.messages import topics
from linkage_ros.motion.drives import DRIVES
from linkage_ros.quantities import BOOLEANS, leaves, shown
from linkage_ros.settings.joints import GROUP as JOINTS
from linkage_ros.settings.parameters import OF_THE_RUN, MechanismAndDrive, Session

LINKAGES = 'linkages'

Values: TypeAlias = Mapping[str, object]

_NAMES = next(leaf.quantity for leaf in leaves(Session) if leaf.name == LINKAGES)


def linkage_names(values: Values) -> tuple[str, ...]:
    """Returns the names of the linkages; one empty name if none are given.

    Raises:
        ConfigurationError: A name is invalid.
    """
    if LINKAGES not in values:
        return ('',)
    names = cast('tuple[str, ...]', _NAMES.clean(LINKAGES, values[LINKAGES]))
    taken = {**dict.fromkeys(first_parts(), 'a parameter'), **_topics(values)}
    for number, name in enumerate(names):
        label = f'{LINKAGES}: {shown(name)}'
        if name in names[:number]:
            raise ConfigurationError(f'{label} is named twice: give each linkage its own name')
        if name.lower() in BOOLEANS:
            raise ConfigurationError(f'{label}: ROS reads it as a boolean; choose another name')
        if '__' in name or not re.fullmatch(_NAMES.pattern, name):
            raise ConfigurationError(
                f'{label}: a name must be letters, digits and single underscores, and begin with '
                'a letter'
            )
        if name in taken:
            raise ConfigurationError(f'{label} is {taken[name]}: choose another name')
    return names


@cache
def first_parts() -> frozenset[str]:
    """Returns the first part of each parameter's name, such as crank of crank.length."""
    kinds = (MechanismAndDrive, Session, *MECHANISMS.values(), *DRIVES.values())
    parts = {leaf.name.partition('.')[0] for kind in kinds for leaf in leaves(kind)}
    # Groups that exist for given members only, and what every rclpy node declares.
    return frozenset(parts | {'loads', JOINTS, LINKAGES, 'qos_overrides', 'use_sim_time'})


def _topics(values: Values) -> dict[str, str]:
    """Returns the names of all topics, as `taken` of `linkage_names`."""
    fixed = [x.name for x in vars(topics).values() if isinstance(x, topics.Topic)]
    configured = [
        str(value) for name, value in values.items()
        if name.rpartition('.')[2].endswith(('command_topic', 'wrench_topic'))
    ]  # fmt: skip
    names = [name.strip('/') for name in (*fixed, *configured)]
    return dict.fromkeys([*names, topics.POINTS.name.partition('/')[0]], 'a topic')


def split(values: Values, names: Sequence[str]) -> tuple[Values, dict[str, Values]]:
    """Splits parameters into those at the top and those below the name of each linkage.

    Raises:
        ConfigurationError: A linkage has a parameter of the run.
    """
    top, own = dict[str, object](), {name: dict[str, object]() for name in names}
    for full, value in values.items():
        first, _, rest = full.partition('.')
        if rest and first in own:
            own[first][rest] = value
        elif full != LINKAGES:
            top[full] = value
    for name, given in own.items():
        for parameter in given:
            if parameter in OF_THE_RUN:
                raise ConfigurationError(
                    f'{name}.{parameter}: {parameter} is of the whole run; give it at the top'
                )
    return top, dict[str, Values](own)


def shared_by_all(
    every: Mapping[str, Values], top: Iterable[str], own: Mapping[str, Iterable[str]]
) -> tuple[Values, dict[str, frozenset[str]]]:
    """Finds which values stand at the top: those given there, and equal defaults of all linkages.

    Args:
        every: All values of each linkage, by its name.
        top: Names that are given at the top.
        own: Names that are given below the name of each linkage.

    Returns:
        The values at the top, and the names that must stand below the name of each linkage.
    """
    given, shared = {*top}, dict[str, object]({LINKAGES: tuple(every)})
    first, *others = every.values()
    for name in first:
        if not all(name in values for values in others):
            continue
        # The values that the linkages take from the top.
        taken = [values[name] for linkage, values in every.items() if name not in own[linkage]]
        is_equal_default = len(taken) == len(every) and all(x == first[name] for x in taken)
        if taken and (name in given or is_equal_default):
            shared[name] = taken[0]
    below = dict[str, frozenset[str]]()
    for linkage, values in every.items():
        differing = {name for name, x in values.items() if name not in shared or shared[name] != x}
        below[linkage] = frozenset(differing | ({*own[linkage]} & {*values}))
    return shared, below
