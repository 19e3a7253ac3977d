# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Rules on imports that import-linter cannot check, and whether it and ruff see every file."""

import ast
import shutil
import sys
from pathlib import Path

from pages import PACKAGE_FILES, ROOT
from ros_harness import finished

DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef)
WRONG = {
    'mechanism/parts.py': (
        'import linkage_ros.messages.topics',
        'mechanism.parts -> linkage_ros.messages.topics',
    ),
    'node/health.py': ('import matplotlib', 'node.health -> matplotlib'),
    'node/ticker.py': ('import linkage_lab.period', 'node.ticker -> linkage_lab.period'),
    'new_room.py': ('import math', 'linkage_ros.new_room'),
}


def test_import_linter_detects_forbidden_imports(tmp_path):
    shutil.copytree(ROOT / 'linkage_ros', tmp_path / 'linkage_ros')
    shutil.copy(ROOT / 'pyproject.toml', tmp_path)
    for file, (line, _) in WRONG.items():
        with (tmp_path / 'linkage_ros' / file).open('a') as source:
            source.write(f'\n{line}\n')
    linter = Path(sys.executable).parent / 'lint-imports'
    done = finished([linter], '--no-cache', '--no-logo', cwd=tmp_path)
    assert done.returncode == 1
    for _, broken in WRONG.values():
        assert broken in done.stdout


def test_ruff_sees_every_file():
    """A folder may have the name of one that builds leave behind."""
    seen = finished([sys.executable, '-m', 'ruff', 'check', '--show-files'], cwd=ROOT).stdout
    assert {str(path) for path in PACKAGE_FILES} <= set(seen.splitlines())
