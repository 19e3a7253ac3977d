# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Starts Rerun's viewer as a process: a window, or a page for a browser."""

from __future__ import annotations

import importlib.util
import ipaddress
import os
import shutil
import signal
import socket
import subprocess
import tempfile
import urllib.parse
from pathlib import Path

from linkage_ros.errors import ViewerError, missing_library
from linkage_ros.quantities import shown

_MEMORY = '1GB'  # beyond which a window drops its oldest data
_TIMEOUT = 1.0  # s for a page's server to end
# Exit codes of a window that the user has closed, or ended with a signal.
_CLOSED_BY_USER = (0, *(-number for number in (
    signal.SIGHUP, signal.SIGINT, signal.SIGTERM, signal.SIGKILL,
)))  # fmt: skip


class ViewerProcess:
    """Rerun's viewer in a separate process, which shows data served at an address."""

    def __init__(self, command: list[str | Path], *, outlives: bool) -> None:
        """Starts the viewer.

        Args:
            command: The binary, the source of its data, and options.
            outlives: Whether it survives this process, even after a signal of the terminal.

        Raises:
            ViewerError: The program cannot be run.
        """
        # With `CI` set, the viewer sends no usage statistics, and the user's settings stay.
        environment = {**os.environ, 'RUST_LOG': 'error', 'CI': '1'}
        setpriv = None if outlives else shutil.which('setpriv')
        prefix = [setpriv, '--pdeathsig', 'TERM'] if setpriv else []
        self._outlives = outlives
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115, close closes it
        try:
            self.process = subprocess.Popen(  # noqa: S603, the program is Rerun's own
                [*prefix, *command],
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
        """Checks that it runs, or that the user has closed its window.

        Raises:
            ViewerError: It has failed, or a page's server has ended.
        """
        code = self.process.poll()
        if code is None or (self._outlives and code in _CLOSED_BY_USER):
            return
        if code > 0:
            self._errors.seek(0)
            *_, cause = [b'no reason given', *self._errors.read().splitlines()]
            words = cause.decode(errors='replace').removeprefix('Error: ')
            raise ViewerError(f'the viewer could not be opened: {words[:300]}')
        how = f'signal {-code}, {signal.strsignal(-code)}' if code else 'exit code 0'
        raise ViewerError(f'the viewer has ended ({how}): start the run again to have another')

    def close(self) -> None:
        """Ends the viewer, unless it outlives this process."""
        if not self._outlives:
            self.process.terminate()
            try:
                self.process.wait(_TIMEOUT)
            except subprocess.TimeoutExpired:  # it is stopped, by SIGSTOP say
                self.process.kill()
                self.process.wait()
        self._errors.close()


def open_window(binary: Path, data: str) -> ViewerProcess:
    """Opens a window, which stays open with its contents after this process.

    Args:
        binary: Binary of the viewer.
        data: URL of its data.

    Returns:
        The process.

    Raises:
        ViewerError: The program cannot be run.
    """
    # It also accepts data itself, at a port that must not be open to other machines.
    options = ['--bind', '127.0.0.1', '--port', 'auto', '--hide-welcome-screen']
    return ViewerProcess([binary, data, *options, '--memory-limit', _MEMORY], outlives=True)


def serve_page(binary: Path, data: str, bind: str) -> tuple[ViewerProcess, str]:
    """Serves Rerun's page to browsers while this process runs.

    Args:
        binary: Binary of the viewer.
        data: URL of its data.
        bind: Address to serve it on, as for `free_address`.

    Returns:
        The process, and the page's URL.

    Raises:
        ViewerError: The program cannot be run.
    """
    host, port, _ = free_address(bind)
    options = ['--serve-web', '--bind', bind, '--web-viewer-port', str(port), '--port', 'auto']
    page = f'http://{public_host(host)}:{port}/?url={urllib.parse.quote(data, safe="")}'
    return ViewerProcess([binary, data, *options], outlives=False), page


def require_screen() -> None:
    """Checks that a window can be opened.

    Raises:
        ViewerError: There is no screen.
    """
    if not any(map(os.environ.get, ('DISPLAY', 'WAYLAND_DISPLAY', 'WAYLAND_SOCKET'))):
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
    named, package = os.environ.get('RERUN_CLI_PATH'), importlib.util.find_spec('rerun_cli')
    if not (named or (package and package.origin)):
        raise ViewerError(missing_library('rerun'))
    path = Path(named or Path(str(package and package.origin)).with_name('rerun'))
    if not path.is_file():
        raise ViewerError(f'no viewer program at {path}: pip install --force-reinstall rerun-sdk')
    return path


def free_address(bind: str) -> tuple[str, int, bool]:
    """Finds a free port.

    Args:
        bind: An IP address of this machine.

    Returns:
        The address as written in URLs, a free port, and whether other machines can reach it.

    Raises:
        ViewerError: It is not an address of this machine.
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


def public_host(host: str) -> str:
    """The host for a URL: this machine's name if `host` means all addresses."""
    return socket.gethostname() if host in {'0.0.0.0', '[::]'} else host  # noqa: S104
