# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What killed processes leave of Fast DDS's shared memory, for which it would wait for ever.

Each participant of a domain has ports there, files of fixed names. Who finds one that is not ready
waits until its maker has made it; if that was killed meanwhile, every process that needs the port
hangs in C code, with the interpreter, until somebody removes the file.
"""

from __future__ import annotations

import time
from pathlib import Path

from linkage_ros.errors import ConfigurationError
from linkage_ros.files import open_file

_FOLDER = Path('/dev/shm')  # noqa: S108, where Linux has shared memory
_FIRST_PORT, _PORTS = 7400, 250  # of RTPS: the first one, and how many a domain has
_READY = (2, 3)  # the first number in a file that is made, or known to be broken
_LEAST = 64  # bytes of one
_MAKING_SECONDS = 1.0  # which takes a millisecond


def remove_half_made(domain: int) -> list[Path]:
    """Removes ports of a domain that were never made, and of which nobody can make use.

    Args:
        domain: Its number.

    Returns:
        What was removed.

    Raises:
        ConfigurationError: One cannot be removed.
    """
    first = _FIRST_PORT + _PORTS * domain
    names = {f'fastrtps_port{port}' for port in range(first, first + _PORTS)}
    left = [port for port in _present() if port.name in names and _is_left_half_made(port)]
    for port in left:
        _remove(port)
    return left


def _present() -> list[Path]:
    """What is in shared memory; nothing where there is none."""
    try:
        return sorted(_FOLDER.iterdir())
    except OSError:
        return []


def _remove(port: Path) -> None:
    try:
        port.unlink(missing_ok=True)
    except OSError as error:
        raise ConfigurationError(
            f'a killed process has left {port} half made, for which Fast DDS would wait for '
            f'ever: remove it ({error.strerror}), or use another ROS_DOMAIN_ID'
        ) from error


def _is_left_half_made(port: Path) -> bool:
    """Whether a file is not ready, and was made too long ago to become so."""
    while _is_half_made(port):
        try:
            age = time.time() - port.stat().st_mtime
        except FileNotFoundError:
            return False
        if not 0 <= age < _MAKING_SECONDS:
            return True
        time.sleep(0.05)
    return False


def _is_half_made(port: Path) -> bool:
    try:
        with open_file(port) as file:  # which waits for nobody, should it be a pipe
            begin = file.read(_LEAST)
        return len(begin) < _LEAST or int.from_bytes(begin[:4], 'little') not in _READY
    except OSError:  # there is none, or it is another user's
        return False
