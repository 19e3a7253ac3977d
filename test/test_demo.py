# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`make demo` without a screen: the live node, and what it prints and writes."""

import os
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

from pages import ROOT
from ros_harness import PATIENCE, environment, fresh_domain, report_of, wait_for

VENV = Path(sys.executable).parents[1]
SCREEN = dict.fromkeys(('DISPLAY', 'WAYLAND_DISPLAY', 'WAYLAND_SOCKET', 'MAKEFLAGS'), '')


def nodes_in(folder):
    """Returns the process IDs of the nodes that run in a folder."""
    found = []
    for process in Path('/proc').glob('[0-9]*'):
        with suppress(OSError):
            words = (process / 'cmdline').read_bytes().split(b'\0')
            if words[1:3] == [b'-m', b'linkage_ros.node.linkage_node']:
                found += [int(process.name)] * ((process / 'cwd').readlink() == folder)
    return found


def demo(folder):
    words = [
        'make',
        '--no-print-directory',
        '-f',
        ROOT / 'Makefile',
        '-o',
        VENV / 'demo-ready',
        'demo',
    ]
    return subprocess.Popen(
        [*words, f'VENV={VENV}', f'SECONDS={PATIENCE:g}'], cwd=folder,
        env=environment(fresh_domain()) | SCREEN, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    )  # fmt: skip


def test_demo_turns_a_linkage_on_ros_and_shows_it(tmp_path):
    """The node is ended as `timeout` does, but not before it has run on a busy machine."""
    log = tmp_path / 'demo' / 'quadrilateral.mcap'
    with demo(tmp_path) as make:
        wait_for(lambda: make.poll() is not None or (log.exists() and log.stat().st_size > 1e5))
        for node in nodes_in(tmp_path):
            os.kill(node, signal.SIGINT)
        said = make.communicate(timeout=PATIENCE)[0]
    assert make.returncode == 0, said
    assert 'WARN' not in said
    assert len(said.splitlines()) <= 8 + ('not received' in said), said
    assert report_of(log).states > 100
    assert {path.name for path in log.parent.iterdir()} == {log.name, 'quadrilateral.rrd'}
