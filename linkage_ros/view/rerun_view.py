# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The view of a run in Rerun: a window, a browser, a remote viewer, or a file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TypeAlias

import numpy as np
import rerun as rr

from linkage_ros.errors import ViewerError
from linkage_ros.parameters.configuration import Configuration
from linkage_ros.parameters.session import SPAWN, WEB
from linkage_ros.run.simulator import Simulator
from linkage_ros.view.rerun_layout import fixed_components, layout
from linkage_ros.view.rerun_sender import Sender
from linkage_ros.view.scene import JOINT_FIELDS, Scene
from linkage_ros.view.viewer_process import (
    ViewerProcess,
    find_viewer,
    open_window,
    require_screen,
    serve_page,
)

_WALL_CLOCK = 10**18  # ns; smaller stamps, before September 2001, count from a start
_BATCH = 20_000  # greatest number of samples sent at once
# s between batches. A file takes four times the space with small ones; live, each costs as much
# processor time as fifty samples, and the linkage moves twenty times a second.
_PERIOD, _FILE_PERIOD = 0.05, 1.0


# CDR bytes of a message on joint_states, and the time by which its stamp is to be shifted, ns.
Sample: TypeAlias = tuple[int, bytes]


class View:
    """Shows one run; it may be created in one thread and used in another.

    'spawn' serves the data and opens a viewer window on it. As usual with Rerun, the window stays
    open with its contents when the run ends, and closing it does not disturb the run. 'web'
    serves the data and Rerun's page for a browser while the run lasts. A URL names a viewer;
    samples are dropped while it does not answer. A file keeps everything but the last two seconds,
    however the run ends. It has no index, which would grow in memory; `rerun rrd optimize` adds
    one.

    Stamps are times of day; if the first is too small for that, they are durations: a record
    from 0 is marked 0 s, 1 s, 2 s and not with dates in 1970.

    Attributes:
        sender: The connection to viewers, with its address and problems.
        page: URL of the page for a browser; None: there is none.
        dropped: Number of samples dropped because the viewer lagged or was absent.
        period: Time between calls of `consume`, s: a file takes four times the space with small
            batches.
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
            configuration: Configuration of the run.
            target: One of VIEWERS.
            bind: Address on which the data for a window or a page, and the page, are served.
            overwrite: Whether to replace an existing file.

        Raises:
            ViewerError: The target is none of these or cannot be opened, or Rerun is missing.
        """
        self.page: str | None = None
        self.dropped = 0
        self._target = target
        self._configuration, self._scene = configuration, Scene(configuration)
        self._codec = Simulator(configuration).joint_states
        self._wall_clock: bool | None = None
        if target == SPAWN:
            require_screen()
        binary = find_viewer() if target in (SPAWN, WEB) else None
        self.sender = Sender(target, bind, self._send_static, overwrite=overwrite)
        self.period = _FILE_PERIOD if self.sender.is_file else _PERIOD
        self._process: ViewerProcess | None = None
        url = self.sender.url
        if binary and url and target == SPAWN:
            self._process = open_window(binary, url)
        elif binary and url:
            self._process, self.page = serve_page(binary, url, bind)

    def consume(self, samples: Sequence[Sample]) -> None:
        """Shows the samples since the last call, if any.

        Args:
            samples: In the order of their stamps.

        Raises:
            ViewerError: The window could not open, the page's server ended, or the disk is full.
        """
        if self._process:
            self._process.check()
        for start in range(0, len(samples), _BATCH):
            batch = samples[start : start + _BATCH]
            if self.sender.ready():
                self._send(batch)
            else:
                self.dropped += len(batch)

    def close(self) -> None:
        """Sends the rest and disconnects within 3 s, even if the viewer hangs."""
        if self._process:
            self._process.close()
            self._process = None
        self.sender.close()

    def discard(self) -> None:
        """Closes the view and removes its file, if any."""
        self.close()
        if self.sender.is_file:
            Path(self._target).unlink(missing_ok=True)

    def _send_static(self, stream: rr.RecordingStream) -> None:
        drawing = self._scene.drawing
        stream.send_blueprint(layout(self._configuration, drawing))
        for entity, components in fixed_components(drawing).items():
            stream.log(entity, components, static=True, strict=True)

    def _send(self, samples: Sequence[Sample]) -> None:
        try:
            stamps, numbers = self._codec.decode_all(b''.join([data for _, data in samples]))
        except ValueError as error:
            raise ViewerError(f'a message of joint states is {error}') from error
        stamps += np.array([shift for shift, _ in samples])
        values = np.split(numbers, len(JOINT_FIELDS), axis=1)
        if self._wall_clock is None:
            self._wall_clock = bool(stamps[0] >= _WALL_CLOCK)
        for rows in self._scene.advance(stamps, *values):
            self.sender.send(rows, wall_clock=self._wall_clock)
