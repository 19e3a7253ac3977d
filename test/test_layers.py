# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Rules on imports that import-linter cannot check, and whether it and ruff see every file."""

import ast
import os
import shutil
import sys
from pathlib import Path

from pages import PACKAGE_FILES, ROOT
from ros_harness import finished

import linkage_ros

PACKAGE = ROOT / 'linkage_ros'
WRONG = {
    'linkage_ros/mechanism/parts.py': (
        'import linkage_ros.messages.topics',
        'mechanism.parts -> linkage_ros.messages.topics',
    ),
    'linkage_ros/motion/law.py': (
        'from linkage_ros.cli import print_error',
        'motion.law -> linkage_ros.cli',
    ),
    'linkage_ros/node/health.py': ('import matplotlib', 'node.health -> matplotlib'),
    'linkage_ros/node/ticker.py': (
        'import linkage_lab.period',
        'node.ticker -> linkage_lab.period',
    ),
    'linkage_ros/new_room.py': ('import math', 'linkage_ros.new_room'),
    'lab/linkage_lab/flywheel.py': (
        'from linkage_ros.mechanism.solver import Solver',
        'linkage_lab.flywheel -> linkage_ros.mechanism.solver',
    ),
}


def test_import_linter_detects_forbidden_imports(tmp_path):
    for package in ('linkage_ros', 'lab/linkage_lab'):
        shutil.copytree(ROOT / package, tmp_path / package)
    shutil.copy(ROOT / 'pyproject.toml', tmp_path)
    for file, (line, _) in WRONG.items():
        with (tmp_path / file).open('a') as source:
            source.write(f'\n{line}\n')
    linter = Path(sys.executable).parent / 'lint-imports'
    variables = {**os.environ, 'PYTHONPATH': str(tmp_path / 'lab')}
    done = finished([linter], '--no-cache', '--no-logo', cwd=tmp_path, env=variables)
    assert done.returncode == 1
    for _, broken in WRONG.values():
        assert broken in done.stdout


def test_examples_import_only_public_modules():
    """A module is public if its docstring says so."""
    public = set[str]()
    for path in PACKAGE.rglob('*.py'):
        if '\nPublic: ' in (ast.get_docstring(ast.parse(path.read_text())) or ''):
            public.add('.'.join(path.relative_to(ROOT).with_suffix('').parts))
    assert 'linkage_ros.extensions' in public
    for path in (ROOT / 'docs' / 'examples').glob('*.py'):
        parts = ast.walk(ast.parse(path.read_text()))
        used = {part.module for part in parts if isinstance(part, ast.ImportFrom)}
        assert {x for x in used if x.startswith('linkage_ros.')} <= public, path


def test_ruff_sees_every_file():
    """A folder may have the name of one that builds leave behind."""
    seen = finished([sys.executable, '-m', 'ruff', 'check', '--show-files'], cwd=ROOT).stdout
    assert {str(path) for path in PACKAGE_FILES} <= set(seen.splitlines())


def test_every_public_name_is_found():
    names = linkage_ros.__all__
    assert [name for name in names if not hasattr(linkage_ros, name)] == []
    assert set(names) <= set(dir(linkage_ros))
