# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Turns a formula into a program; `docs/tracer.md` shows an example.

A formula is an ordinary function of constants, prepared by `program.Constants`, and arguments. It
is called once with symbolic numbers, which record every operation on a `Tape`. Equal terms are
shared and unused terms are dropped. The rest is written as Python source: `bind` takes the numbers
of the constants, computes all terms that depend on them alone, and returns the program as a
closure. No sum or product is regrouped, so that results for floats are bit-identical to those of
the formula.
"""

import functools
import itertools
import linecache
import math
import weakref
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, NamedTuple, TypeAlias

from linkage_ros import formulas
from linkage_ros.formulas import ZERO, Opaque
from linkage_ros.mechanism.elementwise import SCALAR, by_element, noisy
from linkage_ros.mechanism.nested import leaves, names, places, rebuilt, transformed
from linkage_ros.numeric import Real

# An argument of a formula: the name of a scalar, or the names of the elements of a tuple.
Argument: TypeAlias = str | tuple[str, ...]

_SIGNS = {
    'add': '+', 'sub': '-', 'mul': '*', 'truediv': '/',
    'gt': '>', 'ge': '>=', 'lt': '<', 'le': '<=',
}  # fmt: skip
_COMPARISONS = '>', '>=', '<', '<='
_FLOATS = {**SCALAR, 'sqrt': math.sqrt, 'rint': round}
_ARRAYS = {name: getattr(formulas, name) for name in (*_FLOATS, 'where', 'require')}
_BY_MATH = _ARRAYS | {name: by_element(function) for name, function in SCALAR.items()}
# Number of leading operands that are necessarily finite if the result is finite.
_PASSED_ON = {'+': 2, '-': 2, '*': 2, '/': 1, 'neg': 1, 'abs': 1}
_LONG = 200  # characters; Python limits the nesting of an expression, so a longer one gets a name
_serial = itertools.count(1)


class Symbol:
    """A symbolic number; operations on it are recorded on its tape."""

    __array_ufunc__ = None
    __hash__ = __iter__ = None  # type: ignore[assignment]

    def __init__(self, tape: 'Tape', line: int) -> None:
        self.tape, self.line = tape, line

    def binary(self, sign: str, a: Real, b: Real) -> Real:
        """Records a binary operation; if an operand is ZERO, lets ZERO handle the operation."""
        return NotImplemented if a is ZERO or b is ZERO else self.tape.record(sign, a, b)

    def __repr__(self) -> str:
        return f'<line {self.line}: {" ".join(map(str, self.tape.lines[self.line]))}>'

    def __neg__(self) -> 'Symbol':
        return self.tape.record('neg', self)

    def __abs__(self) -> 'Symbol':
        return self.tape.record('abs', self)

    def __call__(self, *values: Real) -> 'Symbol':
        """Records a call of an opaque function."""
        return self.tape.record('call', self, *values)

    def __getitem__(self, i: int) -> 'Symbol':
        """Records the selection of one result of a call that returns several."""
        return self.tape.record(f'[{i}]', self)

    def __bool__(self) -> bool:
        raise TypeError('a formula cannot branch on a value: use where() or require()')

    def __eq__(self, other: object) -> bool:
        return bool(self)


for _name, _sign in _SIGNS.items():
    setattr(Symbol, f'__{_name}__', lambda a, b, sign=_sign: a.binary(sign, a, b))
    setattr(Symbol, f'__r{_name}__', lambda a, b, sign=_sign: a.binary(sign, b, a))


class Line(NamedTuple):
    """One operation on a tape.

    Attributes:
        operation: Name of the operation, or its sign.
        operands: Indices of the lines that compute the operands.
        text: Source text of an input, constant or literal.
    """

    operation: str
    operands: tuple[int, ...] = ()
    text: str = ''


class Source(NamedTuple):
    """The source of a program in pieces.

    Attributes:
        constants: Names of the numbers and functions of the constants.
        before: Statements that depend on constants alone.
        inputs: Names of the arguments.
        within: Statements that depend on arguments.
        result: The result of the formula; source text in place of each number.
    """

    constants: list[str]
    before: list[str]
    inputs: list[str]
    within: list[str]
    result: Any


class Tape:
    """The operations of a formula in the order in which it calls them, each recorded once.

    Attributes:
        title: Name of the formula.
        lines: The operations.
        result: Result of the formula, nested tuples of symbols and numbers.
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
        self.title, self.lines = formula.__name__, list[Line]()
        self._known: dict[Line, int] = {}
        recorded_constants = self._recorded_constants(constants)
        recorded_arguments = [
            transformed(lambda name: self._add(Line('input', text=name)), names)
            for names in arguments
        ]
        result = formula(recorded_constants, *recorded_arguments)
        self.result = transformed(formulas.number, result)

    def _recorded_constants(self, constants: Any) -> Any:
        """Replaces the numbers and functions among constants by symbols."""
        named = zip(leaves(constants), leaves(names(constants, 'k')), strict=True)
        recorded = [
            self._add(Line('constant', text=name)) if isinstance(x, (float, Opaque)) else x
            for x, name in named
        ]
        return rebuilt(constants, iter(recorded))

    def _add(self, line: Line) -> Symbol:
        if line not in self._known:
            self._known[line] = len(self.lines)
            self.lines.append(line)
        return Symbol(self, self._known[line])

    def record(self, operation: str, *operands: Real) -> Symbol:
        """Records an operation, unless it is already on the tape, or is one of four identities.

        Args:
            operation: Name of the operation, or its sign.
            *operands: Symbols and floats.

        Returns:
            The symbolic result of the operation.
        """
        symbols = [
            x if isinstance(x, Symbol) else self._add(Line('literal', text=repr(float(x))))
            for x in operands
        ]
        simpler = self._simpler(operation, symbols)
        if simpler is not None:
            return simpler
        return self._add(Line(operation, tuple(x.line for x in symbols)))

    def _simpler(self, operation: str, operands: Sequence[Symbol]) -> Symbol | None:
        """Returns the result of an operation by an identity; None if there is none.

        The identities hold for every double: a + -b is a - b, a - -b is a + b, and a * 1 and a / 1
        are a.
        """
        if operation not in {'+', '-', '*', '/'}:
            return None
        a, b = operands
        pairs = [(a, b), (b, a)] if operation in {'+', '*'} else [(a, b)]
        for first, second in pairs:
            line = self.lines[second.line]
            if operation in {'+', '-'} and line.operation == 'neg':
                sign = '-' if operation == '+' else '+'
                return self.record(sign, first, Symbol(self, *line.operands))
            if operation in {'*', '/'} and line == ('literal', (), '1.0'):
                return first
        return None

    def without_implied(self, values: Iterable[Real]) -> list[Symbol]:
        """Removes values whose finiteness is implied by that of another value.

        A finite sum, difference or product has finite operands, and a finite quotient has a finite
        dividend.

        Args:
            values: Symbols and finite floats.

        Returns:
            The symbols that remain to be checked for finiteness.
        """
        symbols = [x for x in values if isinstance(x, Symbol)]
        implied, to_visit = set[int](), [x.line for x in symbols]
        while to_visit:
            line = self.lines[to_visit.pop()]
            finite_operands = line.operands[: _PASSED_ON.get(line.operation, 0)]
            new = {*finite_operands} - implied
            implied |= new
            to_visit += new
        return [x for x in symbols if x.line not in implied]

    @functools.cached_property
    def _live(self) -> list[int]:
        """Lines that the result or a guard requires, in order."""
        live = {x.line for x in leaves(self.result) if isinstance(x, Symbol)}
        live |= {i for i, line in enumerate(self.lines) if line.operation == 'require'}
        for i in reversed(range(len(self.lines))):
            live.update(self.lines[i].operands if i in live else ())
        return sorted(live)

    @functools.cached_property
    def _inner(self) -> set[int]:
        """Live lines that depend on an argument."""
        inner: set[int] = set()
        for i in self._live:
            line = self.lines[i]
            if line.operation == 'input' or not inner.isdisjoint(line.operands):
                inner.add(i)
        return inner

    @property
    def operations(self) -> int:
        """Number of operations in one call of the program, including conditions of guards."""
        kinds = (self.lines[i].operation for i in self._inner)
        return sum(kind not in {'input', 'require'} and kind[0] != '[' for kind in kinds)

    def source(self, guard: str, *, for_arrays: bool = False, term: str = '{}') -> Source:
        """Writes the program.

        Args:
            guard: Statement for a guard; {0} is its condition, {1} the arguments of `require`
                after the condition, {2} the call that rejects them.
            for_arrays: Whether values may be arrays. Every term then gets a name, which is deleted
                after the last use, so that the memory of an array can be reused.
            term: Expression for the value of a term; {} is the operation.
        """
        uses, last_use, free_names = self._uses(), self._last_use(), self._free_names()
        texts = dict[int, str]()  # name or expression of each line
        before, within = list[str](), list[str]()  # statements of `bind`, and of the function
        for i in self._live:
            operation, operands, text = self.lines[i]
            if text:  # a constant, an argument or a literal
                texts[i] = text
                continue
            operand_texts = [texts[x] for x in operands]
            # Guards stay in order, so that the same error is raised as by the formula.
            is_inner = i in self._inner or operation == 'require'
            if operation == 'require':
                statement = _guard_statement(guard, *operand_texts)
            else:
                expression = _expression(operation, operand_texts, for_arrays=for_arrays)
                is_short = uses[i] == 1 and len(expression) < _LONG
                if is_inner and is_short and not for_arrays:
                    texts[i] = expression  # written where it is used
                    continue
                texts[i] = name = next(free_names)
                is_number = operation not in (*_COMPARISONS, 'call')
                statement = f'{name} = {term.format(expression) if is_number else expression}'
            if for_arrays:
                last_used = [x for x in sorted({*operands} & self._inner) if last_use[x] == i]
                statement += f'; del {", ".join(texts[x] for x in last_used)}' * bool(last_used)
            (within if is_inner else before).append(statement)
        constants = [line.text for line in self.lines if line.operation == 'constant']
        inputs = [line.text for line in self.lines if line.operation == 'input']
        result = transformed(
            lambda x: texts[x.line] if isinstance(x, Symbol) else repr(x), self.result
        )
        return Source(constants, before, inputs, within, result)

    def _result_lines(self) -> list[int]:
        """Returns the lines of the symbols in the result."""
        return [x.line for x in leaves(self.result) if isinstance(x, Symbol)]

    def _uses(self) -> Counter[int]:
        """Counts the uses of each line by live lines and by the result."""
        operands = (x for i in self._live for x in self.lines[i].operands)
        return Counter([*self._result_lines(), *operands])

    def _last_use(self) -> dict[int, int]:
        """Returns the last live line that uses each line; the result is after all lines."""
        last_use = {x: i for i in self._live for x in self.lines[i].operands}
        return last_use | dict.fromkeys(self._result_lines(), len(self.lines))

    def _free_names(self) -> Iterator[str]:
        """Yields the names t1, t2 and so on, without those of constants and arguments."""
        taken = {line.text for line in self.lines}
        names_in_order = (f't{n}' for n in itertools.count(1))
        return (name for name in names_in_order if name not in taken)

    @functools.cached_property
    def text(self) -> str:
        """The source of the program for floats."""
        return self._text(self.source('if not {0}: {2}'))

    def _text(self, source: Source) -> str:
        inner = [f'def {self.title}({", ".join(source.inputs)}):', *source.within]
        inner.append(f'return {_written(self.result, iter(leaves(source.result)))}')
        outer = [f'def bind({", ".join(source.constants)}):', *source.before]
        body = [*outer, '\n        '.join(inner), f'return {self.title}']
        return '\n    '.join(body) + '\n'

    @functools.cached_property
    def for_floats(self) -> Callable[..., Any]:
        """Function `bind` of the program for floats."""
        return self._compiled(self.text, _FLOATS)

    @functools.cached_property
    def for_arrays(self) -> Callable[..., Any]:
        """Function `bind` of the program for floats and arrays, with NumPy's functions."""
        return self._compiled(self._array_text, _ARRAYS)

    @functools.cached_property
    def by_math(self) -> Callable[..., Any]:
        """Function `bind` of the same program, with `math`'s functions for each element."""
        return self._compiled(self._array_text, _BY_MATH)

    @functools.cached_property
    def with_noise(self) -> Callable[..., Any]:
        """Function `bind` of the same program, with noise in every term; see `elementwise`."""
        source = self.source('require({0}, {1})', for_arrays=True, term='noisy({})')
        return self._compiled(self._text(source), _BY_MATH | {'noisy': noisy})

    @functools.cached_property
    def _array_text(self) -> str:
        return self._text(self.source('require({0}, {1})', for_arrays=True))

    @functools.cached_property
    def shaped(self) -> Callable[..., Any]:
        """Function that takes the values of the result, and returns them as nested tuples."""
        values = [f'v{i}' for i in range(len(leaves(self.result)))]
        text = f'def bind({", ".join(values)}): return {_written(self.result, iter(values))}\n'
        return self._compiled(text, {})

    @functools.cached_property
    def flat(self) -> Callable[[Any], list[Any]]:
        """Function that returns the values of a result as a list."""
        text = f'def bind(tree): return [{", ".join(places(self.result, "tree"))}]\n'
        return self._compiled(text, {})

    def _compiled(self, text: str, functions: dict[str, Any]) -> Callable[..., Any]:
        path = f'<{self.title} {next(_serial)}>'
        linecache.cache[path] = len(text), None, text.splitlines(keepends=True), path
        space = {'inf': math.inf, **functions, **_classes(self.result)}
        exec(compile(text, path, 'exec'), space)  # noqa: S102
        bind: Callable[..., Any] = space['bind']
        weakref.finalize(bind, linecache.cache.pop, path, None)
        return bind


def _guard_statement(guard: str, condition: str, refuse: str, *arguments: str) -> str:
    """Writes a guard; for `guard`, see `Tape.source`."""
    call = f'{refuse}({", ".join(arguments)})'
    return guard.format(condition, ', '.join((refuse, *arguments)), call)


def _expression(operation: str, read: list[str], *, for_arrays: bool) -> str:
    """Writes one operation whose operands have the source text `read`."""
    if operation == 'call':
        return f'{read[0]}({", ".join(read[1:])})'
    if operation[0] == '[':
        return read[0] + operation
    inner = [f'({x})' if ' ' in x else x for x in read]
    if operation in _SIGNS.values():
        return f'{inner[0]} {operation} {inner[1]}'
    if operation == 'neg':
        return f'-{inner[0]}'
    if operation == 'where' and not for_arrays:
        return f'{inner[1]} if {inner[0]} else {inner[2]}'
    return f'{operation}({", ".join(read)})'


def _written(tree: Any, texts: Iterator[str]) -> str:
    """Writes nested tuples, with the next of the texts in place of each number."""
    if not isinstance(tree, tuple):
        return next(texts)
    parts = [_written(part, texts) for part in tree]
    if type(tree) is tuple:
        return f'({", ".join(parts)}{"," * (len(parts) == 1)})'
    return f'{type(tree).__name__}({", ".join(parts)})'


def _classes(tree: Any) -> dict[str, type]:
    """Returns the classes of the named tuples in a tree, by name."""
    if not isinstance(tree, tuple):
        return {}
    found = {type(tree).__name__: type(tree)}
    return found | {name: kind for part in tree for name, kind in _classes(part).items()}
