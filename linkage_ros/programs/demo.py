# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Program behind `make demo`: runs a four-bar on ROS 2, or records it if rclpy is missing."""

import signal
import subprocess
import sys
import time
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path

from linkage_ros import cli
from linkage_ros.errors import LinkageError, ViewerError
from linkage_ros.settings.viewer import SPAWN
from linkage_ros.view.viewer_process import require_screen

_NAME = 'demo'
_FOLDER = Path('demo')
_LOG, _VIEW = _FOLDER / 'quadrilateral.mcap', _FOLDER / 'quadrilateral.rrd'
_SECONDS = 8.0
_START_SECONDS = 1.0  # from the creation of the log until the crank turns


def _command(module: str, *arguments: object) -> list[str]:
    return [sys.executable, '-m', f'linkage_ros.{module}', *map(str, arguments)]


def _run_live(viewer: str) -> None:
    settings = (f'log:={_LOG}', 'log_overwrite:=true', f'viewer:={viewer}')
    words = [word for setting in settings for word in ('-p', setting)]
    print(f'linkage_node turns the quadrilateral for {_SECONDS:g} s')
    _LOG.unlink(missing_ok=True)
    process = subprocess.Popen(_command('node.linkage_node', '--ros-args', *words))  # noqa: S603
    try:
        while process.poll() is None and not _LOG.exists():
            time.sleep(0.1)
        with suppress(subprocess.TimeoutExpired), cli.waiting(f'turns for {_SECONDS:g} s'):
            process.wait(_START_SECONDS + _SECONDS)
    finally:
        process.send_signal(signal.SIGINT)
        code = process.wait(timeout=30)
    if code != 0:
        raise LinkageError(f'linkage_node ended with exit code {code}')


def _run_recorded(viewer: str) -> None:
    print('rclpy is not installed here: recording the run without ROS')
    rate = 1 if viewer == SPAWN else 1000  # a view written to a file need not run in real time
    for command in (
        _command('programs.record', 'quadrilateral', _LOG, '--duration', _SECONDS, '--overwrite'),
        _command('programs.replay', _LOG, '--no-ros', '--rate', rate, '--viewer', viewer),
    ):
        subprocess.run(command, check=True)  # noqa: S603


def _run() -> None:
    _FOLDER.mkdir(exist_ok=True)
    viewer = SPAWN
    try:
        require_screen()
    except ViewerError:
        viewer = str(_VIEW)
        _VIEW.unlink(missing_ok=True)
    run = _run_live if find_spec('rclpy') else _run_recorded
    run(viewer)
    python = Path(sys.executable).parent
    shown = python.relative_to(Path.cwd()) if python.is_relative_to(Path.cwd()) else python
    print(f'look inside:      {shown}/linkage_log info {_LOG}')
    print(f'replay on topics: {shown}/linkage_replay {_LOG}')
    if viewer == SPAWN:
        print(f'watch it again:   {shown}/linkage_replay {_LOG} --viewer spawn')
    else:
        print(f'watch it in 2-D:  {shown}/rerun {_VIEW}')


def _main() -> int:
    purpose = 'turn a four-bar on ROS 2 for 8 s and watch it; without rclpy, record it'
    notes = 'The results are written into the folder demo in the current directory.'
    cli.make_parser('python -m linkage_ros.programs.demo', purpose, ('',), notes).parse_args()
    return cli.leave(cli.run(_NAME, _run))


if __name__ == '__main__':
    sys.exit(_main())
