# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Progress bars and status lines of the executables, on stderr if it is a terminal."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from tqdm import tqdm


def progress_bar(
    items: Iterable[Any] | None = None, *, wanted: bool = True, **options: Any
) -> tqdm[Any]:
    """Makes a progress bar on stderr, if that is a terminal; the bar disappears at the end.

    Args:
        items: The items to iterate over; None: the bar is updated by hand.
        wanted: Whether to show the bar at all.
        options: Options of tqdm: desc, total, unit, delay and so on.

    Returns:
        The bar, which yields the items.
    """
    disable = None if wanted else True  # None: no bar if stderr is not a terminal
    # Every item may update the bar (miniters): after quick items, tqdm would skip slow ones.
    options = {'leave': False, 'mininterval': 1.0, 'miniters': 1, **options}
    return tqdm(items, disable=disable, **options)


@contextmanager
def waiting(words: str) -> Iterator[None]:
    """Shows a line on stderr while the block runs, if stderr is a terminal.

    Args:
        words: Text of the line, such as the reason for waiting.

    Yields:
        None.
    """
    # The cursor is at the beginning of the line, so that other output overwrites it.
    with progress_bar(desc=words, bar_format='{desc}\r'):
        yield
