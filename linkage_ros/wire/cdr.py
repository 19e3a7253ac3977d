# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""CDR, the bytes of ROS messages: little endian, every padding byte zero, written and read.

Values are aligned to their size, counted from behind the encapsulation on.
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
        ns; -1 where the bytes are too few.
    """
    if len(data) < len(ENCAPSULATION) + STAMP.size:
        return -1
    whole, rest = STAMP.unpack_from(data, len(ENCAPSULATION))
    stamp: int = whole * NS_PER_S + rest
    return stamp


def header(frame_id: str, stamp: int = 0) -> bytes:
    """A std_msgs/Header as CDR bytes, without padding behind it.

    Args:
        frame_id: Its frame.
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
    """Fills CDR bytes, counted without encapsulation, up to a multiple of some size."""
    return body + b'\0' * (-len(body) % size)


class CdrReader:
    """Goes through a message from value to value.

    Where its bytes are too few or no text, reading raises a struct.error or a ValueError.
    """

    def __init__(self, data: bytes, at: int = 0) -> None:
        """Begins.

        Args:
            data: CDR bytes of a message.
            at: Bytes to leave out behind the encapsulation.
        """
        self._data, self._at = data[len(ENCAPSULATION) :], at

    def count(self) -> int:
        """A length.

        Raises:
            ValueError: It is more than there are bytes.
        """
        self._at += -self._at % 4
        count: int = _COUNT.unpack_from(self._data, self._at)[0]
        self._at += 4
        if count > len(self._data):
            raise ValueError(f'{count} elements in {len(self._data)} bytes')
        return count

    def text(self) -> str:
        """A string; the zero behind it may be missing, as for Fast DDS."""
        (data,) = struct.unpack_from(f'{self.count()}s', self._data, self._at)
        self._at += len(data)
        return bytes(data).removesuffix(b'\0').decode()

    def numbers(self) -> tuple[float, ...]:
        """A sequence of doubles."""
        count = self.count()
        if count:
            self._at += -self._at % 8
        found = struct.unpack_from(f'<{count}d', self._data, self._at)
        self._at += 8 * count
        return found
