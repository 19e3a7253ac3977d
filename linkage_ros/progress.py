# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Progress bars and status lines of the executables, on stderr if it is a terminal."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from tqdm import tqdm


def progress_bar(
    items: Iterable[Any] | None = None, *, wanted: bool = True, **options: Any
) -> 'tqdm[Any]':
    """Creates a progress bar on stderr, if it is a terminal; the bar disappears when it is done.

    Args:
        items: Items to iterate over; None if the caller updates the bar.
        wanted: Whether to show the bar at all.
        options: Options of tqdm, such as desc, total, unit and delay.

    Returns:
        The bar, which yields the items.
    """
    disable = None if wanted else True  # None: no bar if stderr is not a terminal
    # By default, tqdm would not update the bar at slow items that follow quick ones.
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
    # Return the cursor to the start of the line, so that other output overwrites it.
    with progress_bar(desc=words, bar_format='{desc}\r'):
        yield
