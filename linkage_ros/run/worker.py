# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A thread of its own for whatever may be slow: the disk and the viewer never delay a tick."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Sequence
from typing import Generic, Protocol, TypeVar

_T = TypeVar('_T')
_T_contra = TypeVar('_T_contra', contravariant=True)


class Consumer(Protocol[_T_contra]):
    """What a worker feeds."""

    def consume(self, items: Sequence[_T_contra]) -> None:
        """Takes what has come since the last call; may be nothing."""

    def close(self) -> None:
        """Ends the work."""


class Worker(Generic[_T]):
    """Feeds a consumer from a bounded queue, in batches, in its own thread.

    Offering never blocks and never fails. Where the consumer lags by more than the queue holds,
    the oldest items are dropped and counted; where it fails, it is closed once, the error is
    reported once, and what comes later is counted as dropped.

    Attributes:
        error: What the consumer failed with, or None.
    """

    def __init__(
        self,
        name: str,
        consumer: Consumer[_T],
        *,
        capacity: int,
        period: float,
        on_error: Callable[[Exception], None],
    ) -> None:
        """Starts the thread.

        Args:
            name: Of the thread.
            consumer: Is used by the thread alone from here on.
            capacity: Items that the queue holds.
            period: Time between batches, s.
            on_error: Called from the thread, once, where the consumer fails.
        """
        self.error: Exception | None = None
        self._consumer, self._on_error, self._period = consumer, on_error, period
        self._queue: deque[_T] = deque(maxlen=capacity)
        self._offered = self._taken = 0
        self._stop = threading.Event()
        # A daemon: a consumer that hangs for good must not keep the process alive.
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def offer(self, item: _T) -> None:
        """Queues an item; only one thread may do so."""
        self._offered += 1
        self._queue.append(item)

    @property
    def dropped(self) -> int:
        """Items lost so far because the consumer lagged or failed."""
        # In this order: what the worker takes meanwhile is counted twice, never as dropped.
        waiting = len(self._queue)
        return max(0, self._offered - self._taken - waiting)

    def close(self, timeout: float) -> bool:
        """Hands over what is queued and ends the thread.

        Args:
            timeout: Longest time to wait, s.

        Returns:
            Whether the consumer was closed in time.
        """
        self._stop.set()
        self._thread.join(timeout)
        return not self._thread.is_alive()

    def _run(self) -> None:
        try:
            while not self._stop.wait(self._period):
                self._consumer.consume(self._take())
            self._consumer.consume(self._take())
        except Exception as error:  # noqa: BLE001, whatever it was must not stop the ticks
            self._fail(error)
        try:
            self._consumer.close()
        except Exception as error:  # noqa: BLE001, as above
            if self.error is None:
                self._fail(error)

    def _take(self) -> list[_T]:
        items = []
        # popleft is atomic, a copy followed by clear is not.
        while self._queue:
            self._taken += 1  # first, so that `dropped` never counts an item on its way
            items.append(self._queue.popleft())
        return items

    def _fail(self, error: Exception) -> None:
        self.error = error
        self._queue = deque(maxlen=0)
        self._on_error(error)
