# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Templates of the messages of a state: CDR, little endian, with zero padding.

A run publishes and logs the same bytes; replay publishes them again.
"""

import struct
from collections.abc import Collection, Iterable, Sequence

from linkage_ros.messages.cdr import ENCAPSULATION, STAMP, align, count, header, string
from linkage_ros.messages.rows import STAMP_FIELDS, Field, Part
from linkage_ros.units import NS_PER_S

ROOT_FRAME = 'base_link'
QUANTITIES = ('position', 'velocity', 'acceleration', 'effort')
POINT_FIELDS = Field('point.x', 'd'), Field('point.y', 'd')

# A trajectory point: four sequences of one number each, aligned to 8 bytes, and a duration.
_POINT = struct.Struct('<' + 4 * 'I4xd' + 'iI')


def joint_numbers(names: Sequence[str]) -> list[str]:
    """Returns the names of the numbers in joint messages, such as 'velocity[coupler]'."""
    return [f'{quantity}[{name}]' for quantity in QUANTITIES for name in names]


def _named(names: Sequence[str], frame_id: str) -> bytes:
    """Encodes a header and joint names, aligned to 4 bytes, without encapsulation."""
    body = count(header(frame_id), len(names))
    for name in names:
        body = string(body, name)
    return align(body, 4)


def _sequences(body: bytes, names: Sequence[str], quantities: Iterable[str]) -> Iterable[Part]:
    """Generates the template of a joint message: constant bytes, then a sequence per quantity.

    Args:
        body: Bytes of the message before the sequences, aligned to 4, without encapsulation.
        names: Names of the joints.
        quantities: Names of the quantities, such as 'velocity'.

    Yields:
        Constant bytes and fields.
    """
    constant = body[STAMP.size :]
    yield from (ENCAPSULATION, *STAMP_FIELDS)
    gap = -(len(body) + 4) % 8
    for quantity in quantities:
        yield constant + count(b'', len(names)) + bytes(gap)
        yield from (Field(f'{quantity}[{name}]', 'd') for name in names)
        constant, gap = b'', 4  # after doubles and the length


def joint_state(names: Sequence[str], frame_id: str) -> list[Part]:
    """Returns the template of a JointState message."""
    quantities = (quantity for quantity in QUANTITIES if quantity != 'acceleration')
    return [*_sequences(_named(names, frame_id), names, quantities)]


def trajectory(names: Sequence[str], frame_id: str) -> list[Part]:
    """Returns the template of a JointTrajectory message with one point at time_from_start 0."""
    return [*_sequences(count(_named(names, frame_id), 1), names, QUANTITIES), bytes(8)]


def point(frame_id: str) -> list[Part]:
    """Returns the template of a PointStamped message with z = 0."""
    body = align(header(frame_id), 8)[STAMP.size :]
    return [ENCAPSULATION, *STAMP_FIELDS, body, *POINT_FIELDS, bytes(8)]


def float64(name: str) -> list[Part]:
    """Returns the template of a std_msgs/Float64 message."""
    return [ENCAPSULATION, Field(name, 'd')]


def float64_array(name: str) -> list[Part]:
    """Returns the template of a std_msgs/Float64MultiArray message with one number."""
    return [ENCAPSULATION + struct.pack('<III4x', 0, 0, 1), Field(name, 'd')]


def crank_trajectory(
    name: str, frame_id: str, points: Collection[tuple[int, tuple[float, ...]]]
) -> bytes:
    """Encodes a JointTrajectory message of one joint and many points.

    Args:
        name: Name of the joint.
        frame_id: Frame of the message.
        points: Stamp of each point, ns, in increasing order, and its values: position, rad,
            velocity, rad/s, acceleration, rad/s^2, and effort, N m.

    Returns:
        The CDR bytes of the message, whose stamp is that of the first point.
    """
    start = next(iter(points))[0]
    body = count(_named([name], frame_id), len(points))[STAMP.size :]
    packed = b''.join(
        _POINT.pack(
            1, p + 0.0, 1, v + 0.0, 1, a + 0.0, 1, e + 0.0, *divmod(time - start, NS_PER_S)
        )
        for time, (p, v, a, e) in points
    )
    # The padding before the first number depends on the name; all later offsets are fixed.
    gap = -(STAMP.size + len(body) + 4) % 8
    first = packed[:4] + packed[8 - gap :]
    return ENCAPSULATION + STAMP.pack(*divmod(start, NS_PER_S)) + body + first
