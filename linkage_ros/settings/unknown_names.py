# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Error message for an unknown parameter name, with a suggestion."""

import difflib
from collections.abc import Collection, Iterable

from linkage_ros.quantities import Leaf, shown

# Smallest similarity of a suggestion, from 0 to 1: to the whole name, and to a name without group.
_SIMILAR, _SIMILAR_WORD = 0.85, 0.65
_FIRST = 'length'  # parameter that a group may be given as, as in frame: 0.4
# Groups that users may put before a parameter that has no group, as in crank.rpm.
_TOP = ('', 'crank', 'motor', 'drive')

# Terms of textbooks and other tools, with the names that they may mean, most likely first.
_MEANINGS = {
    'base ground fixed': ('frame',),
    'input driver': ('crank',),
    'output follower': ('rocker', 'slider'),
    'rod conrod connecting_rod floating': ('coupler',),
    'piston block': ('slider',),
    'weight m': ('mass',),
    'l r len radius a b c d': ('length',),
    'j i moment_of_inertia': ('inertia',),
    'com cog cg centre center_of_mass centre_of_mass': ('center',),
    'moment load force torque': ('torque', 'force', 'value', 'motor.torque'),
    'spring k spring_constant': ('stiffness',),
    'damper viscous': ('damping',),
    'e eccentricity': ('offset',),
    'trace tracepoint coupler_point': ('point', 'coupler.point'),
    'delta phi alpha theta angle start_angle': ('angle', 'crank_angle'),
    'speed velocity omega': ('velocity', 'rpm', 'start_rpm'),
    'acceleration': ('crank_acceleration',),
    'mu coefficient': ('pin', 'friction.pin'),
    'g gravitation': ('gravity',),
    'rate frequency': ('rate_hz',),
    'branch configuration closure': ('assembly',),
    'type kind': ('mechanism',),
    'mode': ('drive',),
    'bag logfile output output_path': ('log',),
    'overwrite': ('log_overwrite',),
    'prefix': ('joint_prefix',),
}


def unknown_name(
    name: str, owner: str, valid: Iterable[Leaf], where: str, elsewhere: str = ''
) -> str:
    """Returns the error message for an unknown parameter name.

    Args:
        name: The unknown name.
        owner: Description of the object without such a parameter.
        valid: The parameters of the object.
        where: Command that lists these parameters.
        elsewhere: Clause about the objects that have such a parameter; empty if there are none.

    Returns:
        One line that suggests a valid name or, if none is similar, lists the names of the group.
    """
    units = {leaf.name: leaf.quantity.unit for leaf in valid}
    group = (
        name if any(known.startswith(f'{name}.') for known in units) else name.rpartition('.')[0]
    )
    words = [known.rpartition('.')[2] for known in units if known.rpartition('.')[0] == group]
    near = nearest(name, units)
    if near and near == f'{name}.{_FIRST}':
        hint = f'; {name} has {", ".join(words)}: write {name}: {{{_FIRST}: ...}};'
    elif near:
        unit = f' ({units[near]})' if units[near] not in ('', near) else ''
        hint = f'; did you mean {near}{unit}?'
    elif elsewhere:
        hint = '; leave it out;'
    else:
        hint = f'; {group} has {", ".join(words)}:' if group and words else ':'
    return f'{shown(name)} is not a parameter of {owner}{elsewhere}{hint} {where} lists all'


def nearest(name: str, valid: Collection[str]) -> str:
    """Finds the most similar valid name, first by meaning, then by spelling.

    Args:
        name: The unknown name.
        valid: The valid names.

    Returns:
        One of the valid names; empty if none is similar.
    """
    group, _, word = name.lower().rpartition('.')
    words = [word, *_meanings(word)]
    meant = [f'{name}.{_FIRST}']
    meant += [f'{other}.{meaning}' for meaning in words for other in (group, *_meanings(group))]
    if group in _TOP:
        grouped = [known for known in valid if known.rpartition('.')[2] in words]
        meant += words + (grouped if len(grouped) == 1 else [])
    meant += difflib.get_close_matches(name.lower(), valid, n=1, cutoff=_SIMILAR)
    if not group:
        single = [known for known in valid if '.' not in known]
        meant += difflib.get_close_matches(word, single, n=1, cutoff=_SIMILAR_WORD)
    return next((known for known in meant if known in valid), '')


def _meanings(word: str) -> list[str]:
    return [name for words, names in _MEANINGS.items() if word in words.split() for name in names]
