# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The error for a parameter name that does not exist, with the name that was probably meant."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

from linkage_ros.quantities import shown

# Least similarity of names, from 0 to 1: as wholes, and of names without a group.
_SIMILAR, _SIMILAR_WORD = 0.85, 0.65


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
    valid = list(valid)
    is_group = any(known.startswith(f'{name}.') for known in valid)
    group = name if is_group else name.rpartition('.')[0]
    words = [known.rpartition('.')[2] for known in valid if known.rpartition('.')[0] == group]
    near = difflib.get_close_matches(name, valid, n=1, cutoff=_SIMILAR)
    if not (near or group):
        near = difflib.get_close_matches(name, words, n=1, cutoff=_SIMILAR_WORD)
    hint = f'; {group} has {", ".join(words)}:' if group and words else ':'
    if near:
        hint = f'; did you mean {near[0]}?'
    return f'{shown(name)} is not a parameter of {owner}{hint} {where} lists all'
