# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Nested tuples, as the constants and results of formulas."""

from __future__ import annotations

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


_NOTHING = Vector(ZERO, ZERO), (Vector, ZERO, ZERO)


class Constants:
    """The constants of a formula, prepared once for all programs that use them.

    Attributes:
        tree: The constants, with vectors in place of complex numbers and ZERO in place of 0.0.
        numbers: The numbers and opaque functions in the tree, in order.
        structure: The tree without these, for use as a key.
    """

    def __init__(self, tree: Any) -> None:
        """Splits nested tuples of floats, complex numbers, `Opaque` functions and other values.

        For many designs at once, numbers are arrays of a row for each design.
        """
        self.numbers: list[Any] = []
        self.tree, self.structure = self._take(tree)

    def part(self, rows: slice) -> Constants:
        """The constants of some designs, where numbers are arrays of a row for each."""
        chosen = copy.copy(self)
        chosen.numbers = [x[rows] if isinstance(x, np.ndarray) else x for x in self.numbers]
        return chosen

    def _take(self, tree: Any) -> tuple[Any, Any]:
        """Splits a part of the tree; returns it and its structure."""
        kind = type(tree)
        if kind is complex or (isinstance(tree, np.ndarray) and np.iscomplexobj(tree)):
            return self._take(Vector(tree.real, tree.imag)) if tree else _NOTHING
        if isinstance(tree, tuple):
            parts, keys = [], [kind]
            for one in tree:
                part, key = self._take(one)
                parts.append(part)
                keys.append(key)
            return tuple.__new__(kind, parts), tuple(keys)
        if not is_number(tree):
            return tree, tree
        if tree == 0.0:
            return ZERO, ZERO
        self.numbers.append(tree)
        return tree, float


def is_number(leaf: Any) -> bool:
    """Returns whether a value is a number or opaque function, not part of the structure."""
    return isinstance(leaf, (float, Opaque, np.ndarray))
