# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Values of the parameter `viewer`."""

import re
from pathlib import Path

from linkage_ros.quantities import shown

SPAWN, WEB = 'spawn', 'web'
# Valid values of the parameter `viewer`, for help and error messages.
VIEWERS = f'{SPAWN}, {WEB}, rerun+http://HOST:PORT/proxy or a .rrd path'

_URL = re.compile(r'rerun\+http://(\[[0-9a-fA-F:.]+\]|[^][/:\s]+):(\d{1,5})/proxy')
_LAST_PORT = 65535


def viewer_address(target: str) -> tuple[str, int] | None:
    """Parses the URL of a viewer.

    Args:
        target: Value of the parameter `viewer`.

    Returns:
        Host and port; None if the value is not the URL of a viewer.
    """
    match = _URL.fullmatch(target)
    if match is None or int(match[2]) > _LAST_PORT:
        return None
    return match[1].strip('[]'), int(match[2])


def is_recording(target: str) -> bool:
    """Returns whether a value of the parameter `viewer` is the path of a .rrd file."""
    return Path(target).suffix == '.rrd' and '://' not in target


def viewer_error(target: str) -> str:
    """Returns the error message for an invalid value of the parameter `viewer`."""
    return f'viewer = {shown(target)} is not one of: {VIEWERS}'
