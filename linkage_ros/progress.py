# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Progress bars and lines of the command lines, on stderr if that is a terminal."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from tqdm import tqdm


def progress_bar(
    items: Iterable[Any] | None = None, *, wanted: bool = True, **options: Any
) -> tqdm[Any]:
    """A progress bar on stderr, if that is a terminal; it disappears at the end.

    Args:
        items: The items to iterate over; None: the bar is updated by hand.
        wanted: Whether to show the bar at all.
        options: Options of tqdm: desc, total, unit, delay and so on.

    Returns:
        The bar, which yields the items.
    """
    disable = None if wanted else True  # None: where stderr is no terminal
    # Every item may be shown (miniters): tqdm would learn from quick ones to skip slow ones.
    options = {'leave': False, 'mininterval': 1.0, 'miniters': 1, **_size(), **options}
    return tqdm(items, disable=disable, **options)


def _size() -> dict[str, int]:
    """Size options of tqdm for a terminal that reports no size, such as that of `script`."""
    try:
        if all(os.get_terminal_size(sys.stderr.fileno())):
            return {}  # tqdm finds the size
    except (AttributeError, OSError, ValueError):  # stderr is closed, a pipe or in memory
        return {}
    columns, rows = shutil.get_terminal_size()  # 80 x 24, or from the environment
    return {'ncols': columns - 1, 'nrows': rows - 1}  # tqdm leaves the last ones free as well


@contextmanager
def waiting(words: str) -> Iterator[None]:
    """Shows a line on stderr, if that is a terminal, for as long as the block runs.

    Args:
        words: The line: what is waited for, and how long at most.

    Yields:
        None.
    """
    # The cursor is at the beginning of the line, so that other output overwrites it.
    with progress_bar(desc=words, bar_format='{desc}\r'):
        yield
