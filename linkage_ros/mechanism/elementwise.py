# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Functions of `math` for arrays, and noise that shows the effect of rounding errors.

NumPy's sine may differ from that of `math` in the last bit, and that of `math` differs between
processors with and without fused multiply-add. All later rounding errors then differ.
"""

import math
import random
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

import numpy as np

from linkage_ros.numeric import Real

SCALAR: dict[str, Callable[..., float]] = {
    'sin': math.sin, 'cos': math.cos, 'atan2': math.atan2, 'exp': math.exp, 'log': math.log,
    'expm1': math.expm1, 'log1p': math.log1p,
}  # fmt: skip
# Factors of the noise, if any, for the calls of this thread.
_factors: ContextVar[Iterator[float] | None] = ContextVar('factors', default=None)


@contextmanager
def noise(size: float, seed: int) -> Iterator[None]:
    """Multiplies every term of the programs run by `math` by 1 + size or 1 - size, at random."""
    signs = random.Random(seed)
    before = _factors.set(iter(lambda: 1.0 + signs.choice((-size, size)), None))
    try:
        yield
    finally:
        _factors.reset(before)


def is_noisy() -> bool:
    """Returns whether programs are run with noise."""
    return _factors.get() is not None


def noisy(value: Real) -> Real:
    """Adds noise to a value; without `noise`, returns the value."""
    factors = _factors.get()
    return value if factors is None else value * next(factors)


def by_element(function: Callable[..., float]) -> Callable[..., Real]:
    """Extends a function of floats to arrays by calling it for each element."""

    def apply(*values: Real) -> Real:
        if not any(isinstance(x, np.ndarray) for x in values):
            return function(*values)
        rows = np.broadcast_arrays(*values)
        results = np.fromiter(map(function, *(row.ravel().tolist() for row in rows)), float)
        return results.reshape(rows[0].shape)

    return apply
