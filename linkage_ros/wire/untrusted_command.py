# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads untrusted bytes of JointState messages: commands and measurements.

rclpy could do this, but it prints a line on stderr, from C, for each invalid message.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

from linkage_ros.wire.cdr import ENCAPSULATION, STAMP, CdrReader, stamp_of

LARGEST_COMMAND = 65536  # bytes


class JointStateData(NamedTuple):
    """The contents of a JointState; its lists may differ in length.

    Attributes:
        stamp: ns.
        names: Names of the joints.
        positions: rad or m.
        velocities: rad/s or m/s.
        efforts: N m or N.
    """

    stamp: int
    names: list[str]
    positions: tuple[float, ...]
    velocities: tuple[float, ...]
    efforts: tuple[float, ...]


def decode_joint_state(data: bytes) -> JointStateData:
    """Decodes a JointState.

    Args:
        data: Its CDR bytes, little endian.

    Returns:
        Its contents.

    Raises:
        ValueError: The bytes are not a JointState, or are too many for a command.
    """
    if len(data) > LARGEST_COMMAND:
        raise ValueError(f'it has {len(data)} bytes: must be at most {LARGEST_COMMAND}')
    if data[:4] != ENCAPSULATION:
        raise ValueError('its bytes are no JointState')
    reader = CdrReader(data, STAMP.size)
    try:
        reader.text()  # the frame
        names = [reader.text() for _ in range(reader.count())]
        positions, velocities, efforts = (reader.numbers() for _ in range(3))
    except (struct.error, ValueError) as error:
        raise ValueError('its bytes are no JointState') from error
    return JointStateData(stamp_of(data), names, positions, velocities, efforts)
