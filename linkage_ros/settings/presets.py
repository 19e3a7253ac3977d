# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Finds parameter files by path or by the name of a preset.

Presets are not package data, because `colcon build --symlink-install` does not install it.
"""

import os
import sys
from pathlib import Path

from linkage_ros.errors import ConfigurationError
from linkage_ros.files import path_exists
from linkage_ros.quantities import shown

DEFAULT_PRESET = 'quadrilateral'


def preset_names() -> list[str]:
    """Returns the names of all presets in alphabetical order."""
    return sorted(_presets())


def preset_path(name: str) -> Path:
    """Finds the parameter file of a preset.

    Args:
        name: Name of the preset, that is, its file name without `.yaml`.

    Returns:
        Path of the file in the first preset folder that contains it.

    Raises:
        ConfigurationError: There is no such preset.
    """
    presets = _presets()
    if name not in presets:
        known = ', '.join(sorted(presets)) or (
            'none: share/linkage_ros/config is missing; install with `pip install .` or `colcon '
            'build`'
        )
        raise ConfigurationError(f'no preset {shown(name)}: choose one of {known}')
    return presets[name]


def find_file(source: str) -> Path:
    """Finds the parameter file for a path or the name of a preset.

    Args:
        source: Path of a ROS 2 parameter file, or name of a preset.

    Returns:
        Path of the file; if `source` is a path, the file may not exist.
    """
    path = Path(source)
    is_path = source and (path.suffix or path_exists(path))  # '' would be the current folder
    return path if is_path else preset_path(source)


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
