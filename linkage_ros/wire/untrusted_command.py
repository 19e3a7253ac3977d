# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads commands from the bytes of JointState messages, whoever sent them.

rclpy would do it as well, but each message that is none costs a line on stderr, from below Python.
"""

from __future__ import annotations

import struct

from linkage_ros.wire.cdr import ENCAPSULATION, STAMP, CdrReader

LARGEST_COMMAND = 65536  # bytes


def decode_command(data: bytes) -> tuple[list[str], tuple[float, ...]]:
    """Names and efforts of a JointState.

    Args:
        data: Its CDR bytes, little endian.

    Returns:
        Both, as they are: they need not belong together.

    Raises:
        ValueError: The bytes are none, or too many for a command.
    """
    if len(data) > LARGEST_COMMAND:
        raise ValueError(f'it has {len(data)} bytes: must be at most {LARGEST_COMMAND}')
    if data[:4] != ENCAPSULATION:
        raise ValueError('its bytes are no JointState')
    reader = CdrReader(data, STAMP.size)
    try:
        reader.text()  # the frame
        names = [reader.text() for _ in range(reader.count())]
        _, _, efforts = (reader.numbers() for _ in range(3))
    except (struct.error, ValueError) as error:
        raise ValueError('its bytes are no JointState') from error
    return names, efforts
