# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Columns of numbers in CSV files of loads, laws and boards, whose first line names them."""

import math
from collections.abc import Collection, Sequence
from decimal import Decimal
from pathlib import Path
from typing import NamedTuple

import numpy as np

from linkage_ros.errors import printable, shortened
from linkage_ros.files import read_file
from linkage_ros.quantities import shown

_MOST_ROWS = 100_000  # millions would take gigabytes
_DEGREE = math.pi / 180


class _Column(NamedTuple):
    """The meaning of a column.

    Attributes:
        quantity: What the numbers are.
        unit: Their unit, for messages.
        factor: Factor that converts them to SI units.
    """

    quantity: str
    unit: str
    factor: float = 1.0


_COLUMNS = {
    'at': _Column('at', 'rad or m'),
    'crank_angle': _Column('crank_angle', 'rad'),
    'crank_angle_deg': _Column('crank_angle', 'deg', _DEGREE),
    'crank_angle_from_tdc_deg': _Column('crank_angle_from_tdc', 'deg', _DEGREE),
    'time': _Column('time', 's'),
    'time_ms': _Column('time', 'ms', 1e-3),
    'time_us': _Column('time', 'us', 1e-6),
    'angle': _Column('angle', 'rad'),
    'angle_deg': _Column('angle', 'deg', _DEGREE),
    'position': _Column('position', 'm'),
    'position_mm': _Column('position', 'mm', 1e-3),
    'speed': _Column('speed', 'rad/s or m/s'),
    'speed_deg': _Column('speed', 'deg/s', _DEGREE),
    'acceleration': _Column('acceleration', 'rad/s^2 or m/s^2'),
    'acceleration_deg': _Column('acceleration', 'deg/s^2', _DEGREE),
    'value': _Column('value', 'N or N m'),
    'return_value': _Column('return_value', 'N or N m'),
    'pressure': _Column('pressure', 'Pa'),
    'pressure_kpa': _Column('pressure', 'kPa', 1e3),
    'pressure_bar': _Column('pressure', 'bar', 1e5),
}


def column_names(*quantities: str) -> str:
    """Lists the columns that may hold any of some quantities, with their units."""
    return ', '.join(
        f'{name} [{column.unit}]'
        for name, column in _COLUMNS.items()
        if column.quantity in quantities
    )


class Place(NamedTuple):
    """A column of a file.

    Attributes:
        at: Index of the column.
        factor: Factor that converts its numbers to SI units.
    """

    at: int
    factor: float

    @property
    def decimal(self) -> Decimal:
        """The factor as the decimal that prints it."""
        return Decimal(repr(self.factor))


def measured_places(head: Sequence[str], quantity: str, column: str = '') -> dict[str, Place]:
    """Finds the columns of a measured motion, among any others.

    Args:
        head: The names of all columns.
        quantity: What is measured, 'angle' or 'position'.
        column: Name of its column; by default, that of the quantity. Of other names, those that
            end with _deg or _mm have this unit.

    Returns:
        The columns by 'time', 'measured' and, if there is one, 'speed'.

    Raises:
        ValueError: A column is missing, or several hold the same quantity.
    """
    names = [name.strip(' \t"') for name in head]
    if column and column not in names:
        raise ValueError(f'has no column {shown(column)}, only {listed(names)}')
    names_of = {
        'time': _names_of('time', names),
        'measured': [column] if column else _names_of(quantity, names),
        'speed': _names_of('speed', names),
    }
    places = {}
    for key, candidates in names_of.items():
        if len(candidates) > 1:
            raise ValueError(f'has {" and ".join(candidates)}: give one of these as --column')
        if candidates:
            (name,) = candidates
            of_suffix = {'deg': _DEGREE, 'mm': 1e-3}.get(name.rpartition('_')[2], 1.0)
            factor = _COLUMNS[name].factor if name in _COLUMNS else of_suffix
            places[key] = Place(names.index(name), factor)
        elif key != 'speed':
            cure = '; or give --column NAME' if key == 'measured' else ''
            if len(names) == 1:
                cure = '; separate columns by commas'
            valid = column_names(quantity if key == 'measured' else key)
            raise ValueError(f'its first line names {listed(names)}: one must be of {valid}{cure}')
    return places


def _names_of(quantity: str, names: Sequence[str]) -> list[str]:
    """Returns the names of columns that hold a quantity."""
    return [name for name in names if name in _COLUMNS and _COLUMNS[name].quantity == quantity]


def listed(names: Sequence[str]) -> str:
    """Lists names for an error message, which may come from any file."""
    return shortened(', '.join(map(printable, names)), 200) or 'nothing'


def read_columns(path: Path | str, quantities: Collection[str]) -> dict[str, list[float]]:
    """Reads a CSV file of numbers, whose first line names the columns.

    Args:
        path: Path of the file, in UTF-8.
        quantities: Valid quantities, each at most once.

    Returns:
        The numbers of each quantity, in SI units.

    Raises:
        OSError: The file cannot be read, or is too large.
        ValueError: A name is not valid, there are too many rows or columns, a cell is not a
            number, or a line has more or fewer cells than the first line.
    """
    head, *lines = read_file(path).decode('utf-8-sig').splitlines() or ['']
    columns = _columns_in(head, quantities)
    if len(lines) > _MOST_ROWS:
        raise ValueError(f'has {len(lines)} rows, and at most {_MOST_ROWS} are read')
    rows = np.empty((0, 0))
    if any(lines):
        try:
            rows = np.loadtxt(lines, delimiter=',', comments=None, quotechar='"', ndmin=2)
        except ValueError as error:
            raise ValueError(str(error).partition('; use ')[0]) from error  # about NumPy
    if rows.shape[1] != len(columns):
        raise ValueError(f'each line below {",".join(columns)} must be {len(columns)} numbers')
    return {
        column.quantity: [column.factor * x for x in numbers]
        for column, numbers in zip(columns.values(), rows.T.tolist(), strict=True)
    }


def _columns_in(head: str, quantities: Collection[str]) -> dict[str, _Column]:
    """Returns the columns that the first line of a file names, by name.

    Raises:
        ValueError: There are too many, a name is not valid, or a quantity is not in `quantities`
            or occurs twice.
    """
    if (number := head.count(',') + 1) > len(_COLUMNS):
        raise ValueError(f'its first line has {number} columns: must be at most {len(_COLUMNS)}')
    names = [name.strip(' \t"') for name in head.split(',')]
    columns = list[_Column]()
    for name in names:
        column = _COLUMNS.get(name)
        if column is None or column.quantity not in quantities:
            raise ValueError(f'its first line names {shown(name)}')
        columns.append(column)
    if len({column.quantity for column in columns}) < len(columns):
        raise ValueError(f'its first line names {", ".join(names)}: give each quantity once')
    return dict(zip(names, columns, strict=True))
