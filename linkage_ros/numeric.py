# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Arithmetic for floats and arrays: exact sums, multi-turn angles, and argument checks."""

import functools
import math
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from linkage_ros.errors import ConfigurationError
from linkage_ros.quantities import shown

# A float or an array of floats; formulas accept both. This is Any, because no type expresses that
# arithmetic on floats gives floats and on arrays gives arrays.
Real: TypeAlias = Any
Array: TypeAlias = npt.NDArray[np.float64]
# What a user may give for coordinates, their rates or a torque; see `Solver`.
Numbers: TypeAlias = float | npt.NDArray[Any] | Sequence[float | npt.NDArray[Any]]


# pi/2 and 2 pi, each as a sum of the nearest double and the remainder.
HALF_PI = (math.pi / 2, 6.123233995736766e-17)
_TWO_PI = (2 * math.pi, 2.4492935982947064e-16)
# 2 pi as a similar sum whose first term has 31 bits, so that its product with up to 4 million
# turns is exact.
_SHORT_TWO_PI = (6.2831853069365025, 2.430840202602477e-10)
TURN = Fraction(_TWO_PI[0]) + Fraction(_TWO_PI[1])


def two_sum(a: Real, b: Real) -> tuple[Real, Real]:
    """Returns the rounded sum and its rounding error, which add up to exactly a + b (Knuth)."""
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


def wrap(angle: Real, to_whole: Callable[[Real], Real] = round) -> Real:
    """Wraps an angle of a few turns to [-pi, pi], rad, without the rounding error of 2 pi.

    Args:
        angle: Angle or array of angles, rad.
        to_whole: Function that rounds to the nearest integer; use `np.rint` for arrays.

    Returns:
        The wrapped angle, rad.
    """
    turns = to_whole(angle * (1 / _TWO_PI[0]))
    return (angle - turns * _TWO_PI[0]) - turns * _TWO_PI[1]


@functools.lru_cache(maxsize=64)
def nearest_turns(angle: float) -> int:
    """Rounds an angle to the nearest whole number of turns, exactly.

    The double nearest to 3 pi is less than 3 pi, so the result is 1. In floating point, dividing
    it by 2 pi would give 1.5, which rounds to 2.

    Args:
        angle: Angle, rad.

    Returns:
        The number of turns.
    """
    return round(Fraction(angle) / TURN) if abs(angle) > 3 else 0


def within_two_turns(angle: float) -> tuple[float, int]:
    """Removes pairs of whole turns from a crank angle; states repeat after at most two turns.

    Args:
        angle: Angle, rad.

    Returns:
        The remaining angle, rad, between -2 and 2 turns and rounded once, and the number of pairs
        removed.
    """
    pairs = int(angle / (2 * _TWO_PI[0]))
    return with_turns(angle, -pairs), pairs


def with_turns(angle: float, pairs: float | Fraction) -> float:
    """Adds pairs of turns to an angle, rad, and rounds once; inverts `within_two_turns`."""
    return math.fsum((angle, *_parts_of(pairs))) if pairs else angle


@functools.lru_cache(maxsize=64)
def _parts_of(pairs: float | Fraction) -> tuple[float, ...]:
    """Converts pairs of turns to rad, as floats whose sum is exact."""
    parts, rest = [], Fraction(pairs) * 2 * TURN
    while rest:
        parts.append(float(rest))
        rest -= Fraction(parts[-1])
    return tuple(parts)


def without_turns(angle: Real, first: float, period: int = 1) -> Real:
    """Reduces an angle by whole periods to the period that starts at `first`.

    Args:
        angle: Angle or array of angles, rad; results for floats and arrays are bit-identical.
        first: Angle at which the period starts, rad.
        period: Number of turns in a period.

    Returns:
        The reduced angle, rad.
    """
    floor = math.floor if isinstance(angle, float) else np.floor
    turns = floor((angle - first) * (1 / (period * _TWO_PI[0]))) * period
    return (angle - turns * _SHORT_TWO_PI[0]) - turns * _SHORT_TWO_PI[1]


def short_sum(longest: float, *terms: float) -> float:
    """Sums link lengths with a single rounding; a sum below 4 ulp of the longest becomes 0.

    Lengths entered as decimals may miss an intended equality: 0.2 + 0.3 - 0.1 - 0.4 is not 0 in
    binary. Four ulp cover the rounding errors of the four lengths.

    Args:
        longest: Longest link, m.
        *terms: Signed lengths, m.

    Returns:
        The sum, m.
    """
    total = math.fsum(terms)
    return 0.0 if is_rounding(longest, total) else total


def is_rounding(longest: float, total: float) -> bool:
    """Returns whether a sum of lengths is treated as 0: below 4 ulp of the longest length."""
    return abs(total) < 4 * math.ulp(longest)


def rounded(length: float, *, up: bool) -> str:
    """Formats a limit of a length with six digits, rounded to the valid side.

    Args:
        length: The limit, m.
        up: Whether to round up, as required for a lower limit; otherwise, rounds down.

    Returns:
        The formatted limit.
    """
    text = f'{length:.6g}'
    gap = length - float(text) if up else float(text) - length
    if length <= 0 or gap <= 0 or is_rounding(length, gap):
        return text
    unit = 10.0 ** (math.floor(math.log10(length)) - 5)
    return f'{float(text) + (unit if up else -unit):.6g}'


def signs_around(values: Array) -> Array:
    """Returns the sign of each value around a period; that of a zero is the sign before it.

    Each change of sign is then between two neighbours, even if one of them is 0.

    Args:
        values: Values over one period in the last axis; the first follows the last.

    Returns:
        The signs, 1.0 or -1.0, or 0.0 if all values of a row are 0; of the shape of the values.
    """
    signs, count = np.sign(values), np.shape(values)[-1]
    if signs.all():
        return np.asarray(signs)
    twice = np.concatenate([signs, signs], axis=-1)
    latest = np.maximum.accumulate(np.where(twice != 0, np.arange(2 * count), 0), axis=-1)
    return np.asarray(np.take_along_axis(twice, latest[..., count:], axis=-1))


def require_finite(**named: Real) -> None:
    """Raises unless every value is finite.

    Args:
        **named: Floats or arrays, by their names in error messages, with _ for spaces.

    Raises:
        ConfigurationError: A value is not finite.
    """
    for name, values in named.items():
        for bad in np.extract(~np.isfinite(values), values)[:1]:
            words = name.replace('_', ' ')
            raise ConfigurationError(f'{words} = {bad}: must be a finite number')


def real_numbers(
    names: Sequence[str], values: Sequence[object]
) -> tuple[list[Real], tuple[int, ...] | None]:
    """Converts arguments to floats or arrays of floats.

    Args:
        names: Names of the values in error messages, with _ for spaces.
        values: Numbers, arrays or nested sequences of numbers.

    Returns:
        A float or an array of floats for each value, and the shape to which the arrays broadcast;
        None if all values are single numbers.

    Raises:
        ConfigurationError: A value is not a real number, or the shapes do not broadcast.
    """
    numbers = [*map(_number, names, values)]
    shapes = {x.shape for x in numbers if type(x) is not float}
    if len(shapes) < 2:
        return numbers, next(iter(shapes), None)
    try:
        return numbers, np.broadcast_shapes(*shapes)
    except ValueError:
        words = ', '.join(
            f'{name.replace("_", " ")} {np.shape(x)}'
            for name, x in zip(names, numbers, strict=True)
            if np.shape(x)
        )
        raise ConfigurationError(
            f'the shapes of {words} do not broadcast: give one shape for all, or single numbers'
        ) from None


_SINGLE = float, int, np.floating, np.integer


def single_numbers(*values: Any) -> list[float]:
    """Returns numbers and tuples of one number as floats; empty if a value is neither."""
    if type(values[0]) is np.ndarray:
        return []
    row = [x[0] if type(x) is tuple and len(x) == 1 else x for x in values]
    try:
        floats = [float(x) for x in row if isinstance(x, _SINGLE) and not isinstance(x, bool)]
    except OverflowError:  # 10**400
        return []
    return floats if len(floats) == len(values) else []


def _number(name: str, value: object) -> Real:
    """Converts a single number to a float, and an array or a nested sequence to an array.

    Raises:
        ConfigurationError: The value is not a real number, or is a masked array.
    """
    if type(value) is np.ndarray and value.dtype.char == 'd':
        return value
    try:
        if isinstance(value, _SINGLE) and not isinstance(value, bool):
            return float(value)
        array = np.asarray(value)
        if array.dtype.kind in 'iufO' and not isinstance(value, np.ma.MaskedArray):
            return np.asarray(array, dtype=np.float64) if array.ndim else float(array)
    except (TypeError, ValueError, OverflowError):
        pass
    if isinstance(value, np.ma.MaskedArray):
        raise ConfigurationError(
            f'{name.replace("_", " ")} is a masked array, whose mask would be lost: give its '
            'compressed() or filled() values'
        )
    raise ConfigurationError(
        f'{name.replace("_", " ")} = {shown(value)}: must be a finite number, or an array of them'
    )
