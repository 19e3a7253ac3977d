# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Work that kills its process, in a small module that worker processes import fast."""

import multiprocessing
import os
import signal
from pathlib import Path


def die_once(given):
    """Returns the square of a number; if a file is named, the first process to try is killed."""
    number, path = given
    if path and not Path(path).exists():
        Path(path).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    if not path and multiprocessing.parent_process():
        os.kill(os.getpid(), signal.SIGINT)  # as Ctrl-C in a terminal does, to every process
    return number * number


def die(given):
    """Kills the process."""
    os.kill(os.getpid(), signal.SIGKILL)
