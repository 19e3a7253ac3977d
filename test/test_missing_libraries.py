# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Runs real processes with hidden libraries, as on a machine that lacks them."""

import sys

import pytest
from ros_harness import assert_refused, command, finished, hiding, stop, watched

from linkage_ros import cli
from linkage_ros.programs.record import record
from linkage_ros.settings.configuration import load

OF_ROS = ('rclpy', 'rcl_interfaces', 'sensor_msgs', 'std_msgs')
# Packages that pip adds to a machine whose ROS 2 comes from Debian packages.
OF_PIP = ('mcap', 'lz4', 'zstandard', 'rerun', 'rerun_bindings', 'mpmath')


@pytest.fixture
def hide(tmp_path, monkeypatch):
    """Hides libraries from every Python process that the test starts."""

    def hide(*names):
        for variable, value in hiding(tmp_path / 'site', names).items():
            monkeypatch.setenv(variable, value)

    return hide


def run(entry, *arguments):
    """Runs an entry point as its console script does."""
    return finished(command(entry), *arguments)


def test_solver_needs_numpy_alone(hide):
    hide(*OF_PIP, *OF_ROS, 'matplotlib', 'scipy', 'yaml', 'tqdm')
    code = (
        'from linkage_ros import Body, Coupler, FourBar, Frame, Solver\n'
        'assert Solver(FourBar(Frame(6), Body(2), Coupler(7), Body(9))).state(0.5).torque == 0.0'
    )
    assert finished([sys.executable, '-c', code]).stderr == ''


def test_node_without_log_and_viewer_runs_on_debian_packages_alone(hide):
    hide(*OF_PIP, 'matplotlib', 'scipy')
    with watched(['/joint_states'], program=command('node')) as (listener, node):
        listener.await_more(50)
        stop(node)


def test_record_needs_no_ros_no_viewer_and_no_charts(hide, tmp_path):
    hide(*OF_ROS, 'rerun', 'rerun_bindings', 'matplotlib')
    done = run('record', 'quadrilateral', tmp_path / 'run.mcap', '--duration', 0.5)
    assert (done.returncode, done.stderr) == (0, '')
    record(load('quadrilateral'), tmp_path / 'here.mcap', duration=0.5)
    assert (tmp_path / 'run.mcap').read_bytes() == (tmp_path / 'here.mcap').read_bytes()


@pytest.mark.parametrize(
    ('entry', 'option'), [('node', '--help-parameters'), ('controller', '--help')]
)
def test_help_needs_no_ros(hide, entry, option):
    hide(*OF_ROS)
    done = run(entry, option)
    assert (done.returncode, done.stderr) == (0, '')
    assert '  rpm: ' in done.stdout


@pytest.mark.parametrize('entry', ['log', 'chart'])
@pytest.mark.parametrize('option', ['--help', '--version'])
def test_help_waits_for_no_large_library(hide, entry, option):
    hide('numpy', 'tqdm', *OF_PIP, *OF_ROS, 'matplotlib', 'scipy')
    done = run(entry, option)
    assert (done.returncode, done.stderr) == (0, '')


NODE = 'node', '--ros-args', '-p', 'log:=run.mcap', '-p'


@pytest.mark.parametrize(
    ('hidden', 'words', 'said'),
    [
        (['mcap'], (*NODE, 'viewer:=run.rrd'),
         'node: logs need mcap, which .*: pip install --upgrade mcap lz4 zstandard;'),
        (['rerun', 'rerun_cli'], (*NODE, 'viewer:=web'),
         'node: the viewer needs rerun-sdk, which is not installed'),
        (['rclpy'], ['node'], 'linkage_node: ROS 2 topics need rclpy, .*: source ROS 2 Jazzy'),
        (['mcap'], ('replay', 'x.mcap'), 'linkage_replay: logs need mcap, '),
        (['scipy'], ('record', 'wind_pump', 'x.mcap'),
         'records of a motion under a torque need'),
        (['matplotlib'], ('chart', 'motion', 'quadrilateral'),
         'linkage_chart: this program needs matplotlib, '),
        (['mujoco'], ('import', 'site/leg.xml', '--crank', 'motor', '-o', 'leg.yaml'),
         'linkage_import: this program needs mujoco, '),
    ],
)  # fmt: skip
def test_a_tool_names_the_library_that_it_lacks(hide, tmp_path, monkeypatch, hidden, words, said):
    """And leaves no file behind."""
    monkeypatch.chdir(tmp_path)
    hide(*hidden)
    (tmp_path / 'site' / 'leg.xml').write_text('<mujoco/>')
    done = run(*words)
    assert_refused(done.returncode, done.stdout, done.stderr, said)
    assert [path.name for path in tmp_path.iterdir()] == ['site']


FAILURES = {
    # Raised by Ubuntu's Matplotlib after pip has installed NumPy 2; it names no module.
    "raise ImportError('numpy.core.multiarray failed to import')": 'numpy.core.mul',
    'import numpy.core.nothing': 'numpy, .*damaged .*No module named.*pip install .*numpy;',
    'import rclpy.nothing': "rclpy, .*No module named 'rclpy.nothing'.*source ROS 2",
    'from mcap.writer import nothing': 'logs need mcap, .*cannot import name.*pip install',
    'from linkage_ros.files import nothing': 'linkage_ros .*cannot import name.*again',
    'import unheard.of': 'needs unheard, which is not installed: pip install --upgrade unheard;',
}


@pytest.mark.parametrize(('statement', 'words'), FAILURES.items())
def test_a_failed_import_is_reported_with_its_cause_and_remedy(statement, words, capsys):
    """A library that is installed, or this package itself, is not called missing."""
    assert cli.run('linkage_x', lambda: exec(statement)) == 2
    out, err = capsys.readouterr()
    assert_refused(2, out, err, words)
    assert 'not installed' not in err or 'unheard' in err
    assert 'pip install --upgrade linkage_ros' not in err
