# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Turns formulas into straight-line Python: one program for each structure of constants.

A formula is an ordinary function of constants and arguments. It runs once on recording numbers:
equal terms are shared, unused terms are dropped, and terms of constants alone are computed when
the constants are bound. The order of operations is kept, so that results have the
bits of the formula itself. Constants are floats, complex numbers and `Opaque` functions in nested
tuples. None, booleans, whole numbers, text and 0.0 among them belong to the structure, on which a
formula may branch; terms that 0.0 makes vanish are not computed.
"""

from __future__ import annotations

import collections
import functools
import itertools
import linecache
import math
import re
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from linkage_ros import formulas
from linkage_ros.dynamics.tape import OPERATORS, Argument, Recorder, Tape
from linkage_ros.dynamics.trees import Constants, leaves, transformed
from linkage_ros.numeric import Real, by_element

_CHUNK = 16384  # values of an array at a time: what lies between stays in the processor's cache
_INFIX = {
    **{sign: f'{{}} {sign} {{}}' for sign in OPERATORS.values()},
    'neg': '-{}', 'where': '{1} if {0} else {2}',
}  # fmt: skip
_FUNCTIONS = {'sin': np.sin, 'cos': np.cos, 'sqrt': np.sqrt, 'atan2': np.arctan2}
_LONG = 200  # characters of a term that gets a line of its own
_serial = itertools.count(1)


class Writer:
    """Writes the lines of a tape as Python, for floats or for arrays.

    Attributes:
        namespace: Named tuples used in the text.
        used: For each number of the constants, whether the text uses it.
    """

    def __init__(self, tape: Tape, arrays: frozenset[str]) -> None:
        """Finds the operations that the result needs.

        Args:
            tape: The operations.
            arrays: Names of the array inputs; none: all are floats.
        """
        self.namespace: dict[str, Any] = {}
        self._tape, lines = tape, tape.lines
        result = [x.line for x in leaves(tape.result) if isinstance(x, Recorder)]
        live = {*result, *(i for i, line in enumerate(lines) if line.operation == 'require')}
        for i in reversed(range(len(lines))):
            live.update(lines[i].operands if i in live else ())
        self._live = sorted(live)
        self._reads = collections.Counter([*result, *(x for i in live for x in lines[i].operands)])
        self.used = [i in live for i, line in enumerate(lines) if line.operation == 'constant']
        self._inner: set[int] = set()  # lines that depend on inputs
        self._varying: set[int] = set()  # lines that are arrays
        for i in self._live:
            kind, operands, name = lines[i]
            if kind == 'input' or not self._inner.isdisjoint(operands):
                self._inner.add(i)
            if name in arrays or not self._varying.isdisjoint(operands):
                self._varying.add(i)
        self._words = {i: line.text for i, line in enumerate(lines) if line.text}
        self._taken = {*self._words.values(), *_FUNCTIONS, 'abs', 'bind', 'inf', 'new', 'refuse'}

    def text(self) -> str:
        """The source of a function of the constants that returns the program."""
        tape = self._tape
        written = [
            (i in self._inner, self._statement(i)) for i in self._live if i not in self._words
        ]
        before, within = ([x for part, x in written if x and part == wanted] for wanted in (0, 1))
        given = ', '.join(line.text for line in tape.lines if line.operation == 'input')
        numbers = (line.text for line in tape.lines if line.operation == 'constant')
        constants = ', '.join(itertools.compress(numbers, self.used))
        result = f'return {self._tree(tape.result)}'
        body = [f'def {tape.title}({given}):', *within, result]
        if self._varying:
            _free_memory(body)
        within_bind = [*before, '\n        '.join(body), f'return {tape.title}\n']
        return '\n    '.join([f'def bind({constants}):', *within_bind])

    def _statement(self, i: int) -> str:
        """The statement of a line; empty if its text is inlined into its only use."""
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
        self.namespace[type(tree).__name__] = type(tree)
        return f'new({type(tree).__name__}, {inside})'


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
        bind: Function of the used constants that returns the program.
        text: Source code of the program.
        used: For each number of the constants, whether it is used.
    """

    bind: Callable[..., Any]
    text: str
    used: list[bool]


@functools.cache
def _compile(tape: Tape, arrays: frozenset[str], *, by_math: bool) -> Code:
    writer = Writer(tape, arrays)
    text, path = writer.text(), f'<{tape.title} {next(_serial)}>'
    space = {
        **writer.namespace, 'inf': math.inf, 'new': tuple.__new__, 'refuse': formulas.require,
        'array_abs': np.absolute, 'array_where': np.where,
    }  # fmt: skip
    for name, function in _FUNCTIONS.items():
        space[name] = getattr(math, name)
        space[f'array_{name}'] = by_element(space[name]) if by_math else function
    exec(compile(text, path, 'exec'), space)  # noqa: S102
    linecache.cache[path] = len(text), None, text.splitlines(keepends=True), path
    return Code(space['bind'], text, writer.used)


_tapes: dict[Any, Tape] = {}


class Program:
    """A formula with its constants bound.

    A new structure is recorded and compiled when the program first runs.

    Attributes:
        formula: The formula.
        constants: Constants bound to the formula.
        names: Names of the scalar arguments, in order.
        scalar: The program for floats: a function of all numbers of the arguments, one by one.
    """

    def __init__(
        self, formula: Callable[..., Any], constants: Constants, arguments: tuple[Argument, ...]
    ) -> None:
        """Takes a formula.

        Args:
            formula: From constants and arguments to numbers in nested tuples.
            constants: The constants of the formula.
            arguments: The names of the arguments.
        """
        self.formula, self.constants, self._arguments = formula, constants, arguments
        self.names: list[str] = leaves(arguments)
        self.scalar: Callable[..., Any] = self._first

    def compile(self) -> Callable[..., Any]:
        """Compiles the program for floats now, not at its first run."""
        self.scalar = self._bind(frozenset())
        return self.scalar

    def _first(self, *values: float) -> Any:
        return self.compile()(*values)

    def _bind(self, arrays: frozenset[str], *, by_math: bool = False) -> Any:
        code = _compile(self.tape, arrays, by_math=by_math)
        return code.bind(*itertools.compress(self.constants.numbers, code.used))

    @functools.cached_property
    def tape(self) -> Tape:
        """The recorded formula."""
        key = self.formula, self.constants.structure, self._arguments
        if key not in _tapes:
            _tapes[key] = Tape(self.formula, self.constants.tree, self._arguments)
        return _tapes[key]

    @property
    def code(self) -> Code:
        """The program for floats, without bound constants."""
        return _compile(self.tape, frozenset(), by_math=False)

    @property
    def source(self) -> str:
        """The program for floats as Python text."""
        return self.code.text

    def untraced(self, *values: float) -> Any:
        """The formula itself on floats, for debugging and comparison."""
        given = iter(values)
        result = self.formula(
            self.constants.tree, *(transformed(lambda _: next(given), x) for x in self._arguments)
        )
        return transformed(formulas.number, result)

    def designs(self, *values: Real, by_math: bool = False) -> Any:
        """The program where constants may be arrays, too: designs times angles.

        Args:
            *values: Floats, and arrays that broadcast with those among the constants.
            by_math: See `arrays`.

        Returns:
            The result; what nothing of an array enters is a float.
        """
        named = [line.text for line in self.tape.lines if line.operation == 'constant']
        given = zip([*named, *self.names], [*self.constants.numbers, *values], strict=True)
        varying = frozenset(name for name, value in given if isinstance(value, np.ndarray))
        with np.errstate(all='ignore'):
            return self._bind(varying, by_math=by_math)(*values)

    def arrays(self, *values: Real, by_math: bool = False) -> Any:
        """Runs the program on arrays of one shape.

        Args:
            *values: Arrays, and floats that are the same everywhere.
            by_math: Whether to use the functions of `math`, element by element, for results with
                the bits of the scalar program; NumPy's are faster.

        Returns:
            The result, with arrays.
        """
        shape = np.broadcast_shapes(*map(np.shape, values))
        rows: list[Real] = [np.broadcast_to(x, shape).ravel() if np.ndim(x) else x for x in values]
        varying = frozenset(name for name, x in zip(self.names, rows, strict=True) if np.ndim(x))
        run, size = self._bind(varying, by_math=by_math), math.prod(shape)
        results = [np.empty(size) for _ in leaves(self.tape.result)]
        # glibc hands memory of the size of a chunk back to the system at once, and gets it again
        # page by page, until it has seen a larger piece freed. This one is never touched.
        np.empty(3_000_000)
        for start in range(0, size, _CHUNK):
            part = slice(start, start + _CHUNK)
            with np.errstate(over='ignore', invalid='ignore', under='ignore'):
                found = run(*(x[part] if np.ndim(x) else x for x in rows))
            for row, value in zip(results, leaves(found), strict=True):
                row[part] = value
        filled = iter(results)
        return transformed(lambda _: next(filled).reshape(shape), self.tape.result)
