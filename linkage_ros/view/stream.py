# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The live view: a run as Rerun shows it, in a window, in a viewer elsewhere or in a file.

Left to itself, the Rerun SDK waits for ever for a viewer that has stopped reading: in calls that
log, in disconnect, and in an exit handler. Therefore a batch is sent only once the one before
has left, which `flush` tells with a timeout; the handler is removed; and disconnecting is left
to a thread that can be abandoned.
"""

from __future__ import annotations

import contextlib
import os
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from linkage_ros.errors import ViewerError
from linkage_ros.run.configuration import Configuration
from linkage_ros.view.layout import TIMELINE, fixed_components, layout
from linkage_ros.view.scene import Kind, Rows, Scene
from linkage_ros.view.viewer import (
    SPAWN,
    WEB,
    Program,
    create_file,
    find_viewer,
    free_address,
    host_page,
    open_window,
    reachable,
    require_screen,
    viewer_url,
)

# Rerun costs 60 MB and most of a second: it is imported where it is used, which is in a View.
if TYPE_CHECKING:
    import rerun as rr

_WALL_CLOCK = 10**18  # ns; a stamp before September 2001 counts from the start of something
_SERVED = '64MB'  # of the past, for windows that connect late
_BATCH = 20_000  # samples sent at once, however many have come
_FILE_SECONDS = 1.0  # between the batches of a file: small ones take four times the space
_SEND_SECONDS = 2.0  # for which a viewer may hold up a batch
_LAGGING_SECONDS = 0.05  # likewise once it has done so
_WRITE_SECONDS = 5.0  # for which a disk may do so
_CLOSE_SECONDS = 2.5
_LAST_SECONDS = 0.5  # of these, for a viewer that has not kept up


class Sample(NamedTuple):
    """The joints at one stamp, in the order of the tree.

    Attributes:
        stamp: ns.
        position: The crank's unwrapped, the coupler's from the crank, the output link's; rad, m.
        velocity: rad/s or m/s.
        effort: N m.
    """

    stamp: int
    position: tuple[float, ...]
    velocity: tuple[float, ...]
    effort: tuple[float, ...]


class View:
    """Shows one run; made in one thread, it may then be used by one other.

    'spawn' serves the data and opens a viewer window on it. As usual with Rerun, the window
    stays open with all it has got when the run ends, and closing it does not disturb the run.
    'web' serves the data and hosts Rerun's page for a browser, while the run lasts.
    A URL is that of a viewer that is running already.
    A file keeps all but the last two seconds however the run ends. It has no index, which would
    be collected in memory all the time; `rerun rrd optimize` adds one.

    Stamps are times of day; where the first is none, they are durations: a record from 0 is
    marked 0 s, 1 s, 2 s and not with dates in 1970.

    Attributes:
        url: Where windows connect; None: nothing is served here.
        page: The page for a browser; None: there is none.
        exposed: Whether other machines can read what is served.
        dropped: Samples left out because the viewer lagged.
    """

    def __init__(
        self,
        configuration: Configuration,
        target: str,
        bind: str = '127.0.0.1',
        *,
        overwrite: bool = False,
    ) -> None:
        """Opens the view.

        Args:
            configuration: Of the run.
            target: 'spawn', 'web', 'rerun+http://HOST:PORT/proxy' or the path of an .rrd file.
            bind: Address on which the data for a window or a page, and the page, are served.
            overwrite: Whether to replace an existing file.

        Raises:
            ViewerError: The target is none of these or cannot be opened, or Rerun is missing.
        """
        _import_rerun()
        self.url: str | None = None
        self.page: str | None = None
        self.exposed = False
        self.dropped = 0
        self._target = target
        self._is_file = self._lags = False
        self._waiting: list[Sample] = []
        self._due = 0.0
        self._scene = Scene(configuration)
        self._wall_clock: bool | None = None
        if target == SPAWN:
            require_screen()
        binary = find_viewer() if target in (SPAWN, WEB) else None
        self._recording = self._open(bind, overwrite)
        drawing = self._scene.drawing
        self._recording.send_blueprint(layout(configuration, drawing.bounds))
        for entity, components in fixed_components(configuration, drawing).items():
            self._recording.log(entity, components, static=True, strict=True)
        self._program: Program | None = None
        if binary and self.url:
            if target == SPAWN:
                self._program = open_window(binary, self.url)
            else:
                self._program, self.page = host_page(binary, self.url, bind)

    def consume(self, samples: Sequence[Sample]) -> None:
        """Shows what has come since the last call; may be nothing.

        Args:
            samples: In the order of their stamps.

        Raises:
            ViewerError: The window could not open, the viewer is gone or the disk is full.
        """
        if self._program:
            self._program.check()
        self._waiting += samples
        if time.monotonic() >= self._due or len(self._waiting) >= _BATCH:
            self._release()

    def close(self) -> None:
        """Sends what is left and lets the viewer go: within 3 s, even if it is stuck."""
        if self._program:
            self._program.let_go()
            self._program = None
        try:
            self._release()
        finally:
            thread = threading.Thread(target=self._disconnect, name='viewer close', daemon=True)
            thread.start()
            thread.join(_LAST_SECONDS if self._lags else _CLOSE_SECONDS)

    def discard(self) -> None:
        """Closes the view and removes the file that it has made, if any."""
        self.close()
        if self._target.endswith('.rrd'):
            Path(self._target).unlink(missing_ok=True)

    def _disconnect(self) -> None:
        with contextlib.suppress(RuntimeError):
            self._recording.flush(timeout_sec=_CLOSE_SECONDS - _LAST_SECONDS)
        self._recording.disconnect()

    def _open(self, bind: str, overwrite: bool) -> rr.RecordingStream:
        import rerun as rr

        sink: rr.GrpcServerSink | rr.GrpcSink | rr.FileSink
        if self._target in (SPAWN, WEB):
            host, port, self.exposed = free_address(bind)
            sink = rr.GrpcServerSink(host, port, server_memory_limit=_SERVED)
            where = reachable(host) if self._target == WEB else host
            self.url = f'rerun+http://{where}:{port}/proxy'
        elif url := viewer_url(self._target):
            sink = rr.GrpcSink(url)
        else:
            create_file(self._target, overwrite=overwrite)
            sink = rr.FileSink(self._target, write_footer=False)
            self._is_file = True
        recording = rr.RecordingStream('linkage_ros')
        try:
            recording.set_sinks(sink)
        except RuntimeError as error:
            raise ViewerError(f'{self._target} cannot be opened: {error}') from error
        return recording

    def _has_left(self) -> bool:
        """Whether all that was sent has left this process.

        Raises:
            ViewerError: It never will.
        """
        patience = _WRITE_SECONDS if self._is_file else _SEND_SECONDS
        try:
            self._recording.flush(timeout_sec=_LAGGING_SECONDS if self._lags else patience)
        except RuntimeError as error:
            self._lags = True
            if self._is_file:
                raise ViewerError(f'{self._target} takes no more: is the disk full?') from error
            if 'severed' in str(error):
                raise ViewerError(
                    f'the viewer at {self._target} has ended, or something else listens there'
                ) from error
        else:
            self._lags = False
        return not self._lags

    def _release(self) -> None:
        samples, self._waiting = self._waiting, []
        if self._is_file:
            self._due = time.monotonic() + _FILE_SECONDS
        for start in range(0, len(samples), _BATCH):
            batch = samples[start : start + _BATCH]
            if self._has_left():
                self._show(batch)
            else:
                self.dropped += len(batch)

    def _show(self, samples: Sequence[Sample]) -> None:
        stamps, *values = (np.array(column) for column in zip(*samples, strict=True))
        if self._wall_clock is None:
            self._wall_clock = bool(stamps[0] >= _WALL_CLOCK)
        for rows in self._scene.advance(stamps, *values):
            self._send(rows)

    def _send(self, rows: Rows) -> None:
        import rerun as rr

        if self._wall_clock:
            times = rr.TimeColumn(TIMELINE, timestamp=rows.stamps.astype('datetime64[ns]'))
        else:
            times = rr.TimeColumn(TIMELINE, duration=rows.stamps.astype('timedelta64[ns]'))
        self._recording.send_columns(rows.entity, [times], _columns(rows), strict=True)


def _columns(rows: Rows) -> rr.ComponentColumnList:
    """What an entity shows, as Rerun takes it."""
    import rerun as rr

    values = rows.values
    if rows.kind is Kind.SCALARS:
        return rr.Scalars.columns(scalars=values)
    if rows.kind is Kind.POINTS:
        return rr.Points2D.columns(positions=values)
    if rows.kind is Kind.LINES:
        return rr.LineStrips2D.columns(strips=values.astype(np.float32))
    if rows.kind is Kind.LABELS:
        count, size = values.shape
        return rr.Points2D.columns(labels=values.ravel()).partition([size] * count)
    factors, shifts = np.pad(values, ((0, 0), (0, 0), (0, 1))).swapaxes(0, 1)
    return rr.Transform3D.columns(scale=factors, translation=shifts)


def _import_rerun() -> None:
    # At every start the SDK would warn that files get no index, which is meant.
    quiet = 'RUST_LOG' not in os.environ
    if quiet:
        os.environ['RUST_LOG'] = 'warn,re_log_encoding=error'
    try:
        import rerun as rr

        rr.GrpcServerSink  # noqa: B018, missing in old versions
    except (ImportError, AttributeError) as error:
        raise ViewerError(
            'the viewer needs rerun-sdk, which is missing or too old: '
            "pip install --upgrade 'linkage_ros[viewer]'"
        ) from error
    finally:
        if quiet:
            del os.environ['RUST_LOG']
    rr.unregister_shutdown()
