# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Columns of forces that are infinite at change points, or missing where friction locks."""

from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np

from linkage_ros import Solver, UnreachableError
from linkage_ros.formulas import Array

SAME = 1e-9  # rad; closer crank angles are the two sides of a corner, jump or change point
_IN_LINE = 1e-6  # sine of an angle between links that are in line, within 1 ns of a law
# Distances from a gap, rad: friction may change within the large ones, and rounding errors grow
# towards it. At each, a limit is extrapolated from the values at one, two and three times the
# distance, with these weights. Least such distances in time, s.
_STEPS, _LIMIT = np.array([1e-4, 1e-5, 1e-6, 1e-7, 1e-8]), np.array([3.0, -3.0, 1.0])
_LEAST_TIMES = [1e-6, *[1e-7] * 4]
_GROWS = 1.5  # a column at a distance, relative to that at twice the distance, if it is infinite
_ROUNDING = 1e-12  # smaller values, relative to the largest, are rounding errors


class Column(NamedTuple):
    """A quantity over the period: its SI unit, and its values at the crank angles."""

    unit: str
    values: Array


def beside_change_points(solver: Solver, crank: Any) -> Any:
    """Moves crank angles at change points aside, rad, where joints with friction have forces."""
    reach = solver.reach
    if not (solver.model.joint_loads and reach.has_change_point):
        return crank
    sine, cosine = np.sin(crank - reach.fast), np.cos(crank - reach.fast)
    # Each angle moves away from the change point, on its own side.
    aside = np.where((sine >= 0) == (cosine > 0), SAME, -SAME)
    return crank + np.where(np.abs(sine) < SAME, aside, 0.0)


def at_change_points(solver: Solver, crank: Array, speed: Array) -> Any:
    """Returns whether each crank angle, rad, is that of a change point.

    Along a law, a time has a resolution of 1 ns, hence the crank's speed, rad/s.
    """
    reach, is_in_line = solver.mobility, np.zeros(len(crank), dtype=bool)
    if reach is None or not reach.has_change_point:
        return is_in_line
    close = SAME * np.maximum(1.0, np.abs(speed))
    # Change points are at the angle `fast` or half a turn away, but not always at both.
    for i in np.flatnonzero(np.abs(np.sin(crank - reach.fast)) <= close):
        is_in_line[i] = abs(solver.dyad_sines((float(crank[i]), 0.0))[0].sine) < _IN_LINE
    return is_in_line


def around_gaps(
    columns: Callable[[Array], Mapping[str, Column]], x: Array, is_in_line: Any, speed: float
) -> tuple[dict[str, Column], Any]:
    """Computes columns that may have no value at some places.

    Args:
        columns: Function that computes the columns at places of shape (k,). It raises
            `UnreachableError` if one of the places has none.
        x: Increasing places, rad or s, shape (n,).
        is_in_line: Whether each place is at a change point, shape (n,). If no place is, all
            places must have values.
        speed: Largest crank speed if the places are times, rad/s; otherwise 0.

    Returns:
        The columns at all places, and whether each place is a gap, where they have no value. At a
        gap, a column has its limit, which is infinite if it grows without bound.

    Raises:
        UnreachableError: The columns have no value at a place without change points.
    """
    if not is_in_line.any():
        return dict(columns(x)), is_in_line
    valid, valid_columns = _possible(columns, x, np.flatnonzero(~is_in_line))
    is_gap = np.ones(len(x), dtype=bool)
    is_gap[valid] = False
    side, has_limit = _sides(x, is_gap)
    places = x[is_gap] + _distances(speed) * side  # shape (distances, 3, gaps)
    beside = _values_at(columns, valid_columns, places, has_limit)
    largest = max(np.nan_to_num(np.abs(values[-1])).max() for values in beside.values())
    # The nearest valid place on the side of the limit, or on the other if that has none.
    neighbor = np.searchsorted(valid, np.flatnonzero(is_gap)) - (side < 0)
    neighbor = np.clip(neighbor, 0, len(valid) - 1)
    filled = dict[str, Column]()
    for name, (unit, values) in valid_columns.items():
        all_values = np.empty(len(x))
        all_values[valid] = values
        all_values[is_gap] = _at_gaps(beside[name], values[neighbor], _ROUNDING * largest)
        filled[name] = Column(unit, all_values)
    return filled, is_gap


def _sides(x: Array, is_gap: Any) -> tuple[Array, Any]:
    """Chooses the side of each gap from which its limit is taken.

    Returns:
        1.0 for the right side, -1.0 for the left side; and whether a limit exists. It exists at a
        change point, which has one place on each side, and at an end. Other gaps are where
        friction locks the mechanism.
    """
    is_second = np.diff(x, prepend=x[0]) < SAME
    is_first = np.diff(x, append=x[-1]) < SAME
    follows_values = np.append(False, ~is_gap[:-1])
    precedes_values = np.append(~is_gap[1:], False)
    is_right = is_second | (precedes_values & ~follows_values)
    return np.where(is_right, 1.0, -1.0)[is_gap], (is_first | is_second)[is_gap]


def _distances(speed: float) -> Array:
    """Returns one, two and three times each distance from a gap, shape (distances, 3, 1).

    Args:
        speed: Largest crank speed if the distances are times, rad/s; otherwise 0.
    """
    steps = np.unique(np.maximum(_STEPS / speed, _LEAST_TIMES))[::-1] if speed else _STEPS
    distances: Array = steps[:, None] * np.arange(1.0, 1.0 + len(_LIMIT))
    return distances[:, :, None]


def _at_gaps(beside: Array, neighbor: Array, least: float) -> Array:
    """Extrapolates a column to gaps, from the distance at which its limit changes least.

    Args:
        beside: Values beside the gaps at one, two and three times each distance, the smallest
            distance last, shape (distances, 3, gaps).
        neighbor: Value at the nearest place with values. Infinity has its sign where no value
            beside the gap exists.
        least: Values below it are rounding errors.

    Returns:
        The limit at each gap, or infinity where there is none.
    """
    near, far, _ = beside[-1]
    grows = ~(np.abs(near) <= np.maximum(_GROWS * np.abs(far), least))
    limits = np.einsum('j,ijk->ik', _LIMIT, beside)
    changes = np.nan_to_num(np.abs(np.diff(limits, axis=0)), nan=np.inf)
    best = 1 + changes.argmin(axis=0)
    limit = np.take_along_axis(limits, best[None], axis=0)[0]
    infinite = np.copysign(np.inf, np.where(np.isnan(near), neighbor, near))
    return np.where(grows | ~np.isfinite(limit), infinite, limit)


def _possible(
    columns: Callable[[Array], Mapping[str, Column]], x: Array, wanted: Any
) -> tuple[Any, Mapping[str, Column]]:
    """Returns the indices of the wanted places that have values, and the columns there.

    Raises:
        UnreachableError: No place has values.
    """
    try:
        return wanted, columns(x[wanted])
    except UnreachableError:
        valid = _bisected(columns, x, wanted)
        if not valid.size:
            raise
        return valid, columns(x[valid])


def _bisected(columns: Callable[[Array], Mapping[str, Column]], x: Array, wanted: Any) -> Any:
    """Finds the indices of the wanted places that have values, by halving parts without."""
    valid, parts = list[int](), [wanted]
    while parts:
        part = parts.pop()
        try:
            columns(x[part])
        except UnreachableError:
            if len(part) > 1:
                parts += np.array_split(part, 2)
        else:
            valid += part.tolist()
    return np.array(sorted(valid), dtype=int)


def _values_at(
    columns: Callable[[Array], Mapping[str, Column]],
    names: Iterable[str],
    places: Array,
    is_wanted: Any,
) -> dict[str, Array]:
    """Computes the values of columns at the wanted places; NaN at others and where none exist.

    Args:
        columns: Function that computes the columns at places of shape (k,).
        names: Names of the columns.
        places: The places, of any shape.
        is_wanted: Whether each place is wanted, in a shape that can be broadcast to that of the
            places.

    Returns:
        The values of each column, in the shape of the places.
    """
    values = {name: np.full(places.shape, np.nan) for name in names}
    wanted = np.flatnonzero(np.broadcast_to(is_wanted, places.shape))
    with suppress(UnreachableError):
        valid, valid_columns = _possible(columns, places.ravel(), wanted)
        for name, column in valid_columns.items():
            values[name].flat[valid] = column.values
    return values
