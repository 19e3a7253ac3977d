# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Distributes work among processes of this machine or of a Dask cluster."""

import logging
import multiprocessing
import os
import signal
import socket
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import (
    BrokenExecutor,
    CancelledError,
    Executor,
    ProcessPoolExecutor,
    as_completed,
)
from contextlib import AbstractContextManager, contextmanager, suppress
from importlib.metadata import version
from typing import Any, cast

from linkage_ros import ConfigurationError

_ATTEMPTS = 3
_PATIENCE = 10  # time limit, s, for the scheduler to answer, and again for its first worker


def spread(
    work: Callable[[Any], Any],
    blocks: Sequence[Any],
    connect: Callable[[], AbstractContextManager[Executor]],
) -> Iterator[tuple[int, Any]]:
    """Processes blocks; if an executor breaks, a new executor processes the unfinished blocks.

    Args:
        work: The function to call for each block; it must be picklable.
        blocks: The arguments of the calls.
        connect: Context manager that starts and ends an executor.

    Yields:
        Index and result of each block, in any order.

    Raises:
        ConfigurationError: Three executors broke.
    """
    left = dict(enumerate(blocks))
    for _ in range(_ATTEMPTS):
        with suppress(BrokenExecutor), connect() as executor:
            numbers = {executor.submit(work, block): i for i, block in left.items()}
            for future in as_completed(numbers):
                yield numbers[future], future.result()
                del left[numbers[future]]
            return
    raise ConfigurationError(
        f'worker processes died {_ATTEMPTS} times, perhaps for lack of memory; give fewer '
        '--workers, or fewer angles'
    )


@contextmanager
def processes(count: int) -> Iterator[Executor]:
    """Starts worker processes on this machine; an error or Ctrl-C ends them at once."""
    context = multiprocessing.get_context('spawn')
    executor = ProcessPoolExecutor(count, context, initializer=_prepare)
    try:
        yield executor
    except BaseException:
        for process in multiprocessing.active_children():
            process.terminate()
        raise
    finally:
        executor.shutdown(cancel_futures=True)


def _prepare() -> None:
    """Makes a worker ignore Ctrl-C, and ends it when its parent process is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def end_with_parent() -> None:
        cast('Any', multiprocessing.parent_process()).join()
        os._exit(1)

    threading.Thread(target=end_with_parent, daemon=True).start()


@contextmanager
def cluster(address: str) -> Iterator[Executor]:
    """Connects to the workers of a Dask cluster, on which this package must be installed.

    Yields:
        An executor; the cluster repeats the work of a lost worker on another one.

    Raises:
        ConfigurationError: No scheduler answers, it has no workers, or its workers fail.
        BrokenExecutor: A result was lost with its worker.
        TypeError: The work function raised a TypeError.
    """
    from distributed import Client, KilledWorker
    from distributed.comm.addressing import get_address_host_port

    # Dask would log errors that are also raised here, and each repetition of lost work.
    logging.getLogger('distributed.client').setLevel(logging.CRITICAL)
    try:
        # A client takes 20 s to end if it finds no scheduler.
        socket.create_connection(get_address_host_port(address), _PATIENCE).close()
        client = Client(address, timeout=_PATIENCE, set_as_default=False)
    except (OSError, ValueError, OverflowError) as error:
        raise ConfigurationError(
            f'--scheduler {address}: no Dask scheduler answers; start one with `dask scheduler`, '
            'or leave --scheduler out'
        ) from error
    with client:
        try:
            client.wait_for_workers(1, timeout=_PATIENCE)
            client.run(version, 'linkage_lab')  # a worker without it dies, and its tasks wait
            yield client.get_executor()
        except (TimeoutError, KilledWorker, ImportError, CancelledError) as error:
            raise ConfigurationError(
                f'--scheduler {address}: {type(error).__name__}: {error}; the cluster needs '
                f'workers (`dask worker {address}`) with linkage_lab, and memory for the angles'
            ) from error
        except TypeError as error:
            # Dask's executor occasionally raises this if a worker dies while it sends a result.
            if 'cannot unpack' in str(error):
                raise BrokenExecutor('a result was lost with its worker') from error
            raise
