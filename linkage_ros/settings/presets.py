# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Finds parameter files by path or by the name of a preset.

Presets are not package data, because `colcon build --symlink-install` does not install it.
"""

import itertools
import os
import sys
from contextlib import suppress
from pathlib import Path

from linkage_ros.errors import ConfigurationError
from linkage_ros.files import path_exists
from linkage_ros.quantities import did_you_mean, shown

_MOST_FILES = 1000  # of a folder that are compared with a misspelt name

DEFAULT_PRESET = 'quadrilateral'


def preset_names() -> list[str]:
    """Returns the names of all presets in alphabetical order."""
    return sorted(_presets())


def preset_path(name: str) -> Path:
    """Finds the parameter file of a preset, in the first preset folder that contains it.

    Raises:
        ConfigurationError: There is no such preset.
    """
    presets = _presets()
    if name not in presets:
        known = ', '.join(sorted(presets)) or (
            'none: share/linkage_ros/config is missing; install with `pip install .` or `colcon '
            'build`'
        )
        hint = _similar(name, Path())
        raise ConfigurationError(f'no preset {shown(name)}: choose one of {known}{hint}')
    return presets[name]


def find_file(source: str) -> Path:
    """Finds the parameter file for a path or the name of a preset.

    Raises:
        ConfigurationError: There is no such file or preset.
    """
    path = Path(source)
    if not source or not (path.suffix or path_exists(path)):  # '' would be the current folder
        return preset_path(source)
    if not path_exists(path):
        hint = _similar(path.name, path.parent)
        file = source if source.isprintable() else repr(source)
        raise ConfigurationError(f'{file}: no such file; give the path of a parameter file{hint}')
    return path


def _similar(name: str, folder: Path) -> str:
    """Suggests the preset, or the parameter file in a folder, that a misspelt name resembles."""
    files = list[str]()
    with suppress(OSError, ValueError):  # the folder may be missing
        entries = itertools.islice(os.scandir(folder), _MOST_FILES)
        files = [entry.name for entry in entries if entry.name.endswith(('.yaml', '.yml'))]
    for file in files:
        if file.startswith(f'{name} '):
            return f'; did you mean "{file}"? Write quotes around a name with spaces'
    presets = _presets()
    if Path(name).stem in presets:
        return f'; did you mean {Path(name).stem}? Presets have no .yaml'
    return did_you_mean(name, [*presets, *files])


def _presets() -> dict[str, Path]:
    """Returns the path of each preset by name; if a name occurs twice, the first file is used."""
    root = Path(__file__).resolve().parents[2]
    # Sourced workspaces come first, even if the code runs from a checkout, because sourcing
    # selects an installation, and overlays may replace presets. Then come the prefixes used by
    # pip: with --target; with --user or --prefix (PREFIX/lib/python3.X/site-packages); and in a
    # virtual environment.
    sourced = filter(None, os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep))
    prefixes = [*map(Path, sourced), root, *root.parents[2:3], Path(sys.prefix)]
    folders = [prefix / 'share' / 'linkage_ros' / 'config' for prefix in prefixes]
    if (root / 'package.xml').is_file():  # site-packages/config may belong to another package
        folders.append(root / 'config')
    paths = [path for folder in folders for path in folder.glob('*.yaml')]
    # A link into a deleted workspace is not a file.
    return {path.stem: path for path in reversed(paths) if path.is_file()}
