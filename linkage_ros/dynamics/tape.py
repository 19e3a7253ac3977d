# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Records the operations of a formula on a tape, by calling the formula with symbolic numbers.

The constants and results of formulas are nested tuples.
"""

import copy
import sys
from collections.abc import Callable, Iterable
from types import FrameType
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from linkage_ros import formulas, numeric
from linkage_ros.formulas import ZERO, Opaque, Vector
from linkage_ros.numeric import Real

# An argument of a formula: the name of a scalar, or the names of the elements of a tuple.
Argument: TypeAlias = str | tuple[str, ...]

OPERATORS = {
    'add': '+', 'sub': '-', 'mul': '*', 'truediv': '/',
    'gt': '>', 'ge': '>=', 'lt': '<', 'le': '<=',
}  # fmt: skip
COMPARISONS = '>', '>=', '<', '<='
# Neutral second operands: x * 1, x / 1, x - 0.0 and x + -0.0 are x for all x, including -0.0.
_NEUTRAL = {'*': '1.0', '/': '1.0', '-': '0.0', '+': '-0.0'}
# Number of leading operands that are necessarily finite if the result is finite.
_PASSED_ON = {'+': 2, '-': 2, '*': 2, '/': 1, 'neg': 1, 'abs': 1}
# Files whose local variables do not name variables of the program.
_UNNAMED = __file__, formulas.__file__, numeric.__file__


class Recorder:
    """A symbolic number; operations on it are recorded on a tape."""

    __array_ufunc__ = None
    __hash__ = __iter__ = None  # type: ignore[assignment]

    def __init__(self, tape: 'Tape', line: int) -> None:
        self.tape, self.line = tape, line

    def binary(self, sign: str, a: Real, b: Real) -> Real:
        """Records a binary operation; if an operand is ZERO, lets ZERO handle the operation."""
        if a is ZERO or b is ZERO:
            return NotImplemented
        return self.tape.record(sign, a, b)

    def __call__(self, *values: Real) -> 'Recorder':
        """Records a call of an opaque function."""
        return self.tape.record('call', self, *values)

    def __getitem__(self, i: int) -> 'Recorder':
        """Records the selection of one result of a call that returns several."""
        return self.tape.record(f'[{i}]', self)

    def __bool__(self) -> bool:
        raise TypeError('a formula cannot branch on a value: use where() or require()')

    def __eq__(self, other: object) -> bool:
        return bool(self)


for _name, _sign in OPERATORS.items():
    setattr(Recorder, f'__{_name}__', lambda a, b, sign=_sign: a.binary(sign, a, b))
    setattr(Recorder, f'__r{_name}__', lambda a, b, sign=_sign: a.binary(sign, b, a))
for _name in ('abs', 'neg'):
    setattr(Recorder, f'__{_name}__', lambda a, name=_name: a.tape.record(name, a))


class Line(NamedTuple):
    """One operation on a tape.

    Attributes:
        operation: Name of the operation.
        operands: Indices of the lines that compute the operands.
        text: Source text of an input, constant or literal.
    """

    operation: str
    operands: tuple[int, ...]
    text: str = ''


class Tape:
    """The operations of a formula in order of execution, each recorded once.

    Attributes:
        title: Name of the formula.
        lines: The operations, in order.
        names: Name of the variable that holds the result of a line, by line index.
        result: Result of the formula, nested tuples of `Recorder`s.
    """

    def __init__(
        self, formula: Callable[..., Any], constants: Any, arguments: tuple[Argument, ...]
    ) -> None:
        """Records a formula.

        Args:
            formula: Function of constants and arguments that returns nested tuples of numbers.
            constants: Constants with the structure to record; the values of their numbers are not
                used.
            arguments: Names of the scalars in each argument.
        """
        self.title = formula.__name__
        self.names: dict[int, str] = {}
        self.lines: list[Line] = []
        self._numbers: dict[Line, int] = {}
        named = zip(leaves(constants), leaves(paths(constants, 'k')), strict=True)
        numbers = float, np.ndarray, Opaque
        given = iter(
            [self._add('constant', (), at) if isinstance(x, numbers) else x for x, at in named]
        )
        # Keep a profiler that is already active; the tape then has no names.
        is_free = sys.getprofile() is None
        if is_free:
            sys.setprofile(self._take_names)
        try:
            result = formula(
                transformed(lambda _: next(given), constants),
                *(transformed(lambda name: self._add('input', (), name), x) for x in arguments),
            )
        finally:
            if is_free:
                sys.setprofile(None)
        self.result = transformed(formulas.number, result)

    def record(self, operation: str, *operands: Real) -> Recorder:
        """Records an operation, unless it is already on the tape.

        Args:
            operation: Name of the operation, or its sign.
            *operands: Symbolic numbers and floats.

        Returns:
            The symbolic result of the operation.
        """
        known = [
            x if isinstance(x, Recorder) else self._add('literal', (), repr(float(x)))
            for x in operands
        ]
        for i in {'+': (1, 0), '-': (1,)}.get(operation, ()):
            negative, positive, _ = self.lines[known[i].line]
            if negative == 'neg':  # a + -b is bit-identical to a - b, and a - -b to a + b
                sign = '-' if operation == '+' else '+'
                return self.record(sign, known[1 - i], Recorder(self, *positive))
        neutral = self._numbers.get(Line('literal', (), _NEUTRAL.get(operation, '')))
        for kept, other in (known, known[::-1]) if neutral is not None else ():
            if other.line == neutral and (operation in '*+' or other is known[1]):
                return kept
        return self._add(operation, tuple(x.line for x in known))

    def without_implied(self, values: Iterable[Real]) -> list[Recorder]:
        """Removes values whose finiteness is implied by that of another value.

        A finite sum, difference or product has finite operands, and a finite quotient has a finite
        dividend.

        Args:
            values: Symbolic numbers and finite floats.

        Returns:
            The symbolic numbers that remain to be checked for finiteness.
        """
        recorded = [x for x in values if isinstance(x, Recorder)]
        implied, lines = set[int](), [x.line for x in recorded]
        for i in lines:  # the list grows during the loop
            operation, operands, _ = self.lines[i]
            passed = {*operands[: _PASSED_ON.get(operation, 0)]} - implied
            implied |= passed
            lines += passed
        return [x for x in recorded if x.line not in implied]

    def _add(self, *line: Any) -> Recorder:
        found = Line(*line)
        if found not in self._numbers:
            self._numbers[found] = len(self.lines)
            self.lines.append(found)
        return Recorder(self, self._numbers[found])

    def _take_names(self, frame: FrameType, event: str, _: object) -> None:
        """Copies the names of a function's local variables when the function returns."""
        if event == 'return' and frame.f_code.co_filename not in _UNNAMED:
            for name, value in frame.f_locals.items():
                if isinstance(value, Recorder) and value.tape is self:
                    self.names.setdefault(value.line, name)


def leaves(tree: Any) -> list[Any]:
    """Returns all values of nested tuples, in order."""
    if not isinstance(tree, tuple):
        return [tree]
    return [leaf for part in tree for leaf in leaves(part)]


def paths(tree: Any, path: str) -> Any:
    """Replaces each value in nested tuples with a unique name.

    The name consists of `path` and the field names or indices that lead to the value, joined by
    underscores.
    """
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
        numbers: The numbers and opaque functions among the constants, in order.
        known: Cache of tapes and compiled code for this structure of constants.
    """

    def __init__(self, tree: Any) -> None:
        """Separates the numbers and functions in nested tuples from the structure of the tuples.

        For many designs at once, each number is an array with one row per design.
        """
        self._given = tree
        self.numbers: list[Any] = []
        structure: list[Any] = []
        waiting = [tree]
        while waiting:
            part = waiting.pop()
            kind = type(part)
            if isinstance(part, tuple):
                structure += kind, len(part)
                waiting += part[::-1]
            elif kind is Opaque:
                structure.append(kind)
                self.numbers.append(part.function)
            elif isinstance(part, (float, complex, np.ndarray)):
                is_vector = kind is complex or (kind is not float and np.iscomplexobj(part))
                for x in (part.real, part.imag) if is_vector else (part,):
                    structure += (is_vector, float) if x else (is_vector, ZERO)
                    self.numbers += [x] if x else []
            else:
                structure.append(part)
        self.known = _known.setdefault(tuple(structure), {})

    def part(self, rows: slice) -> 'Constants':
        """Selects the constants of some designs by their rows in the arrays."""
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
