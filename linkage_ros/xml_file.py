# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads the XML of robot models, as tolerantly as ROS, Gazebo and MuJoCo do."""

import re
from pathlib import Path
from xml.etree import ElementTree as ET

from linkage_ros.errors import ConfigurationError
from linkage_ros.files import read_file

_MOST = 200_000  # elements; millions would take seconds and gigabytes
_DEEPEST = 400  # MuJoCo reads 500
_PIECE = 1 << 18  # bytes that expat parses before it sees an error of its target
_PREFIX = re.compile(rb'(</?[\w.-]+):')


def read_xml(path: Path) -> ET.Element:
    """Reads an XML file; prefixes need no declaration, and become part of the names.

    Args:
        path: Path of a URDF, SDF or MJCF file.

    Returns:
        The root element.

    Raises:
        ConfigurationError: The file cannot be read, is too large, is not XML, has a <!DOCTYPE>,
            or has too many or too deeply nested elements.
    """
    try:
        data = read_file(path)
    except OSError as error:
        raise ConfigurationError(
            f'{path}: {error.strerror or error}; give the path of a URDF, SDF or MJCF file'
        ) from error
    # Robot models have comments that contain -- and prefixes that are not declared, which ROS,
    # Gazebo and MuJoCo accept. Line numbers are kept.
    data = _PREFIX.sub(rb'\1.', _without_comments(data))
    parser = ET.XMLParser(target=_Limited())  # noqa: S314, entities are refused
    try:
        for at in range(0, max(1, len(data)), _PIECE):
            parser.feed(data[at : at + _PIECE])
        root: ET.Element = parser.close()
    except ConfigurationError as error:
        raise ConfigurationError(f'{path}: {error}') from error
    except (ET.ParseError, ValueError, LookupError) as error:
        raise ConfigurationError(f'{path}: not XML ({error}); give a URDF, SDF or MJCF') from error
    return root


class _Limited(ET.TreeBuilder):
    """Builds a tree of limited depth and size."""

    def __init__(self) -> None:
        super().__init__()
        self.count = self.depth = 0

    def doctype(self, *_: str | None) -> None:
        # Expat reads its declarations in quadratic time.
        raise ConfigurationError('it has a <!DOCTYPE>, which is not read: leave it out')

    def start(self, tag: str, attrs: dict[str, str], /) -> ET.Element:
        self.count += 1
        self.depth += 1
        if self.count > _MOST:
            raise ConfigurationError(f'it has too many elements: must be at most {_MOST}')
        if self.depth > _DEEPEST:
            raise ConfigurationError(f'its elements are nested too deeply: at most {_DEEPEST}')
        return super().start(tag, attrs)

    def end(self, tag: str, /) -> ET.Element:
        self.depth -= 1
        return super().end(tag)


def _without_comments(data: bytes) -> bytes:
    """Replaces comments by their line ends, in linear time even if many do not end."""
    parts, at = [], 0
    while (begin := data.find(b'<!--', at)) >= 0 and (end := data.find(b'-->', begin + 4)) >= 0:
        parts += [data[at:begin], b'\n' * data.count(b'\n', begin, end)]
        at = end + 3
    return b''.join([*parts, data[at:]])
