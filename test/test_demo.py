# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What `make demo` runs does nothing else than what it is asked for."""

from __future__ import annotations

import subprocess
import sys

import pytest

import linkage_ros

PROGRAM = 'python -m linkage_ros.demo'


@pytest.mark.parametrize(
    ('argument', 'code', 'out', 'err'),
    [
        ('--help', 0, f'usage: {PROGRAM} [-h] [--version]', ''),
        ('--version', 0, f'{PROGRAM} {linkage_ros.__version__}\n', ''),
        (
            '--rate',
            2,
            '',
            f'{PROGRAM}: unrecognized arguments: --rate; see {PROGRAM} --help\n',
        ),
    ],
)
def test_an_argument_does_not_start_it(tmp_path, argument, code, out, err):
    done = subprocess.run(
        [sys.executable, '-m', 'linkage_ros.demo', argument],
        capture_output=True, text=True, cwd=tmp_path, timeout=60,
    )  # fmt: skip
    assert (done.returncode, done.stdout[: len(out)], done.stderr) == (code, out, err)
    assert not list(tmp_path.iterdir())
