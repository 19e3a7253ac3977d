# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Compiles formulas to straight-line Python: one program per structure of constants.

A formula is an ordinary function of constants and arguments. It runs once on symbolic numbers that
record its operations. Equal terms are shared, unused terms are dropped, and terms that depend only
on constants are computed when the constants are bound. The order of operations is kept, so results
are bit-identical to those of the formula.

Constants are floats, complex numbers and `Opaque` functions in nested tuples. None, booleans,
integers, strings and the value 0.0 belong to the structure: a formula may branch on them, and
terms that vanish because of a 0.0 are not computed.
"""

import collections
import functools
import itertools
import linecache
import math
import re
from collections.abc import Callable, Iterable
from types import FunctionType
from typing import Any, NamedTuple, TypeVar, cast

import numpy as np

from linkage_ros import formulas
from linkage_ros.dynamics.tape import (
    COMPARISONS,
    OPERATORS,
    Argument,
    Constants,
    Recorder,
    Tape,
    leaves,
    transformed,
)
from linkage_ros.numeric import Real, by_element

_CHUNK = 16384  # array values per block, so that intermediate results fit the processor's cache
_INFIX = {
    **{sign: f'{{}} {sign} {{}}' for sign in OPERATORS.values()},
    'neg': '-{}', 'where': '{1} if {0} else {2}',
}  # fmt: skip
_FUNCTIONS: dict[str, tuple[Callable[..., float], Callable[..., Real]]] = {
    'sin': (math.sin, np.sin), 'cos': (math.cos, np.cos), 'atan2': (math.atan2, np.arctan2),
    'sqrt': (math.sqrt, np.sqrt), 'rint': (round, np.rint),
}  # fmt: skip
_EXACT = 'sqrt', 'rint'  # functions that NumPy, like Python, rounds correctly
_RESERVED = {*_FUNCTIONS, 'abs', 'bind', 'inf', 'refuse', 'locals'}
_LONG = 200  # characters; a term at least this long is assigned to a variable
_serial = itertools.count(1)
_T = TypeVar('_T')


class Writer:
    """Writes a tape as Python source, for floats or for arrays.

    Attributes:
        namespace: Named-tuple classes used by the program, by name.
    """

    def __init__(self, tape: Tape, arrays: frozenset[str], head: tuple[str, ...]) -> None:
        """Finds the operations required for the result.

        Args:
            tape: The recorded operations.
            arrays: Names of the inputs that are arrays; all others are floats.
            head: First lines of the program; if empty, a `def` line with the inputs is used.
        """
        self.namespace: dict[str, Any] = {}
        self._tape, self._head, lines = tape, head, tape.lines
        result = [x.line for x in leaves(tape.result) if isinstance(x, Recorder)]
        live = {*result, *(i for i, line in enumerate(lines) if line.operation == 'require')}
        for i in reversed(range(len(lines))):
            live.update(lines[i].operands if i in live else ())
        self._live = sorted(live)
        self._reads = collections.Counter([*result, *(x for i in live for x in lines[i].operands)])
        self._inner: set[int] = set()  # lines that depend on inputs
        self._varying: set[int] = set()  # lines that are arrays
        for i in self._live:
            kind, operands, name = lines[i]
            if kind == 'input' or not self._inner.isdisjoint(operands):
                self._inner.add(i)
            if name in arrays or not self._varying.isdisjoint(operands):
                self._varying.add(i)
        self._words = {i: line.text for i, line in enumerate(lines) if line.text}
        self._taken = {*_RESERVED, *self._words.values(), *re.findall(r'\w+', ' '.join(head))}

    def text(self) -> tuple[str, str]:
        """Returns the sources of two functions.

        The first computes all terms that depend only on constants, and returns them by name. The
        second is the program, which uses these names.
        """
        tape = self._tape
        written = [
            (i in self._inner, self._statement(i)) for i in self._live if i not in self._words
        ]
        before, within = ([x for part, x in written if x and part == wanted] for wanted in (0, 1))
        constants, inputs = (
            ', '.join(line.text for line in tape.lines if line.operation == kind)
            for kind in ('constant', 'input')
        )
        program = [
            *(self._head or [f'def {tape.title}({inputs}):']),
            *within,
            f'return {self._tree(tape.result)}',
        ]
        if self._varying:
            _free_memory(program)
        bind = [f'def bind({constants}):', *before, 'return locals()']
        return '\n    '.join(bind) + '\n\n\n', '\n    '.join(program) + '\n'

    def numbers(self) -> list[str]:
        """Returns the names of the numbers in the program that depend only on constants."""
        others = 'literal', 'require', *COMPARISONS
        outer = (i for i in self._live if i not in self._inner)
        return [self._words[i] for i in outer if self._tape.lines[i].operation not in others]

    def _statement(self, i: int) -> str:
        """Returns the statement for a line of the tape; empty if it is inlined at its only use."""
        operation, operands, _ = self._tape.lines[i]
        read = [self._words[x] for x in operands]
        if operation == 'require':
            guard = f'if not {read[0]}: {read[1]}({", ".join(read[2:])})'
            is_array = i in self._varying
            return f'refuse({", ".join(read)})' if is_array else guard
        name = self._tape.names.get(i, 't')
        expression = self._expression(operation, read, is_array=i in self._varying)
        if name == 't' and self._reads[i] == 1 and i in self._inner and len(expression) < _LONG:
            self._words[i] = expression
            return ''
        names = itertools.chain([name], (f'{name}{n}' for n in itertools.count(2)))
        self._words[i] = next(n for n in names if n not in self._taken)
        self._taken.add(self._words[i])
        return f'{self._words[i]} = {expression}'

    @staticmethod
    def _expression(operation: str, read: list[str], *, is_array: bool) -> str:
        if operation == 'call':
            return f'{read[0]}({", ".join(read[1:])})'
        if operation[0] == '[':
            return read[0] + operation
        if operation in _INFIX and not (is_array and operation == 'where'):
            return _INFIX[operation].format(*(f'({x})' if ' ' in x else x for x in read))
        return f'{"array_" if is_array else ""}{operation}({", ".join(read)})'

    def _tree(self, tree: Any) -> str:
        if isinstance(tree, Recorder):
            return self._words[tree.line]
        if not isinstance(tree, tuple):
            return repr(tree)
        inside = f'({"".join(f"{self._tree(part)}, " for part in tree)})'
        if type(tree) is tuple:
            return inside
        name = type(tree).__name__
        self.namespace[name] = _fast_variant(type(tree))
        return f'{name}({inside})'


class _Tuple(tuple[Any, ...]):
    __slots__ = ()


@functools.cache
def _fast_variant(kind: Any) -> type:
    """Returns a faster variant of a named tuple, constructed from a single tuple of values."""

    def reduce(row: tuple[Any, ...]) -> tuple[Any, ...]:
        return kind, tuple(row)

    methods = {'__slots__': (), '__new__': tuple.__new__, '__reduce__': reduce}
    return type(kind.__name__, (_Tuple, kind), methods)


def _free_memory(statements: list[str]) -> None:
    """Deletes each array after its last use, so that its memory can be reused."""
    names = {statement.partition(' = ')[0] for statement in statements}
    read = {*re.findall(r'\w+', statements[-1])}
    for i in reversed(range(1, len(statements) - 1)):
        found = {*re.findall(r'\w+', statements[i])}
        if dead := names & found - read:
            statements[i] += f'; del {", ".join(sorted(dead))}'
        read |= found


class Code(NamedTuple):
    """A compiled program whose constants are not bound yet.

    Attributes:
        text: Source code of the program.
        bound: Function that takes the numbers of the constants, and as keyword arguments the
            functions added by `Program.entry`; it returns the program as a callable.
    """

    text: str
    bound: Callable[..., Callable[..., Any]]


def _compile(tape: Tape, arrays: frozenset[str], head: tuple[str, ...], *, by_math: bool) -> Code:
    writer = Writer(tape, arrays, head)
    (bind, program), path = writer.text(), f'<{tape.title} {next(_serial)}>'
    space = {
        **writer.namespace, 'inf': math.inf, 'refuse': formulas.require,
        'array_abs': np.absolute, 'array_where': np.where,
    }  # fmt: skip
    for name, (scalar, array) in _FUNCTIONS.items():
        is_slow = by_math and name not in _EXACT
        space |= {name: scalar, f'array_{name}': by_element(scalar) if is_slow else array}
    # In the compiled code, strings are placeholders for the numbers that depend on constants only.
    numbers = '|'.join(writer.numbers()) or '$'
    quoted = re.sub(rf'\b({numbers})\b(?!\()', r"'\1'", program)
    exec(compile(bind + quoted, path, 'exec'), space)  # noqa: S102
    text = bind + program
    linecache.cache[path] = len(text), None, text.splitlines(keepends=True), path
    run = space[program[len('def ') : program.index('(')]]

    def bound(numbers: Iterable[Any], **others: Any) -> Callable[..., Any]:
        """Replaces the placeholders with numbers; constants are faster than variables."""
        values = space['bind'](*numbers)
        constants = transformed(lambda x: values.get(x, x), run.__code__.co_consts)
        code = run.__code__.replace(co_consts=constants)
        return FunctionType(code, {**space, **values, **others}, argdefs=run.__defaults__)

    return Code(text, bound)


class Program:
    """A formula with its constants bound.

    If the structure of the constants is new, the formula is recorded and compiled on first use.

    Attributes:
        formula: Function that the program evaluates.
        constants: Constants bound to the formula.
        names: Names of the scalar arguments, in order.
    """

    def __init__(
        self, formula: Callable[..., Any], constants: Constants, arguments: tuple[Argument, ...]
    ) -> None:
        """Binds a formula to constants.

        Args:
            formula: Function of constants and arguments that returns nested tuples of numbers.
            constants: The constants of the formula.
            arguments: The names of the scalars in each argument.
        """
        self.formula, self.constants, self._arguments = formula, constants, arguments
        self.names: list[str] = leaves(arguments)

    @functools.cached_property
    def scalar(self) -> Callable[..., Any]:
        """The program for floats, with a separate parameter for each scalar of the arguments."""
        return self.code().bound(self.constants.numbers)

    def entry(self, *head: str, **others: Any) -> Callable[..., Any]:
        """Returns the program for floats as a function with a different signature.

        Args:
            *head: First lines of the function: its `def` line, followed by statements that compute
                the program's arguments from the function's parameters.
            **others: Functions and programs used by these statements, by name.

        Returns:
            The function defined by `head`, which returns the result of the program.
        """
        return self.code(head=head).bound(self.constants.numbers, **others)

    @property
    def tape(self) -> Tape:
        """The recorded formula."""
        return self._cached((), lambda: Tape(self.formula, self.constants.tree, self._arguments))

    @property
    def source(self) -> str:
        """The Python source of the program for floats."""
        return self.code().text

    def code(
        self,
        arrays: frozenset[str] = frozenset(),
        head: tuple[str, ...] = (),
        *,
        by_math: bool = False,
    ) -> Code:
        """Compiles the program without its constants, once per structure.

        Args:
            arrays: Names of the arguments that are arrays; all others are floats.
            head: First lines of the function; see `entry`.
            by_math: Whether to apply functions of `math` to arrays, element by element.

        Returns:
            The compiled program, to which constants can be bound.
        """
        return self._cached(
            (arrays, head, by_math), lambda: _compile(self.tape, arrays, head, by_math=by_math)
        )

    def _cached(self, part: tuple[Any, ...], make: Callable[[], _T]) -> _T:
        """Creates an object once for all programs with the same formula and structure."""
        known, key = self.constants.known, (self.formula, self._arguments, *part)
        if key not in known:
            known[key] = make()
        return cast('_T', known[key])

    def untraced(self, *values: float) -> Any:
        """Evaluates the uncompiled formula on floats, for debugging and comparison."""
        given = iter(values)
        result = self.formula(
            self.constants.tree, *(transformed(lambda _: next(given), x) for x in self._arguments)
        )
        return transformed(formulas.number, result)

    def designs(self, *values: Real, by_math: bool = False) -> Any:
        """Runs the program for many designs and angles at once; constants may be arrays too.

        Args:
            *values: Floats, and arrays that broadcast with the arrays among the constants.
            by_math: See `arrays`.

        Returns:
            The result, with floats for values that do not depend on an array.
        """
        named = [line.text for line in self.tape.lines if line.operation == 'constant']
        given = zip([*named, *self.names], [*self.constants.numbers, *values], strict=True)
        varying = frozenset(name for name, value in given if isinstance(value, np.ndarray))
        with np.errstate(all='ignore'):
            return self.code(varying, by_math=by_math).bound(self.constants.numbers)(*values)

    def arrays(self, *values: Real, by_math: bool = False) -> Any:
        """Runs the program on arrays of the same shape.

        Args:
            *values: Arrays of the same shape, and floats that apply to all elements.
            by_math: Whether to apply functions of `math`, element by element, so that results are
                bit-identical to those of the scalar program. NumPy's functions are faster.

        Returns:
            The result of the scalar program, with arrays instead of floats.
        """
        shape = np.broadcast_shapes(*map(np.shape, values))
        rows: list[Real] = [np.broadcast_to(x, shape).ravel() if np.ndim(x) else x for x in values]
        varying = frozenset(name for name, x in zip(self.names, rows, strict=True) if np.ndim(x))
        run = self.code(varying, by_math=by_math).bound(self.constants.numbers)
        size = math.prod(shape)
        results = [np.empty(size) for _ in leaves(self.tape.result)]
        # By default, glibc returns large freed blocks to the system and faults them in again page
        # by page. Freeing this larger block, which is never touched, raises that threshold.
        np.empty(3_000_000)
        for start in range(0, size, _CHUNK):
            part = slice(start, start + _CHUNK)
            with np.errstate(over='ignore', invalid='ignore', under='ignore'):
                found = run(*(x[part] if np.ndim(x) else x for x in rows))
            for row, value in zip(results, leaves(found), strict=True):
                row[part] = value
        filled = iter(results)
        return transformed(lambda _: next(filled).reshape(shape), self.tape.result)
