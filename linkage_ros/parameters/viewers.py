# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Valid values of the parameter viewer: a word, the URL of a viewer, or a recording's path."""

from __future__ import annotations

import re
from pathlib import Path

from linkage_ros.quantities import shown

SPAWN, WEB = 'spawn', 'web'
# For help and errors.
VIEWERS = f'{SPAWN}, {WEB}, rerun+http://HOST:PORT/proxy or a .rrd path'

_URL = re.compile(r'rerun\+http://(\[[0-9a-fA-F:.]+\]|[^][/:\s]+):(\d{1,5})/proxy')
_LAST_PORT = 65535


def viewer_address(target: str) -> tuple[str, int] | None:
    """Reads the URL of a viewer.

    Args:
        target: The value of the parameter.

    Returns:
        Host and port; None if it is not such a URL.
    """
    match = _URL.fullmatch(target)
    if match is None or int(match[2]) > _LAST_PORT:
        return None
    return match[1].strip('[]'), int(match[2])


def is_recording(target: str) -> bool:
    """Whether a viewer is the path of a file, by its form alone."""
    return Path(target).suffix == '.rrd' and '://' not in target


def is_viewer(target: str) -> bool:
    """Whether a viewer is one of VIEWERS, by its form alone."""
    return target in (SPAWN, WEB) or is_recording(target) or viewer_address(target) is not None


def no_viewer(target: str) -> str:
    """Error message for an invalid viewer."""
    return f'viewer = {shown(target)} is not one of: {VIEWERS}'
