# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The metadata records of a log: configuration and segments of motion.

MCAP has no checksums of metadata, so each record has its own: a flipped bit must not turn a
setting into another one.
"""

from __future__ import annotations

import json
import math
import zlib
from collections.abc import Callable, Mapping
from fractions import Fraction
from typing import Any

from linkage_ros import __version__
from linkage_ros.errors import LogError
from linkage_ros.model.structure import Description
from linkage_ros.motion.segments import Segment, SpeedSegment, TorqueSegment
from linkage_ros.parameters.configuration import Configuration, from_strings, to_strings

CONFIGURATION_RECORD = 'linkage_ros'
MOTION_RECORD = 'linkage_ros/motion'
END_RECORD = 'linkage_ros/end'

_CHECKSUM = 'crc32'
_LARGEST_FRACTION = 10**30  # turns; or turns per minute


def encode_configuration(configuration: Configuration) -> dict[str, str]:
    """The record of a configuration, with the version that writes it."""
    return _seal({'version': __version__, **to_strings(configuration)})


def decode_configuration(record: Mapping[str, str]) -> tuple[str, Configuration]:
    """The version and the configuration of a record.

    Args:
        record: From `encode_configuration`.

    Returns:
        The version of linkage_ros that wrote it, and the configuration.

    Raises:
        LogError: The record is damaged.
        ConfigurationError: This version cannot use the configuration.
    """
    settings = _unseal(record, 'configuration')
    version = settings.pop('version', 'unknown')
    return version, from_strings(settings)


def _time(text: str) -> int:
    """A stamp, which has 64 bits.

    Raises:
        ValueError: The value has more bits.
    """
    time = int(text)
    if abs(time) >= 2**63:
        raise ValueError(f'{time} ns')
    return time


def _finite(text: str) -> float:
    """A number.

    Raises:
        ValueError: The number is not finite.
    """
    if not math.isfinite(number := float(text)):
        raise ValueError(text)
    return number


def _fraction(text: str) -> Fraction:
    """Parses the str of a fraction; Fraction itself would expand 1e999999999.

    Raises:
        ValueError: The number is too large.
    """
    fraction = Fraction(*map(int, text.split('/')))
    if abs(fraction) > _LARGEST_FRACTION:
        raise ValueError('too large')
    return fraction


def _description(text: str) -> Description:
    """What str made of a description."""
    *coordinates, assembly = text.split()
    return Description(tuple(coordinates), assembly)


_NAMES = {'old_stamp': 'before'}  # fields of segments that have another name in a record
_READERS: dict[str, Callable[[str], Any]] = {
    'stamp': _time, 'phase': _fraction, 'speed': _fraction, 'rpm': _finite,
    'acceleration': _finite, 'torque': _finite, 'old_stamp': _time,
    'description': _description,
}  # fmt: skip


def encode_motion(segment: Segment) -> dict[str, str]:
    """The record of a segment: exact fractions of turns and of turns per minute, or a torque."""
    fields = {_NAMES.get(n, n): str(v) for n, v in vars(segment).items() if v is not None}
    return _seal(fields)


def decode_motion(record: Mapping[str, str]) -> Segment:
    """The segment of a record.

    Args:
        record: From `encode_motion`.

    Returns:
        The segment.

    Raises:
        LogError: The record is damaged.
    """
    fields = _unseal(record, 'motion')
    kind = TorqueSegment if 'torque' in fields else SpeedSegment
    try:
        given = {n: fields[key] for n in _READERS if (key := _NAMES.get(n, n)) in fields}
        return kind(**{name: _READERS[name](text) for name, text in given.items()})
    except (ValueError, TypeError, ArithmeticError) as error:
        raise LogError(f'a motion record is damaged ({type(error).__name__})') from error


def encode_end(messages: int) -> dict[str, str]:
    """The last record of a log: how many messages were logged."""
    return _seal({'messages': str(messages)})


def decode_end(record: Mapping[str, str]) -> int:
    """The number of messages in a record.

    Args:
        record: From `encode_end`.

    Returns:
        The number.

    Raises:
        LogError: The record is damaged.
    """
    fields = _unseal(record, 'end')
    try:
        return int(fields['messages'])
    except (KeyError, ValueError) as error:
        raise LogError(f'an end record is damaged ({type(error).__name__})') from error


def _checksum(fields: Mapping[str, str]) -> str:
    return f'{zlib.crc32(json.dumps(sorted(fields.items())).encode()):08x}'


def _seal(fields: dict[str, str]) -> dict[str, str]:
    return {**fields, _CHECKSUM: _checksum(fields)}


def _unseal(record: Mapping[str, str], name: str) -> dict[str, str]:
    fields = dict(record)
    if fields.pop(_CHECKSUM, '') != _checksum(fields):
        raise LogError(f'a {name} record is damaged: its checksum is wrong')
    return fields
