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

# A spline minimizes the integral over time of a squared derivative: of the second one for a cubic,
# of the third one for a quintic. Half this integral is called energy here. Over a polynomial of
# length 1, it is a quadratic form of the slopes (the rate and, for a quintic, the acceleration) at
# the start, those at the end, and the rise. Each row has the factors of these in the derivative of
# the energy with respect to one of the slopes. The keys are the numbers of slopes at a point.
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
# Twice the coefficients of s^2 and s^3, or of s^3 to s^5, of a polynomial of length 1. Each row is
# multiplied by the rise, the slopes at the start and those at the end.
_COEFFICIENTS = {
    1: ((6, -4, -2), (-4, 2, 2)),
    2: ((20, -12, -3, -8, 1), (-30, 16, 3, 14, -2), (12, -6, -1, -6, 1)),
}
# Rates and, for a quintic, accelerations at a point.
_Slopes: TypeAlias = tuple[Decimal, ...]
_Matrix: TypeAlias = dict[int, dict[int, Decimal]]  # entries by row and column


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
        points = [*map(Decimal, angles)]
        turns = None
        if repeat:
            turns = round((points[-1] - points[0]) / _TURN)
            points[-1] = points[0] + turns * _TURN
        lengths = [Decimal(end - begin) / NS_PER_S for begin, end in pairwise(times)]
        rises = [end - begin for begin, end in pairwise(points)]
        if slopes is not None:
            at_points = [tuple(map(Decimal, each)) for each in slopes]
        else:
            zero = (0.0,) if cubic else (0.0, 0.0)
            ends = None if repeat else (start or zero, zero)
            pieces = [*zip(lengths, rises, strict=True)]
            at_points = _smooth(pieces, len(zero), ends)
        rows = [*map(_row, points, lengths, rises, at_points, at_points[1:])]
        ends_at_rest = not at_points[-1][0]
        if ends_at_rest and not repeat:
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
    start = moment.rate, moment.acceleration
    if slopes is None:
        return interpolated((0, *times), (moment.angle, *angles), start=start)
    first = times[0]
    from_first = interpolated([time - first for time in times], angles, slopes)
    at_first = slopes[0][0], from_first.at(0).acceleration
    to_first = interpolated((0, first), (moment.angle, angles[0]), [start, at_first])
    return Spline((0, *times), (*to_first.rows[:1], *from_first.rows))


def _row(
    angle: Decimal, length: Decimal, rise: Decimal, start: _Slopes, end: _Slopes
) -> tuple[float, ...]:
    """Returns the coefficients of the polynomial with given rise and slopes at both ends."""
    count = len(start)  # of slopes at a point
    # For a length of 1, a slope is multiplied by length^order; order 1 is the rate.
    start_scaled = [slope * length**order for order, slope in enumerate(start, 1)]
    end_scaled = [slope * length**order for order, slope in enumerate(end, 1)]
    values = [rise, *start_scaled, *end_scaled]
    rate, *acceleration = start
    coefficients = [angle, rate, *(x / 2 for x in acceleration)]
    for power, factors in enumerate(_COEFFICIENTS[count], count + 1):
        doubled = sum(map(operator.mul, factors, values), Decimal())
        coefficients.append(doubled / (2 * length**power))
    return tuple(map(float, coefficients))


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
    known = dict[int, Decimal]()
    if ends is not None:
        first_slopes, last_slopes = ends
        known |= {n: Decimal(x) for n, x in enumerate(first_slopes)}
        known |= {last * size + n: Decimal(x) for n, x in enumerate(last_slopes)}
    slopes = known | _solved(*_system(pieces, size, count, known))
    # A periodic spline has the slopes of the first point at the last.
    return [tuple(slopes[(i * size + n) % count] for n in range(size)) for i in range(last + 1)]


def _system(
    pieces: Sequence[tuple[Decimal, Decimal]], size: int, count: int, known: dict[int, Decimal]
) -> tuple[_Matrix, dict[int, Decimal]]:
    """Returns matrix and right-hand side for the slopes that are not known; see `_smooth`.

    Each row sets the derivative of the spline's energy with respect to a slope to 0. The slopes of
    all points are numbered, modulo `count`.
    """
    matrix: _Matrix = defaultdict(lambda: defaultdict(Decimal))
    right: dict[int, Decimal] = defaultdict(Decimal)
    orders = 2 * [*range(1, size + 1)]  # of the derivatives at start and end; 1 is the rate
    for i, (length, rise) in enumerate(pieces):
        numbers = [(i * size + n) % count for n in range(2 * size)]  # of the slopes
        # The energy is that for a length of 1, for which slopes are multiplied by length^order,
        # times `energy_scale`.
        energy_scale = 1 / length ** (2 * size + 1)
        powers = accumulate([length] * (2 * size), operator.mul, initial=energy_scale)
        scales = [*powers]  # energy_scale * length^0, 1, ..., 2 size
        for row, order, factors in zip(numbers, orders, _ENERGY[size], strict=True):
            if row in known:
                continue
            *of_slopes, of_rise = factors
            right[row] -= of_rise * rise * scales[order]
            for column, other_order, factor in zip(numbers, orders, of_slopes, strict=True):
                entry = factor * scales[order + other_order]
                if column in known:
                    right[row] -= entry * known[column]
                else:
                    matrix[row][column] += entry
    return matrix, right


def _solved(matrix: _Matrix, right: dict[int, Decimal]) -> dict[int, Decimal]:
    """Solves a symmetric positive definite system by elimination; changes its arguments."""
    order = sorted(matrix)
    for k in order:
        pivot = matrix[k][k]
        later = {column: entry for column, entry in matrix[k].items() if column > k}
        for row, entry in later.items():  # by symmetry, also the entry of column k in this row
            share = entry / pivot
            for column, value in later.items():
                matrix[row][column] -= share * value
            right[row] -= share * right[k]
    solution = dict[int, Decimal]()
    for row in reversed(order):
        for column, entry in matrix[row].items():
            if column > row:
                right[row] -= entry * solution[column]
        solution[row] = right[row] / matrix[row][row]
    return solution
