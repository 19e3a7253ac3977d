# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The viewer as a program: its window, its address, and what may be typed to name one."""

from __future__ import annotations

import contextlib
import importlib.util
import ipaddress
import os
import re
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from linkage_ros.errors import ViewerError
from linkage_ros.quantities import shown

SPAWN = 'spawn'
TARGETS = 'spawn, rerun+http://HOST:PORT/proxy or the path of an .rrd file'

_URL = re.compile(r'rerun\+http://(\[[0-9a-fA-F:.]+\]|[^][/:\s]+):(\d{1,5})/proxy')
_MEMORY = '1GB'  # beyond which the window forgets the oldest
_ANSWER_SECONDS = 3.0  # a viewer that was started a moment ago needs about one


class Window:
    """A viewer window: a process that outlives this one, so that what it shows stays."""

    def __init__(self, binary: Path, url: str) -> None:
        """Opens a window.

        Args:
            binary: Of the viewer.
            url: Where it gets its data.

        Raises:
            ViewerError: The program cannot be run.
        """
        # `CI` is all that keeps the viewer from reporting its use without changing the user's
        # settings. Its port, on which it would take data itself, must not be open to others.
        environment = {'RUST_LOG': 'error', **os.environ, 'CI': '1'}
        options = ['--bind', '127.0.0.1', '--port', 'auto', '--hide-welcome-screen']
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115, let_go closes it
        try:
            self.process = subprocess.Popen(  # noqa: S603, the program is Rerun's own
                [binary, url, *options, '--memory-limit', _MEMORY],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=self._errors,
                env=environment,
                start_new_session=True,  # Ctrl-C in the terminal is not for it
            )
        except OSError as error:
            self._errors.close()
            raise ViewerError(f'{binary} cannot be run: {error.strerror or error}') from error

    def check(self) -> None:
        """Passes if the window is open or was closed.

        Raises:
            ViewerError: The viewer gave up by itself.
        """
        if (self.process.poll() or 0) > 0:
            self._errors.seek(0)
            *_, cause = [b'no reason given', *self._errors.read().splitlines()]
            words = cause.decode(errors='replace').removeprefix('Error: ')
            raise ViewerError(f'the viewer window could not be opened: {words[:300]}')

    def let_go(self) -> None:
        """Leaves the window to itself."""
        self._errors.close()


def find_viewer() -> Path:
    """Finds the program that opens a window.

    Returns:
        The binary itself: the `rerun` command is a wrapper that does not pass signals on.

    Raises:
        ViewerError: It is not installed, or there is no screen.
    """
    screens = ('DISPLAY', 'WAYLAND_DISPLAY', 'WAYLAND_SOCKET')
    if sys.platform == 'linux' and not any(os.environ.get(name) for name in screens):
        raise ViewerError(
            'no screen for a viewer window (neither DISPLAY nor WAYLAND_DISPLAY is set): '
            'give an .rrd file or the URL of a viewer on another machine'
        )
    named = os.environ.get('RERUN_CLI_PATH')
    package = importlib.util.find_spec('rerun_cli')
    folder = Path(package.origin).parent if package and package.origin else Path()
    files = ('Rerun.app/Contents/MacOS/Rerun', 'rerun', 'rerun.exe')
    paths = [Path(named)] if named else [folder / file for file in files]
    for path in paths:
        if path.is_file():
            return path
    raise ViewerError(
        f'no viewer program at {paths[-1] if named else folder / "rerun"}: '
        'pip install --force-reinstall rerun-sdk'
    )


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
            f'viewer_bind = {shown(bind)} is no address of this machine: 127.0.0.1 serves this '
            'machine alone, 0.0.0.0 every network it is in'
        ) from error
    host = f'[{address}]' if address.version == 6 else str(address)
    return host, port, not address.is_loopback


def viewer_url(target: str) -> str | None:
    """Reads the URL of a viewer.

    Args:
        target: What was typed.

    Returns:
        The URL, or None if it is none.

    Raises:
        ViewerError: No viewer answers there.
    """
    match = _URL.fullmatch(target)
    if match is None:
        return None
    deadline = time.monotonic() + _ANSWER_SECONDS
    while time.monotonic() < deadline:
        # Ports beyond 65535 are an OverflowError.
        with contextlib.suppress(OSError, OverflowError):
            socket.create_connection((match[1].strip('[]'), int(match[2])), timeout=1).close()
            return target
        time.sleep(0.1)
    raise ViewerError(f'no viewer answers at {target}: start one there first, with `rerun`')


def create_file(target: str, *, overwrite: bool) -> None:
    """Creates an empty recording.

    Args:
        target: Its path.
        overwrite: Whether to replace an existing file.

    Raises:
        ViewerError: It is no path of an .rrd file, the file exists and is not to be replaced,
            or it cannot be created.
    """
    path = Path(target)
    if path.suffix != '.rrd' or path.is_dir() or '://' in target:
        raise ViewerError(f'viewer = {shown(target)} is not one of: {TARGETS}')
    try:
        path.open('wb' if overwrite else 'xb').close()
    except FileExistsError as error:
        raise ViewerError(
            f'{target} exists already and is kept: choose another name, or delete it first'
        ) from error
    except OSError as error:
        raise ViewerError(
            f'viewer = {shown(target)} cannot be written ({error.strerror or error}); '
            f'a viewer is one of: {TARGETS}'
        ) from error
