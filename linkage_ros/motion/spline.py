# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Computes the polynomials of a law of motion through points.

They are computed in 50 decimal digits and rounded once, so that all machines find the same
coefficients.
"""

import operator
from collections import defaultdict
from collections.abc import Sequence
from decimal import Context, Decimal, localcontext
from itertools import accumulate, pairwise
from typing import TypeAlias

from linkage_ros.motion.law import Moment, Spline
from linkage_ros.numeric import TURN
from linkage_ros.units import NS_PER_S

_EXACT = Context(prec=50)
_TURN = Decimal(TURN.numerator) / Decimal(TURN.denominator)

# Second derivatives of the energy of a polynomial of length 1 by its rates at both ends or, for a
# quintic, by rate and acceleration at its start, then at its end; and by its rise. A cubic spline
# has the least integral of the squared second derivative, a quintic spline that of the third. The
# keys are the numbers of slopes at a point.
_ENERGY = {
    1: (
        (4, 2, -6),
        (2, 4, -6),
    ),
    2: (
        (192, 36, 168, -24, -360),
        (36, 9, 24, -3, -60),
        (168, 24, 192, -36, -360),
        (-24, -3, -36, 9, 60),
    ),
}  # fmt: skip
# Coefficients of s^2 and s^3, or of s^3 to s^5, of a polynomial of length 1, by its rise; then as
# above. They are doubled.
_ROWS = {
    1: ((6, -4, -2), (-4, 2, 2)),
    2: ((20, -12, -3, -8, 1), (-30, 16, 3, 14, -2), (12, -6, -1, -6, 1)),
}
# Rates and, for a quintic, accelerations at a point.
_Slopes: TypeAlias = tuple[Decimal, ...]


def interpolated(
    times: Sequence[int],
    angles: Sequence[float],
    slopes: Sequence[Sequence[float]] | None = None,
    *,
    cubic: bool = False,
    repeat: bool = False,
    start: Sequence[float] = (),
) -> Spline:
    """Computes a law through points.

    Args:
        times: Times of the points, ns, increasing from 0.
        angles: Angles at the points, rad. If the law repeats, the last one is made to differ from
            the first one by whole turns.
        slopes: Rates, rad/s, or rates and accelerations, rad/s^2, at each point, for a cubic or
            quintic polynomial between adjacent points; None for a spline.
        cubic: Whether the spline is cubic and has continuous accelerations. Otherwise, it is
            quintic and has two more continuous derivatives.
        repeat: Whether the law repeats after the last point. A spline is then periodic. Otherwise,
            its rates and accelerations are 0 at both ends; for a cubic spline, only its rates.
        start: Rate and acceleration at the start; 0 if empty.

    Returns:
        The law.
    """
    with localcontext(_EXACT):
        given = [*map(Decimal, angles)]
        turns = round((given[-1] - given[0]) / _TURN) if repeat else None
        if turns is not None:
            given[-1] = given[0] + turns * _TURN
        pieces = [
            (Decimal(end - begin) / NS_PER_S, rise)
            for (begin, end), rise in zip(pairwise(times), _steps(given), strict=True)
        ]
        if slopes is not None:
            found = [tuple(map(Decimal, each)) for each in slopes]
        else:
            zero = (0.0,) if cubic else (0.0, 0.0)
            ends = None if repeat else (start or zero, zero)
            found = _smooth(pieces, len(zero), ends)
        rows = [
            _row(angle, *piece, *sides)
            for angle, piece, sides in zip(given, pieces, pairwise(found), strict=False)
        ]
        if not repeat and not found[-1][0]:
            rows.append((angles[-1],))
    return Spline(tuple(times), tuple(rows), turns)


def joined(
    moment: Moment,
    times: Sequence[int],
    angles: Sequence[float],
    slopes: Sequence[Sequence[float]] | None = None,
) -> Spline:
    """Computes a law that continues the motion of a crank through points.

    Args:
        moment: The motion of the crank at t = 0.
        times: Times of the points, ns, increasing, above 0.
        angles: Angles at the points, rad, without the whole turns of the moment.
        slopes: See `interpolated`. Without them, the law is a quintic spline.

    Returns:
        The law, which begins with a quintic polynomial from the moment to the first point.
    """
    _, angle, *start = moment
    if slopes is None:
        return interpolated((0, *times), (angle, *angles), start=start)
    first = times[0]
    rest = interpolated([time - first for time in times], angles, slopes)
    ends = [start, (slopes[0][0], rest.at(0).acceleration)]
    begin = interpolated((0, first), (angle, angles[0]), ends)
    return Spline((0, *times), (*begin.rows[:1], *rest.rows))


def _steps(values: Sequence[Decimal]) -> list[Decimal]:
    return [after - before for before, after in pairwise(values)]


def _row(
    angle: Decimal, length: Decimal, rise: Decimal, start: _Slopes, end: _Slopes
) -> tuple[float, ...]:
    """Returns the coefficients of the polynomial with given rise and slopes at both ends."""
    size = len(start)
    scaled = [rise, *(x * length**n for side in (start, end) for n, x in enumerate(side, 1))]
    found = [angle, start[0], *(x / 2 for x in start[1:])]
    for n, row in enumerate(_ROWS[size], size + 1):
        found.append(sum(map(operator.mul, row, scaled), Decimal()) / (2 * length**n))
    return tuple(map(float, found))


def _smooth(
    pieces: Sequence[tuple[Decimal, Decimal]],
    size: int,
    ends: tuple[Sequence[float], Sequence[float]] | None,
) -> list[_Slopes]:
    """Solves for the slopes of a spline, which minimize its energy; see `_ENERGY`.

    The system is symmetric and positive definite, so that elimination in order is stable.

    Args:
        pieces: Length, s, and rise, rad, between adjacent points.
        size: Number of slopes at a point: 1 for a cubic, 2 for a quintic spline.
        ends: Slopes at the first and the last point; None if the spline is periodic.

    Returns:
        The slopes at each point.
    """
    last = len(pieces)
    count = (last if ends is None else last + 1) * size
    known = {}
    for first, slopes in zip((0, last * size), ends or (), strict=False):
        known.update({first + n: Decimal(x) for n, x in enumerate(slopes)})
    matrix, right = _system(pieces, size, count, known)
    order = sorted(matrix)
    for key in order:
        pivot, later = matrix[key][key], {x: y for x, y in matrix[key].items() if x > key}
        for other, entry in later.items():
            share, row = entry / pivot, matrix[other]
            for column, value in later.items():
                row[column] -= share * value
            right[other] -= share * right[key]
    for key in reversed(order):
        for other, entry in matrix[key].items():
            if other > key:
                right[key] -= entry * known[other]
        known[key] = right[key] / matrix[key][key]
    return [tuple(known[(i * size + n) % count] for n in range(size)) for i in range(last + 1)]


def _system(
    pieces: Sequence[tuple[Decimal, Decimal]], size: int, count: int, known: dict[int, Decimal]
) -> tuple[dict[int, dict[int, Decimal]], dict[int, Decimal]]:
    """Returns matrix and right-hand side for the slopes that are not known; see `_smooth`.

    The slopes of all points are numbered, modulo `count`.
    """
    matrix: dict[int, dict[int, Decimal]] = defaultdict(lambda: defaultdict(Decimal))
    right: dict[int, Decimal] = defaultdict(Decimal)
    powers = 2 * [*range(1, size + 1)]
    for i, (length, rise) in enumerate(pieces):
        keys = [(i * size + n) % count for n in range(2 * size)]
        scales = [
            *accumulate(2 * size * [length], operator.mul, initial=1 / length ** (2 * size + 1))
        ]
        for key, power, row in zip(keys, powers, _ENERGY[size], strict=True):
            if key in known:
                continue
            right[key] -= row[-1] * rise * scales[power]
            for other, second, factor in zip(keys, powers, row, strict=False):
                term = factor * scales[power + second]
                if other in known:
                    right[key] -= term * known[other]
                else:
                    matrix[key][other] += term
    return matrix, right
