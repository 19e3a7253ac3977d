# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Workers between ticks and slow consumers, and threads that meet their deadlines.

Gates simulate slowness, without sleeps.
"""

import ctypes
import gc
import os
import resource
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from ros_harness import PATIENCE, finished, wait_for

from linkage_ros.node import workers
from linkage_ros.node.workers import Worker

QUICK = 0.001


class Gated:
    """A consumer that blocks each call until its gate opens, and may fail at one call."""

    def __init__(self, *, is_open=True, fails=False, fails_to_close=False):
        self.gate, self.entered, self.called = (threading.Event() for _ in range(3))
        self.batches, self.closed, self.threads = [], 0, set()
        self.fails, self.fails_to_close = fails, fails_to_close
        if is_open:
            self.gate.set()

    @property
    def items(self):
        return [item for batch in self.batches for item in batch]

    def consume(self, items):
        self.threads.add(threading.current_thread().name)
        self.called.set()
        if items:
            self.entered.set()
            assert self.gate.wait(PATIENCE)
            if self.fails:
                raise OSError(28, 'No space left on device')
        self.batches.append(list(items))

    def close(self):
        self.closed += 1
        if self.fails_to_close:
            raise OSError(5, 'Input/output error')


def start(consumer, capacity=1_000, period=QUICK):
    errors = []
    worker = Worker('test', consumer, capacity=capacity, period=period, on_error=errors.append)
    return worker, errors


def test_close_passes_on_all_queued_items():
    consumer = Gated()
    worker, errors = start(consumer, period=PATIENCE)
    for item in range(500):
        worker.offer(item)
    assert consumer.batches == []
    assert [worker.close(PATIENCE), worker.close(PATIENCE)] == [True, True]
    assert consumer.batches == [list(range(500))]
    assert (consumer.closed, consumer.threads) == (1, {'test'})
    assert (worker.dropped, worker.error, errors) == (0, None, [])


def test_consumer_is_called_without_items_so_that_it_can_flush():
    consumer = Gated()
    worker, _ = start(consumer)
    for _ in range(3):
        assert consumer.called.wait(PATIENCE)
        consumer.called.clear()
    assert worker.close(PATIENCE)
    assert consumer.items == []


def test_oldest_items_are_dropped_and_counted_exactly():
    consumer = Gated(is_open=False)
    worker, errors = start(consumer, capacity=10)
    worker.offer(0)
    assert consumer.entered.wait(PATIENCE)
    for count in range(1, 36):
        worker.offer(count)
        assert worker.dropped == max(0, count - 10)
    consumer.gate.set()
    assert worker.close(PATIENCE)
    assert (consumer.items, worker.dropped, errors) == ([0, *range(26, 36)], 25, [])


def test_items_to_keep_are_never_dropped_and_stay_in_order():
    consumer = Gated(is_open=False)
    errors = []
    worker = Worker(
        'test',
        consumer,
        capacity=3,
        period=QUICK,
        on_error=errors.append,
        gap=lambda n: f'gap {n}',
    )
    worker.offer(0)
    assert consumer.entered.wait(PATIENCE)
    for count in range(1, 11):
        worker.offer(count, keep=count in {2, 9})
    consumer.gate.set()
    assert worker.close(PATIENCE)
    assert consumer.items == [0, 'gap 5', 2, 7, 8, 9, 10]
    assert (worker.dropped, errors) == (5, [])


def test_waiting_items_are_limited_by_their_bytes():
    consumer = Gated(is_open=False)
    worker, errors = start(consumer)
    worker.offer(0)
    assert consumer.entered.wait(PATIENCE)
    for count in range(1, 11):
        worker.offer(count, 10_000_000, keep=count in {2, 9})
        assert worker.dropped == max(0, count - 6)
    worker.offer(11, 70_000_000)  # alone too large
    assert worker.dropped == 9
    consumer.gate.set()
    assert worker.close(PATIENCE)
    assert (consumer.items, errors) == ([0, 2, 9], [])


def test_too_many_bytes_to_keep_end_a_hanging_consumer():
    consumer = Gated(is_open=False)
    worker, errors = start(consumer)
    worker.offer('written', 1, keep=True)
    assert consumer.entered.wait(PATIENCE)
    for _ in range(4):
        worker.offer('kept', 16_000_000, keep=True)
    assert (worker.error, worker.dropped) == (None, 0)
    for count in range(100):
        worker.offer('later', 16_000_000, keep=True)
        assert worker.dropped == 5 + count
        assert not worker._kept
    assert [worker.error] == errors
    assert '64 MB' in str(worker.error)
    consumer.gate.set()
    worker._thread.join(PATIENCE)  # ends without further calls
    assert (consumer.items, consumer.closed, len(errors)) == (['written'], 1, 1)


def test_bytes_count_until_they_are_consumed():
    consumer = Gated()
    worker, errors = start(consumer)
    for number in range(20):
        worker.offer(number, 16_000_000, keep=number % 2 > 0)
        wait_for(lambda number=number: number in consumer.items)
    assert worker.close(PATIENCE)
    assert (consumer.items, errors) == ([*range(20)], [])


def test_concurrent_offers_keep_their_order_and_count_every_loss():
    consumer = Gated()
    worker, _ = start(consumer, capacity=50, period=0.0001)

    def offer(thread):
        for number in range(20_000):
            worker.offer((thread, number))

    with ThreadPoolExecutor(3) as pool:
        list(pool.map(offer, range(3)))
    assert worker.close(PATIENCE)
    assert len(consumer.items) + worker.dropped == 60_000
    for i in range(3):
        own = [number for thread, number in consumer.items if thread == i]
        assert own == sorted(set(own))


@pytest.mark.parametrize('period', [QUICK, PATIENCE], ids=['at work', 'on the last batch'])
@pytest.mark.parametrize(
    ('options', 'said'),
    [
        ({'fails': True}, 'No space left on device'),
        ({'fails': True, 'fails_to_close': True}, 'No space left on device'),
        ({'fails_to_close': True}, 'Input/output error'),
    ],
)
def test_the_first_failure_is_reported_once_and_the_consumer_closed(period, options, said):
    consumer = Gated(**options)
    worker, errors = start(consumer, period=period)
    worker.offer(0)
    assert worker.close(PATIENCE)
    assert [error.strerror for error in errors] == [said]
    assert worker.error is errors[0]
    assert consumer.closed == 1


def test_items_of_a_failed_batch_and_later_ones_are_counted():
    consumer = Gated(is_open=False, fails=True)
    worker, errors = start(consumer)
    worker.offer(0)
    assert consumer.entered.wait(PATIENCE)
    for item in range(3):
        worker.offer(item)
    consumer.gate.set()
    worker._thread.join(PATIENCE)  # ends without further calls
    for item in range(100):
        assert worker.dropped == 4 + item
        worker.offer(item)
    assert (consumer.items, len(errors)) == ([], 1)


def test_close_gives_up_on_a_hanging_consumer():
    consumer = Gated(is_open=False)
    worker, errors = start(consumer)
    worker.offer(0)
    assert consumer.entered.wait(PATIENCE)
    assert worker.close(0.05) is False
    assert consumer.closed == 0
    consumer.gate.set()  # when it continues, it is still closed
    assert worker.close(PATIENCE)
    assert (consumer.closed, errors) == (1, [])


HANGING = """
import sys, threading
from linkage_ros.node.workers import Worker

class Consumer:
    entered = threading.Event()

    def consume(self, items):
        self.entered.set()
        threading.Event().wait()

    def close(self):
        pass

worker = Worker('log', Consumer(), capacity=10, period=0.001, on_error=print)
worker.offer(1)
Consumer.entered.wait()
print(worker.close(0.1), flush=True)
sys.exit(7)
"""


def test_the_process_ends_although_a_consumer_hangs():
    done = finished([sys.executable, '-c', HANGING])
    assert (done.returncode, done.stdout) == (7, 'False\n')


# ---------------------------------------------------------------- deadlines


def in_thread(work):
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(work).result()


def policy():
    return os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK


def test_the_system_shows_the_name_of_a_worker():
    def shown():
        return Path(f'/proc/self/task/{threading.get_native_id()}/comm').read_text()

    found = []
    worker = Worker(
        'test', Gated(), capacity=1, period=QUICK, on_error=found.append,
        on_start=lambda: found.append(shown()),
    )  # fmt: skip
    assert worker.close(PATIENCE)
    assert found == ['test\n']


def test_thread_wakes_at_the_requested_time():
    def work():
        prctl = ctypes.CDLL(None).prctl
        prctl(29, 50_000, 0, 0, 0)  # PR_SET_TIMERSLACK, which other tests may have changed
        before = prctl(30)
        workers.wake_on_time()
        return before, prctl(30)

    assert in_thread(work) == (50_000, 1)


def test_real_time_priority_is_not_inherited():
    def work():
        return workers.take_real_time_priority(), policy(), in_thread(policy)

    def beside():
        workers.accompany_ticker()
        return policy(), os.sched_getparam(0).sched_priority

    granted, own, child = in_thread(work)
    assert in_thread(beside) == (own, 40 if granted else 0)
    assert own == (os.SCHED_FIFO if granted else os.SCHED_OTHER)
    assert child == policy() == os.SCHED_OTHER


def test_missing_real_time_permission_is_reported(monkeypatch):
    def refuse(*_):
        raise PermissionError(1, 'Operation not permitted')

    monkeypatch.setattr(os, 'sched_setscheduler', refuse)
    assert workers.take_real_time_priority() is False
    monkeypatch.delattr(os, 'SCHED_FIFO')  # as on other systems
    assert workers.take_real_time_priority() is False


def test_frozen_objects_are_not_garbage_collected():
    workers.freeze_heap()
    assert gc.get_freeze_count() > 0
    gc.unfreeze()


def pause_and_work(interval):
    """Returns a pause of a thread that waits for the interpreter, and its work per pause, s.

    Args:
        interval: Switch interval of the interpreter, s; None for that of the product.
    """
    hold = ctypes.PyDLL(None).usleep  # does not release the interpreter
    is_held = True

    def wait():
        begun, before = time.thread_time(), resource.getrusage(resource.RUSAGE_THREAD)
        while is_held:
            time.sleep(1e-3)
        pauses = resource.getrusage(resource.RUSAGE_THREAD).ru_nvcsw - before.ru_nvcsw
        return (time.thread_time() - begun) / pauses

    usual = sys.getswitchinterval()
    with ThreadPoolExecutor(1) as pool:
        try:
            pool.submit(workers.wake_on_time).result()
            sys.setswitchinterval(interval or sys.getswitchinterval())
            waiting = pool.submit(wait)
            for _ in range(20):
                hold(10_000)
            is_held = False
            return sys.getswitchinterval(), waiting.result()
        finally:
            is_held = False
            sys.setswitchinterval(usual)


def test_thread_waiting_for_the_interpreter_pauses_longer_than_it_works():
    """Otherwise, with real-time priority, it could starve the thread that holds the interpreter.

    The control does not take real-time priority, because it would stop the tests that run beside
    it, and their nodes, for up to a second.
    """
    pause, work = pause_and_work(None)
    assert work < pause
    pause, work = pause_and_work(1e-6)
    assert work > pause
