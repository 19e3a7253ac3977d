# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Nested tuples, as the constants and results of formulas."""

import copy
from collections.abc import Callable
from typing import Any

import numpy as np

from linkage_ros.formulas import ZERO, Opaque, Vector


def leaves(tree: Any) -> list[Any]:
    """All values of nested tuples, in order."""
    if not isinstance(tree, tuple):
        return [tree]
    return [leaf for part in tree for leaf in leaves(part)]


def paths(tree: Any, path: str) -> Any:
    """Replaces each value of nested tuples by its path of names."""
    if not isinstance(tree, tuple):
        return path
    names = getattr(tree, '_fields', range(len(tree)))
    return tuple(paths(part, f'{path}_{n}') for n, part in zip(names, tree, strict=True))


def transformed(function: Callable[[Any], Any], tree: Any) -> Any:
    """Applies a function to each value of nested tuples."""
    if not isinstance(tree, tuple):
        return function(tree)
    return tuple.__new__(type(tree), [transformed(function, part) for part in tree])


class Constants:
    """The constants of a formula, prepared once for all programs that use them.

    Attributes:
        numbers: The numbers and opaque functions in the tree, in order.
        known: Compiled programs for constants of this structure, independent of their values.
    """

    def __init__(self, tree: Any) -> None:
        """Splits nested tuples of floats, complex numbers, `Opaque` functions and other values.

        For many designs at once, numbers are arrays of a row for each design.
        """
        self._given = tree
        self.numbers: list[Any] = []
        structure: list[Any] = []
        waiting = [tree]
        while waiting:
            part = waiting.pop()
            kind = type(part)
            if (kind is float and part) or kind is Opaque:
                structure.append(kind)
                self.numbers.append(part.function if kind is Opaque else part)
            elif kind is complex or (isinstance(part, np.ndarray) and np.iscomplexobj(part)):
                structure.append(complex)
                waiting += part.imag, part.real
            elif isinstance(part, tuple):
                structure += kind, len(part)
                waiting += part[::-1]
            elif not isinstance(part, (float, np.ndarray)):
                structure.append(part)
            elif part:
                structure.append(float)
                self.numbers.append(part)
            else:
                structure.append(ZERO)
        self.known = _known.setdefault(tuple(structure), {})

    def part(self, rows: slice) -> 'Constants':
        """The constants of some designs, where numbers are arrays of a row for each."""
        chosen = copy.copy(self)
        chosen.numbers = [x[rows] if isinstance(x, np.ndarray) else x for x in self.numbers]
        return chosen

    @property
    def tree(self) -> Any:
        """The constants, with vectors in place of complex numbers and ZERO in place of 0.0."""
        return transformed(_prepared, self._given)


_known: dict[tuple[Any, ...], dict[Any, Any]] = {}


def _prepared(leaf: Any) -> Any:
    if np.iscomplexobj(leaf):
        return Vector(_prepared(leaf.real), _prepared(leaf.imag))
    return ZERO if isinstance(leaf, (float, np.ndarray)) and not leaf else leaf


def is_number(leaf: Any) -> bool:
    """Returns whether a value is a number or opaque function, not part of the structure."""
    return isinstance(leaf, (float, Opaque, np.ndarray))
