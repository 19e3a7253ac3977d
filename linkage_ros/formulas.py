# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Functions for formulas of floats, arrays and symbolic numbers (`mechanism/tracer`).

Public: other packages may import this module.

Terms that a mechanism does not have are `ZERO`. They drop out of sums, and their products are
`ZERO`.
"""

import functools
import math
import operator
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple, NoReturn

import numpy as np

from linkage_ros.numeric import Array as Array
from linkage_ros.numeric import Real as Real


class _Zero:
    """A zero for absent terms: x + ZERO is x itself, and ZERO * x is ZERO.

    Unlike 0.0, it is recognised when a formula is recorded, so that the program omits the term.
    """

    __array_ufunc__ = None

    def __repr__(self) -> str:
        return 'ZERO'

    def __bool__(self) -> bool:
        return False

    def __float__(self) -> float:
        return 0.0

    def __neg__(self) -> '_Zero':
        return self

    def __sub__(self, other: Real) -> Real:
        return -other

    def __mul__(self, other: Real) -> '_Zero':
        return self

    def __add__(self, other: Real) -> Real:
        return other

    def __abs__(self) -> '_Zero':
        return self

    def __truediv__(self, other: Real) -> '_Zero':
        return other.__rtruediv__(self) if other is self else self

    def __rtruediv__(self, other: Real) -> NoReturn:
        raise ZeroDivisionError('a formula divides by a constant of 0')

    __radd__ = __rsub__ = __add__
    __rmul__ = __mul__


for _compare in (operator.lt, operator.le, operator.gt, operator.ge):
    setattr(_Zero, f'__{_compare.__name__}__', lambda _, other, f=_compare: f(0.0, other))


ZERO = _Zero()


def total(terms: Iterable[Real]) -> Real:
    """Returns the sum of the terms, added from left to right; ZERO if there are none.

    The built-in `sum` starts from 0 and, from Python 3.12 on, compensates rounding errors.
    """
    return functools.reduce(operator.add, terms, ZERO)


def number(value: Real) -> Real:
    """Replaces ZERO with 0.0; returns any other value unchanged."""
    return 0.0 if value is ZERO else value


def sin(angle: Real) -> Real:
    """Returns the sine of an angle, rad."""
    return _apply('sin', math.sin, np.sin, angle)


def cos(angle: Real) -> Real:
    """Returns the cosine of an angle, rad."""
    return _apply('cos', math.cos, np.cos, angle)


def sqrt(square: Real) -> Real:
    """Returns the square root; the caller must ensure that the argument is not negative."""
    return _apply('sqrt', math.sqrt, np.sqrt, square)


def exp(value: Real) -> Real:
    """Returns the exponential function."""
    return _apply('exp', math.exp, np.exp, value)


def expm1(value: Real) -> Real:
    """Returns the exponential function minus 1, with all digits also near 0."""
    return _apply('expm1', math.expm1, np.expm1, value)


def log(value: Real) -> Real:
    """Returns the natural logarithm; the caller must ensure that the argument is positive."""
    return _apply('log', math.log, np.log, value)


def log1p(value: Real) -> Real:
    """Returns the natural logarithm of 1 + value, with all digits also near 0."""
    return _apply('log1p', math.log1p, np.log1p, value)


def atan2(y: Real, x: Real) -> Real:
    """Returns the direction of (x, y), rad in [-pi, pi]."""
    return _apply('atan2', math.atan2, np.arctan2, y, x)


def rint(value: Real) -> Real:
    """Rounds to the nearest integer, and half-way cases to the even one."""
    return _apply('rint', round, np.rint, value)


def is_finite(*values: Real) -> Any:
    """Returns the condition that all values are finite.

    A program omits values whose finiteness is implied by that of another value.
    """
    recorded = next((x for x in values if hasattr(x, 'tape')), None)
    if recorded is not None:
        values = recorded.tape.without_implied(values)
    # inf - inf is NaN, for which every comparison is false.
    return number(total(value - value for value in values)) >= 0.0


def where(condition: Any, then: Real, otherwise: Real) -> Real:
    """Selects one of two values, both of which are computed and must be finite.

    Args:
        condition: Result of a comparison.
        then: Value where the condition is true.
        otherwise: Value where the condition is false.

    Returns:
        The selected value, or an array of selected values.
    """
    then, otherwise = number(then), number(otherwise)
    if hasattr(condition, 'tape'):
        return condition.tape.record('where', condition, then, otherwise)
    if isinstance(condition, np.ndarray):
        return np.where(condition, then, otherwise)
    return then if condition else otherwise


def require(condition: Any, refuse: Callable[..., object] | None, *values: Real) -> None:
    """Guards the rest of a formula with a condition.

    Args:
        condition: Result of a comparison, which must be true for all elements of arrays.
        refuse: Function that raises an error, called if the condition is false; None for no guard.
        *values: Arguments for `refuse`; from arrays, the first elements for which the condition
            is false.
    """
    if refuse is None:
        return
    recorded = next((x for x in (condition, refuse) if hasattr(x, 'tape')), None)
    if recorded is not None:
        recorded.tape.record('require', condition, refuse, *values)
    elif not (condition if type(condition) is bool else condition.all()):
        holds, *elements = np.broadcast_arrays(condition, *values)
        first = np.flatnonzero(np.logical_not(holds))[0]
        refuse(*(float(value.flat[first]) for value in elements))


class Opaque:
    """A function that a program calls at run time, such as a table look-up or an error function.

    The operations of all other functions in a formula are recorded.

    Attributes:
        function: The function to call.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self.function = function

    def __call__(self, *values: Any) -> Any:
        """Calls the function."""
        return self.function(*values)


class Vector(NamedTuple):
    """A vector in the plane.

    Attributes:
        x: Component along the x axis.
        y: Component along the y axis.
    """

    x: Real
    y: Real

    def __add__(self, other: 'Vector') -> 'Vector':  # type: ignore[override]
        return Vector(self.x + other.x, self.y + other.y)

    def __sub__(self, other: 'Vector') -> 'Vector':
        return Vector(self.x - other.x, self.y - other.y)

    def __neg__(self) -> 'Vector':
        return Vector(-self.x, -self.y)

    def __mul__(self, factor: Real) -> 'Vector':
        return Vector(self.x * factor, self.y * factor)

    @classmethod
    def at(cls, angle: Real) -> 'Vector':
        """Returns the unit vector at an angle, rad, from the x axis."""
        return cls(cos(angle), sin(angle))

    def left(self) -> 'Vector':
        """Returns the vector rotated by 90 degrees, counter-clockwise."""
        return Vector(-self.y, self.x)


def dot(u: Vector, v: Vector) -> Real:
    """Returns the scalar product."""
    return u.x * v.x + u.y * v.y


def cross(u: Vector, v: Vector) -> Real:
    """Returns the z component of the cross product."""
    return u.x * v.y - u.y * v.x


def turned(vector: Vector, cos: Real, sin: Real) -> Vector:
    """Rotates a vector by the angle of (cos, sin), and scales it by the length of (cos, sin)."""
    return Vector(vector.x * cos - vector.y * sin, vector.x * sin + vector.y * cos)


def _apply(
    name: str, scalar: Callable[..., float], array: Callable[..., Real], *values: Real
) -> Real:
    for value in values:
        if hasattr(value, 'tape'):
            return value.tape.record(name, *values)
    values = tuple(map(number, values))
    return (scalar if all(isinstance(value, float) for value in values) else array)(*values)
