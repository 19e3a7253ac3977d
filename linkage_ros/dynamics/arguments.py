# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Checks of the arguments that the solver and the equations of motion take."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Set
from contextlib import suppress
from itertools import chain
from math import isfinite
from typing import Any

import numpy as np

from linkage_ros.dynamics.state import State
from linkage_ros.errors import ConfigurationError
from linkage_ros.mechanisms.links import PerCoordinate
from linkage_ros.numeric import Real, real_numbers, require_finite
from linkage_ros.quantities import shown

# What coordinates, rates and accelerations are called in errors.
_NAMES = (
    ('crank_angle', 'slider_position'),
    ('crank_speed', 'slider_speed'),
    ('crank_acceleration', 'slider_acceleration'),
)


def checked(
    coordinates: tuple[str, ...], *rows: PerCoordinate, torque: Real = 0.0
) -> tuple[Any, ...]:
    """Checks coordinates, rates, accelerations and a torque; floats pass as they are.

    Args:
        coordinates: Names of the coordinates.
        *rows: Coordinates, their rates and their accelerations, in this order; the last may be
            left out.
        torque: N m.

    Returns:
        The rows as tuples of floats or arrays of floats, then the torque.

    Raises:
        ConfigurationError: A value is not a finite real number or an array of them, a row has
            not one value for each coordinate, or the shapes do not broadcast.
    """
    count = len(coordinates)
    # This comes before every step of a motion, hence the short way.
    with suppress(TypeError):
        values = (*chain(*rows), torque)
        if (
            {*map(type, values)} == {float}
            and {*map(type, rows)} == {tuple}
            and {*map(len, rows)} == {count}
            and isfinite(sum(values))
        ):
            return (*rows, torque)
    named: dict[str, object] = {'torque': torque}
    for letter, names, row in zip('qua', _NAMES, rows, strict=False):
        entries = _entries(row)
        if len(entries) != count:
            words = ', '.join(names[:count]).replace('_', ' ') + ',' * (count == 1)
            raise ConfigurationError(f'{letter} = {shown(row)}: must be a tuple ({words})')
        named.update(zip(names, entries, strict=False))
    (torque, *motion), _ = _finite(named)
    return (*(tuple(motion[i : i + count]) for i in range(0, len(motion), count)), torque)


def checked_state(links: tuple[str, ...], state: State) -> State:
    """Checks a state of a mechanism.

    Args:
        links: Names of its moving links.
        state: From its solver.

    Returns:
        The state, all floats or all arrays of one shape.

    Raises:
        ConfigurationError: It is something else, or a value is not a finite number.
    """
    count = len(links)
    rows = state[:3] if isinstance(state, State) else ()
    if not rows or any(len(_entries(row)) != count for row in rows):
        raise ConfigurationError(
            f'state = {shown(state)}: must be a State of this mechanism, from its solver'
        )
    names = [f'{link}_{field}' for field in State._fields[:3] for link in links]
    named = dict(zip((*names, 'torque'), (*chain(*rows), state.torque), strict=True))
    values, shape = _finite(named)
    *motion, torque = (np.broadcast_to(x, shape) for x in values) if shape else values
    position, velocity, acceleration = (
        tuple(motion[i : i + count]) for i in range(0, len(motion), count)
    )
    return State(position, velocity, acceleration, torque)


def _finite(named: Mapping[str, object]) -> tuple[list[Real], tuple[int, ...]]:
    values, shape = real_numbers(**named)
    require_finite(**dict(zip(named, values, strict=True)))
    return values, shape


def _entries(row: object) -> tuple[object, ...]:
    """The entries of a sequence or array; none of anything that has no order."""
    if isinstance(row, (str, bytes, Set, Mapping)) or not isinstance(row, Iterable):
        return ()
    with suppress(TypeError):  # an array without dimensions
        return tuple(row)
    return ()
