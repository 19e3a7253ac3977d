# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where a view goes: the addresses and the file that belong to a target."""

from __future__ import annotations

import contextlib
import ipaddress
import socket
import time
from pathlib import Path
from typing import BinaryIO

from linkage_ros.errors import ViewerError
from linkage_ros.files import is_replaceable, open_file
from linkage_ros.parameters.viewers import VIEWERS, is_recording, no_viewer
from linkage_ros.quantities import shown

_SOCKETS = '/proc/net/tcp', '/proc/net/tcp6'
# States of a socket, as Linux writes them there.
_CONNECTED, _LISTENS = '01', '0A'


def free_address(bind: str) -> tuple[str, int, bool]:
    """Finds where to serve.

    Args:
        bind: An IP address of this machine.

    Returns:
        The address as URLs write it, a free port, and whether other machines reach it.

    Raises:
        ViewerError: It is no such address.
    """
    try:
        address = ipaddress.ip_address(bind)
        family = socket.AF_INET6 if address.version == 6 else socket.AF_INET
        with socket.socket(family) as probe:
            probe.bind((bind, 0))
            port: int = probe.getsockname()[1]
    except (ValueError, OSError) as error:
        raise ViewerError(
            f'viewer_bind = {shown(bind)} is not an address of this machine: 127.0.0.1 serves '
            'this machine alone, 0.0.0.0 every network it is in'
        ) from error
    host = f'[{address}]' if address.version == 6 else str(address)
    return host, port, not address.is_loopback


def answers(address: tuple[str, int], patience: float) -> bool:
    """Whether something takes connections where a viewer should.

    Args:
        address: Of the viewer.
        patience: How long to go on asking, s; it is asked at least once.

    Returns:
        Whether it does.
    """
    deadline = time.monotonic() + patience
    while True:
        with contextlib.suppress(OSError, UnicodeError):  # a name that no host can have
            socket.create_connection(address, timeout=1).close()
            return True
        if time.monotonic() > deadline:
            return False
        time.sleep(0.1)


def is_connected(port: int) -> bool:
    """Whether anybody is connected to a port of this machine.

    Args:
        port: The port.

    Returns:
        Whether there is a connection.
    """
    return _has_socket(port, _CONNECTED)


def is_served(port: int) -> bool:
    """Whether anything takes connections at a port of this machine.

    Args:
        port: The port.

    Returns:
        Whether something does.
    """
    return _has_socket(port, _LISTENS)


def _has_socket(port: int, wanted: str) -> bool:
    tables = (path for path in map(Path, _SOCKETS) if path.exists())  # without IPv6, one
    lines = (line.split() for path in tables for line in path.read_text().splitlines()[1:])
    return any(own.endswith(f':{port:04X}') and state == wanted for _, own, _, state, *_ in lines)


def reachable(host: str) -> str:
    """What a browser elsewhere has to ask for where something is served on every address.

    Args:
        host: From `free_address`.

    Returns:
        The address, or this machine's name instead of all addresses.
    """
    return socket.gethostname() if host in {'0.0.0.0', '[::]'} else host  # noqa: S104


def create_file(target: str, *, overwrite: bool) -> BinaryIO:
    """Creates an empty recording.

    Args:
        target: Its path.
        overwrite: Whether to replace an existing file.

    Returns:
        The file, which is kept from other runs as long as it is open.

    Raises:
        ViewerError: It is no path of an .rrd file, the file exists and is not to be replaced,
            another run writes it, or it cannot be created.
    """
    path = Path(target)
    if not is_recording(target) or path.is_dir():
        raise ViewerError(no_viewer(target))
    try:
        return open_file(path, 'wb' if overwrite else 'xb')
    except BlockingIOError as error:
        raise ViewerError(
            f'{target} is being written by another run and is kept: choose another name'
        ) from error
    except FileExistsError as error:
        if not is_replaceable(path):
            raise ViewerError(f'{target} cannot be replaced: choose another name') from error
        raise ViewerError(
            f'{target} already exists and is kept: choose another name, or delete it first '
            '(linkage_node: or set log_overwrite)'
        ) from error
    except OSError as error:
        raise ViewerError(
            f'viewer = {shown(target)} cannot be written ({error.strerror or error}); '
            f'a viewer is one of: {VIEWERS}'
        ) from error
