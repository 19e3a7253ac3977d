# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Encodes and decodes CDR, the encoding of ROS messages: little endian, with zero padding.

Values are aligned to their size, relative to the end of the encapsulation header. Commands,
measurements and trajectories are messages from other nodes. They are decoded here because rclpy
prints a line to stderr for each invalid message.
"""

import struct
from collections.abc import Sequence
from typing import Any, NamedTuple

from linkage_ros.units import NS_PER_S

ENCAPSULATION = b'\x00\x01\x00\x00'
STAMP = struct.Struct('<iI')  # s and ns
_COUNT = struct.Struct('<I')
LARGEST_COMMAND = 65536  # bytes
_ABSENT = b''  # value of a field of size 0
NAMED_TWICE, NOT_ONE_EACH = (
    'the joint is named more than once', 'not one position and velocity for each name'
)  # fmt: skip
OK, WARN, ERROR = 0, 1, 2  # levels of a DiagnosticStatus


def stamp_of(data: bytes) -> int:
    """Reads the stamp, ns, in the header with which a message starts; -1 if it is too short."""
    if len(data) < len(ENCAPSULATION) + STAMP.size:
        return -1
    seconds, nanoseconds = STAMP.unpack_from(data, len(ENCAPSULATION))
    return int(seconds * NS_PER_S + nanoseconds)


def align(body: bytes, size: int) -> bytes:
    """Pads CDR bytes to a multiple of a size, in bytes."""
    return body + b'\0' * (-len(body) % size)


def count(body: bytes, number: int) -> bytes:
    """Appends the length of a sequence or string to CDR bytes."""
    return align(body, 4) + _COUNT.pack(number)


def string(body: bytes, text: str) -> bytes:
    """Appends a string to CDR bytes."""
    data = text.encode() + b'\0'
    return count(body, len(data)) + data


def header(frame_id: str, stamp: int = 0) -> bytes:
    """Encodes a std_msgs/Header; `stamp` is in ns."""
    return string(STAMP.pack(*divmod(stamp, NS_PER_S)), frame_id)


def encode_string(text: str) -> bytes:
    """Encodes a std_msgs/String message as CDR bytes.

    Like DDS, it pads the message to a multiple of 4 bytes, so that subscribers receive exactly the
    logged bytes.
    """
    return align(ENCAPSULATION + string(b'', text), 4)


def encode_clock(stamp: int) -> bytes:
    """Encodes a rosgraph_msgs/Clock message as CDR bytes; `stamp` is in ns."""
    return ENCAPSULATION + STAMP.pack(*divmod(stamp, NS_PER_S))


class Status(NamedTuple):
    """The status of a component, with the fields of a DiagnosticStatus.

    Attributes:
        level: OK, WARN or ERROR.
        name: Name of the component.
        message: Short description of its status.
        values: Further values as strings, by key.
    """

    level: int
    name: str
    message: str
    values: dict[str, str]


def encode_diagnostics(stamp: int, hardware: str, statuses: Sequence[Status]) -> bytes:
    """Encodes a diagnostic_msgs/DiagnosticArray message, padded as in `encode_string`.

    The stamp is in ns; `hardware` is the hardware_id of every status.
    """
    body = count(header('', stamp), len(statuses))
    for level, name, message, values in statuses:
        body += bytes([level])
        for text in (name, message, hardware):
            body = string(body, text)
        body = count(body, len(values))
        for text in (text for pair in values.items() for text in pair):
            body = string(body, text)
    return align(ENCAPSULATION + body, 4)


class JointStateData(NamedTuple):
    """The contents of a JointState; the sequences may differ in length.

    Attributes:
        stamp: Stamp of the message, ns.
        names: Names of the joints.
        positions: Joint positions, rad or m.
        velocities: Joint velocities, rad/s or m/s.
        efforts: Joint efforts, N m or N.
    """

    stamp: int
    names: list[str]
    positions: tuple[float, ...]
    velocities: tuple[float, ...]
    efforts: tuple[float, ...]


def decode_joint_state(data: bytes) -> JointStateData:
    """Decodes an untrusted JointState, CDR bytes.

    Raises:
        ValueError: The bytes are not a JointState, or the message is too large.
    """
    body = _body(data, 'JointState')
    try:
        names, at = _names(body)
        rows, _ = _rows(body, at, 3)
    except (struct.error, ValueError) as error:
        raise ValueError('its bytes are not a JointState') from error
    return JointStateData(stamp_of(data), names, *rows)


class DoubtfulJointError(ValueError):
    """A JointState from which it is unclear which values a joint has."""


class JointReader:
    """Reads one joint from untrusted JointState messages.

    The messages of a topic usually differ only in numbers, so the rest is parsed only where it
    changes.
    """

    def __init__(self, joint: str) -> None:
        """Initializes the reader of a joint."""
        self._joint, self._size = joint, -1
        # For messages of this size: what must not change, and the values to read.
        self._frame, self._constant = struct.Struct(''), tuple[Any, ...]()
        self._values = self._frame

    def read(self, data: bytes) -> tuple[int, float | None, float | None]:
        """Reads stamp, ns, and position and velocity of the joint, None where they are absent.

        Raises:
            ValueError: The bytes are not a JointState, or the message is too large.
            DoubtfulJointError: The joint is named more than once, or the positions or velocities
                are neither empty nor one for each name.
        """
        if len(data) != self._size or self._frame.unpack_from(data) != self._constant:
            self._parse(data)
        seconds, nanoseconds, position, velocity = self._values.unpack_from(data)
        return (
            seconds * NS_PER_S + nanoseconds,
            None if position == _ABSENT else position,
            None if velocity == _ABSENT else velocity,
        )

    def _parse(self, data: bytes) -> None:
        """Finds the joint in a message.

        Raises:
            ValueError: As for `read`.
            DoubtfulJointError: As for `read`.
        """
        message = decode_joint_state(data)
        names, rows = message.names, (message.positions, message.velocities, message.efforts)
        is_named = self._joint in names
        if names.count(self._joint) > 1:
            raise DoubtfulJointError(NAMED_TWICE)
        lengths = {len(message.positions), len(message.velocities)}
        if is_named and not lengths <= {0, len(names)}:
            raise DoubtfulJointError(NOT_ONE_EACH)
        start = len(ENCAPSULATION)
        _, size_of_names = _names(data[start:])
        # Offset and format of each row's length, and of the joint's number in it.
        length_fields, own_fields = list[tuple[int, str]](), list[tuple[int, str]]()
        end = start + size_of_names
        for row in rows:
            _, end = _count(data, end)
            length_fields.append((end - _COUNT.size, 'I'))
            if row:
                end += (start - end) % 8  # doubles are aligned
            has_own = is_named and len(row) == len(names)
            own = (end + 8 * names.index(self._joint), 'd') if has_own else (end, '0s')
            own_fields.append(own)
            end += 8 * len(row)
        # All but the stamp and the numbers must not change.
        after_stamp, end_of_names = start + STAMP.size, length_fields[0][0]
        frame = (0, f'{start}s'), (after_stamp, f'{end_of_names - after_stamp}s')
        self._frame = _struct(*frame, *length_fields)
        self._constant = self._frame.unpack_from(data)
        position, velocity, _ = own_fields
        self._values, self._size = _struct((start, 'iI'), position, velocity), len(data)


def _struct(*fields: tuple[int, str]) -> struct.Struct:
    """Returns the struct of fields with the given offsets, in increasing order."""
    form = '<'
    for at, code in fields:
        form += f'{at - struct.calcsize(form)}x{code}'
    return struct.Struct(form)


class TrajectoryPoint(NamedTuple):
    """A point of a JointTrajectory; the sequences may differ in length.

    Attributes:
        positions: Joint positions, rad or m.
        velocities: Joint velocities, rad/s or m/s.
        accelerations: Joint accelerations, rad/s^2 or m/s^2.
        efforts: Joint efforts, N m or N.
        time: Time from the start, ns.
    """

    positions: tuple[float, ...]
    velocities: tuple[float, ...]
    accelerations: tuple[float, ...]
    efforts: tuple[float, ...]
    time: int


def decode_trajectory(data: bytes) -> tuple[int, list[str], list[TrajectoryPoint]]:
    """Decodes stamp, ns, names of the joints, and points of an untrusted JointTrajectory.

    Raises:
        ValueError: The bytes are not a JointTrajectory, or the message is too large.
    """
    body, points = _body(data, 'JointTrajectory'), list[TrajectoryPoint]()
    try:
        names, at = _names(body)
        number, at = _count(body, at)
        for _ in range(number):
            (positions, velocities, accelerations, efforts), at = _rows(body, at, 4)
            at += -at % 4 + STAMP.size
            seconds, nanoseconds = STAMP.unpack_from(body, at - STAMP.size)
            time = seconds * NS_PER_S + nanoseconds
            points.append(TrajectoryPoint(positions, velocities, accelerations, efforts, time))
    except (struct.error, ValueError) as error:
        raise ValueError('its bytes are not a JointTrajectory') from error
    return stamp_of(data), names, points


def decode_wrench(data: bytes) -> tuple[str, float, float]:
    """Decodes frame_id, and the force along its x and y axes, N, of an untrusted WrenchStamped.

    Raises:
        ValueError: The bytes are not a WrenchStamped, or the message is too large.
    """
    body = _body(data, 'WrenchStamped')
    try:
        (text,), at = _sequence(body, STAMP.size, 's')
        at += -at % 8
        x, y, *_ = struct.unpack_from('<6d', body, at)
        return text.removesuffix(b'\0').decode(), x, y
    except (struct.error, ValueError) as error:
        raise ValueError('its bytes are not a WrenchStamped') from error


def decode_point(data: bytes) -> tuple[int, tuple[float, ...]]:
    """Decodes stamp, ns, and the coordinates x, y and z, m, of an untrusted PointStamped.

    Raises:
        ValueError: The bytes are not a PointStamped, or the message is too large.
    """
    body = _body(data, 'PointStamped')
    try:
        _, at = _sequence(body, STAMP.size, 's')  # the frame
        place = struct.unpack_from('<3d', body, at + -at % 8)
    except (struct.error, ValueError) as error:
        raise ValueError('its bytes are not a PointStamped') from error
    return stamp_of(data), place


def _body(data: bytes, kind: str) -> bytes:
    """Removes the encapsulation of an untrusted message.

    Raises:
        ValueError: It has another encapsulation, or is too large.
    """
    if len(data) > LARGEST_COMMAND:
        raise ValueError(f'it has {len(data)} bytes: must be at most {LARGEST_COMMAND}')
    if data[:4] != ENCAPSULATION:
        raise ValueError(f'its bytes are not a {kind}')
    return data[len(ENCAPSULATION) :]


def _names(body: bytes) -> tuple[list[str], int]:
    """Reads the joint names after a header; returns them and the end offset."""
    _, at = _sequence(body, STAMP.size, 's')  # the frame
    number, at = _count(body, at)
    names = []
    for _ in range(number):
        (text,), at = _sequence(body, at, 's')
        names.append(text.removesuffix(b'\0').decode())  # Fast DDS may omit the zero
    return names, at


def _rows(body: bytes, at: int, number: int) -> tuple[list[tuple[float, ...]], int]:
    """Reads sequences of doubles at an offset; returns them and the end offset."""
    rows = []
    for _ in range(number):
        row, at = _sequence(body, at, 'd')
        rows.append(row)
    return rows, at


def _count(body: bytes, at: int) -> tuple[int, int]:
    """Reads the length of a sequence at an offset; returns it and the end offset."""
    at += -at % 4 + _COUNT.size
    (number,) = _COUNT.unpack_from(body, at - _COUNT.size)
    return number, at


def _sequence(body: bytes, at: int, code: str) -> tuple[tuple[Any, ...], int]:
    """Reads a sequence of characters or doubles at an offset; returns values and end offset."""
    number, at = _count(body, at)
    form = f'<{number}{code}'
    at += -at % struct.calcsize(f'<{code}') if number else 0
    return struct.unpack_from(form, body, at), at + struct.calcsize(form)
