# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Nested tuples of values, the form of the constants and results of formulas."""

from collections.abc import Callable, Iterator
from typing import Any


def leaves(tree: Any) -> list[Any]:
    """Returns all values of nested tuples, in order."""
    if not isinstance(tree, tuple):
        return [tree]
    values = []
    for part in tree:
        if isinstance(part, tuple):
            values += leaves(part)
        else:
            values.append(part)
    return values


def rebuilt(tree: Any, values: Iterator[Any]) -> Any:
    """Replaces the values of nested tuples with others, in order."""
    if not isinstance(tree, tuple):
        return next(values)
    parts = [rebuilt(x, values) if isinstance(x, tuple) else next(values) for x in tree]
    return tuple.__new__(type(tree), parts)


def transformed(function: Callable[[Any], Any], tree: Any) -> Any:
    """Applies a function to each value of nested tuples."""
    if not isinstance(tree, tuple):
        return function(tree)
    return tuple.__new__(type(tree), [transformed(function, part) for part in tree])


def names(tree: Any, path: str) -> Any:
    """Replaces each value in nested tuples with a unique name.

    The name consists of `path` and the field names or indices that lead to the value, joined by
    underscores.
    """
    if not isinstance(tree, tuple):
        return path
    fields = getattr(tree, '_fields', range(len(tree)))
    return tuple(names(part, f'{path}_{n}') for n, part in zip(fields, tree, strict=True))


def places(tree: Any, path: str) -> Iterator[str]:
    """Generates expressions that select each value of nested tuples, such as 'tree[0][1]'."""
    if not isinstance(tree, tuple):
        yield path
        return
    for i, part in enumerate(tree):
        yield from places(part, f'{path}[{i}]')
