# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Compiles programs to machine code with Numba, for computing many states.

The extra `fast` installs Numba. It is imported only for a `Solver` with `compiled=True`. The first
call of each program takes about a second.
"""

import functools
import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from linkage_ros.errors import ConfigurationError, import_failure
from linkage_ros.mechanism.nested import leaves
from linkage_ros.mechanism.program import Program
from linkage_ros.mechanism.tracer import Tape
from linkage_ros.numeric import Real


class CompiledProgram(Program):
    """A program that evaluates arrays in machine code.

    The results equal those for floats, except for the last digits of functions such as the sine.
    """

    def arrays(
        self, rows: Iterable[Real], shape: tuple[int, ...], *, by_math: bool = False
    ) -> Any:
        """See `Program.arrays`. A program that calls Python functions runs without Numba.

        Raises:
            ConfigurationError: Numba is not installed.
            LinkageError: The program rejects some values; the error describes the first of them.
        """
        if by_math or self.tape.calls_functions:
            return super().arrays(rows, shape, by_math=by_math)
        given = np.array([np.broadcast_to(row, shape).ravel() for row in rows])
        found = np.empty((len(leaves(self.tape.result)), given.shape[1]))
        constants = (x if isinstance(x, float) else math.nan for x in self.constants.numbers)
        refused = _loop(self.tape)(*constants, given, found)
        if refused >= 0 and given.size:
            self.floats(*given[:, refused].tolist())
        return self.tape.shaped(*found.reshape(len(found), *shape))


@functools.cache
def _loop(tape: Tape) -> Callable[..., int]:
    """Compiles a program as a loop over columns.

    The parameters of the loop are the constants, an array with a row per argument, and an array
    to fill with a row per result. It returns the index of the first column rejected by a guard,
    or -1.

    Raises:
        ConfigurationError: Numba is not installed.
    """
    try:
        import numba
    except ImportError as error:
        raise ConfigurationError(import_failure(error)) from None
    source = tape.source('if not {0}: return i')
    lines = [
        f'def loop({", ".join([*source.constants, "given", "found"])}):',
        'i = 0',
        *source.before,
        'for i in range(given.shape[1]):',
        *(f'    {name} = given[{n}, i]' for n, name in enumerate(source.inputs)),
        *(f'    {statement}' for statement in source.within),
        *(f'    found[{n}, i] = {text}' for n, text in enumerate(leaves(source.result))),
        'return -1',
    ]
    space = vars(math) | {'rint': round}
    exec('\n    '.join(lines), space)  # noqa: S102
    return numba.njit(space['loop'], error_model='numpy')  # type: ignore[no-any-return]
