# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Rerun's viewer as a program that is started here: a window, or a page for a browser."""

from __future__ import annotations

import importlib.util
import os
import shutil
import signal
import subprocess
import tempfile
import urllib.parse
from pathlib import Path

from linkage_ros.errors import ViewerError, missing_library
from linkage_ros.view.targets import free_address, reachable

_LOOPBACK = '127.0.0.1'
_MEMORY = '1GB'  # beyond which the window forgets the oldest
_PATIENCE = 1.0  # s for a page's host to end
# How a user ends a window: by closing it, or by one of these signals.
_CLOSED = (0, *(-number for number in (
    signal.SIGHUP, signal.SIGINT, signal.SIGTERM, signal.SIGKILL,
)))  # fmt: skip


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
        """Passes if it runs, or is a window that was closed.

        Raises:
            ViewerError: It ended by itself, or what is to last as long as this process has ended.
        """
        code = self.process.poll()
        if code is None or (self._outlives and code in _CLOSED):
            return
        if code > 0:
            self._errors.seek(0)
            *_, cause = [b'no reason given', *self._errors.read().splitlines()]
            words = cause.decode(errors='replace').removeprefix('Error: ')
            raise ViewerError(f'the viewer could not be opened: {words[:300]}')
        how = f'signal {-code}, {signal.strsignal(-code)}' if code else 'exit code 0'
        raise ViewerError(f'the viewer has ended ({how}): start the run again to have another')

    @property
    def runs(self) -> bool:
        """Whether it has not ended."""
        return self.process.poll() is None

    def let_go(self) -> None:
        """Leaves it to itself, or ends it if it is not to outlive us."""
        if not self._outlives:
            self.process.terminate()
            try:
                self.process.wait(_PATIENCE)
            except subprocess.TimeoutExpired:  # it is stopped
                self.process.kill()
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
    if not any(os.environ.get(name) for name in screens):
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
    if not (named or package):
        raise ViewerError(missing_library('rerun'))
    folder = Path(package.origin).parent if package and package.origin else Path()
    path = Path(named) if named else folder / 'rerun'
    if not path.is_file():
        raise ViewerError(f'no viewer program at {path}: pip install --force-reinstall rerun-sdk')
    return path
