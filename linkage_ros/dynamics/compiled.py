# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Compiles programs to machine code with Numba, for computing many states.

The extra `fast` installs Numba. It is imported only for a `Solver` with `compiled=True`. The first
call of each program takes about a second.
"""

import ast
import functools
import math
import re
from collections.abc import Callable
from typing import Any

import numpy as np

from linkage_ros.dynamics.program import Program
from linkage_ros.dynamics.tape import leaves, transformed
from linkage_ros.errors import ConfigurationError, missing_library


def compiled_arrays(program: Program, *values: Any) -> Any:
    """Runs a program on arrays, in machine code.

    Args:
        program: The program to run. A program that calls Python functions, such as tables, runs
            without Numba.
        *values: Arrays and floats that broadcast.

    Returns:
        The result as arrays. It equals that of the scalar program, except for the last digits of
        functions such as the sine.

    Raises:
        ConfigurationError: Numba is not installed.
        LinkageError: The program rejects some values; the error describes the first of them.
    """
    if any(line.operation == 'call' for line in program.tape.lines):
        return program.arrays(*values)
    rows = np.broadcast_arrays(*values)
    given = np.array([row.ravel() for row in rows], dtype=np.float64)
    tree = program.tape.result
    found = np.empty((len(leaves(tree)), given.shape[1]))
    constants = (x if isinstance(x, float) else math.nan for x in program.constants.numbers)
    refused = _loop(program.source)(*constants, given, found)
    if refused >= 0 and given.size:
        program.scalar(*given[:, refused].tolist())
    filled = iter(found)
    return transformed(lambda _: next(filled).reshape(rows[0].shape), tree)


@functools.cache
def _loop(source: str) -> Callable[..., int]:
    """Compiles the source of a scalar program as a loop over columns.

    The parameters of the loop are the constants, an array with a row per argument, and an array
    to fill with a row per result. It returns the index of the first column rejected by a guard,
    or -1.

    Raises:
        ConfigurationError: Numba is not installed.
    """
    try:
        import numba
    except ImportError:
        raise ConfigurationError(missing_library('numba')) from None
    functions: Any = ast.parse(source).body
    bind, body = functions
    *before, _ = bind.body
    *statements, result = body.body
    lines = [
        *(_statement_source('0', x) for x in before),
        'for i in range(given.shape[1]):',
        *(f'    {name.arg} = given[{n}, i]' for n, name in enumerate(body.args.args)),
        *(f'    {_statement_source("i", x)}' for x in statements),
        *(f'    found[{n}, i] = {text}' for n, text in enumerate(_number_sources(result.value))),
        'return -1',
    ]
    head = f'def loop({ast.unparse(bind.args)}, given, found):'
    space = vars(math) | {}
    exec('\n    '.join([head, *lines]), space)  # noqa: S102
    return numba.njit(space['loop'], error_model='numpy')  # type: ignore[no-any-return]


def _statement_source(column: str, statement: ast.stmt) -> str:
    """Returns the source of a statement; a guard becomes a return of the rejected column."""
    return re.sub(r'\n +.*', f' return {column}', ast.unparse(statement))


def _number_sources(tree: ast.expr) -> list[str]:
    """Returns the source of each number in a nested result."""
    if isinstance(tree, ast.Call) and isinstance(tree.args[0], ast.Tuple):  # a named tuple
        tree = tree.args[0]
    if isinstance(tree, ast.Tuple):
        return [text for part in tree.elts for text in _number_sources(part)]
    return [ast.unparse(tree)]
