# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Sends rows to Rerun without ever waiting for ever.

Left to itself, the Rerun SDK waits for ever for a viewer that has stopped reading: in calls that
log, in disconnect, and in an exit handler. Therefore a batch is sent only once the one before
has left, which `flush` tells with a timeout; the handler is removed; and disconnecting is left
to a thread that can be abandoned. A viewer that is not there is likewise one that does not read,
until one answers.
"""

from __future__ import annotations

import contextlib
import os
import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, BinaryIO, TypeAlias

import numpy as np

from linkage_ros.errors import ViewerError, missing_library
from linkage_ros.parameters.viewers import SPAWN, WEB, viewer_address
from linkage_ros.quantities import shown
from linkage_ros.view.scene import TIMELINE, Form, Rows
from linkage_ros.view.targets import (
    answers,
    create_file,
    free_address,
    is_served,
    reachable,
)

# Rerun costs 60 MB and most of a second: it is imported where it is used.
if TYPE_CHECKING:
    import rerun as rr

    Begin: TypeAlias = Callable[[rr.RecordingStream], None]

_SERVED = '64MB'  # of the past, for windows that connect late
_SEND_SECONDS = 2.0  # for which a viewer may hold up a batch
_LAGGING_SECONDS = 0.05  # likewise once it has done so
_WRITE_SECONDS = 5.0  # for which a disk may do so
_CLOSE_SECONDS = 2.5
_LAST_SECONDS = 0.5  # of these, for a viewer that has not kept up
_ANSWER_SECONDS = 3.0  # a viewer that was started a moment ago needs about one
_RETRY_SECONDS = 1.0  # between two looks for a viewer


class Sender:
    """Sends to a viewer elsewhere, to whoever connects here, or to a file.

    Attributes:
        url: Where windows connect; None: nothing is served here.
        exposed: Whether other machines can read what is served.
    """

    def __init__(self, target: str, bind: str, begin: Begin, *, overwrite: bool) -> None:
        """Opens it.

        Args:
            target: One of VIEWERS.
            bind: Address on which data are served.
            begin: Called with the recording at each connection: sends what never changes.
            overwrite: Whether to replace an existing file.

        Raises:
            ViewerError: The target cannot be opened, or Rerun is missing.
        """
        _import_rerun()
        import rerun as rr

        self.url: str | None = None
        self.exposed = False
        self._absent = False
        self._port = 0
        self._file: BinaryIO | None = None
        self._target, self._begin = target, begin
        self._address = viewer_address(target)
        self._lags = False
        self._retry = 0.0
        if target in (SPAWN, WEB):
            host, port, self.exposed = free_address(bind)
            self._port = port
            self._sink: rr.GrpcServerSink | rr.GrpcSink | rr.FileSink = rr.GrpcServerSink(
                host, port, server_memory_limit=_SERVED
            )
            where = reachable(host) if target == WEB else host
            self.url = f'rerun+http://{where}:{port}/proxy'
        elif self._address:
            try:
                self._sink = rr.GrpcSink(target)
            except RuntimeError as error:
                raise ViewerError(
                    f'viewer = {shown(target)} is not a valid viewer address'
                ) from error
            self._absent = True
        else:
            self._file = create_file(target, overwrite=overwrite)
            self._sink = rr.FileSink(target, write_footer=False)
        self._stream = rr.RecordingStream('linkage_ros')
        if self._absent:
            self._find(_ANSWER_SECONDS)
        else:
            self._connect()

    @property
    def is_file(self) -> bool:
        """Whether it is a file."""
        return self._file is not None

    @property
    def trouble(self) -> str:
        """Why nothing can be sent now, in words; empty: it can."""
        if self._absent:
            return f'no viewer answers at {self._target}: states are left out until one does'
        if self._port and not is_served(self._port):
            return f'the data are no longer served at {self.url}: start the run again'
        where = self.url or self._target
        words = f'the viewer at {where} does not read: states are left out until it does'
        return words if self._lags else ''

    def ready(self) -> bool:
        """Whether more may be sent: somebody is there, and has taken all that was sent so far.

        Raises:
            ViewerError: The disk takes no more.
        """
        if self._absent and not (time.monotonic() >= self._retry and self._find(0.0)):
            return False
        patience = _WRITE_SECONDS if self.is_file else _SEND_SECONDS
        try:
            self._stream.flush(timeout_sec=_LAGGING_SECONDS if self._lags else patience)
        except RuntimeError as error:
            self._lags = True
            if self.is_file:
                raise ViewerError(f'{self._target} takes no more: is the disk full?') from error
            if 'severed' in str(error) or 'disconnected' in str(error):
                self._absent = True
                self._retry = time.monotonic() + _RETRY_SECONDS
        else:
            self._lags = False
        return not self._lags

    def send(self, rows: Rows, *, wall_clock: bool) -> None:
        """Sends rows of one entity.

        Args:
            rows: Values at stamps.
            wall_clock: Whether the stamps are times of day, not durations.
        """
        import rerun as rr

        if wall_clock:
            times = rr.TimeColumn(TIMELINE, timestamp=rows.stamps.astype('datetime64[ns]'))
        else:
            times = rr.TimeColumn(TIMELINE, duration=rows.stamps.astype('timedelta64[ns]'))
        self._stream.send_columns(rows.entity, [times], _columns(rows), strict=True)

    def close(self) -> None:
        """Sends what is left and lets the viewer go: within 3 s, even if it is stuck."""
        thread = threading.Thread(target=self._disconnect, name='viewer close', daemon=True)
        thread.start()
        thread.join(_LAST_SECONDS if self._lags or self._absent else _CLOSE_SECONDS)
        if self._file:
            self._file.close()

    def _find(self, patience: float) -> bool:
        """Connects to the viewer elsewhere if it answers in time; returns whether it does."""
        if self._address and answers(self._address, patience):
            self._connect()
            self._lags = self._absent = False
        self._retry = time.monotonic() + _RETRY_SECONDS
        return not self._absent

    def _connect(self) -> None:
        try:
            self._stream.set_sinks(self._sink)
        except RuntimeError as error:
            raise ViewerError(f'{self._target} cannot be opened: {error}') from error
        self._begin(self._stream)

    def _disconnect(self) -> None:
        with contextlib.suppress(RuntimeError):
            self._stream.flush(timeout_sec=_CLOSE_SECONDS - _LAST_SECONDS)
        self._stream.disconnect()


def _columns(rows: Rows) -> rr.ComponentColumnList:
    """What an entity shows, as Rerun takes it."""
    import rerun as rr

    values = rows.values
    if rows.form is Form.SCALARS:
        return rr.Scalars.columns(scalars=values)
    if rows.form is Form.POINTS:
        return rr.Points2D.columns(positions=values)
    if rows.form is Form.LINES:
        return rr.LineStrips2D.columns(strips=values.astype(np.float32))
    if rows.form is Form.LABELS:
        count, size = values.shape
        return rr.Points2D.columns(labels=values.ravel()).partition([size] * count)
    factors, shifts = np.pad(values, ((0, 0), (0, 0), (0, 1))).swapaxes(0, 1)
    return rr.Transform3D.columns(scale=factors, translation=shifts)


def _import_rerun() -> None:
    # The SDK would warn at every start that files get no index, which is meant; of each flush that
    # comes to nothing, which is what flushes are asked for here; and of a full disk, which we say.
    quiet = 'RUST_LOG' not in os.environ
    if quiet:
        os.environ['RUST_LOG'] = 'warn,re_log_encoding=off,re_sdk=off,re_grpc_client=off'
    try:
        import rerun as rr

        rr.GrpcServerSink  # noqa: B018, missing in old versions
    except (ImportError, AttributeError) as error:
        raise ViewerError(missing_library('rerun')) from error
    finally:
        if quiet:
            del os.environ['RUST_LOG']
    if os.environ.get('RERUN', '').lower() in {'0', 'false', 'off'}:  # as Rerun reads it
        raise ViewerError(
            'Rerun is switched off: unset RERUN in the environment, or set no viewer'
        )
    rr.unregister_shutdown()
