# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The view of a run in Rerun: a window, a browser, a remote viewer, or a file.

By default, the Rerun SDK waits without limit for a viewer that has stopped reading: when logging,
when disconnecting, and in an exit handler. Therefore a batch is sent only after `flush`, with a
timeout, has reported that the previous one was sent; the exit handler is removed; and
disconnecting happens in a thread that can be abandoned.
"""

import contextlib
import re
import socket
import threading
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, BinaryIO, TypeAlias

import numpy as np
import numpy.typing as npt
import rerun as rr
from rerun import FileSink, GrpcSink  # missing in old versions

from linkage_ros.errors import ViewerError
from linkage_ros.files import create_file
from linkage_ros.mechanism.kinematics import State
from linkage_ros.numeric import Array
from linkage_ros.quantities import shown
from linkage_ros.settings.configuration import Configuration
from linkage_ros.settings.parameters import SPAWN, VIEWERS, WEB
from linkage_ros.view.rerun_drawing import TIMELINE, RerunDrawing, Rows, blueprint
from linkage_ros.view.viewer_process import ViewerProcess, connections, open_viewer

_URL = re.compile(r'rerun\+http://(\[[0-9a-fA-F:.]+\]|[^][/:\s]+):(\d{1,5})/proxy')
_LAST_PORT = 65535
_WALL_CLOCK = 10**18  # ns; smaller stamps, before September 2001, are times since a start
_BATCH = 20_000  # greatest number of samples sent at once
# Time between batches, s: drawings to a viewer, curves to a viewer, and all data to a file. In a
# viewer, a batch costs as much processor time as fifty samples; small batches would make a file
# four times as large.
_PERIOD, _CURVES_PERIOD, _FILE_PERIOD = 0.1, 0.2, 1.0
_SEND_SECONDS, _WRITE_SECONDS = 2.0, 5.0  # time limit of a batch, for a viewer and for a disk
_CLOSE_SECONDS, _LAST_SECONDS = 2.5, 0.5  # time limit of closing; if the viewer does not read
_ANSWER_SECONDS = 3.0  # a viewer that has just been started needs about 1 s


# The motion of the links at n stamps: stamps, ns; positions, rad and m, and rates, of shape
# (n, links); and driving torques, N m, or forces, N, of shape (n, 1).
LinkMotion: TypeAlias = tuple[npt.NDArray[np.int64], Array, Array, Array]


def motions_of(samples: Sequence[tuple[int, Mapping[str, State]]]) -> dict[str, LinkMotion]:
    """Returns the motion of each linkage, given the states by linkage and their stamps, ns."""
    names = dict.fromkeys(name for _, states in samples for name in states)
    return {
        name: _motion_of([(stamp, x[name]) for stamp, x in samples if name in x]) for name in names
    }


def _motion_of(samples: Sequence[tuple[int, State]]) -> LinkMotion:
    """Returns the motion of the links in states, given with their stamps, ns."""
    stamps, states = zip(*samples, strict=True)
    positions, rates, _, torques, *_ = zip(*states, strict=True)
    # Making arrays from a few long rows takes half the time.
    table = (np.array([*zip(*rows, strict=True)]).T for rows in (positions, rates))
    return np.array(stamps), *table, np.array([torques]).T


class View:
    """A view of one run, which may be created in one thread and used in another.

    'spawn' opens a viewer window. As is usual with Rerun, the window stays open when the run ends,
    and closing it does not affect the run. 'web' serves Rerun's page for a browser while the run
    lasts. A URL names a viewer; samples are dropped while it does not answer. A file contains
    everything except at most the last two seconds, however the run ends. It has no index, which
    would grow in memory; `rerun rrd optimize` adds one.

    Stamps are shown as dates and times of day, but small stamps are shown as durations: a record
    that starts at 0 has the labels 0 s, 1 s, 2 s, not dates in 1970.

    Attributes:
        page: URL of the page for a browser, or an empty text.
        trouble: Reason why no data is currently sent, or an empty text.
        dropped: Number of samples dropped because the viewer lagged or was absent.
        period: Time between calls of `consume`, s.
    """

    def __init__(
        self,
        configuration: Configuration,
        target: str,
        bind: str = '127.0.0.1',
        *,
        overwrite: bool = False,
        read: Callable[[Sequence[Any]], Mapping[str, LinkMotion]] = motions_of,
    ) -> None:
        """Opens the view.

        Args:
            configuration: Configuration of the run.
            target: One of VIEWERS.
            bind: Address on which the data and the page are served, for a window or a page.
            overwrite: Whether to replace an existing file.
            read: Reads samples: returns the motion of each linkage that they hold; by default,
                samples are stamps, ns, and states by linkage.

        Raises:
            ViewerError: The target is invalid or cannot be opened, or Rerun is missing.
        """
        rr.unregister_shutdown()
        self.page = self.trouble = ''
        self.dropped, self.period = 0, _PERIOD
        self._target = target
        self._drawings = {x.name: RerunDrawing(x) for x in configuration.linkages}
        # Samples that the curves do not show yet, and the time of the next curves, s.
        self._read, self._waiting, self._due = read, list[Any](), 0.0
        self._process: ViewerProcess | None = None
        self._file: BinaryIO | None = None  # locked, so that other runs cannot replace it
        self._stream = rr.RecordingStream('linkage_ros')
        if target in (SPAWN, WEB):
            self._process, self._target, self.page = open_viewer(bind, window=target == SPAWN)
        self._address = _address_of(self._target)
        if self._address:
            self._connect(self._address, _ANSWER_SECONDS)
        elif Path(target).suffix != '.rrd' or '://' in target:
            raise ViewerError(f'viewer = {shown(target)} is not one of: {VIEWERS}')
        else:
            cure = 'give --overwrite (a node: log_overwrite)'
            self._file = create_file(target, ViewerError, overwrite=overwrite, cure=cure)
            self._connected, self.period = True, _FILE_PERIOD
            self._use(FileSink(target, write_footer=False))

    def consume(self, samples: Sequence[Any]) -> None:
        """Shows the samples since the last call, and updates the curves when they are due.

        Raises:
            ViewerError: The window did not open, the page's server ended, or the disk is full.
        """
        if self._process and not self._process.runs():
            return  # the user has closed the window
        for start in range(0, max(len(samples), bool(self._waiting)), _BATCH):
            batch = samples[start : start + _BATCH]
            if self._is_ready():
                self._show(batch)
            else:
                self.dropped += len(batch)

    def is_watched(self) -> bool:
        """Returns whether a viewer is connected to the served data; True if this is unknown."""
        count = connections(self._address[1]) if self._address else None
        return count is None or count > 1  # one connection is that of this process

    def close(self) -> None:
        """Sends the remaining samples and disconnects within 3 s, even if the viewer hangs."""
        thread = threading.Thread(target=self._disconnect, name='viewer close', daemon=True)
        thread.start()
        thread.join(_LAST_SECONDS if self.trouble else _CLOSE_SECONDS)
        for part in (self._file, self._process):
            if part:
                part.close()

    def discard(self) -> None:
        """Closes the view and removes its file, if any."""
        self.close()
        if self._file:
            Path(self._target).unlink(missing_ok=True)

    def _is_ready(self) -> bool:
        """Returns whether a viewer is connected and has received everything sent so far.

        Raises:
            ViewerError: The disk is full.
        """
        if self._address and not self._connected:
            self._connect(self._address, 0.0)
        if not self._connected:
            return False
        try:
            self._stream.flush(timeout_sec=_SEND_SECONDS if self._address else _WRITE_SECONDS)
            self.trouble = ''
        except RuntimeError as error:
            if not self._address:
                words = f'{self._target} cannot be written: is the disk full?'
                raise ViewerError(words) from error
            self.trouble = (
                f'the viewer at {self._target} is not reading: states are dropped until it does'
            )
            # The SDK may not notice that a viewer was killed.
            is_cut = 'severed' in str(error) or 'disconnected' in str(error)
            self._connected = not is_cut and _is_reachable(self._address, 0.0)
        return not self.trouble

    def _connect(self, address: tuple[str, int], timeout: float) -> None:
        """Connects to the viewer if it answers in time."""
        self._connected = _is_reachable(address, timeout)
        if self._connected:
            self._use(GrpcSink(self._target))
        else:
            self.trouble = (
                f'no viewer answers at {self._target}: states are dropped until one does'
            )

    def _use(self, sink: GrpcSink | FileSink) -> None:
        self._stream.set_sinks(sink)
        self._stream.send_blueprint(blueprint(self._drawings.values()))
        for drawing in self._drawings.values():
            for entity, components in drawing.constants().items():
                self._stream.log(entity, *components, static=True, strict=True)

    def _show(self, samples: Sequence[Any]) -> None:
        """Sends all drawings and curves if they are due, otherwise only the last drawing."""
        self._waiting += samples
        if self._file or time.monotonic() > self._due:
            self._due = time.monotonic() + _CURVES_PERIOD
            self._send_waiting()
        elif samples:
            for name, motion in self._read(samples[-1:]).items():
                self._send_rows(self._drawings[name].frame(*motion))

    def _send_waiting(self) -> None:
        if self._waiting:
            for name, motion in self._read(self._waiting).items():
                self._send_rows(self._drawings[name].rows(*motion))
            self._waiting = []

    def _send_rows(self, rows: Iterable[Rows]) -> None:
        for entity, stamps, columns in rows:
            is_date = stamps[0] >= _WALL_CLOCK
            times = stamps.astype('datetime64[ns]' if is_date else 'timedelta64[ns]')
            index = rr.TimeColumn(TIMELINE, **{'timestamp' if is_date else 'duration': times})
            self._stream.send_columns(entity, [index], columns, strict=True)

    def _disconnect(self) -> None:
        if not self.trouble:
            self._send_waiting()
        with contextlib.suppress(RuntimeError):
            self._stream.flush(timeout_sec=_CLOSE_SECONDS - _LAST_SECONDS)
        self._stream.disconnect()


def _address_of(target: str) -> tuple[str, int] | None:
    """Returns the host and port in the URL of a viewer; None for other targets."""
    match = _URL.fullmatch(target)
    if match is None or int(match[2]) > _LAST_PORT:
        return None
    return match[1].strip('[]'), int(match[2])


def _is_reachable(address: tuple[str, int], timeout: float) -> bool:
    """Waits, at most for a time, s, for a server at an address; returns whether one answers."""
    deadline = time.monotonic() + timeout
    while True:
        with contextlib.suppress(OSError, UnicodeError):  # UnicodeError: an impossible host name
            socket.create_connection(address, timeout=1).close()
            return True
        if time.monotonic() > deadline:
            return False
        time.sleep(0.1)
