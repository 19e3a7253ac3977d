# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The error for a parameter name that does not exist, with the name that was probably meant."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

from linkage_ros.quantities import shown

# Usual words for a parameter that are spelt differently.
_SYNONYMS = {
    'weight': 'mass',
    'radius': 'length',
    'com': 'center',
    'cog': 'center',
    'speed': 'rpm',
    'crank_speed': 'rpm',
}
_MIN_SIMILARITY = 0.85  # least similarity of two whole names, from 0 to 1


def unknown_name(name: str, owner: str, valid: Iterable[str], where: str) -> str:
    """Words the error for a name that does not exist.

    Args:
        name: The name that was given.
        owner: What it was given to.
        valid: The names that this has.
        where: The place that lists them.

    Returns:
        An error message, with the name that was probably meant, or with those of the group.
    """
    members: dict[str, list[str]] = {}
    for known in valid:
        group, _, word = known.rpartition('.')
        members.setdefault(group, []).append(word)
    group = name if name in members else name.rpartition('.')[0]
    if near := '' if name in members else _nearest(name, members):
        hint = f'; did you mean {near}?'
    elif group and group in members:
        hint = f'; {group} has {", ".join(members[group])}:'
    else:
        hint = ':'
    return f'{shown(name)} is not a parameter of {owner}{hint} {where} lists all'


def _nearest(name: str, members: dict[str, list[str]]) -> str:
    """The valid name that was probably meant; empty if none is near.

    A name that is not nearly the same as a whole is compared by its last word within its group:
    as a whole, rocker.weight is like rocker.length.
    """
    whole = [f'{group}.{word}'.lstrip('.') for group, words in members.items() for word in words]
    for found in difflib.get_close_matches(name, whole, n=1, cutoff=_MIN_SIMILARITY):
        return found
    group, dot, word = name.rpartition('.')
    for likely in difflib.get_close_matches(group, members, n=1) if dot else ['']:
        words = members.get(likely, [])
        for found in difflib.get_close_matches(_SYNONYMS.get(word, word), words, n=1):
            return f'{likely}{dot}{found}'
    return ''
