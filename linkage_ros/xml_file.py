# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads the XML of robot models, as tolerantly as ROS, Gazebo and MuJoCo do."""

import re
from pathlib import Path
from xml.etree import ElementTree as ET

from linkage_ros.errors import ConfigurationError
from linkage_ros.files import read_file

_PREFIX = re.compile(rb'<(/?)([\w.-]+):')


def read_xml(path: Path) -> ET.Element:
    """Reads an XML file; prefixes need no declaration, and become part of the names.

    Args:
        path: Path of a URDF, SDF or MJCF file.

    Returns:
        The root element.

    Raises:
        ConfigurationError: The file cannot be read, is too large, or is not XML.
    """
    try:
        data = read_file(path)
    except OSError as error:
        raise ConfigurationError(
            f'{path}: {error.strerror or error}; give the path of a URDF, SDF or MJCF file'
        ) from error
    # Robot models have comments that contain -- and prefixes that are not declared, which ROS,
    # Gazebo and MuJoCo accept. Line numbers are kept.
    data = _PREFIX.sub(rb'<\1\2.', _without_comments(data))
    try:
        return ET.fromstring(data)  # noqa: S314, expat limits the growth of entities
    except (ET.ParseError, ValueError, LookupError) as error:
        raise ConfigurationError(f'{path}: not XML ({error}); give a URDF, SDF or MJCF') from error


def _without_comments(data: bytes) -> bytes:
    """Replaces comments by their line ends, in linear time even if many do not end."""
    parts, at = [], 0
    while (begin := data.find(b'<!--', at)) >= 0 and (end := data.find(b'-->', begin + 4)) >= 0:
        parts += [data[at:begin], b'\n' * data.count(b'\n', begin, end)]
        at = end + 3
    return b''.join([*parts, data[at:]])
