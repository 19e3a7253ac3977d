# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`make demo`: its output, and its reaction to an argument and to a busy machine."""

import os
import re
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

from ros_harness import PATIENCE, environment, fresh_domain

PROGRAM = 'python -m linkage_ros.programs.demo'
SHORT = 'from linkage_ros.programs import demo; demo._SECONDS = 2.0; demo._main()'


def test_demo_refuses_arguments(tmp_path):
    done = subprocess.run(
        [sys.executable, '-m', 'linkage_ros.programs.demo', '--rate'],
        capture_output=True, text=True, cwd=tmp_path, timeout=PATIENCE,
    )  # fmt: skip
    words = f'{PROGRAM}: unrecognized arguments: --rate; see {PROGRAM} --help\n'
    assert (done.returncode, done.stdout, done.stderr) == (2, '', words)
    assert not list(tmp_path.iterdir())


def children(pid):
    found = Path(f'/proc/{pid}/task/{pid}/children').read_text().split()
    return [int(child) for child in found]


def test_busy_machine_causes_no_warning_and_few_lines(tmp_path):
    """Twice a second, the node is stopped for 30 ms: it loses about 5 % of its ticks."""
    without_screen = {
        name: value
        for name, value in environment(fresh_domain()).items()
        if name not in ('DISPLAY', 'WAYLAND_DISPLAY')
    }
    demo = subprocess.Popen(
        [sys.executable, '-c', SHORT], env=without_screen, cwd=tmp_path,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip
    try:
        while demo.poll() is None:
            for node in children(demo.pid):
                with suppress(ProcessLookupError):
                    os.kill(node, signal.SIGSTOP)
                    time.sleep(0.03)
                    os.kill(node, signal.SIGCONT)
            time.sleep(0.5)
        said = demo.stdout.read()
    finally:
        demo.kill()
        demo.communicate()
    assert demo.returncode == 0, said
    assert int(re.search(r' states, (\d+) ticks? missed', said)[1]) > 0, said
    # `make demo` adds a line when it sets up; another line may report lost messages.
    assert len(said.splitlines()) <= 7 + ('not received' in said), said
    assert 'WARN' not in said
