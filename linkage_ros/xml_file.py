# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads the XML of robot models, as tolerantly as ROS, Gazebo and MuJoCo do."""

import re
from pathlib import Path
from xml.etree import ElementTree as ET

from linkage_ros.errors import ConfigurationError
from linkage_ros.files import open_file

_LARGEST = 1 << 26  # bytes
_COMMENT, _PREFIX = re.compile(b'<!--.*?-->', re.DOTALL), re.compile(rb'<(/?)([\w.-]+):')


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
        with open_file(path) as stream:
            data = stream.read(_LARGEST + 1)
    except OSError as error:
        raise ConfigurationError(
            f'{path}: {error.strerror or error}; give the path of a URDF, SDF or MJCF file'
        ) from error
    if len(data) > _LARGEST:
        raise ConfigurationError(f'{path}: over {_LARGEST} bytes; give a URDF, SDF or MJCF file')
    # Robot models have comments that contain -- and prefixes that are not declared, which ROS,
    # Gazebo and MuJoCo accept. Line numbers are kept.
    data = _COMMENT.sub(lambda comment: b'\n' * comment[0].count(b'\n'), data)
    data = _PREFIX.sub(rb'<\1\2.', data)
    try:
        return ET.fromstring(data)  # noqa: S314, expat limits the growth of entities
    except (ET.ParseError, ValueError, LookupError) as error:
        raise ConfigurationError(f'{path}: not XML ({error}); give a URDF, SDF or MJCF') from error
