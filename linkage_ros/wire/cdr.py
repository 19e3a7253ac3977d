# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Writes and reads CDR, the encoding of ROS messages: little endian, padding bytes zero.

Values are aligned to their size, counted from the end of the encapsulation header.
"""

from __future__ import annotations

import struct

from linkage_ros.units import NS_PER_S

ENCAPSULATION = b'\x00\x01\x00\x00'
STAMP = struct.Struct('<iI')  # s and ns
_COUNT = struct.Struct('<I')


def stamp_of(data: bytes) -> int:
    """The stamp in the header of a message.

    Args:
        data: CDR bytes of a message with a header.

    Returns:
        The stamp, ns; -1 if the message is too short.
    """
    if len(data) < len(ENCAPSULATION) + STAMP.size:
        return -1
    whole, rest = STAMP.unpack_from(data, len(ENCAPSULATION))
    stamp: int = whole * NS_PER_S + rest
    return stamp


def header(frame_id: str, stamp: int = 0) -> bytes:
    """A std_msgs/Header as CDR bytes, without padding behind it.

    Args:
        frame_id: Frame of the message.
        stamp: ns.

    Returns:
        The bytes.
    """
    return string(STAMP.pack(*divmod(stamp, NS_PER_S)), frame_id)


def string(body: bytes, text: str) -> bytes:
    """Appends a string to CDR bytes that end on a multiple of 4."""
    data = text.encode() + b'\0'
    return body + _COUNT.pack(len(data)) + data


def align(body: bytes, size: int) -> bytes:
    """Pads CDR bytes, counted without encapsulation, to a multiple of a size."""
    return body + b'\0' * (-len(body) % size)


class CdrReader:
    """Reads a message value by value.

    Reading raises struct.error or ValueError if bytes are missing or are not text.
    """

    def __init__(self, data: bytes, at: int = 0) -> None:
        """Begins at the first value.

        Args:
            data: CDR bytes of a message.
            at: Number of bytes to skip after the encapsulation.
        """
        self._data, self._at = data[len(ENCAPSULATION) :], at

    def count(self) -> int:
        """Reads a length.

        Raises:
            ValueError: The length exceeds the remaining bytes.
        """
        self._at += -self._at % 4
        count: int = _COUNT.unpack_from(self._data, self._at)[0]
        self._at += 4
        if count > len(self._data):
            raise ValueError(f'{count} elements in {len(self._data)} bytes')
        return count

    def text(self) -> str:
        """Reads a string; its terminating zero may be missing, as in Fast DDS."""
        (data,) = struct.unpack_from(f'{self.count()}s', self._data, self._at)
        self._at += len(data)
        return bytes(data).removesuffix(b'\0').decode()

    def numbers(self) -> tuple[float, ...]:
        """Reads a sequence of doubles."""
        count = self.count()
        if count:
            self._at += -self._at % 8
        found = struct.unpack_from(f'<{count}d', self._data, self._at)
        self._at += 8 * count
        return found
