# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The live view: a run as Rerun shows it, in a window, in a viewer elsewhere or in a file."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from linkage_ros.parameters.configuration import Configuration
from linkage_ros.parameters.viewers import SPAWN, WEB, viewer_address
from linkage_ros.run.machine import Machine
from linkage_ros.view.rerun_layout import layout
from linkage_ros.view.rerun_program import (
    Program,
    find_viewer,
    host_page,
    open_window,
    require_screen,
)
from linkage_ros.view.rerun_sender import Sender
from linkage_ros.view.rerun_static import fixed_components
from linkage_ros.view.scene import JOINT_FIELDS, Scene
from linkage_ros.view.targets import is_connected

# Rerun is imported where it is used, which is in a View.
if TYPE_CHECKING:
    import rerun as rr

_WALL_CLOCK = 10**18  # ns; a stamp before September 2001 counts from the start of something
_BATCH = 20_000  # messages shown at once, however many have come
_FILE_SECONDS = 1.0  # between the batches of a file: small ones take four times the space

# Stamp of the view, ns, and CDR bytes of joint_states.
Shown: TypeAlias = tuple[int, bytes]


class View:
    """Shows one run; made in one thread, it may then be used by one other.

    'spawn' serves the data and opens a viewer window on it. As usual with Rerun, the window
    stays open with all it has got when the run ends, and closing it does not disturb the run.
    'web' serves the data and hosts Rerun's page for a browser, while the run lasts.
    A URL is that of a viewer: whenever none answers there, samples are left out until one does.
    A file keeps all but the last two seconds however the run ends. It has no index, which would
    be collected in memory all the time; `rerun rrd optimize` adds one.

    Stamps are times of day; where the first is none, they are durations: a record from 0 is
    marked 0 s, 1 s, 2 s and not with dates in 1970.

    Attributes:
        url: Where windows connect; None: nothing is served here.
        page: The page for a browser; None: there is none.
        exposed: Whether other machines can read what is served.
        dropped: Samples left out because the viewer lagged, or was not there.
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
            target: One of VIEWERS.
            bind: Address on which the data for a window or a page, and the page, are served.
            overwrite: Whether to replace an existing file.

        Raises:
            ViewerError: The target is none of these or cannot be opened, or Rerun is missing.
        """
        self.page: str | None = None
        self.dropped = 0
        self._target = target
        self._waiting: list[Shown] = []
        self._was_connected = False
        self._due = 0.0
        self._configuration, self._scene = configuration, Scene(configuration)
        self._codec = Machine(configuration).joint_states
        self._wall_clock: bool | None = None
        if target == SPAWN:
            require_screen()
        binary = find_viewer() if target in (SPAWN, WEB) else None
        self._sender = Sender(target, bind, self._begin, overwrite=overwrite)
        self.url, self.exposed = self._sender.url, self._sender.exposed
        self._program: Program | None = None
        if binary and self.url:
            if target == SPAWN:
                self._program = open_window(binary, self.url)
            else:
                self._program, self.page = host_page(binary, self.url, bind)

    @property
    def trouble(self) -> str:
        """Why nothing is shown now, in words; empty where all is well."""
        if words := self._sender.trouble:
            return words
        if self._has_lost_its_window():
            return (
                'the viewer window has lost its connection, as one does that is stopped for half '
                f'a minute: `rerun {self.url}` opens another, with what came lately'
            )
        return ''

    def consume(self, samples: Sequence[Shown]) -> None:
        """Shows what has come since the last call; may be nothing.

        Args:
            samples: Messages of joint states, in the order of their stamps.

        Raises:
            ViewerError: The window could not open, the page's host has ended, or the disk is full.
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
            self._sender.close()

    def discard(self) -> None:
        """Closes the view and removes the file that it has made, if any."""
        self.close()
        if self._sender.is_file:
            Path(self._target).unlink(missing_ok=True)

    def _has_lost_its_window(self) -> bool:
        """Whether the window runs and shows nothing any more: Rerun's server gave it up."""
        address = viewer_address(self.url or '')
        if self._target != SPAWN or not address or not (self._program and self._program.runs):
            return False
        connected = is_connected(address[1])
        self._was_connected |= connected
        return self._was_connected and not connected

    def _begin(self, stream: rr.RecordingStream) -> None:
        drawing = self._scene.drawing
        stream.send_blueprint(layout(self._configuration, drawing))
        for entity, components in fixed_components(self._configuration, drawing).items():
            stream.log(entity, components, static=True, strict=True)

    def _release(self) -> None:
        samples, self._waiting = self._waiting, []
        if self._sender.is_file:
            self._due = time.monotonic() + _FILE_SECONDS
        for start in range(0, len(samples), _BATCH):
            batch = samples[start : start + _BATCH]
            if self._sender.ready():
                self._show(batch)
            else:
                self.dropped += len(batch)

    def _show(self, samples: Sequence[Shown]) -> None:
        stamps = np.array([stamp for stamp, _ in samples])
        numbers = np.array([self._codec.decode(message)[1] for _, message in samples])
        values = np.split(numbers, len(JOINT_FIELDS), axis=1)
        if self._wall_clock is None:
            self._wall_clock = bool(stamps[0] >= _WALL_CLOCK)
        for rows in self._scene.advance(stamps, *values):
            self._sender.send(rows, wall_clock=self._wall_clock)
