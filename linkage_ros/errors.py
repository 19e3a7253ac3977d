# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The errors of linkage_ros.

A program reads the attributes of an error. A person reads its message: one line that names the
value, the valid range and what to do.
"""

from __future__ import annotations

_LONGEST = 600  # characters of an error message


def printable(text: str) -> str:
    """Escapes the characters of a text that are not printable.

    Args:
        text: A text that may contain names and values from untrusted files.

    Returns:
        The text, without control characters.
    """
    if text.isprintable():
        return text
    parts = (c if c.isprintable() else c.encode('unicode_escape').decode() for c in text)
    return ''.join(parts)


def shortened(text: str, longest: int) -> str:
    """Shortens a text by leaving out its middle.

    Args:
        text: Any text.
        longest: Maximum length of the result, characters.

    Returns:
        The text itself if it is short enough, otherwise its beginning and end.
    """
    if len(text) <= longest:
        return text
    return f'{text[: longest // 2]} ... {text[5 - longest // 2 :]}'


def one_line(text: str) -> str:
    """Makes a text fit for an error message: printable, short and on one line.

    Args:
        text: A text that may contain names and values from untrusted files.

    Returns:
        At most 600 characters; the middle of a longer text is left out.
    """
    words = shortened(' '.join(text.split()), _LONGEST)
    return shortened(printable(words), _LONGEST)


# For each module: why it is needed, and the arguments of `pip install`.
_LIBRARIES = {
    'mcap': ('logs need mcap', 'mcap lz4 zstandard'),
    'lz4': ('logs need lz4', 'mcap lz4 zstandard'),
    'zstandard': ('logs need zstandard', 'mcap lz4 zstandard'),
    # A new rerun-sdk brings NumPy 2, with which Ubuntu's SciPy and Matplotlib do not work.
    'rerun': ('the viewer needs rerun-sdk', '--upgrade rerun-sdk scipy matplotlib'),
    'matplotlib': ('charts need matplotlib', 'matplotlib'),
    'mpmath': ('accuracy and stability charts need mpmath', 'mpmath'),
    'scipy': ('charts, and records of a motion under a torque, need scipy', 'scipy'),
    'distributed': ('--scheduler needs Dask', "'dask[distributed]'"),
    'numba': ('compiled=True needs numba', 'numba'),
    'yaml': ('parameter files need PyYAML', 'PyYAML'),
}


def missing_library(module: str) -> str:
    """Returns the error message for a missing library.

    Args:
        module: The module that cannot be imported.

    Returns:
        One line that says which feature needs the missing library, and how to install it.
    """
    name = module.partition('.')[0]
    if name.startswith('rcl') or name.endswith('_msgs'):
        return (
            f'ROS 2 topics need {name}, which is not installed: source ROS 2 Jazzy, or, without '
            "ROS 2 on Linux x86-64, pip install 'linkage_ros[ros]'"
        )
    need, packages = _LIBRARIES.get(name, (f'linkage_ros needs {name}', name))
    return (
        f'{need}, which is missing or too old: pip install {packages}; with the ROS 2 of Ubuntu, '
        'use a virtual environment (docs/ros2.md)'
    )


class LinkageError(Exception):
    """Base of all errors of this package; its message is always one line."""

    def __str__(self) -> str:
        return one_line(super().__str__())


class ConfigurationError(LinkageError, ValueError):
    """A parameter, file or argument has a value that cannot be used."""


class MechanismError(ConfigurationError):
    """The lengths, masses or centres do not describe a mechanism."""


class UnreachableError(LinkageError, ValueError):
    """No state exists at this crank angle, because the loop cannot close.

    Attributes:
        crank_angle: The first requested angle that is out of reach, rad.
        arcs: The reachable arcs of the crank angle, pairs (from, to) in rad; empty if no angle
            is reachable.
    """

    def __init__(
        self, message: str, *, crank_angle: float, arcs: tuple[tuple[float, float], ...]
    ) -> None:
        super().__init__(message)
        self.crank_angle = crank_angle
        self.arcs = arcs


class MotionError(LinkageError):
    """A torque-driven motion cannot be continued.

    Attributes:
        time: Time at which the motion ends, s.
        coordinates: Coordinates at that time: crank angle, rad, and for a wind pump also the
            slider position, m.
    """

    def __init__(self, message: str, *, time: float, coordinates: tuple[float, ...]) -> None:
        super().__init__(message)
        self.time = time
        self.coordinates = coordinates


class LogError(LinkageError):
    """A log cannot be written or read."""


class ViewerError(LinkageError):
    """The viewer cannot be started or reached."""
