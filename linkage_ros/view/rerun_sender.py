# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Sends rows to Rerun without waiting for a viewer that does not read.

By itself, the Rerun SDK waits without limit for a viewer that has stopped reading: when logging,
when disconnecting, and in an exit handler. Therefore a batch is sent only after `flush`, with a
timeout, has reported that the last one has left; the exit handler is removed; and disconnecting
happens in a thread that can be abandoned.
"""

from __future__ import annotations

import contextlib
import socket
import threading
import time
from collections.abc import Callable
from typing import BinaryIO, NamedTuple

import numpy as np
import pyarrow as pa
import rerun as rr
from rerun import FileSink, GrpcServerSink, GrpcSink  # missing in old versions

from linkage_ros.errors import ViewerError
from linkage_ros.files import create_file
from linkage_ros.parameters.session import (
    SPAWN,
    WEB,
    is_recording,
    viewer_address,
    viewer_error,
)
from linkage_ros.view.scene import TIMELINE, Rows
from linkage_ros.view.viewer_process import free_address, public_host

# The component that an archetype's values fill; to be given to `columns` once.
_COMPONENTS = {
    archetype: next(iter(columns)).component_descriptor()
    for archetype, columns in (
        (rr.Scalars, rr.Scalars.columns(scalars=[0.0])),
        (rr.Points2D, rr.Points2D.columns(positions=[[0.0, 0.0]])),
        (rr.LineStrips2D, rr.LineStrips2D.columns(strips=[np.zeros((2, 2))])),
    )
}
_SERVED_MEMORY = '64MB'  # of the past, for windows that connect late
_SEND_SECONDS = 2.0  # a viewer may delay a batch for so long
_LAGGING_SECONDS = 0.05  # likewise after it has done so once
_WRITE_SECONDS = 5.0  # likewise for a disk
_CLOSE_SECONDS = 2.5
_LAST_SECONDS = 0.5  # of these, for a viewer that lags
_ANSWER_SECONDS = 3.0  # a viewer that has just been started needs about one
_RETRY_SECONDS = 1.0  # between two attempts to connect


class Sender:
    """Sends to a remote viewer, to viewers that connect here, or to a file.

    Attributes:
        url: Where viewers connect; None: nothing is served here.
        exposed: Whether other machines can read the data.
        is_file: Whether the target is a file.
        trouble: Why nothing can be sent now; empty: it can.
    """

    def __init__(
        self,
        target: str,
        bind: str,
        send_static: Callable[[rr.RecordingStream], None],
        *,
        overwrite: bool,
    ) -> None:
        """Opens the target.

        Args:
            target: One of VIEWERS.
            bind: Address on which data are served.
            send_static: Called with the recording at each connection: sends what never changes.
            overwrite: Whether to replace an existing file.

        Raises:
            ViewerError: The target cannot be opened, or Rerun is missing.
        """
        rr.unregister_shutdown()
        self.url: str | None = None
        self.exposed = False
        self.trouble = ''
        self._target, self._send_static = target, send_static
        self._address = viewer_address(target)
        self._unreachable: tuple[str, int] | None = (
            None  # the address, while no viewer answers there
        )
        self._retry_at = 0.0
        self.is_file = not (target in (SPAWN, WEB) or self._address)
        self._file: BinaryIO | None = None  # locked, so that other runs cannot replace it
        if self.is_file:
            if not is_recording(target):
                raise ViewerError(viewer_error(target))
            cure = 'delete it first (linkage_node: or set log_overwrite)'
            self._file = create_file(target, ViewerError, overwrite=overwrite, cure=cure)
        self._stream = rr.RecordingStream('linkage_ros')
        if target in (SPAWN, WEB):
            host, port, self.exposed = free_address(bind)
            self.url = f'rerun+http://{public_host(host) if target == WEB else host}:{port}/proxy'
            self._connect(GrpcServerSink(host, port, server_memory_limit=_SERVED_MEMORY))
        elif self._address:
            self._try_to_connect(self._address, _ANSWER_SECONDS)
        else:
            self._connect(FileSink(target, write_footer=False))

    def ready(self) -> bool:
        """Returns whether a viewer is connected and has received everything sent so far.

        Raises:
            ViewerError: The disk is full.
        """
        if self._unreachable and time.monotonic() >= self._retry_at:
            self._try_to_connect(self._unreachable, 0.0)
        if self._unreachable:
            return False
        timeout = _WRITE_SECONDS if self.is_file else _SEND_SECONDS
        try:
            self._stream.flush(timeout_sec=_LAGGING_SECONDS if self.trouble else timeout)
            self.trouble = ''
        except RuntimeError as error:
            if self.is_file:
                raise ViewerError(f'{self._target} takes no more: is the disk full?') from error
            where = self.url or self._target
            self.trouble = (
                f'the viewer at {where} does not read: states are left out until it does'
            )
            is_cut = 'severed' in str(error) or 'disconnected' in str(error)
            if self._address and (is_cut or self._has_gone(self._address)):
                self._try_to_connect(self._address, 0.0)
        return not self.trouble

    def _has_gone(self, address: tuple[str, int]) -> bool:
        """Returns whether a stalled viewer has ended; the SDK may not report a killed one."""
        now = time.monotonic()
        if now < self._retry_at:
            return False
        self._retry_at = now + _RETRY_SECONDS
        return not _is_reachable(address, 0.0)

    def send(self, rows: Rows, *, wall_clock: bool) -> None:
        """Sends rows of one entity.

        Args:
            rows: Values at stamps.
            wall_clock: Whether the stamps are times of day, not durations.
        """
        if wall_clock:
            times = rr.TimeColumn(TIMELINE, timestamp=rows.stamps.astype('datetime64[ns]'))
        else:
            times = rr.TimeColumn(TIMELINE, duration=rows.stamps.astype('timedelta64[ns]'))
        self._stream.send_columns(rows.entity, [times], [_column(rows)], strict=True)

    def close(self) -> None:
        """Sends the rest and disconnects within 3 s, even if the viewer hangs."""
        thread = threading.Thread(target=self._disconnect, name='viewer close', daemon=True)
        thread.start()
        thread.join(_LAST_SECONDS if self.trouble else _CLOSE_SECONDS)
        if self._file:
            self._file.close()

    def _try_to_connect(self, address: tuple[str, int], timeout: float) -> None:
        """Connects to the remote viewer if it answers in time."""
        self._unreachable = None if _is_reachable(address, timeout) else address
        if self._unreachable:
            self._retry_at = time.monotonic() + _RETRY_SECONDS
            self.trouble = (
                f'no viewer answers at {self._target}: states are left out until one does'
            )
        else:
            self.trouble = ''
            self._connect(GrpcSink(self._target))

    def _connect(self, sink: GrpcServerSink | GrpcSink | FileSink) -> None:
        try:
            self._stream.set_sinks(sink)
        except RuntimeError as error:
            raise ViewerError(f'{self._target} cannot be opened: {error}') from error
        self._send_static(self._stream)

    def _disconnect(self) -> None:
        with contextlib.suppress(RuntimeError):
            self._stream.flush(timeout_sec=_CLOSE_SECONDS - _LAST_SECONDS)
        self._stream.disconnect()


class _Batch(NamedTuple):
    """What Rerun takes for components."""

    array: pa.Array

    def as_arrow_array(self) -> pa.Array:
        """The components."""
        return self.array


def _column(rows: Rows) -> rr.ComponentColumn:
    """The values of rows; Rerun's archetypes make the same in three times the processor time."""
    count, size, *_ = rows.values.shape
    offsets = np.arange(0, count * size + 1, size, dtype=np.int32)
    if rows.archetype is rr.Scalars:
        array = pa.array(rows.values.reshape(-1))
    else:
        numbers = rows.values.astype(np.float32, copy=False).reshape(-1)
        array = pa.FixedSizeListArray.from_arrays(pa.array(numbers), 2)
    if rows.archetype is rr.LineStrips2D:  # one strip of all points for each stamp
        array = pa.ListArray.from_arrays(offsets, array)
        offsets = np.arange(count + 1, dtype=np.int32)
    return rr.ComponentColumn(_COMPONENTS[rows.archetype], _Batch(array), offsets=offsets)


def _is_reachable(address: tuple[str, int], timeout: float) -> bool:
    """Waits until something accepts connections at an address.

    Args:
        address: Host and port.
        timeout: Longest time, s; there is at least one attempt.

    Returns:
        Whether something accepts connections.
    """
    deadline = time.monotonic() + timeout
    while True:
        with contextlib.suppress(OSError, UnicodeError):  # UnicodeError: an impossible host name
            socket.create_connection(address, timeout=1).close()
            return True
        if time.monotonic() > deadline:
            return False
        time.sleep(0.1)
