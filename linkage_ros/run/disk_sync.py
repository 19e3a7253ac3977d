# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Syncs the log of a node to the disk."""

import os
from collections.abc import Sequence
from pathlib import Path

from linkage_ros.errors import LogError


class DiskSync:
    """Consumer of a worker that syncs a file to the disk, so that it survives a power cut.

    It needs its own worker, because a sync may take seconds, during which the log must still be
    flushed.
    """

    def __init__(self, path: Path | str, number: int) -> None:
        """Duplicates a file descriptor, so that syncs work even after the file is closed.

        Args:
            path: Path of the file, for error messages.
            number: Descriptor of the file.
        """
        self._path, self._number = path, os.dup(number)

    def consume(self, _: Sequence[object]) -> None:
        """Syncs all data flushed so far.

        Raises:
            LogError: The sync failed.
        """
        try:
            os.fdatasync(self._number)
        except OSError as error:
            raise LogError(f'{self._path} does not reach the disk: {error.strerror}') from error

    def close(self) -> None:
        """Closes the duplicated descriptor."""
        os.close(self._number)
