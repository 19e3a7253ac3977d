# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Records the operations of a formula on symbolic numbers, on a tape."""

import sys
from collections.abc import Callable, Iterable
from types import FrameType
from typing import Any, NamedTuple, TypeAlias

from linkage_ros import formulas, numeric
from linkage_ros.dynamics.trees import is_number, leaves, paths, transformed
from linkage_ros.numeric import Real

# An argument of a formula: the name of a number, or the names of a tuple of numbers.
Argument: TypeAlias = str | tuple[str, ...]

OPERATORS = {
    'add': '+', 'sub': '-', 'mul': '*', 'truediv': '/',
    'gt': '>', 'ge': '>=', 'lt': '<', 'le': '<=',
}  # fmt: skip
COMPARISONS = '>', '>=', '<', '<='
# x * 1, x / 1, x - 0.0 and x + -0.0 are x for every double, signed zeros included.
_NEUTRAL = {'*': '1.0', '/': '1.0', '-': '0.0', '+': '-0.0'}
# For each operation, the number of first operands whose non-finite values make the result so.
_PASSED_ON = {'+': 2, '-': 2, '*': 2, '/': 1, 'neg': 1, 'abs': 1}
# Files whose functions do not name the values that they compute.
_UNNAMED = __file__, formulas.__file__, numeric.__file__


class Recorder:
    """A symbolic number that records the operations on it on a tape."""

    __array_ufunc__ = None
    __hash__ = __iter__ = None  # type: ignore[assignment]

    def __init__(self, tape: 'Tape', line: int) -> None:
        self.tape, self.line = tape, line

    def apply(self, operation: str, *values: Real) -> 'Recorder':
        """Records an operation on values."""
        return self.tape.record(operation, *values)

    def binary(self, sign: str, a: Real, b: Real) -> Real:
        """Records an operation between two values; the operators of ZERO drop it."""
        if a is formulas.ZERO or b is formulas.ZERO:
            return NotImplemented
        return self.tape.record(sign, a, b)

    def __call__(self, *values: Real) -> 'Recorder':
        """Records a call of an opaque function."""
        return self.tape.record('call', self, *values)

    def __getitem__(self, i: int) -> 'Recorder':
        """Records the choice of one of the results of a call."""
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
        operands: Numbers of earlier lines.
        text: Source text of an input, constant or literal.
    """

    operation: str
    operands: tuple[int, ...]
    text: str = ''


class Tape:
    """The operations of one formula, each once, in the formula's order.

    Attributes:
        title: Name of the formula.
        lines: The operations.
        names: Names of the results of lines in the formulas.
        result: Result of the formula, in recording numbers.
    """

    def __init__(
        self, formula: Callable[..., Any], constants: Any, arguments: tuple[Argument, ...]
    ) -> None:
        """Records a formula.

        Args:
            formula: Function from constants and arguments to nested tuples of numbers.
            constants: Constants of the structure to record; their values do not matter.
            arguments: Names of the arguments.
        """
        self.title = formula.__name__
        self.names: dict[int, str] = {}
        self.lines: list[Line] = []
        self._numbers: dict[Line, int] = {}
        named = zip(leaves(constants), leaves(paths(constants, 'k')), strict=True)
        given = iter([self._add('constant', (), path) if is_number(x) else x for x, path in named])
        # An active profiler is kept; names are then missing.
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
        """Records an operation, or finds it on the tape.

        Args:
            operation: Name of the operation.
            *operands: Recording numbers and literals.

        Returns:
            The result of the operation.
        """
        known = [
            x if isinstance(x, Recorder) else self._add('literal', (), repr(float(x)))
            for x in operands
        ]
        for i in {'+': (1, 0), '-': (1,)}.get(operation, ()):
            negative, positive, _ = self.lines[known[i].line]
            if negative == 'neg':  # a + -b is a - b to the bit, and a - -b is a + b
                sign = '-' if operation == '+' else '+'
                return self.record(sign, known[1 - i], Recorder(self, *positive))
        neutral = self._numbers.get(Line('literal', (), _NEUTRAL.get(operation, '')))
        for kept, other in (known, known[::-1]) if neutral is not None else ():
            if other.line == neutral and (operation in '*+' or other is known[1]):
                return kept
        return self._add(operation, tuple(x.line for x in known))

    def unshown(self, values: Iterable[Real]) -> list[Recorder]:
        """Leaves out values whose finiteness follows from that of another value.

        A sum, difference, product or quotient is finite only if its operands are.

        Args:
            values: Recording numbers, and finite ones.

        Returns:
            The other recording numbers.
        """
        recorded = [x for x in values if isinstance(x, Recorder)]
        shown, lines = set[int](), [x.line for x in recorded]
        for i in lines:  # the list grows
            operation, operands, _ = self.lines[i]
            passed = {*operands[: _PASSED_ON.get(operation, 0)]} - shown
            shown |= passed
            lines += passed
        return [x for x in recorded if x.line not in shown]

    def _add(self, *line: Any) -> Recorder:
        found = Line(*line)
        if found not in self._numbers:
            self._numbers[found] = len(self.lines)
            self.lines.append(found)
        return Recorder(self, self._numbers[found])

    def _take_names(self, frame: FrameType, event: str, _: object) -> None:
        """Copies the variable names of a formula's function when it returns."""
        if event == 'return' and frame.f_code.co_filename not in _UNNAMED:
            for name, value in frame.f_locals.items():
                if isinstance(value, Recorder) and value.tape is self:
                    self.names.setdefault(value.line, name)
