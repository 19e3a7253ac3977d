# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Syncs a log to the disk, so that it survives a power cut.

A sync may take seconds, while the log must still be flushed; so it has a worker of its own.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Sequence
from pathlib import Path

from linkage_ros.errors import LogError


class DiskSync:
    """Syncs one log; the consumer of a worker without items."""

    def __init__(self, path: Path, number: int) -> None:
        """Prepares the sync.

        Args:
            path: Path of the log, for messages.
            number: File descriptor of the log; the log may close its file earlier.
        """
        self._path, self._number = path, os.dup(number)

    def consume(self, _: Sequence[object]) -> None:
        """Syncs everything flushed so far to the disk.

        Raises:
            LogError: The sync failed.
        """
        try:
            os.fdatasync(self._number)
        except OSError as error:
            if error.errno != errno.EINVAL:  # a pipe or a device: there is no disk to wait for
                raise LogError(
                    f'{self._path} does not reach the disk: {error.strerror}'
                ) from error

    def close(self) -> None:
        """Closes its descriptor of the file."""
        os.close(self._number)
