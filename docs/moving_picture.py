# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Makes docs/quadrilateral.gif: one turn of the quadrilateral in Rerun's viewer.

    python docs/moving_picture.py

Requires the extras viewer and chart (Pillow comes with matplotlib), and Vulkan: the driver of a
graphics card, or Mesa's software driver (mesa-vulkan-drivers on Debian and Ubuntu). It needs no
screen, because the viewer renders without a window. This takes a quarter of a minute.
"""

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
from linkage_ros.mechanism.kinematics import State
from linkage_ros.motion.drives.speed import SpeedDrive
from linkage_ros.run.states import Simulator
from linkage_ros.settings.configuration import Configuration, load
from linkage_ros.units import NS_PER_S
from linkage_ros.view.rerun_connection import View
from linkage_ros.view.rerun_drawing import TIMELINE, RerunDrawing
from linkage_ros.view.viewer_process import ViewerProcess, find_viewer, free_address

# Imported where it is used, after linkage_ros.view has set the log level of Rerun.
if TYPE_CHECKING:
    import rerun.blueprint as rrb
    from rerun.experimental import ViewerClient

_NAME = 'python docs/moving_picture.py'
_OUT = Path(__file__).with_name('quadrilateral.gif')
_RPM, _TURN = 60.0, 1.0  # s
_FRAMES = 50  # per turn, the rate at which a View draws, so that each frame shows a new state
_FRAME_MS = 40  # half the speed of the crank, to be easy to follow
_SHOWN = (-0.06, 1.06)  # s, range of the time axis, with room for the labels at its ends
_SIZE = '960x500'
_ZOOMS = 3  # each enlarges text and lines by a tenth: the picture is also read at half size
_BAND = 46  # px above the views, where the viewer reserves space for its hidden title bar
_COLORS = 64
_PATIENCE = 30.0  # s, time limit for the viewer to start


def _states(configuration: Configuration) -> list[tuple[int, dict[str, State]]]:
    """Computes the states of one turn, including the one at its end, with their stamps, ns."""
    simulator = Simulator(configuration.only)
    motion = simulator.begin(0)
    stamps = map(
        simulator.ticks.elapsed, range(simulator.ticks.tick_at(round(_TURN * NS_PER_S)) + 1)
    )
    return [(stamp, {'': simulator.state(motion.at(stamp))}) for stamp in stamps]


def _blueprint(configuration: Configuration) -> 'rrb.Blueprint':
    """Reduces the usual layout to linkage and torque, without panels, with a fixed time axis."""
    import rerun as rr
    import rerun.blueprint as rrb

    usual = RerunDrawing(configuration.only).layout(is_alone=True)
    linkage, plots = usual.contents
    torque = plots.contents[0].contents[0]
    start, end = (rr.TimeRangeBoundary.absolute(seconds=seconds) for seconds in _SHOWN)
    turn = rr.TimeRange(start=start, end=end)
    # Usually the axis ends at the cursor, which moves.
    torque.properties['TimeAxis'] = rrb.archetypes.TimeAxis(view_range=turn)
    return rrb.Blueprint(
        rrb.Horizontal(linkage, torque, column_shares=[2, 3]),
        rrb.TopPanel(state='hidden'),
        rrb.TimePanel(timeline=TIMELINE, state='hidden'),
        rrb.SelectionPanel(state='hidden'),
        rrb.BlueprintPanel(state='hidden'),
    )


def _connect(program: ViewerProcess, url: str) -> 'ViewerClient':
    """Connects to the viewer, and waits until it has loaded the data.

    Raises:
        ViewerError: The viewer failed, or did not load the data in time.
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
    """Yields screenshots of a turn, evenly spaced in time."""
    host, port = free_address('127.0.0.1')
    options = ['--headless', '--window-size', _SIZE, '--bind', host, '--port', str(port)]
    program = ViewerProcess([find_viewer(), *files, *options], outlives=False)
    try:
        client = _connect(program, f'rerun+http://{host}:{port}/proxy')
        for _ in range(_ZOOMS):
            client.run_command('ui.zoom_in_ui')
        for number in [0] * 10 + list(range(_FRAMES)):  # the viewer needs some frames to settle
            client.set_time(TIMELINE, duration=number * _TURN / _FRAMES, play_state='paused')
            picture = Image.open(io.BytesIO(client.take_screenshot())).convert('RGB')
            yield picture.crop((0, _BAND, *picture.size))
    finally:
        program.close()


def _make(out: Path) -> None:
    linkage = replace(load('quadrilateral').only, drive=SpeedDrive(rpm=_RPM))
    configuration = Configuration((linkage,))
    with tempfile.TemporaryDirectory() as folder:
        recording, blueprint = Path(folder, 'turn.rrd'), Path(folder, 'turn.rbl')
        view = View(configuration, str(recording))
        view.consume(_states(configuration))
        view.close()
        _blueprint(configuration).save('linkage_ros', blueprint)
        frames = list(_frames([recording, blueprint]))[-_FRAMES:]
    # With one palette and no dithering, areas that do not move are identical and take no space.
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
