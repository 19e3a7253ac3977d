# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Binds formulas to constants, and evaluates them on floats and on arrays.

Constants are floats, complex numbers and `Opaque` functions in nested tuples, whose numbers may
also be NumPy's. None, booleans, integers, strings and the value 0.0 belong to the structure: a
formula may branch on them, and terms that vanish because of a 0.0 are not computed. A structure is
traced once; other numbers only bind its program again.
"""

import functools
import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any, cast

import numpy as np

from linkage_ros import formulas
from linkage_ros.errors import ConfigurationError
from linkage_ros.formulas import ZERO, Opaque, Vector
from linkage_ros.mechanism.elementwise import is_noisy
from linkage_ros.mechanism.nested import leaves, rebuilt, transformed
from linkage_ros.mechanism.tracer import Argument, Tape
from linkage_ros.numeric import Array, Real, real_numbers
from linkage_ros.quantities import shown

_CHUNK = 16384  # array values per block, so that intermediate results fit the processor's cache
_STRUCTURES = 100  # whose tapes are kept, of 0.1 to 1 MB each; the least recently used leave


class Constants:
    """The constants of a formula, prepared once for all programs that use them.

    Attributes:
        numbers: The numbers and opaque functions among the constants, in order.
        tapes: Cache of the tapes for this structure, by formula and arguments.
    """

    def __init__(self, tree: Any) -> None:
        """Separates numbers and functions from the structure of the tuples.

        Raises:
            ConfigurationError: A constant is a list, an array or another mutable object.
        """
        self._given = tree
        self.numbers: list[Any] = []
        structure: list[Any] = []
        to_visit = [tree]  # the next part is the last; the parts of tuples are added in reverse
        while to_visit:
            part = to_visit.pop()
            kind = type(part)
            if kind is float:
                structure.append(float if part else ZERO)
                if part:
                    self.numbers.append(part)
            elif kind is complex:
                structure.append(complex)
                to_visit += part.imag, part.real
            elif kind in _BRANCHING:
                structure += kind, part  # True and 1 are different
            elif isinstance(part, tuple):
                structure += kind, len(part)
                to_visit += part[::-1]
            elif isinstance(part, Opaque):
                structure.append(Opaque)
                self.numbers.append(part.function)
            elif type(plain := _plain(part)) is not kind:
                to_visit.append(plain)
            elif part.__hash__ is None:
                raise ConfigurationError(
                    f'{shown(part)} is a constant of a formula, such as a value in a load: must '
                    'be a number, text, None, an Opaque function, or a tuple of these'
                )
            else:
                structure += kind, part
        self.tapes = _tapes_of(tuple(structure))

    @functools.cached_property
    def tree(self) -> Any:
        """The constants, with vectors in place of complex numbers and ZERO in place of 0.0."""
        return transformed(_prepared, self._given)


_BRANCHING = {bool, int, str, type(None)}  # on which a formula may branch
_PLAIN: tuple[tuple[type, tuple[type, ...]], ...] = (
    (float, (float, np.floating)),
    (complex, (complex, np.complexfloating)),
    (int, (np.integer,)),
)


@functools.lru_cache(_STRUCTURES)
def _tapes_of(structure: tuple[Any, ...]) -> dict[Any, Tape]:  # noqa: ARG001, the key
    return {}


def _prepared(leaf: Any) -> Any:
    leaf = _plain(leaf)
    if isinstance(leaf, complex):
        return Vector(leaf.real or ZERO, leaf.imag or ZERO)
    return (leaf or ZERO) if isinstance(leaf, float) else leaf


def _plain(leaf: Any) -> Any:
    """Converts numbers of NumPy and of derived classes, whose arithmetic differs, to Python's."""
    for kind, kinds in _PLAIN:
        if isinstance(leaf, kinds):
            return kind(leaf)
    return leaf


class Program:
    """A formula with its constants bound, for floats and for arrays.

    Attributes:
        formula: Function that the program evaluates.
        constants: Constants bound to the formula.
        arguments: Names of the scalars in each argument of the formula.
        names: The same names in one list.
    """

    def __init__(
        self,
        formula: Callable[..., Any],
        constants: Constants,
        arguments: tuple[Argument, ...],
        *,
        traced: bool = True,
        by_math: bool = False,
    ) -> None:
        """Binds a formula, which returns nested tuples of numbers; it is traced on first use.

        If it is not `traced`, the formula itself is called, on floats and on arrays, so that a
        debugger can stop in it. By `math`, functions are applied to arrays element by element, so
        that results are bit-identical to those of floats; NumPy's functions are faster.
        """
        self.formula, self.constants, self.arguments = formula, constants, arguments
        self.names: list[str] = leaves(arguments)
        self._traced, self._by_math = traced, by_math

    @functools.cached_property
    def tape(self) -> Tape:
        """The recorded formula."""
        tapes, key = self.constants.tapes, (self.formula, self.arguments)
        if key not in tapes:
            tapes[key] = Tape(self.formula, self.constants.tree, self.arguments)
        return tapes[key]

    @functools.cached_property
    def floats(self) -> Callable[..., Any]:
        """The program for floats, with a separate parameter for each scalar of the arguments."""
        return self.tape.for_floats(*self.constants.numbers) if self._traced else self.untraced

    def untraced(self, *values: Real) -> Any:
        """Evaluates the formula itself, on floats or on arrays of the same shape."""
        given = iter(values)
        arguments = (transformed(lambda _: next(given), x) for x in self.arguments)
        return transformed(formulas.number, self.formula(self.constants.tree, *arguments))

    def __call__(self, *values: Any) -> Any:
        """Evaluates the formula.

        Args:
            *values: Numbers, or arrays that broadcast.

        Returns:
            The result of the formula: floats if no argument is an array, else arrays.
        """
        if {*map(type, values)} == {float}:
            return self.floats(*values)
        rows, shape = real_numbers(self.names, values)
        return self.floats(*rows) if shape is None else self.arrays(rows, shape)

    def arrays(self, rows: Sequence[Real], shape: tuple[int, ...]) -> Any:
        """Evaluates the formula on floats and arrays that broadcast to a shape; see `__call__`."""
        size = math.prod(shape)
        if size == 1 and not is_noisy():
            return self._single(rows, len(shape))
        is_flat = len(shape) == 1 and all(type(x) is float or x.shape == shape for x in rows)
        if not is_flat:
            rows = [x if type(x) is float else np.broadcast_to(x, shape).ravel() for x in rows]
        if self._by_math and not self._traced and size:
            tree, values = self._by_element(rows, size)
        else:
            tree, values = self._blocks(rows, size)
        return self._shaped(tree, values.reshape(len(values), *shape))

    def _single(self, rows: Sequence[Real], dimensions: int) -> Any:
        """Evaluates the formula on floats and arrays of one element, as floats."""
        tree = self.floats(*[x if type(x) is float else x.item() for x in rows])
        values = self.tape.flat(tree) if self._traced else leaves(tree)
        return self._shaped(tree, [np.array(x, ndmin=dimensions) for x in values])

    def _by_element(self, rows: Sequence[Real], size: int) -> tuple[Any, Array]:
        """Evaluates the untraced formula for each element of arrays of shape (size,).

        Returns:
            The result for the first element, and all values, shape (leaves, size).
        """
        columns = ([x] * size if isinstance(x, float) else x.tolist() for x in rows)
        trees = [self.floats(*row) for row in zip(*columns, strict=True)]
        return trees[0], np.array([leaves(each) for each in trees]).T

    def _shaped(self, tree: Any, values: Iterable[Array]) -> Any:
        """Returns a result with the structure of a tree and other values."""
        return self.tape.shaped(*values) if self._traced else rebuilt(tree, iter(values))

    def _bound(self) -> Callable[..., Any]:
        """Returns the program for floats and arrays, with its constants bound."""
        bind = self.tape.by_math if self._by_math else self.tape.for_arrays
        if self._by_math and is_noisy():
            bind = self.tape.with_noise
        return cast('Callable[..., Any]', bind(*self.constants.numbers))

    def _blocks(self, rows: Sequence[Real], size: int) -> tuple[Any, Array]:
        """Evaluates the formula on floats and arrays of shape (size,), block by block.

        Returns:
            The result for the last block, and all values, shape (leaves, size).
        """
        # By default, glibc returns large freed blocks to the system and faults them in again page
        # by page. Freeing this larger, untouched block raises that threshold.
        np.empty(3_000_000)
        run = self._bound() if self._traced else self.untraced
        tree, values = None, np.empty((0, size))
        for start in range(0, max(size, 1), _CHUNK):
            block = slice(start, start + _CHUNK)
            arguments = (x if isinstance(x, float) else x[block] for x in rows)
            with np.errstate(over='ignore', invalid='ignore', under='ignore'):
                tree = run(*arguments)
            of_block = leaves(tree)
            if not len(values):  # the first block tells the number of values
                values = np.empty((len(of_block), size))
            for row, value in zip(values, of_block, strict=True):
                row[block] = value
        return tree, values
