# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`make demo`: its output and its files, and its reaction to an argument."""

from ros_harness import environment, finished, fresh_domain, verified

PROGRAM = 'python -m linkage_ros.demo'


def test_demo_refuses_arguments(tmp_path):
    done = finished('demo', '--rate', cwd=tmp_path)
    words = f'{PROGRAM}: unrecognized arguments: --rate; see {PROGRAM} --help\n'
    assert (done.returncode, done.stdout, done.stderr) == (2, '', words)
    assert not list(tmp_path.iterdir())


def test_demo_without_a_screen_writes_log_and_view(tmp_path):
    screens = dict.fromkeys(('DISPLAY', 'WAYLAND_DISPLAY'), '')
    done = finished('demo', cwd=tmp_path, env=environment(fresh_domain()) | screens)
    assert (done.returncode, done.stderr) == (0, '')
    assert len(done.stdout.splitlines()) <= 6
    assert verified(tmp_path / 'demo' / 'quadrilateral.mcap').states == 1600
    assert (tmp_path / 'demo' / 'quadrilateral.rrd').stat().st_size > 50_000
