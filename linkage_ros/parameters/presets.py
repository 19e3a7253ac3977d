# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Finds parameter files by path, or by name among the package's presets.

Presets are not package data, because `colcon build --symlink-install` does not install that.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path

from linkage_ros.errors import ConfigurationError
from linkage_ros.files import path_exists
from linkage_ros.quantities import shown


def preset_names() -> list[str]:
    """The names of all presets, in alphabetical order."""
    return sorted(_presets())


def preset_path(name: str) -> Path:
    """Finds the parameter file of a preset.

    Args:
        name: The preset's name, which is its file's name without `.yaml`.

    Returns:
        The file, in the first of these places that has it: the share of each prefix in
        AMENT_PREFIX_PATH, the share of the installation that this module belongs to, the
        source tree.

    Raises:
        ConfigurationError: No place has such a preset.
    """
    presets = _presets()
    if not presets:
        raise ConfigurationError(
            'linkage_ros is installed without its presets, share/linkage_ros/config: '
            'install it with `pip install .` or `colcon build`'
        )
    if name not in presets:
        raise ConfigurationError(
            f'no preset {shown(name)}: choose one of {", ".join(sorted(presets))}'
        )
    return presets[name]


def find_file(source: str) -> Path:
    """Finds the parameter file for a path or the name of a preset.

    Args:
        source: Path of a ROS 2 parameter file, or the name of a preset.

    Returns:
        The file, which need not exist where source is a path.
    """
    path = Path(source)
    is_path = source and (path.suffix or path_exists(path))  # '' would be the current folder
    return path if is_path else preset_path(source)


def _presets() -> dict[str, Path]:
    """The presets: for each name, the first file found."""
    presets: dict[str, Path] = {}
    for folder in _folders():
        for path in folder.glob('*.yaml'):
            if path.is_file():  # a link into a workspace that was deleted is not
                presets.setdefault(path.stem, path)
    return presets


def _folders() -> Iterator[Path]:
    """The folders that may hold presets, in order of precedence."""
    share = Path('share', 'linkage_ros', 'config')
    # A sourced workspace comes first, also for code that runs from a checkout: by sourcing, a ROS
    # user selects an installation, and an overlay replaces presets.
    for prefix in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep):
        if prefix:
            yield Path(prefix, share)
    root = Path(__file__).resolve().parents[2]
    yield root / share  # pip install --target
    if root.name in {'site-packages', 'dist-packages'}:
        # PREFIX/Lib/site-packages or PREFIX/lib/python3.X/site-packages, where PREFIX need
        # not be sys.prefix: pip install --user or --prefix, and Debian's /usr/local.
        yield root.parents[1] / share
        yield root.parents[2] / share
    yield Path(sys.prefix, share)
    if (root / 'package.xml').is_file():  # a stranger's site-packages/config is not ours
        yield root / 'config'
