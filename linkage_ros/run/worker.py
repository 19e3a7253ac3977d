# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Slow work in a separate thread, so that disk and viewer never delay a tick."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import Any, Generic, TypeVar

_T = TypeVar('_T')


class Worker(Generic[_T]):
    """Feeds a consumer from a bounded queue, in batches, in a separate thread.

    `offer` never waits for the consumer and never fails. If the consumer falls behind by more
    than the queue holds, the oldest items are dropped and counted. If the consumer fails, it is
    closed once, the error is reported once, and later items are counted as dropped.

    Attributes:
        error: The consumer's failure, or None.
        dropped: Number of items lost because the consumer lagged or failed.
    """

    def __init__(
        self,
        name: str,
        consumer: Any,
        *,
        capacity: int,
        period: float,
        on_error: Callable[[Exception], None],
        on_start: Callable[[], object] = lambda: None,
    ) -> None:
        """Starts the thread.

        Args:
            name: Name of the thread.
            consumer: Used only by this thread from now on. Its `consume` takes the items offered
                since the last call, possibly none; `close` is called last.
            capacity: Items that the queue holds.
            period: Time between batches, s.
            on_error: Called from the thread, once, if the consumer fails.
            on_start: Called from the thread when it starts.
        """
        self.error: Exception | None = None
        self.dropped = 0
        self._consumer, self._on_error, self._on_start = consumer, on_error, on_start
        self._capacity, self._period = capacity, period
        self._queue: deque[_T] = deque(maxlen=capacity)
        self._lock = threading.Lock()
        self._stop = threading.Event()
        # A daemon thread: a hanging disk must not keep the process alive.
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def offer(self, item: _T) -> None:
        """Queues an item; any thread may call this."""
        with self._lock:
            self.dropped += len(self._queue) == self._capacity
            self._queue.append(item)

    def close(self, timeout: float) -> bool:
        """Passes the queued items to the consumer, and ends the thread.

        Args:
            timeout: Longest time to wait, s.

        Returns:
            Whether the consumer was closed in time.
        """
        self._stop.set()
        self._thread.join(timeout)
        return not self._thread.is_alive()

    def _run(self) -> None:
        self._on_start()
        for act in (self._feed, self._consumer.close):
            try:
                act()
            except Exception as error:  # noqa: BLE001, PERF203, no failure may stop the ticks
                self._fail(error)

    def _feed(self) -> None:
        is_last = False
        while not is_last:
            is_last = self._stop.wait(self._period)
            with self._lock:
                items = list(self._queue)
                self._queue.clear()
            self._consumer.consume(items)

    def _fail(self, error: Exception) -> None:
        if self.error is not None:
            return
        with self._lock:
            self.error = error
            self.dropped += len(self._queue)
            self._capacity, self._queue = 0, deque(maxlen=0)
        self._on_error(error)
