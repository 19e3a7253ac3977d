# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Columns of numbers in CSV files."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from linkage_ros.files import read_file

_MOST_ROWS = 100_000  # millions would take gigabytes


def read_columns(
    path: Path | str, check: Callable[[Sequence[str]], object]
) -> dict[str, list[float]]:
    """Reads a CSV file of numbers, whose first line names the columns.

    Args:
        path: Path of the file, in UTF-8.
        check: Raises a ValueError unless the names are valid.

    Returns:
        The numbers of each column, by name.

    Raises:
        OSError: The file cannot be read, or is too large.
        ValueError: The names are not valid, there are too many rows, a cell is not a number, or a
            line has more or fewer cells than the first line.
    """
    head, *lines = read_file(path).decode('utf-8-sig').splitlines() or ['']
    names = [name.strip(' \t"') for name in head.split(',')]
    check(names)
    if len(lines) > _MOST_ROWS:
        raise ValueError(f'has {len(lines)} rows, and at most {_MOST_ROWS} are read')
    rows = np.empty((0, 0))
    if any(lines):
        try:
            rows = np.loadtxt(lines, delimiter=',', comments=None, quotechar='"', ndmin=2)
        except ValueError as error:
            raise ValueError(str(error).partition('; use ')[0]) from error  # about NumPy
    if rows.shape[1] != len(names):
        raise ValueError(f'each line below {",".join(names)} must be {len(names)} numbers')
    return dict(zip(names, rows.T.tolist(), strict=True))
