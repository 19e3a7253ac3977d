# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a viewer may be: a word, the URL of one that runs, or the path of a recording."""

from __future__ import annotations

import re
from pathlib import Path

from linkage_ros.quantities import shown

SPAWN, WEB = 'spawn', 'web'
# Wherever people are told.
VIEWERS = f'{SPAWN}, {WEB}, rerun+http://HOST:PORT/proxy or a .rrd path'

_URL = re.compile(r'rerun\+http://(\[[0-9a-fA-F:.]+\]|[^][/:\s]+):(\d{1,5})/proxy')
_LAST_PORT = 65535


def viewer_address(target: str) -> tuple[str, int] | None:
    """Reads the URL of a viewer.

    Args:
        target: What was typed.

    Returns:
        Its host and port; None: it is no such URL.
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
    """What to say of a viewer that is none."""
    return f'viewer = {shown(target)} is not one of: {VIEWERS}'
