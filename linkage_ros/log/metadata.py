# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The metadata records by which a log explains itself: configuration and segments of motion.

MCAP keeps no checksum of metadata, so each record carries one of its own: a flipped bit in a
setting must not pass for another setting.
"""

from __future__ import annotations

import json
import math
import zlib
from collections.abc import Mapping
from fractions import Fraction

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
_LONGEST_FIELD = 1000  # characters; the longest fraction of a motion has 150


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


def encode_motion(segment: Segment) -> dict[str, str]:
    """The record of a segment: exact fractions of turns and of turns per minute, or a torque."""
    fields = {'stamp': str(segment.stamp)}
    if isinstance(segment, TorqueSegment):
        fields['torque'] = json.dumps(segment.torque)
        if segment.description:
            fields['coordinates'] = ' '.join(segment.description.coordinates)
            fields['assembly'] = segment.description.assembly
    else:
        fields['phase'] = str(segment.phase)
        fields['speed'] = str(segment.speed)
        fields['rpm'] = json.dumps(segment.rpm)
        fields['acceleration'] = json.dumps(segment.acceleration)
    if segment.old_stamp is not None:
        fields['before'] = str(segment.old_stamp)
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
    if max(map(len, fields.values()), default=0) > _LONGEST_FIELD:
        raise LogError('a motion record is damaged: it is endless')
    try:
        stamp = _time(fields['stamp'])
        old_stamp = _time(fields['before']) if 'before' in fields else None
        if 'torque' in fields:
            description = None
            if 'coordinates' in fields:
                description = Description(tuple(fields['coordinates'].split()), fields['assembly'])
            return TorqueSegment(stamp, _finite(fields['torque']), old_stamp, description)
        return SpeedSegment(
            stamp,
            _fraction(fields['phase']),
            _fraction(fields['speed']),
            _finite(fields['rpm']),
            _finite(fields['acceleration']),
            old_stamp,
        )
    except (KeyError, ValueError, TypeError, ArithmeticError, RecursionError) as error:
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


def _time(text: str) -> int:
    """A stamp, which has 64 bits.

    Raises:
        ValueError: This one has more.
    """
    time = int(text)
    if abs(time) >= 2**63:
        raise ValueError(f'{time} ns')
    return time


def _finite(text: str) -> float:
    """A number in JSON.

    Raises:
        ValueError: It is not finite.
    """
    if not math.isfinite(number := float(json.loads(text))):
        raise ValueError(f'{number}')
    return number


def _fraction(text: str) -> Fraction:
    """What str made of a fraction; Fraction itself would compute 1e999999999 to the last digit.

    Raises:
        ValueError: No crank turns so far or so fast.
    """
    fraction = Fraction(*map(int, text.split('/')))
    if abs(fraction) > _LARGEST_FRACTION:
        raise ValueError('too large')
    return fraction


def _checksum(fields: Mapping[str, str]) -> str:
    return f'{zlib.crc32(json.dumps(sorted(fields.items())).encode()):08x}'


def _seal(fields: dict[str, str]) -> dict[str, str]:
    return {**fields, _CHECKSUM: _checksum(fields)}


def _unseal(record: Mapping[str, str], name: str) -> dict[str, str]:
    fields = dict(record)
    if fields.pop(_CHECKSUM, '') != _checksum(fields):
        raise LogError(f'a {name} record is damaged: its checksum is wrong')
    return fields
