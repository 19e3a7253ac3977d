# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""States as the very bytes of ROS messages: CDR, little endian, every padding byte zero.

The bytes are what is published, logged and replayed. Fast DDS would leave whatever was on the
heap in the padding, so that equal states gave unequal files; and filling a template is several
times faster than serialising a message object.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import NamedTuple

from linkage_ros.interfaces import FLOAT64, JOINT_STATE, POINT_STAMPED, STRING, Interface

_ENCAPSULATION = b'\x00\x01\x00\x00'
_STAMP = struct.Struct('<iI')
_NS = 10**9
ROOT_FRAME = 'base_link'


class Topic(NamedTuple):
    """A topic of the node.

    Attributes:
        name: Relative.
        interface: Its message type.
        latched: Whether late subscribers get the last message (transient local durability).
        depth: Messages kept for a reader that lags.
    """

    name: str
    interface: Interface
    latched: bool = False
    depth: int = 10


JOINT_STATES = Topic('joint_states', JOINT_STATE)
DRIVING_TORQUE = Topic('driving_torque', FLOAT64)
COUPLER_POINT = Topic('coupler_point', POINT_STAMPED)
ROBOT_DESCRIPTION = Topic('robot_description', STRING, latched=True, depth=1)
TOPICS = (JOINT_STATES, DRIVING_TORQUE, COUPLER_POINT, ROBOT_DESCRIPTION)


class JointStateCodec:
    """JointState messages of a fixed set of joints.

    Attributes:
        names: The joints.
    """

    def __init__(self, names: Sequence[str], frame_id: str = ROOT_FRAME) -> None:
        self.names = tuple(names)
        count = len(self.names)
        body = _align(_header(frame_id), 4) + struct.pack('<I', count)
        for name in names:
            body = _align(_string(body, name), 4)
        # Three sequences: a length, padding to 8 bytes, the numbers. All but the first length
        # fall on multiples of 8.
        first_gap = -(len(body) + 4) % 8
        self._numbers = struct.Struct(f'<I{first_gap}x{count}dI4x{count}dI4x{count}d')
        self._head = len(_ENCAPSULATION) + len(body)
        self._buffer = bytearray(_ENCAPSULATION + body + b'\0' * self._numbers.size)

    def encode(
        self,
        stamp: int,
        position: Sequence[float],
        velocity: Sequence[float],
        effort: Sequence[float],
    ) -> bytes:
        """One message.

        Args:
            stamp: ns.
            position: rad or m, one for each joint.
            velocity: rad/s or m/s.
            effort: N m or N.

        Returns:
            Its CDR bytes.
        """
        count = len(self.names)
        _STAMP.pack_into(self._buffer, 4, *divmod(stamp, _NS))
        self._numbers.pack_into(
            self._buffer, self._head, count, *position, count, *velocity, count, *effort
        )
        return bytes(self._buffer)

    def decode(self, data: bytes) -> tuple[int, tuple[float, ...]]:
        """Reads a message of the same joints.

        Args:
            data: Its CDR bytes.

        Returns:
            Stamp, ns, and all positions, then velocities, then efforts.

        Raises:
            ValueError: The bytes are no such message.
        """
        fixed = len(data) == len(self._buffer) and all(
            data[part] == self._buffer[part] for part in (slice(4), slice(12, self._head))
        )
        numbers = self._numbers.unpack_from(data, self._head) if fixed else ()
        count = len(self.names)
        if numbers[:: count + 1] != (count,) * 3:
            raise ValueError(f'not a JointState of the joints {", ".join(self.names)}')
        seconds, nanoseconds = _STAMP.unpack_from(data, 4)
        rows = (
            numbers[start + 1 : start + 1 + count]
            for start in range(0, 3 * (count + 1), count + 1)
        )
        return seconds * _NS + nanoseconds, tuple(value for row in rows for value in row)


class PointCodec:
    """PointStamped messages of one frame."""

    def __init__(self, frame_id: str = ROOT_FRAME) -> None:
        head = _align(_header(frame_id), 8)
        self._head = len(_ENCAPSULATION) + len(head)
        self._numbers = struct.Struct('<3d')
        self._buffer = bytearray(_ENCAPSULATION + head + b'\0' * self._numbers.size)

    def encode(self, stamp: int, x: float, y: float) -> bytes:
        """One message.

        Args:
            stamp: ns.
            x: m.
            y: m; z is 0.

        Returns:
            Its CDR bytes.
        """
        _STAMP.pack_into(self._buffer, 4, *divmod(stamp, _NS))
        self._numbers.pack_into(self._buffer, self._head, x, y, 0.0)
        return bytes(self._buffer)


def encode_float64(value: float) -> bytes:
    """A std_msgs/Float64 message as CDR bytes."""
    return _ENCAPSULATION + struct.pack('<d', value)


def encode_string(text: str) -> bytes:
    """A std_msgs/String message as CDR bytes.

    It is filled up to a multiple of 4 bytes, as DDS would do on the way: subscribers get the
    bytes that are logged.
    """
    return _align(_ENCAPSULATION + _string(b'', text), 4)


def _header(frame_id: str) -> bytes:
    return _string(b'\0' * _STAMP.size, frame_id)


def _string(body: bytes, text: str) -> bytes:
    data = text.encode() + b'\0'
    return body + struct.pack('<I', len(data)) + data


def _align(body: bytes, size: int) -> bytes:
    return body + b'\0' * (-len(body) % size)
