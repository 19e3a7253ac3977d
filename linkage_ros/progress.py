# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What all command lines show on the way, on stderr where that is a terminal."""

from __future__ import annotations

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
    return tqdm(items, disable=disable, leave=False, mininterval=1.0, **look)


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
