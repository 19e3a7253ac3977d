# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Makes quadrilateral.gif beside it: a turn of the quadrilateral, as Rerun's viewer shows it.

    python docs/moving_picture.py

It needs the package with its extras viewer and chart (Pillow comes with matplotlib), and Vulkan:
a graphics card's, or Mesa's in software (mesa-vulkan-drivers on Debian and Ubuntu). It needs no
screen: the viewer draws all it has in its window, but opens none. A quarter of a minute.
"""

from __future__ import annotations

import io
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from PIL import Image

from linkage_ros import cli
from linkage_ros.errors import ViewerError
from linkage_ros.motion.drives import SpeedDrive
from linkage_ros.parameters.configuration import Configuration, load
from linkage_ros.run.simulator import Simulator
from linkage_ros.units import NS_PER_S
from linkage_ros.view.picture import TIMELINE, Picture
from linkage_ros.view.rerun_view import View
from linkage_ros.view.viewer_process import ViewerProcess, find_viewer, free_address

# Imported where it is used, after a View has told it not to warn of what is meant.
if TYPE_CHECKING:
    import rerun.blueprint as rrb
    from rerun.experimental import ViewerClient

_NAME = 'python docs/moving_picture.py'
_OUT = Path(__file__).with_name('quadrilateral.gif')
_RPM, _TURN = 60.0, 1.0  # s
_FRAMES = 50  # a turn: as many as a View draws, so that each shows another state
_FRAME_MS = 40  # half as fast as the crank turns: eyes can follow
_SHOWN = (-0.06, 1.06)  # s, on the axis of time: with room for the numbers at its ends
_SIZE = '960x500'
_ZOOMS = 3  # each makes letters and lines a tenth larger: the picture is read at half size too
_BAND = 46  # above the views, where the viewer keeps its title bar even if that is hidden
_COLORS = 64
_PATIENCE = 30.0  # s, for the viewer to start


def _messages(configuration: Configuration) -> list[tuple[int, bytes]]:
    """One turn, with the state at its end."""
    simulator = Simulator(configuration)
    motion = simulator.begin(0)
    stamps = map(simulator.elapsed, range(simulator.tick_at(round(_TURN * NS_PER_S)) + 1))
    return [(0, simulator.snapshot_at(motion, stamp).messages[0]) for stamp in stamps]


def _blueprint(configuration: Configuration) -> rrb.Blueprint:
    """The linkage and the torque of the usual layout, no panels, and a time axis that stands."""
    import rerun as rr
    import rerun.blueprint as rrb

    usual = Picture(configuration).layout()
    linkage, first, _ = usual.root_container.contents
    torque = first.contents[0]
    start, end = (rr.TimeRangeBoundary.absolute(seconds=seconds) for seconds in _SHOWN)
    turn = rr.TimeRange(start=start, end=end)
    # The usual axis ends at the cursor, which moves.
    torque.properties['TimeAxis'] = rrb.archetypes.TimeAxis(view_range=turn)
    del torque.properties['VisibleTimeRanges']
    return rrb.Blueprint(
        rrb.Horizontal(linkage, torque, column_shares=[2, 3]),
        rrb.TopPanel(state='hidden'),
        rrb.TimePanel(timeline=TIMELINE, state='hidden'),
        rrb.SelectionPanel(state='hidden'),
        rrb.BlueprintPanel(state='hidden'),
    )


def _connect(program: ViewerProcess, url: str) -> ViewerClient:
    """Waits for the viewer until it has loaded all.

    Raises:
        ViewerError: It gave up, or nothing came of it.
    """
    from rerun.experimental import ViewerClient

    deadline = time.monotonic() + _PATIENCE
    while time.monotonic() < deadline:
        program.runs()
        try:
            client = ViewerClient.connect(url)
            state = client.get_state()
            if len(state.views) == 2 and not state.loading:
                return client
        except ConnectionError:
            pass  # not yet
        time.sleep(0.2)
    raise ViewerError('the viewer does not start')


def _frames(files: list[Path]) -> Iterator[Image.Image]:
    """The viewer's pictures of a turn, evenly spaced in time."""
    host, port = free_address('127.0.0.1')
    options = ['--headless', '--window-size', _SIZE, '--bind', host, '--port', str(port)]
    program = ViewerProcess([find_viewer(), *files, *options], outlives=False)
    try:
        client = _connect(program, f'rerun+http://{host}:{port}/proxy')
        for _ in range(_ZOOMS):
            client.run_command('ui.zoom_in_ui')
        for number in [0] * 10 + list(range(_FRAMES)):  # it needs some frames to settle
            client.set_time(TIMELINE, duration=number * _TURN / _FRAMES, play_state='paused')
            picture = Image.open(io.BytesIO(client.take_screenshot())).convert('RGB')
            yield picture.crop((0, _BAND, *picture.size))
    finally:
        program.close()


def _make(out: Path) -> None:
    configuration = replace(load('quadrilateral'), drive=SpeedDrive(rpm=_RPM))
    with tempfile.TemporaryDirectory() as folder:
        recording, blueprint = Path(folder, 'turn.rrd'), Path(folder, 'turn.rbl')
        view = View(configuration, str(recording))
        view.consume(_messages(configuration))
        view.close()
        _blueprint(configuration).save('linkage_ros', blueprint)
        frames = list(_frames([recording, blueprint]))[-_FRAMES:]
    # One palette for all, and no dither: what does not move stays the same, and takes no space.
    palette = frames[_FRAMES // 3].quantize(_COLORS)
    first, *others = (
        frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames
    )
    first.save(out, save_all=True, append_images=others, duration=_FRAME_MS, loop=0, optimize=True)
    print(
        f'{out}: {first.width} x {first.height}, {len(frames)} frames, {out.stat().st_size} bytes'
    )


if __name__ == '__main__':
    parser = cli.make_parser(
        _NAME, 'Make the picture in the README; needs rerun-sdk and Vulkan.', ('', '--out new.gif')
    )
    parser.add_argument('--out', type=Path, default=_OUT, help='default: %(default)s')
    arguments = parser.parse_args()
    sys.exit(cli.run(_NAME, lambda: _make(arguments.out)))
