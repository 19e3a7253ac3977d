# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Imports go one way, and each foreign library is known to one room: read from the source."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from graphlib import CycleError, TopologicalSorter

import pytest
from house import (
    EDGES,
    FILES,
    FLOORS,
    IMPORTS,
    MODULES,
    PACKAGE,
    ROOT,
    foreign,
    graph,
    imports,
    name_of,
)

BELOW_ALL = {
    *('errors', 'files', 'palette', 'cli', 'progress', 'units', 'numeric', 'quantities'),
    'formulas',
}
# Which files may import what, at their top and within functions.
ROS = {name for name in MODULES if name.startswith('ros.')} | {
    'playback.republish',
    'node',
    'controller',
}
MCAP = {
    'log.untrusted_chunks',
    'log.untrusted_mcap',
    'log.writer',
    'log.reader',
    'recovery.recover',
    'recovery.record_copy',
    'recovery.damaged_mcap',
}
UNPACKING = {'log.untrusted_chunks', 'recovery.damaged_mcap'}
RERUN = {name for name in MODULES if name.startswith('view.rerun_')} - {'view.rerun_program'}
CHARTS = {
    'charts.pareto_panel',
    'charts.integration',
    'charts.motion',
    'charts.page',
    'charts.linkage',
    'charts.accuracy',
    'charts.stability',
    'charts.pump',
    'charts.pump_states',
    'charts.pump_motions',
    'charts.pump_load',
}
MOTIONS = {
    'methods.registry',
    'methods.integrators',
    'methods.motion_reference',
    'methods.motion_bench',
    'methods.motion_situations',
    'methods.motion_accuracy',
    'methods.motion_outcomes',
}
MPMATH = {'methods.reference', 'methods.bench', 'methods.accuracy', 'methods.outcomes'}
SCIPY = {'methods.integrators', 'motion.adaptive_integrator', 'analysis.poincare'}
ANALYSIS = {name for name in MODULES if name.startswith('analysis.')}
TQDM = {'progress'}
ROOMS = {
    'mcap': (MCAP, MCAP),
    'lz4': ({'log.untrusted_chunks'}, {'log.untrusted_chunks'}),
    'zstandard': (UNPACKING, UNPACKING),
    'rerun': (RERUN, RERUN),
    'matplotlib': (CHARTS, CHARTS),
    'scipy': (SCIPY, SCIPY),
    'mpmath': (
        {'methods.reference', 'methods.motion_reference'},
        {'methods.reference', 'methods.motion_reference'},
    ),
    'yaml': ({'parameters.parameter_file'}, {'parameters.parameter_file'}),
    'tqdm': (TQDM, TQDM),
    'rclpy': (ROS, {*ROS, 'demo'}),
    'rcl_interfaces': (ROS, ROS),
    'sensor_msgs': (ROS, {*ROS, 'demo'}),
    'std_msgs': (ROS, {*ROS, 'demo'}),
    'rosgraph_msgs': (ROS, ROS),
}
# ---------------------------------------------------------------- direction


def floor(name):
    """Where a module stands: the number of its folder, or one above all for what has none."""
    return FLOORS.index(name.partition('.')[0]) if '.' in name or name in FLOORS else len(FLOORS)


def test_the_modules_are_all_found():
    assert EDGES | ROS | MCAP | RERUN | BELOW_ALL <= MODULES
    assert len(MODULES) > 50
    folders = {path.name for path in PACKAGE.iterdir() if path.is_dir()} - {'__pycache__'}
    assert folders == set(FLOORS)


def test_folders_are_floors_each_built_on_those_below():
    wrong = [
        (name, module)
        for name, modules in graph().items()
        for module in modules
        if floor(module) > floor(name) and module not in {*BELOW_ALL, '__init__'}
    ]
    assert wrong == []


def test_no_module_reaches_itself():
    try:
        order = list(TopologicalSorter(graph()).static_order())
    except CycleError as error:
        pytest.fail(f'these import each other: {" -> ".join(error.args[1])}')
    assert order.index('errors') < order.index('model.four_bar')
    assert order.index('model.four_bar') < order.index('dynamics.solver')
    assert order.index('dynamics.solver') < order.index('run.machine') < order.index('node')


def test_a_cycle_would_be_found():
    edges = graph()
    edges['errors'].add('dynamics.solver')
    with pytest.raises(CycleError, match='nodes are in a cycle'):
        list(TopologicalSorter(edges).static_order())


def test_nothing_is_built_on_what_a_shell_starts():
    users = {(name, module) for name, modules in graph().items() for module in modules & EDGES}
    assert users <= {('demo', 'record')}


# The mechanics, from descriptions to torques.
GROUND = {'errors', 'numeric', 'quantities', 'formulas'}
CORE = {name for name in MODULES if floor(name) in (0, 1)} | GROUND


@pytest.mark.parametrize('name', sorted(CORE))
def test_the_core_imports_numpy_the_standard_library_and_itself(name):
    assert graph()[name] <= CORE
    assert foreign(name, top=True) <= {'numpy'}
    assert foreign(name, top=False) == set()


def test_the_package_itself_offers_the_core_alone():
    assert graph()['__init__'] <= CORE


# ---------------------------------------------------------------- rooms


@pytest.mark.parametrize('library', ROOMS)
def test_each_library_is_known_to_its_room_alone(library):
    at_top, anywhere = ROOMS[library]
    users = {name for name in IMPORTS if library in foreign(name, top=True)}
    assert users <= at_top
    users |= {name for name in IMPORTS if library in foreign(name, top=False)}
    assert users <= anywhere


@pytest.mark.parametrize('name', sorted(IMPORTS))
def test_every_library_has_a_room(name):
    found = foreign(name, top=True) | foreign(name, top=False)
    assert found <= {*ROOMS, 'numpy'}


def test_an_import_out_of_its_room_would_be_found(tmp_path):
    path = tmp_path / 'stray.py'
    path.write_text(
        'import numpy as np\n'
        'if True:\n    import mcap.reader\n'
        'try:\n    from rerun import blueprint\nexcept ImportError:\n    pass\n'
        'class A:\n    import yaml\n    def f(self):\n        import rclpy.node\n'
        'def g():\n    from linkage_ros import cli, Solver\n'
    )
    assert imports(path) == [
        *(('numpy', True), ('mcap.reader', True), ('rerun', True), ('yaml', True)),
        *(('rclpy.node', False), ('linkage_ros.cli', False), ('linkage_ros', False)),
    ]


@pytest.mark.parametrize('path', FILES, ids=name_of)
def test_files_stay_short_enough_to_read(path):
    nodes = ast.walk(ast.parse(path.read_text()))
    assert sum(isinstance(node, ast.stmt) and not is_docstring(node) for node in nodes) <= 200


def is_docstring(node):
    return isinstance(node, ast.Expr) and isinstance(getattr(node.value, 'value', None), str)


def test_the_linter_sees_every_file():
    """A folder may bear the name of one that builds leave behind."""
    command = [sys.executable, '-m', 'ruff', 'check', '--show-files']
    seen = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert {str(path) for path in FILES} <= set(seen.splitlines())


# ---------------------------------------------------------------- really imported

BLOCK = """
import sys

class Blocked:
    names = set(sys.argv[1].split(','))

    def find_spec(self, name, path=None, target=None):
        if name.partition('.')[0] in self.names:
            raise ModuleNotFoundError(f'{name} is blocked here', name=name)

sys.meta_path.insert(0, Blocked())
"""
SOLVE = """
import math
from linkage_ros import Body, Coupler, FourBar, Frame, Solver

# Norton's table: links 2, 7, 9 and frame 6, crank at 30 deg.
for assembly, coupler, rocker in (('open', 88.84, 117.29), ('crossed', -115.21, -143.66)):
    linkage = FourBar(Frame(6), Body(2), Coupler(7), Body(9), assembly)
    state = Solver(linkage).state(math.radians(30))
    got = [math.degrees(angle) for angle in state.position]
    assert abs(got[1] - coupler) < 0.006 and abs(got[2] - rocker) < 0.006, got
print(sorted({name.partition('.')[0] for name in sys.modules} & Blocked.names))
"""
OPTIONAL = 'rclpy,rcl_interfaces,sensor_msgs,std_msgs,rerun,rerun_bindings,matplotlib,scipy,mpmath'
EVERYTHING = f'{OPTIONAL},mcap,yaml,tqdm'


def run(code, blocked):
    path = os.pathsep.join((str(ROOT), os.environ.get('PYTHONPATH', '')))
    return subprocess.run(
        [sys.executable, '-c', BLOCK + code, blocked], env={**os.environ, 'PYTHONPATH': path},
        capture_output=True, text=True, check=False,
    )  # fmt: skip


def test_the_core_works_with_all_libraries_but_numpy_absent():
    done = run(SOLVE, EVERYTHING)
    assert (done.returncode, done.stdout) == (0, '[]\n'), done.stderr


@pytest.mark.parametrize(
    ('module', 'library'),
    [
        ('log.writer', 'mcap'),
        ('parameters.parameter_file', 'yaml'),
        ('record', 'tqdm'),
        ('node', 'rclpy'),
    ],
)
def test_the_block_keeps_a_library_out(module, library):
    done = run(f'import linkage_ros.{module}', library)
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].startswith(f'ModuleNotFoundError: {library}')


def test_all_but_the_ros_modules_are_imported_without_ros_viewer_and_charts():
    names = ', '.join(
        f'linkage_ros.{name}'
        for name in sorted(MODULES - ROS - CHARTS - MPMATH - MOTIONS - ANALYSIS)
    )
    done = run(f'import {names}\nprint("all")', OPTIONAL)
    assert (done.returncode, done.stdout) == (0, 'all\n'), done.stderr
