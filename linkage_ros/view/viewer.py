# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The viewer as a program: its window or page, and what may be typed to name one."""

from __future__ import annotations

import contextlib
import importlib.util
import ipaddress
import os
import re
import shutil
import socket
import subprocess
import sys
import tempfile
import time
import urllib.parse
from pathlib import Path

from linkage_ros.core.quantities import shown
from linkage_ros.errors import ViewerError

SPAWN, WEB = 'spawn', 'web'
TARGETS = 'spawn, web, rerun+http://HOST:PORT/proxy or the path of an .rrd file'

_URL = re.compile(r'rerun\+http://(\[[0-9a-fA-F:.]+\]|[^][/:\s]+):(\d{1,5})/proxy')
_LOOPBACK = '127.0.0.1'
_LAST_PORT = 65535
_CONNECTIONS = '/proc/net/tcp', '/proc/net/tcp6'
_MEMORY = '1GB'  # beyond which the window forgets the oldest


class Program:
    """Rerun's viewer as a process of its own, which shows what is served at an address."""

    def __init__(self, command: list[str | Path], *, outlives: bool) -> None:
        """Starts it.

        Args:
            command: The binary, where it gets its data, and options.
            outlives: Whether it stays when this process ends, even by a signal of the terminal.

        Raises:
            ViewerError: The program cannot be run.
        """
        # `CI` is all that keeps the viewer from reporting its use without changing the user's
        # settings.
        environment = {'RUST_LOG': 'error', **os.environ, 'CI': '1'}
        with_us = [] if outlives or not (found := shutil.which('setpriv')) else [
            found, '--pdeathsig', 'TERM',
        ]  # fmt: skip
        self._outlives = outlives
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115, let_go closes it
        try:
            self.process = subprocess.Popen(  # noqa: S603, the program is Rerun's own
                [*with_us, *command],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=self._errors,
                env=environment,
                start_new_session=True,  # Ctrl-C in the terminal is not for it
            )
        except OSError as error:
            self._errors.close()
            raise ViewerError(f'{command[0]} cannot be run: {error.strerror or error}') from error

    def check(self) -> None:
        """Passes if it runs or was ended by its user.

        Raises:
            ViewerError: The viewer gave up by itself.
        """
        if (self.process.poll() or 0) > 0:
            self._errors.seek(0)
            *_, cause = [b'no reason given', *self._errors.read().splitlines()]
            words = cause.decode(errors='replace').removeprefix('Error: ')
            raise ViewerError(f'the viewer could not be opened: {words[:300]}')

    @property
    def runs(self) -> bool:
        """Whether it has not ended."""
        return self.process.poll() is None

    def let_go(self) -> None:
        """Leaves it to itself, or ends it if it is not to outlive us."""
        if not self._outlives:
            self.process.terminate()
            self.process.wait()
        self._errors.close()


def open_window(binary: Path, data: str) -> Program:
    """Opens a window that stays, with what it shows, when this process ends.

    Args:
        binary: Of the viewer.
        data: URL where it gets its data.

    Returns:
        The process.

    Raises:
        ViewerError: The program cannot be run.
    """
    # Its port, on which it would take data itself, must not be open to others.
    options = ['--bind', _LOOPBACK, '--port', 'auto', '--hide-welcome-screen']
    return Program([binary, data, *options, '--memory-limit', _MEMORY], outlives=True)


def host_page(binary: Path, data: str, bind: str) -> tuple[Program, str]:
    """Hosts Rerun's page, for a browser, as long as this process runs.

    Args:
        binary: Of the viewer.
        data: URL where the page gets its data.
        bind: Address to host it on, as in `free_address`.

    Returns:
        The process, and the page's URL.

    Raises:
        ViewerError: The program cannot be run.
    """
    host, port, _ = free_address(bind)
    options = ['--serve-web', '--bind', bind, '--web-viewer-port', str(port), '--port', 'auto']
    page = f'http://{reachable(host)}:{port}/?url={urllib.parse.quote(data, safe="")}'
    return Program([binary, data, *options], outlives=False), page


def require_screen() -> None:
    """Passes where a window can be opened.

    Raises:
        ViewerError: There is no screen.
    """
    screens = ('DISPLAY', 'WAYLAND_DISPLAY', 'WAYLAND_SOCKET')
    if sys.platform == 'linux' and not any(os.environ.get(name) for name in screens):
        raise ViewerError(
            'no screen for a viewer window (neither DISPLAY nor WAYLAND_DISPLAY is set): '
            'give web for a page, an .rrd file or the URL of a viewer on another machine'
        )


def find_viewer() -> Path:
    """Finds the viewer's program.

    Returns:
        The binary itself: the `rerun` command is a wrapper that does not pass signals on.

    Raises:
        ViewerError: It is not installed.
    """
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


def viewer_address(target: str) -> tuple[str, int] | None:
    """Reads the URL of a viewer.

    Args:
        target: What was typed.

    Returns:
        Its host and port; None: it is no such URL.
    """
    match = _URL.fullmatch(target)
    if match is None or int(match[2]) > _LAST_PORT:
        return None
    return match[1].strip('[]'), int(match[2])


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
        with contextlib.suppress(OSError):
            socket.create_connection(address, timeout=1).close()
            return True
        if time.monotonic() > deadline:
            return False
        time.sleep(0.1)


def is_connected(port: int) -> bool:
    """Whether anybody is connected to a port of this machine; true where Linux does not tell.

    Args:
        port: The port.

    Returns:
        Whether there is a connection.
    """
    tables = [path for path in map(Path, _CONNECTIONS) if path.exists()]
    lines = (line.split() for path in tables for line in path.read_text().splitlines()[1:])
    there = any(own.endswith(f':{port:04X}') and state == '01' for _, own, _, state, *_ in lines)
    return there or not tables


def reachable(host: str) -> str:
    """What a browser elsewhere has to ask for where something is served on every address.

    Args:
        host: From `free_address`.

    Returns:
        The address, or this machine's name instead of all addresses.
    """
    return socket.gethostname() if host in {'0.0.0.0', '[::]'} else host  # noqa: S104


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
