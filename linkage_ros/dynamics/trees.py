# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Nested tuples: the constants of formulas, and their results."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from linkage_ros.formulas import Opaque


def leaves(tree: Any) -> list[Any]:
    """All values of nested tuples, in order."""
    if not isinstance(tree, tuple):
        return [tree]
    return [leaf for part in tree for leaf in leaves(part)]


def paths(tree: Any, path: str) -> Any:
    """Nested tuples with the path of names to each value in its place."""
    if not isinstance(tree, tuple):
        return path
    names = getattr(tree, '_fields', range(len(tree)))
    return tuple(paths(part, f'{path}_{n}') for n, part in zip(names, tree, strict=True))


def transformed(function: Callable[[Any], Any], tree: Any) -> Any:
    """Nested tuples with a function of each of their values in its place."""
    if not isinstance(tree, tuple):
        return function(tree)
    return tuple.__new__(type(tree), [transformed(function, part) for part in tree])


def is_number(leaf: Any) -> bool:
    """Whether a value is a number or an opaque function, and no part of the structure."""
    return isinstance(leaf, (float, Opaque))


def structure_of(tree: Any) -> Any:
    """Nested tuples without their numbers, as a key."""
    if not isinstance(tree, tuple):
        return float if is_number(tree) else tree
    return type(tree), tuple([structure_of(part) for part in tree])
