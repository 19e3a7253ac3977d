# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Brings a log from the system's memory to the disk, where it outlives a power cut as well.

A disk may take seconds for that, in which the log is still to be flushed: hence a worker of its
own.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Sequence
from pathlib import Path

from linkage_ros.errors import LogError


class DiskSync:
    """Keeps one log; it is what a worker feeds, with nothing."""

    def __init__(self, path: Path, number: int) -> None:
        """Begins.

        Args:
            path: Path of the log, for messages.
            number: File descriptor of the log; the file may be closed before this object.
        """
        self._path, self._number = path, os.dup(number)

    def consume(self, _: Sequence[object]) -> None:
        """Brings to the disk what was flushed so far.

        Raises:
            LogError: The disk fails.
        """
        try:
            os.fdatasync(self._number)
        except OSError as error:
            if error.errno != errno.EINVAL:  # a pipe or a device: there is no disk to wait for
                raise LogError(
                    f'{self._path} does not reach the disk: {error.strerror}'
                ) from error

    def close(self) -> None:
        """Lets the file go."""
        os.close(self._number)
