# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The vocabulary of the formulas: they run on floats, on arrays and on recording numbers.

A term that a mechanism does not have is None, and formulas leave it out: `total`, `difference`
and `times` do so.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from linkage_ros.numeric import Real


def sin(angle: Real) -> Real:
    """Sine of an angle, rad."""
    return _apply('sin', math.sin, np.sin, angle)


def cos(angle: Real) -> Real:
    """Cosine of an angle, rad."""
    return _apply('cos', math.cos, np.cos, angle)


def sqrt(square: Real) -> Real:
    """Square root; the caller requires that the square is not negative."""
    return _apply('sqrt', math.sqrt, np.sqrt, square)


def atan2(y: Real, x: Real) -> Real:
    """Direction of (x, y), rad, in [-pi, pi]."""
    return _apply('atan2', math.atan2, np.arctan2, y, x)


def is_finite(*values: Real) -> Any:
    """Whether a sum of values is finite, and with it each of them, as a condition."""
    value = total(*values)
    return value - value >= 0.0  # inf - inf is not a number, for which no comparison holds


def where(condition: Any, then: Real, otherwise: Real) -> Real:
    """One of two values, both of which must be finite.

    Args:
        condition: A comparison of values.
        then: The result where it holds.
        otherwise: The result elsewhere.

    Returns:
        The value.
    """
    if hasattr(condition, 'apply'):
        return condition.apply('where', condition, then, otherwise)
    if isinstance(condition, np.ndarray):
        return np.where(condition, then, otherwise)
    return then if condition else otherwise


def require(condition: Any, refuse: Callable[..., object], *values: Real) -> None:
    """Guards the formulas that follow.

    Args:
        condition: Must hold everywhere.
        refuse: Called where it does not; raises an error that says what to do.
        *values: Its arguments; of arrays, the first values at which the condition fails.
    """
    recorded = next((x for x in (condition, refuse) if hasattr(x, 'apply')), None)
    if recorded is not None:
        recorded.apply('require', condition, refuse, *values)
    elif not np.all(condition):
        holds, *found = np.broadcast_arrays(condition, *values)
        first = np.flatnonzero(np.logical_not(holds))[0]
        refuse(*(float(value.flat[first]) for value in found))


class Opaque:
    """A function that a program calls as it is, such as a table or a refusal.

    Other functions that a formula calls become part of the program.

    Attributes:
        function: What is called.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self.function = function

    def __call__(self, *values: Any) -> Any:
        """Calls the function."""
        return self.function(*values)


def total(*terms: Real | None) -> Real:
    """The sum of the terms that are there, from left to right; None if there is none."""
    present = [term for term in terms if term is not None]
    if not present:
        return None
    result, *others = present
    for term in others:
        result = result + term
    return result


def difference(first: Real | None, second: Real | None) -> Real:
    """First - second, for the terms that are there; None if there is none."""
    if second is None:
        return first
    return -second if first is None else first - second


def times(*factors: Real | None) -> Real:
    """The product, from left to right; None if a factor is not there."""
    result: Real = 1
    for factor in factors:
        result = None if result is None or factor is None else result * factor
    return result


class Vector(NamedTuple):
    """A vector in the plane.

    Attributes:
        x: Along the x axis.
        y: Along the y axis.
    """

    x: Real
    y: Real

    def __add__(self, other: Vector) -> Vector:  # type: ignore[override]
        return Vector(self.x + other.x, self.y + other.y)

    def __sub__(self, other: Vector) -> Vector:
        return Vector(self.x - other.x, self.y - other.y)

    def __neg__(self) -> Vector:
        return Vector(-self.x, -self.y)

    def __mul__(self, factor: Real) -> Vector:
        return Vector(self.x * factor, self.y * factor)

    @classmethod
    def at(cls, angle: Real) -> Vector:
        """The unit vector in a direction, rad."""
        return cls(cos(angle), sin(angle))

    def left(self) -> Vector:
        """The vector turned by 90 degrees, counter-clockwise."""
        return Vector(-self.y, self.x)


def dot(u: Vector, v: Vector) -> Real:
    """Scalar product."""
    return u.x * v.x + u.y * v.y


def cross(u: Vector, v: Vector) -> Real:
    """The z component of the cross product."""
    return u.x * v.y - u.y * v.x


def _apply(
    name: str, scalar: Callable[..., float], array: Callable[..., Real], *values: Real
) -> Real:
    for value in values:
        if hasattr(value, 'apply'):
            return value.apply(name, *values)
    if all(isinstance(value, float) for value in values):
        return scalar(*values)
    return array(*values)
