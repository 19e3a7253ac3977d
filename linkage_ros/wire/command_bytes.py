# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads commands from the bytes of JointState messages, whoever sent them.

rclpy would do it as well, but each message that is none costs a line on stderr, from below Python.
"""

from __future__ import annotations

import struct

from linkage_ros.wire.messages import ENCAPSULATION

LARGEST = 65536  # bytes of a command


def decode_command(data: bytes) -> tuple[list[str], tuple[float, ...]]:
    """Names and efforts of a JointState.

    Args:
        data: Its CDR bytes, little endian.

    Returns:
        Both, as they are: they need not belong together.

    Raises:
        ValueError: The bytes are none, or too many for a command.
    """
    if len(data) > LARGEST:
        raise ValueError(f'it has {len(data)} bytes: must be at most {LARGEST}')
    if data[:4] != ENCAPSULATION:
        raise ValueError('its bytes are no JointState')
    reader = _Reader(data)
    try:
        reader.text()  # the frame
        names = [reader.text() for _ in range(reader.count())]
        _, _, efforts = (reader.numbers() for _ in range(3))
    except (struct.error, UnicodeDecodeError) as error:
        raise ValueError('its bytes are no JointState') from error
    return names, efforts


class _Reader:
    """Goes through CDR bytes, which are aligned from behind the encapsulation on."""

    def __init__(self, data: bytes) -> None:
        self._data, self._at = data[4:], 8  # behind the stamp

    def count(self) -> int:
        """A length.

        Raises:
            ValueError: It is more than there are bytes.
        """
        self._at += -self._at % 4
        (count,) = struct.unpack_from('<I', self._data, self._at)
        self._at += 4
        if count > len(self._data):
            raise ValueError('its bytes are no JointState')
        found: int = count
        return found

    def text(self) -> str:
        """A string, with the zero behind it."""
        (data,) = struct.unpack_from(f'{self.count()}s', self._data, self._at)
        self._at += len(data)
        return bytes(data[:-1]).decode()

    def numbers(self) -> tuple[float, ...]:
        """A sequence of doubles."""
        count = self.count()
        if count:
            self._at += -self._at % 8
        found = struct.unpack_from(f'<{count}d', self._data, self._at)
        self._at += 8 * count
        return found
