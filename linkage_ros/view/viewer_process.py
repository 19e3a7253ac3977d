# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Starts Rerun's viewer as a process: a window, or a page for a browser."""

import ipaddress
import os
import shutil
import signal
import socket
import subprocess
import tempfile
import urllib.parse
import webbrowser
from contextlib import suppress
from pathlib import Path

from linkage_ros.errors import ViewerError
from linkage_ros.quantities import shown

_ESTABLISHED = '01'  # state of a connection in /proc/net/tcp
_WINDOW_MEMORY = '1GB'  # memory limit; beyond it a window drops its oldest data
_SERVED_MEMORY = '64MB'  # data kept for browsers and windows that connect late
# Exit codes of a window that the user has closed, or ended with a signal.
_CLOSED_BY_USER = (0, *(-number for number in (
    signal.SIGHUP, signal.SIGINT, signal.SIGTERM, signal.SIGKILL,
)))  # fmt: skip


class ViewerProcess:
    """Rerun's viewer in a separate process."""

    def __init__(self, command: list[str | Path], *, outlives: bool) -> None:
        """Starts the viewer; with `outlives`, it keeps running after this process exits."""
        setpriv = None if outlives else shutil.which('setpriv')
        prefix = [setpriv, '--pdeathsig', 'TERM'] if setpriv else []
        self._outlives = outlives
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115, close closes it
        self.process = subprocess.Popen(  # noqa: S603, the program is Rerun's own
            [*prefix, *command],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=self._errors,
            # With `CI`, the viewer sends no usage statistics and keeps the user's settings.
            env={**os.environ, 'RUST_LOG': 'error', 'CI': '1'},
            start_new_session=True,  # Ctrl-C in the terminal must not reach the viewer
        )

    def runs(self) -> bool:
        """Returns whether the viewer is running; False if the user has closed its window.

        Raises:
            ViewerError: The viewer has failed, or a page's server has ended.
        """
        code = self.process.poll()
        if code is None or (self._outlives and code in _CLOSED_BY_USER):
            return code is None
        self._errors.seek(0)
        *_, words = ['no reason given', *self._errors.read().decode(errors='replace').splitlines()]
        how = f'signal {-code}, {signal.strsignal(-code)}' if code < 0 else words[:300]
        raise ViewerError(f'the viewer has ended ({how}): restart the run to open another')

    def close(self) -> None:
        """Stops the viewer, unless it was started to outlive this process."""
        if not self._outlives:
            self.process.kill()  # it has nothing to save, and may be suspended
            self.process.wait()
        self._errors.close()


def open_viewer(bind: str, *, window: bool) -> tuple[ViewerProcess, str, str]:
    """Opens a window or serves a page.

    The window stays open when this process ends; the page does not.

    Args:
        bind: Address on which the viewer receives and serves data, and serves the page.
        window: Whether to open a window; otherwise a page is served.

    Returns:
        The process; the URL at which the viewer receives data; the URL of the page, or an empty
        string for a window.

    Raises:
        ViewerError: There is no screen, the address is invalid, or the program is missing.
    """
    if window:
        require_screen()
    (host, port), (_, page_port) = free_address(bind), free_address(bind)
    data = ['--bind', bind, '--port', str(port), '--server-memory-limit', _SERVED_MEMORY]
    if window:
        options, page = ['--hide-welcome-screen', '--memory-limit', _WINDOW_MEMORY], ''
    else:
        options = ['--serve-web', '--web-viewer-port', str(page_port)]
        # If the page is served on all addresses of this machine, its URL has the host name.
        name = socket.gethostname() if host in {'0.0.0.0', '[::]'} else host  # noqa: S104
        url = urllib.parse.quote(f'rerun+http://{name}:{port}/proxy', safe='')
        page = f'http://{name}:{page_port}/?url={url}'
    process = ViewerProcess([find_viewer(), *data, *options], outlives=window)
    return process, f'rerun+http://{host}:{port}/proxy', page


def open_page(page: str) -> None:
    """Opens a page in a browser, if there is a screen."""
    with suppress(ViewerError):
        require_screen()
        webbrowser.open(page)


def connections(port: int) -> int | None:
    """Counts the connections to a port of this machine; None if the system does not list them."""
    count = None
    for path in map(Path, ('/proc/net/tcp', '/proc/net/tcp6')):
        with suppress(OSError):
            rows = (line.split() for line in path.read_text().splitlines()[1:])
            count = (count or 0) + sum(
                row[3] == _ESTABLISHED and int(row[1].rpartition(':')[2], 16) == port
                for row in rows
            )
    return count


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
    """Finds the viewer's binary; the `rerun` command is a wrapper that does not forward signals.

    Raises:
        ViewerError: The program is not installed, or not executable.
    """
    import rerun

    package = Path(rerun.__file__).parents[1] / 'rerun_cli'
    path = Path(os.environ.get('RERUN_CLI_PATH') or package / 'rerun')
    if not os.access(path, os.X_OK):
        raise ViewerError(f'no viewer program at {path}: pip install --force-reinstall rerun-sdk')
    return path


def free_address(bind: str) -> tuple[str, int]:
    """Returns an IP address of this machine, as written in URLs, and a free port.

    Raises:
        ViewerError: `bind` is not an address of this machine.
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
            'only this machine, 0.0.0.0 all its networks'
        ) from error
    return f'[{bind}]' if address.version == 6 else bind, port
