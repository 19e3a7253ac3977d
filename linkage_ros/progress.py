# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What all command lines show on the way, on stderr where that is a terminal."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from tqdm import tqdm


def progress_bar(
    items: Iterable[Any] | None = None, *, wanted: bool = True, **look: Any
) -> tqdm[Any]:
    """A bar on stderr, if that is a terminal, at most once a second; it goes when all is done.

    Args:
        items: What is gone through; None: it is updated by hand.
        wanted: Whether there is to be one at all.
        look: What it says, as tqdm takes it: desc, total, unit, delay and so on.

    Returns:
        The bar, which gives the items.
    """
    disable = None if wanted else True  # None: where stderr is no terminal
    # Every item may be shown (miniters): tqdm would learn from quick ones to skip slow ones.
    look = {'leave': False, 'mininterval': 1.0, 'miniters': 1, **_size(), **look}
    return tqdm(items, disable=disable, **look)


def _size() -> dict[str, int]:
    """What tqdm is told of a terminal that has no size, as one of `script` where there is none."""
    try:
        if all(os.get_terminal_size(sys.stderr.fileno())):
            return {}  # it looks itself
    except (AttributeError, OSError, ValueError):  # stderr is none, a pipe, or in memory
        return {}
    columns, rows = shutil.get_terminal_size()  # 80 x 24, or what the environment says
    return {'ncols': columns - 1, 'nrows': rows - 1}  # the last are left free, as elsewhere


@contextmanager
def waiting(words: str) -> Iterator[None]:
    """A line on stderr, if that is a terminal, which goes when what is waited for is over.

    Args:
        words: What is waited for, and how long at most.

    Yields:
        Meanwhile.
    """
    # The cursor stands at its beginning: what others say meanwhile does not stick to its end.
    with progress_bar(desc=words, bar_format='{desc}\r'):
        yield
