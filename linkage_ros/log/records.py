# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Metadata records of a log: configuration, segments of motion, ends of torques, end of the log.

MCAP does not protect metadata with checksums. Each record therefore includes one, so that a
flipped bit cannot change a setting unnoticed.
"""

import functools
import json
import zlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields
from fractions import Fraction
from typing import Any, NamedTuple, TypeAlias, TypeVar, get_type_hints

from linkage_ros import __version__
from linkage_ros.errors import LogError
from linkage_ros.mechanism.base import Description
from linkage_ros.motion.law import Law, parse_law
from linkage_ros.motion.segments import Gravity, Segment
from linkage_ros.settings.configuration import Configuration, from_strings, to_strings
from linkage_ros.units import TIME_END

CONFIGURATION_RECORD = 'linkage_ros'
MOTION_RECORD = 'linkage_ros/motion'
END_RECORD = 'linkage_ros/end'  # its field `messages` is the number of logged messages

ROLE = 'linkage_ros.role'  # key in the metadata of a channel; the value is `Topic.role`
LINKAGE = 'linkage'  # field of the record of a segment: its linkage, if that has a name
CHECKSUM = 'crc32'  # name of the field with the checksum


def seal(fields: dict[str, str]) -> dict[str, str]:
    """Adds a checksum to the fields of a record."""
    checksum = zlib.crc32(json.dumps(sorted(fields.items())).encode())
    return {**fields, CHECKSUM: f'{checksum:08x}'}


def unseal(record: Mapping[str, str]) -> dict[str, str]:
    """Verifies and removes the checksum of a record created by `seal`.

    Raises:
        LogError: The checksum is wrong.
    """
    fields = {name: text for name, text in record.items() if name != CHECKSUM}
    if record != seal(fields):
        raise LogError('a record of linkage_ros is damaged: its checksum is wrong')
    return fields


class Gap(NamedTuple):
    """A place in a log, before the next chunk, at which messages are missing.

    Attributes:
        dropped: Number of states and other messages that the run dropped there, because the disk
            was too slow; 0 if the file was damaged there.
    """

    dropped: int


class TorqueEnd(NamedTuple):
    """The end of a torque that the run commanded: it sent a zero on each topic of commands.

    Attributes:
        stamp: Log time of the zeros, ns.
        cause: A signal, or another cause; see `linkage_ros.node`.
        linkage: The linkage that the torque drove; empty for the only one.
    """

    stamp: int
    cause: str
    linkage: str = ''


class LinkageEnd(NamedTuple):
    """The end of the motion of one of several linkages; the others continue.

    Attributes:
        stamp: Stamp of the first state without it, ns.
        cause: Message of the error.
        linkage: Name of the linkage.
    """

    stamp: int
    cause: str
    linkage: str


Event: TypeAlias = Gap | TorqueEnd | LinkageEnd
# The name of the record of each kind of event.
EVENT_RECORDS: dict[type[Event], str] = {
    Gap: 'linkage_ros/gap',
    TorqueEnd: 'linkage_ros/torque_end',
    LinkageEnd: 'linkage_ros/linkage_end',
}
_Event = TypeVar('_Event', Gap, TorqueEnd, LinkageEnd)


def encode_event(event: Event) -> dict[str, str]:
    """Encodes an event as a record."""
    return seal({name: str(value) for name, value in event._asdict().items()})


def decode_events(kind: type[_Event], records: Iterable[Mapping[str, str]]) -> list[_Event]:
    """Decodes records created by `encode_event`, whose first fields are whole numbers.

    Raises:
        LogError: A record is damaged.
        ValueError: A number is malformed. Missing fields may raise other exceptions.
    """
    first, *others = kind._fields
    return [
        kind(int(texts[first]), *(texts[name] for name in others))
        for texts in map(unseal, records)
    ]


class LoggedSegment(NamedTuple):
    """A segment of the motion of a linkage.

    Attributes:
        segment: The segment.
        linkage: Name of the linkage; empty for the only one.
    """

    segment: Segment
    linkage: str = ''


def encode_configuration(configuration: Configuration) -> dict[str, str]:
    """Encodes a configuration as a record, with the version of this package."""
    return seal({'version': __version__, **to_strings(configuration)})


def decode_configuration(record: Mapping[str, str]) -> tuple[str, Configuration]:
    """Decodes the version of linkage_ros that wrote a record, and its configuration.

    Raises:
        LogError: The record is damaged.
        ConfigurationError: This version cannot use the configuration.
    """
    settings = unseal(record)
    version = settings.pop('version', 'unknown')
    return version, from_strings(settings)


def _fraction(text: str) -> Fraction:
    """Parses 'p/q'; unlike `Fraction(text)`, does not expand exponents such as 1e999999999."""
    return Fraction(*map(int, text.split('/')))


def _description(text: str) -> Description:
    """Parses the output of `str(description)`."""
    *coordinates, assembly = text.split()
    return Description(tuple(coordinates), assembly)


def _pair(text: str) -> tuple[float, ...]:
    """Parses the output of `str(pair)`."""
    return tuple(map(float, text.strip('()').split(',')))


_NAMES = {'old_stamp': 'before'}  # field names of segments that differ in records
_LARGEST = {int: TIME_END - 1, float: 1e30, Fraction: 1e30}
# Parsers of the texts of values, by type.
_PARSERS: dict[Any, Callable[[str], Any]] = {
    int: int, float: float, Fraction: _fraction, Gravity: _pair, Description: _description,
    Law: parse_law,
}  # fmt: skip


@functools.cache
def _parsers(kind: type[Segment]) -> dict[str, Callable[[str], Any]]:
    """Returns the parser of each field of a class of segments."""
    hints = get_type_hints(kind)
    return {
        field.name: next(p for x, p in _PARSERS.items() if hints[field.name] in (x, x | None))
        for field in fields(kind)
    }


def encode_motion(segment: Segment, linkage: str = '') -> dict[str, str]:
    """Encodes a segment of motion as a record; phase and speed are exact fractions."""
    texts = {_NAMES.get(n, n): str(v) for n, v in vars(segment).items() if v is not None}
    return seal({**texts, **({LINKAGE: linkage} if linkage else {})})


def decode_motion(record: Mapping[str, str], kind: type[Segment]) -> Segment:
    """Decodes a segment of motion of a class, bit for bit, from a record of `encode_motion`.

    Raises:
        LogError: The record is damaged.
        ValueError: A value is malformed or too large. Unknown or missing fields may raise other
            exceptions.
    """
    texts, values = unseal(record), {}
    texts.pop(LINKAGE, '')
    # The field of each name in records, and the function that parses its text.
    parsers = {_NAMES.get(name, name): (name, parse) for name, parse in _parsers(kind).items()}
    for logged_name, text in texts.items():
        name, parse = parsers[logged_name]
        value = parse(text)
        largest = _LARGEST.get(type(value))
        if largest and not abs(value) <= largest:
            raise ValueError(f'{name} = {text}: must be at most {largest:g}')
        values[name] = value
    return kind(**values)
