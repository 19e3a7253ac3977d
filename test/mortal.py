# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Work that ends its process; a module of its own, which workers import fast."""

import multiprocessing
import os
import signal
from pathlib import Path


def die_once(given):
    """The square of a number; where a file is named, its first process dies over it."""
    number, path = given
    if path and not Path(path).exists():
        Path(path).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    if not path and multiprocessing.parent_process():
        os.kill(os.getpid(), signal.SIGINT)  # as Ctrl-C in a terminal does, to every process
    return number * number


def die(given):
    """The process always dies over it."""
    os.kill(os.getpid(), signal.SIGKILL)
