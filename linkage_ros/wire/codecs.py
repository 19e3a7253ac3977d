# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""States as the very bytes of ROS messages: CDR, little endian, every padding byte zero.

The bytes are what is published, logged and replayed. Fast DDS would leave whatever was on the
heap in the padding, so that equal states gave unequal files; and filling a template is several
times faster than serialising a message object.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Collection, Sequence
from typing import NamedTuple

from linkage_ros.dynamics.state import State
from linkage_ros.model.structure import Link
from linkage_ros.numeric import wrap
from linkage_ros.units import NS_PER_S
from linkage_ros.wire.cdr import ENCAPSULATION, STAMP, align, header, stamp_of, string

ROOT_FRAME = 'base_link'


# Adding 0.0 turns -0.0 into 0.0: a zero in a message has no sign.
_UNSIGNED_ZERO = (0.0).__add__


def joint_rows(links: Sequence[Link], state: State, unwrapped: float) -> list[list[float]]:
    """A state as messages hold it: a number for each joint of the URDF's open tree.

    Args:
        links: The tree; its first joint is the crank's.
        state: The state.
        unwrapped: The whole angle of the crank, rad.

    Returns:
        Positions, rad or m: the crank's unwrapped, other angles in (-pi, pi] from the link before;
        their rates and accelerations; efforts, the driving torque, N m, at the crank, 0 elsewhere.
    """
    position, *_ = rows = [list(row) for row in state[:3]]
    for i, link in reversed(list(enumerate(links))):  # those that hang on a link before it
        if link.parent is not None:
            for row in rows:
                row[i] -= row[link.parent]
            position[i] = wrap(position[i])
        if position[i] <= -math.pi and not link.slides:
            position[i] = math.pi
    position[0] = unwrapped
    return [*rows, [state.torque, *(0.0 for _ in links[1:])]]


class _RowsCodec:
    """Messages that hold rows, a number for each of a fixed set of joints.

    Attributes:
        names: The joints.
    """

    def __init__(self, names: Sequence[str], frame_id: str, rows: int, *, points: bool) -> None:
        self.names = tuple(names)
        self._rows = rows
        count = len(self.names)
        body = align(header(frame_id), 4) + struct.pack('<I', count)
        for name in names:
            body = align(string(body, name), 4)
        if points:
            body += struct.pack('<I', 1)  # a sequence of one point, which holds the rows
        # Each row is a length, padding to 8 bytes, the numbers. All but the first length fall on
        # multiples of 8. A point ends with a duration, which is 0.
        first_gap = -(len(body) + 4) % 8
        other_rows = f'I4x{count}d' * (rows - 1)
        self._numbers = struct.Struct(
            f'<I{first_gap}x{count}d{other_rows}{"8x" if points else ""}'
        )
        self._head = len(ENCAPSULATION) + len(body)
        self._buffer = bytearray(ENCAPSULATION + body + b'\0' * self._numbers.size)

    def encode(self, stamp: int, *rows: Sequence[float]) -> bytes:
        """One message.

        Args:
            stamp: ns.
            *rows: In the order of the message: positions, rad or m, velocities, accelerations
                in a trajectory alone, efforts, N m or N; one number for each joint.

        Returns:
            Its CDR bytes.
        """
        count = len(self.names)
        numbers: list[float] = []
        for row in rows:
            numbers.append(count)
            numbers += map(_UNSIGNED_ZERO, row)
        STAMP.pack_into(self._buffer, 4, *divmod(stamp, NS_PER_S))
        self._numbers.pack_into(self._buffer, self._head, *numbers)
        return bytes(self._buffer)

    def decode(self, data: bytes) -> tuple[int, tuple[float, ...]]:
        """Reads a message of the same joints.

        Args:
            data: Its CDR bytes.

        Returns:
            Stamp, ns, and all rows one after the other.

        Raises:
            ValueError: The bytes are no such message.
        """
        fixed = len(data) == len(self._buffer) and all(
            data[part] == self._buffer[part] for part in (slice(4), slice(12, self._head))
        )
        numbers = self._numbers.unpack_from(data, self._head) if fixed else ()
        count = len(self.names)
        if numbers[:: count + 1] != (count,) * self._rows:
            raise ValueError(f'no message of the joints {", ".join(self.names)}')
        rows = (
            numbers[start + 1 : start + 1 + count]
            for start in range(0, self._rows * (count + 1), count + 1)
        )
        return stamp_of(data), tuple(value for row in rows for value in row)


class JointStateCodec(_RowsCodec):
    """JointState messages: positions, velocities and efforts of a fixed set of joints."""

    def __init__(self, names: Sequence[str], frame_id: str = ROOT_FRAME) -> None:
        super().__init__(names, frame_id, 3, points=False)


class TrajectoryCodec(_RowsCodec):
    """JointTrajectory messages of one point: the same with accelerations before the efforts."""

    def __init__(self, names: Sequence[str], frame_id: str = ROOT_FRAME) -> None:
        super().__init__(names, frame_id, 4, points=True)


class TrajectoryPoint(NamedTuple):
    """A joint at one time of a trajectory.

    Attributes:
        position: rad.
        velocity: rad/s.
        acceleration: rad/s^2.
        effort: N m.
    """

    position: float
    velocity: float
    acceleration: float
    effort: float


class CrankTrajectoryCodec:
    """JointTrajectory messages of one joint and many points."""

    def __init__(self, name: str, frame_id: str = ROOT_FRAME) -> None:
        names = align(header(frame_id), 4) + struct.pack('<I', 1)
        self._body = align(string(names, name), 4)
        # A point is four sequences of one number, each number on a multiple of 8, and a duration.
        # All points but the first begin on such a multiple.
        gap = -(len(self._body) + 8) % 8
        self._first = struct.Struct(f'<I{gap}xdI4xdI4xdI4xdiI')
        self._other = struct.Struct('<I4xdI4xdI4xdI4xdiI')

    def encode(self, points: Collection[tuple[int, TrajectoryPoint]]) -> bytes:
        """One message, whose stamp is that of its first point.

        Args:
            points: Stamps, ns, rising, and points.

        Returns:
            Its CDR bytes.
        """
        start = next(iter(points))[0]
        parts = [ENCAPSULATION, STAMP.pack(*divmod(start, NS_PER_S)), self._body[STAMP.size :]]
        parts.append(struct.pack('<I', len(points)))
        pack = self._first.pack
        for stamp, (position, velocity, acceleration, effort) in points:
            after = divmod(stamp - start, NS_PER_S)
            parts.append(
                pack(
                    1, position + 0.0, 1, velocity + 0.0, 1, acceleration + 0.0, 1, effort + 0.0,
                    *after,
                )
            )  # fmt: skip
            pack = self._other.pack
        return b''.join(parts)


class PointCodec:
    """PointStamped messages."""

    def __init__(self, frame_id: str = ROOT_FRAME) -> None:
        head = align(header(frame_id), 8)
        self._head = len(ENCAPSULATION) + len(head)
        self._numbers = struct.Struct('<3d')
        self._buffer = bytearray(ENCAPSULATION + head + b'\0' * self._numbers.size)

    def encode(self, stamp: int, x: float, y: float) -> bytes:
        """One message.

        Args:
            stamp: ns.
            x: m.
            y: m; z is 0.

        Returns:
            Its CDR bytes.
        """
        STAMP.pack_into(self._buffer, 4, *divmod(stamp, NS_PER_S))
        self._numbers.pack_into(self._buffer, self._head, x + 0.0, y + 0.0, 0.0)
        return bytes(self._buffer)


def encode_float64(value: float) -> bytes:
    """A std_msgs/Float64 message as CDR bytes."""
    return ENCAPSULATION + struct.pack('<d', value + 0.0)


def encode_float64_array(value: float) -> bytes:
    """A std_msgs/Float64MultiArray message of one number, without layout, as CDR bytes."""
    return ENCAPSULATION + struct.pack('<III4xd', 0, 0, 1, value + 0.0)


def encode_string(text: str) -> bytes:
    """A std_msgs/String message as CDR bytes.

    It is filled up to a multiple of 4 bytes, as DDS would do on the way: subscribers get the
    bytes that are logged.
    """
    return align(ENCAPSULATION + string(b'', text), 4)


def encode_clock(stamp: int) -> bytes:
    """A rosgraph_msgs/Clock message as CDR bytes.

    Args:
        stamp: ns.

    Returns:
        The bytes.
    """
    return ENCAPSULATION + STAMP.pack(*divmod(stamp, NS_PER_S))
