# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The package as a house: its files, its floors, and what each file imports, from the source."""

from __future__ import annotations

import ast
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / 'linkage_ros'
FILES = sorted(PACKAGE.rglob('*.py'))
# The floors, lowest first: each imports those below it. What lies in no folder is an edge, what
# edges share, or one of the few files that all may import.
FLOORS = (
    *('model', 'dynamics', 'motion', 'methods', 'analysis', 'wire', 'parameters', 'log'),
    *('recovery', 'run', 'verification', 'view', 'charts', 'chart_commands', 'ros', 'playback'),
)
# What a shell starts: nothing of the package is built on these, but the demo on the recorder.
EDGES = {'node', 'controller', 'record', 'replay', 'log_tool', 'chart_tool', 'demo'}


def name_of(path):
    """A file's module, without the package; '__init__' is the package itself."""
    parts = path.relative_to(PACKAGE).with_suffix('').parts
    return '.'.join(parts[:-1] if parts[-1] == '__init__' else parts) or '__init__'


MODULES = {name_of(path) for path in FILES} - {'__init__'}


def imports(path):
    """(module, whether at the top of the file), for all imports that are carried out."""
    found = []

    def visit(node, is_top):
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.If) and ast.unparse(child.test) == 'TYPE_CHECKING':
                names = [name for part in child.body for name in named(part)]
                found.extend((name, is_top) for name in names)
            elif isinstance(child, (ast.Import, ast.ImportFrom)):
                found.extend((name, is_top) for name in named(child))
            else:
                inside = isinstance(child, (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda))
                visit(child, is_top and not inside)

    def named(node):
        if isinstance(node, ast.Import):
            return [alias.name for alias in node.names]
        if not isinstance(node, ast.ImportFrom):
            return []
        assert node.level == 0, f'{path.name} imports relatively'
        if node.module.partition('.')[0] != 'linkage_ros':
            return [node.module]
        folder = node.module.partition('.')[2]
        own = [f'{folder}.{alias.name}'.lstrip('.') for alias in node.names]
        return [f'linkage_ros.{n}' if n in MODULES else node.module for n in own]

    visit(ast.parse(path.read_text()), is_top=True)
    return found


IMPORTS = {name_of(path): imports(path) for path in FILES}


def graph():
    """Which modules of the package each of them imports; '__init__' is the package itself."""
    edges = {name: set() for name in IMPORTS}
    for name, found in IMPORTS.items():
        for module, _ in found:
            top, _, rest = module.partition('.')
            if top == 'linkage_ros':
                edges[name].add(rest or '__init__')
    return edges


def foreign(name, *, top):
    """The libraries that a module imports at its top, or within its functions."""
    found = {module.partition('.')[0] for module, is_top in IMPORTS[name] if is_top == top}
    return found - {'linkage_ros'} - set(sys.stdlib_module_names)
