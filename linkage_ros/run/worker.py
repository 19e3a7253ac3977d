# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Moves slow work to a separate thread, so that disk and viewer never delay a tick."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import Any, Generic, TypeVar

_T = TypeVar('_T')


class Worker(Generic[_T]):
    """Passes batches of items from a bounded queue to a consumer, in a separate thread.

    `offer` never waits for the consumer and never fails. If the queue is full, the oldest item is
    dropped and counted. If the consumer fails, the error is reported once, the consumer is closed,
    and later items are counted as dropped.

    Attributes:
        error: The error raised by the consumer, or None.
        dropped: Number of items lost because the consumer was too slow or failed.
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
            consumer: Object that only this thread uses from now on. Its method `consume` is called
                with the items offered since the last call, possibly none; `close` is called last.
            capacity: Largest number of items in the queue.
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
        # A daemon thread, because a hanging disk must not keep the process alive.
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def offer(self, item: _T) -> None:
        """Adds an item to the queue; thread-safe."""
        with self._lock:
            self.dropped += len(self._queue) == self._capacity
            self._queue.append(item)

    def close(self, timeout: float) -> bool:
        """Passes the remaining items to the consumer, and ends the thread.

        Args:
            timeout: Longest time to wait for the thread, s.

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
