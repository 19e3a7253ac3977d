# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Threads of a run: settings that let them meet their deadlines, and workers for slow tasks.

A worker moves slow work to its own thread, so that the disk and the viewer never delay a tick.
"""

import ctypes
import gc
import os
import sys
import threading
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from typing import Any, Generic, NamedTuple, TypeVar

from linkage_ros.errors import LogError

_T = TypeVar('_T')

_PR_SET_NAME, _PR_SET_TIMERSLACK = 15, 29  # options of prctl
# Priority of the ticker, as in ros2_control, and of other threads that use the interpreter.
_PRIORITY, _COMPANION_PRIORITY = 50, 40
# Switch interval of the interpreter, s. A thread waiting for the interpreter wakes up after each
# interval. At 10 us, two waiting real-time threads kept both processors busy for a second, which
# blocked the thread that held the interpreter.
_SWITCH_INTERVAL = 1e-4
_MOST_BYTES = 64_000_000  # largest size of the items that wait for a consumer


def freeze_heap() -> None:
    """Excludes all existing objects from garbage collection; call this after set-up.

    This shortens collections, which otherwise visit all objects.
    """
    gc.unfreeze()  # an earlier set-up may have become garbage
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

    As for ros2_control, this requires root or rtprio in limits.conf. Returns whether the system
    granted the priority, from 1 to 99; higher ones run first.
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


class _Waiting(NamedTuple):
    """An item that waits for the consumer.

    Attributes:
        number: Number of the item among all offered ones.
        size: About the memory that it takes, bytes.
        item: The item.
    """

    number: int
    size: int
    item: Any


class Worker(Generic[_T]):
    """Passes batches of items from a bounded queue to a consumer, in a separate thread.

    `offer` never waits for the consumer and never fails. If too many items or more than 64 MB
    wait, the oldest are dropped and counted, except those that must be kept. If the consumer
    fails, the error is reported once, the consumer is closed, and the items of that batch and all
    later ones are counted as dropped. More than 64 MB that must be kept count as a failure.

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
            capacity: Largest number of waiting items that may be dropped.
            period: Time between batches, s.
            on_error: Called once if the consumer fails, before it is closed.
            on_start: Called from the thread when it starts.
            gap: Creates an item that the consumer gets in place of dropped items, given their
                number; None for no such item.
        """
        self.error: Exception | None = None
        self.dropped = 0
        self._consumer, self._on_error, self._on_start = consumer, on_error, on_start
        self._period, self._gap, self._capacity = period, gap, capacity
        # Those that may be dropped, and those that must be kept.
        self._queue, self._kept = deque[_Waiting](), list[_Waiting]()
        self._offered = self._bytes = 0
        self._lock = threading.Lock()
        self._stop = threading.Event()
        # A daemon thread, because a hanging disk must not keep the process alive.
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def offer(self, item: _T, size: int = 0, *, keep: bool = False) -> None:
        """Adds an item; thread-safe.

        Args:
            item: Item for the consumer.
            size: About the memory that the item takes, bytes; 0 if the capacity limits it enough.
            keep: Whether the item must not be dropped while the consumer works.
        """
        with self._lock:
            if self.error is not None:
                self.dropped += 1
                return
            self._offered += 1
            (self._kept if keep else self._queue).append(_Waiting(self._offered, size, item))
            self._bytes += size
            while self._queue and (len(self._queue) > self._capacity or self._bytes > _MOST_BYTES):
                self._bytes -= self._queue.popleft().size
                self.dropped += 1
            is_full = self._bytes > _MOST_BYTES
        if is_full:
            size = _MOST_BYTES // 1_000_000
            self._fail(LogError(f'the disk hangs, and more than {size} MB wait for it'))

    def close(self, timeout: float, join: Callable[..., object] = threading.Thread.join) -> bool:
        """Passes the remaining items to the consumer, and ends the thread.

        Returns whether the consumer was closed in time; the timeout is in s.
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
        """Passes the waiting items to the consumer, once in each period, until the end."""
        is_last, reported = False, 0
        while not is_last and self.error is None:
            is_last = self._stop.wait(self._period)
            with self._lock:
                waiting = [*self._queue]
                if self._kept:
                    waiting = sorted([*self._kept, *waiting], key=lambda one: one.number)
                self._clear()
                dropped = self.dropped
            items: list[Any] = [one.item for one in waiting]
            if self._gap and dropped > reported:  # the oldest were dropped: the gap comes first
                items.insert(0, self._gap(dropped - reported))
            reported = dropped
            try:
                self._consumer.consume(items)
            except Exception:
                with self._lock:
                    self.dropped += len(waiting)
                raise

    def _clear(self) -> None:
        self._queue.clear()
        self._kept.clear()
        self._bytes = 0

    def _fail(self, error: Exception) -> None:
        with self._lock:
            if self.error is None:
                self._on_error(error)
                self.error = error
                self.dropped += len(self._queue) + len(self._kept)
                self._clear()
