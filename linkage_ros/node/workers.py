# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Threads of a run: settings that let them meet their deadlines, and workers for slow tasks.

A worker moves slow work to its own thread, so that the disk and the viewer never delay a tick.
"""

import ctypes
import gc
import operator
import os
import sys
import threading
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from typing import Any, Generic, TypeVar

_T = TypeVar('_T')

_PR_SET_NAME, _PR_SET_TIMERSLACK = 15, 29  # options of prctl
# Priority of the ticker, as in ros2_control, and of other threads that use the interpreter.
_PRIORITY, _COMPANION_PRIORITY = 50, 40
# Switch interval of the interpreter, s. A thread waiting for the interpreter wakes up after each
# interval. At 10 us, two waiting real-time threads kept both processors busy for a second, which
# blocked the thread that held the interpreter.
_SWITCH_INTERVAL = 1e-4


def freeze_heap() -> None:
    """Excludes all existing objects from garbage collection; call this after set-up.

    This shortens collections, which otherwise visit all objects.
    """
    gc.collect()
    gc.freeze()


def wake_on_time() -> None:
    """Makes the calling thread, and threads started by it, wake up on time.

    Python threads release the interpreter after 0.1 ms instead of 5 ms. By default, Linux may wake
    threads up to 50 us late to group wake-ups.
    """
    sys.setswitchinterval(_SWITCH_INTERVAL)
    _prctl(_PR_SET_TIMERSLACK, 1)


def show_name() -> None:
    """Shows the name of the calling thread to the system, so that `top -H` lists it.

    Python does this itself from version 3.14 on.
    """
    _prctl(_PR_SET_NAME, threading.current_thread().name.encode())


def _prctl(option: int, value: int | bytes) -> None:
    with suppress(AttributeError, OSError):  # not Linux
        ctypes.CDLL(None).prctl(option, value, 0, 0, 0)


def take_real_time_priority(priority: int = _PRIORITY) -> bool:
    """Gives the calling thread real-time priority; threads started by it do not inherit it.

    As for ros2_control, this requires root or rtprio in limits.conf.

    Args:
        priority: Priority from 1 to 99; higher priorities run first.

    Returns:
        Whether the system granted the priority.
    """
    try:
        policy = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
        os.sched_setscheduler(0, policy, os.sched_param(priority))
    except (AttributeError, OSError):
        return False
    return True


def accompany_ticker() -> None:
    """Gives the calling thread a real-time priority below that of the ticker.

    Otherwise, if the thread were preempted while it held the interpreter lock, it would delay the
    ticker.
    """
    take_real_time_priority(_COMPANION_PRIORITY)


class Worker(Generic[_T]):
    """Passes batches of items from a bounded queue to a consumer, in a separate thread.

    `offer` never waits for the consumer and never fails. If the queue is full, the oldest item is
    dropped and counted, unless it must be kept. If the consumer fails, the error is reported once,
    the consumer is closed, and the items of that batch and all later ones are counted as dropped.

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
        gap: Callable[[int], Any] | None = None,
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
            gap: Creates an item that the consumer gets in place of dropped items, given their
                number; None for no such item.
        """
        self.error: Exception | None = None
        self.dropped = 0
        self._consumer, self._on_error, self._on_start = consumer, on_error, on_start
        self._period, self._gap = period, gap
        # Items with their numbers in order; those to keep are few, and not limited.
        self._queue: deque[tuple[int, _T]] = deque(maxlen=capacity)
        self._kept = list[tuple[int, _T]]()
        self._offered = 0
        self._lock = threading.Lock()
        self._stop = threading.Event()
        # A daemon thread, because a hanging disk must not keep the process alive.
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def offer(self, item: _T, *, keep: bool = False) -> None:
        """Adds an item; thread-safe.

        Args:
            item: Item for the consumer.
            keep: Whether the item must not be dropped while the consumer works.
        """
        with self._lock:
            self._offered += 1
            if keep and self.error is None:
                self._kept.append((self._offered, item))
                return
            self.dropped += len(self._queue) == self._queue.maxlen
            self._queue.append((self._offered, item))

    def close(self, timeout: float, join: Callable[..., object] = threading.Thread.join) -> bool:
        """Passes the remaining items to the consumer, and ends the thread.

        Args:
            timeout: Longest time to wait for the thread, s.
            join: Waits for a thread, with a time limit.

        Returns:
            Whether the consumer was closed in time.
        """
        self._stop.set()
        join(self._thread, timeout)
        return not self._thread.is_alive()

    def _run(self) -> None:
        show_name()
        self._on_start()
        for act in (self._feed, self._consumer.close):
            try:
                act()
            except Exception as error:  # noqa: BLE001, PERF203, no failure may stop the ticks
                self._fail(error)

    def _feed(self) -> None:
        is_last, reported = False, 0
        while not is_last:
            is_last = self._stop.wait(self._period)
            with self._lock:
                numbered = [*self._kept, *self._queue]
                self._kept.clear()
                self._queue.clear()
                dropped = self.dropped
            items: list[Any] = [x for _, x in sorted(numbered, key=operator.itemgetter(0))]
            if self._gap and dropped > reported:  # the oldest were dropped: the gap comes first
                items.insert(0, self._gap(dropped - reported))
            reported = dropped
            try:
                self._consumer.consume(items)
            except Exception:
                with self._lock:
                    self.dropped += len(numbered)
                raise

    def _fail(self, error: Exception) -> None:
        if self.error is not None:
            return
        with self._lock:
            self.error = error
            self.dropped += len(self._queue) + len(self._kept)
            self._queue = deque(maxlen=0)
            self._kept.clear()
        self._on_error(error)
