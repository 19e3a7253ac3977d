# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Real processes from which libraries are hidden, as on a machine that never installed them."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest
from ros_harness import Listener, environment, fresh_domain, node_arguments, running, wait_for
from test_node import stop

from linkage_ros.errors import missing_library

HIDE = """
import os
from importlib.machinery import PathFinder

find_spec, hidden = PathFinder.find_spec, os.environ['HIDDEN_LIBRARIES'].split(',')


def find(name, path=None, target=None):
    return None if name.partition('.')[0] in hidden else find_spec(name, path, target)


PathFinder.find_spec = find
"""
# What pip brings to a machine whose ROS 2 comes from Debian packages.
OF_PIP = ('mcap', 'lz4', 'zstandard', 'rerun', 'rerun_bindings', 'mpmath')
STATES = {'/joint_states': 'sensor_msgs/msg/JointState'}


@pytest.fixture
def hide(tmp_path, monkeypatch):
    """Hides libraries from every Python process that the test starts."""
    folder = tmp_path / 'site'
    folder.mkdir()
    (folder / 'sitecustomize.py').write_text(HIDE)
    path = os.pathsep.join((str(folder), os.environ.get('PYTHONPATH', '')))
    monkeypatch.setenv('PYTHONPATH', path)
    return lambda *names: monkeypatch.setenv('HIDDEN_LIBRARIES', ','.join(names))


def run(entry, *arguments):
    """Runs an entry point of setup.py as its console script does."""
    code = f'import sys; from linkage_ros.executables import {entry} as run; sys.exit(run())'
    return subprocess.run(
        [sys.executable, '-c', code, *map(str, arguments)], env=environment(fresh_domain()),
        capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip


def refused(done, words):
    """Whether a program ended with exit code 2 and one line on stderr that contains the words."""
    assert (done.returncode, done.stdout) == (2, '')
    (line,) = done.stderr.splitlines()
    assert words in line
    return True


def test_node_without_log_and_viewer_runs_on_debian_packages_alone(hide):
    hide(*OF_PIP, 'matplotlib', 'scipy')
    domain = fresh_domain()
    with Listener(domain, STATES) as listener, running('node', domain=domain) as node:
        wait_for(lambda: len(listener.received['/joint_states']) > 50)
        code, output = stop(node)
    assert code == 0, output


def test_node_refuses_a_log_and_leaves_no_view_behind(hide, tmp_path):
    hide('mcap')
    log, view = tmp_path / 'run.mcap', tmp_path / 'run.rrd'
    done = run('node', *node_arguments(log=log, viewer=view))
    need = 'linkage_node: logs need mcap, which is missing or too old: '
    assert refused(done, f'{need}pip install mcap lz4 zstandard;')
    assert not log.exists()
    assert not view.exists()


@pytest.mark.parametrize('viewer', ['run.rrd', 'web'])
def test_node_refuses_a_viewer_and_leaves_no_file_behind(hide, tmp_path, monkeypatch, viewer):
    monkeypatch.chdir(tmp_path)
    hide('rerun', 'rerun_cli')
    done = run('node', *node_arguments(viewer=viewer, log='run.mcap'))
    assert refused(done, 'linkage_node: the viewer needs rerun-sdk, which is missing')
    assert [path.name for path in tmp_path.iterdir()] == ['site']


def test_node_runs_with_log_and_viewer_where_nothing_is_missing(hide, tmp_path):
    hide('')
    log, view = tmp_path / 'run.mcap', tmp_path / 'run.rrd'
    with running('node', *node_arguments(log=log, viewer=view), domain=fresh_domain()) as node:
        wait_for(lambda: log.exists() and view.exists())
        code, output = stop(node)
    assert code == 0, output


@pytest.mark.parametrize(
    ('hidden', 'entry', 'arguments', 'words'),
    [
        ('rclpy', 'node', (), 'linkage_node: ROS 2 topics need rclpy, which is not installed: '),
        ('rclpy', 'controller', (), 'source ROS 2 Jazzy'),
        ('mcap', 'record', ('quadrilateral', 'x.mcap'), 'linkage_record: logs need mcap, '),
        ('mcap', 'replay', ('x.mcap',), 'linkage_replay: logs need mcap, '),
        ('mcap', 'log', ('info', 'x.mcap'), 'linkage_log: logs need mcap, '),
        ('scipy', 'record', ('wind_pump', 'x.mcap'), 'records of a motion under a torque, need'),
        ('matplotlib', 'chart', ('motion', 'quadrilateral'), 'linkage_chart: charts need matplot'),
        ('scipy', 'chart', ('motion', 'wind_pump'), 'linkage_chart: charts, and records of'),
        ('mpmath', 'chart', ('stability', '--quick'), 'pip install mpmath;'),
    ],
)  # fmt: skip
def test_a_tool_names_the_library_that_it_lacks(
    hide, tmp_path, monkeypatch, hidden, entry, arguments, words
):
    monkeypatch.chdir(tmp_path)
    hide(hidden)
    assert refused(run(entry, *arguments), words)
    assert [path.name for path in tmp_path.iterdir()] == ['site']


def test_an_unknown_library_is_named_too():
    assert missing_library('unheard.of') == (
        'linkage_ros needs unheard, which is missing or too old: pip install unheard; '
        'beside the ROS 2 of Ubuntu, in a virtual environment (docs/ros2.md)'
    )
