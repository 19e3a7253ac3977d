# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Serves a node's callbacks, whatever others send, until it ends, even if it never would."""

from __future__ import annotations

import faulthandler
import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node

from linkage_ros.errors import one_line

# s after which a node that does not end never will.
_STUCK = 10.0


def _spin(executor: SingleThreadedExecutor, node: Node) -> None:
    """Spins until the end, whatever requests others send.

    rclpy raises, for one, on a parameter of an unknown type.
    """
    while node.context.ok():
        try:
            with suppress(ExternalShutdownException):
                executor.spin()
        except Exception as error:  # noqa: BLE001, PERF203, nothing bounds what others send
            if 'timer is canceled' in str(error):
                continue  # by another thread, just before rclpy would have called it
            words = one_line(f'{type(error).__name__}: {error}')
            node.get_logger().error(f'a callback failed: {words}', throttle_duration_sec=1.0)
        else:
            return


@contextmanager
def served(node: Node) -> Iterator[None]:
    """Serves a node's callbacks in a thread of their own; destroys the node at the end.

    Args:
        node: The node.

    Yields:
        While it is served.
    """
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    thread = threading.Thread(target=_spin, args=(executor, node), name='executor', daemon=True)
    thread.start()
    try:
        yield
    finally:
        executor.shutdown(timeout_sec=2.0)
        thread.join(2.0)
        with _ended_if_stuck():
            node.destroy_node()


@contextmanager
def _ended_if_stuck() -> Iterator[None]:
    """Ends the process, with code 1, if Fast DDS never returns (eProsima/Fast-DDS#6513).

    It spins in C code that keeps the interpreter, so that no thread of Python's could do it.
    """
    with Path(os.devnull).open('w') as nowhere:
        faulthandler.dump_traceback_later(_STUCK, exit=True, file=nowhere)
        try:
            yield
        finally:
            faulthandler.cancel_dump_traceback_later()
