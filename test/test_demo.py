# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`make demo` without a screen: what it prints and writes."""

import os
import sys
from pathlib import Path

from pages import ROOT
from ros_harness import finished, report_of


def test_demo_records_a_run_and_shows_it(tmp_path):
    environment = Path(sys.executable).parents[1]
    words = ('make', '-f', ROOT / 'Makefile', '-o', environment / 'demo-ready', 'demo')
    names = 'DISPLAY', 'WAYLAND_DISPLAY', 'WAYLAND_SOCKET', 'MAKEFLAGS'
    variables = {**os.environ, **dict.fromkeys(names, '')}
    done = finished([*words, f'VENV={environment}'], cwd=tmp_path, env=variables)
    assert (done.returncode, done.stderr) == (0, '')
    assert len(done.stdout.splitlines()) == 6
    log = tmp_path / 'demo' / 'quadrilateral.mcap'
    assert report_of(log).states == 1600
    assert {path.name for path in log.parent.iterdir()} == {log.name, 'quadrilateral.rrd'}
