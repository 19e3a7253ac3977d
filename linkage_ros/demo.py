# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Program behind `make demo`: records a four-bar and shows it in Rerun; needs no ROS."""

import subprocess
import sys
from pathlib import Path

from linkage_ros import cli
from linkage_ros.errors import ViewerError
from linkage_ros.parameters.session import SPAWN
from linkage_ros.view.viewer_process import require_screen

_FOLDER = Path('demo')
_LOG, _VIEW = _FOLDER / 'quadrilateral.mcap', _FOLDER / 'quadrilateral.rrd'
_SECONDS = 8


def _run() -> int:
    _FOLDER.mkdir(exist_ok=True)
    viewer, rate = SPAWN, 1
    try:
        require_screen()
    except ViewerError:
        viewer, rate = str(_VIEW), 1000  # a file need not be written in real time
        _VIEW.unlink(missing_ok=True)
    python = Path(sys.executable)
    for module, *arguments in (
        ('record', 'quadrilateral', _LOG, '--duration', _SECONDS, '--overwrite'),
        ('replay', _LOG, '--no-ros', '--rate', rate, '--viewer', viewer),
    ):
        command = [python, '-m', f'linkage_ros.{module}', *arguments]
        if code := subprocess.run(list(map(str, command))).returncode:  # noqa: S603
            return code
    print(f'look inside:      {python.parent}/linkage_log info {_LOG}')
    print(f'replay on topics: {python.parent}/linkage_replay {_LOG}')
    if viewer == SPAWN:
        print(f'watch it again:   {python.parent}/linkage_replay {_LOG} --viewer spawn --no-ros')
    else:
        print(f'watch it in 2-D:  {python.parent}/rerun {_VIEW}')
    return 0


def _main() -> int:
    purpose = 'turn a four-bar for 8 s and watch it'
    notes = 'The results are written into the folder demo in the current directory.'
    cli.make_parser('python -m linkage_ros.demo', purpose, ('',), notes).parse_args()
    return cli.run('demo', _run)


if __name__ == '__main__':
    sys.exit(_main())
