# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Says in which value, and by how much, a logged message differs from the recomputed one."""

from __future__ import annotations

import math
import struct
from contextlib import suppress

import numpy as np

from linkage_ros.verification.message_fields import Value, read_fields
from linkage_ros.wire.interfaces import Interface

_NEGATIVE_ZERO = 1 << 63
_CONTEXT = 12  # characters shown on either side of the first that differs


def differing(interface: Interface, logged: bytes, recomputed: bytes) -> str:
    """Names the first value that differs between two messages.

    Args:
        interface: Their type.
        logged: CDR bytes.
        recomputed: Other CDR bytes.

    Returns:
        The value's name, both values and the size of the difference.
    """
    right, found = read_fields(interface, recomputed), {}
    if len(logged) <= 2 * len(recomputed):  # one of megabytes would take gigabytes by name
        with suppress(ValueError):
            found = read_fields(interface, logged)
    if len(found) == len(right):
        for (name, value), other in zip(right.items(), found.values(), strict=True):
            if _bits(other) != _bits(value):
                return f'{name} = {_compared(other, value)}'
    return _in_bytes(logged, recomputed)


def unsigned_zeros(message: bytes) -> bytes:
    """A message without the signs of zeros, which version 0.1.0 logged.

    Args:
        message: CDR bytes, whose numbers lie on multiples of 8 bytes behind the first 4.

    Returns:
        The message with 0.0 for each -0.0.
    """
    end = 4 + (len(message) - 4) // 8 * 8
    numbers = np.frombuffer(message, '<u8', offset=4, count=(end - 4) // 8).copy()
    numbers[numbers == _NEGATIVE_ZERO] = 0
    return b''.join((message[:4], numbers.tobytes(), message[end:]))


def _bits(value: Value) -> object:
    # Of equal floats, -0.0 and 0.0 differ; of unequal ones, a NaN is itself.
    return struct.pack('<d', value) if isinstance(value, float) else value


def _compared(logged: Value, recomputed: Value) -> str:
    if isinstance(logged, str) or isinstance(recomputed, str):
        return _texts(str(logged), str(recomputed))
    size = f'{abs(logged - recomputed):.3g}'
    if isinstance(logged, float) and math.isfinite(logged):
        size += f', {abs(_rank(logged) - _rank(recomputed)):.6g} ulp'
    return f'{logged!r} logged, {recomputed!r} recomputed: off by {size}'


def _rank(value: float) -> int:
    """The number of a float, counted from 0.0."""
    (bits,) = struct.unpack('<q', struct.pack('<d', value))
    number: int = bits if bits >= 0 else -(bits + 2**63) - 1
    return number


def _texts(logged: str, recomputed: str) -> str:
    pairs = enumerate(zip(logged, recomputed, strict=False))
    shorter = min(len(logged), len(recomputed))
    at = next((place for place, (a, b) in pairs if a != b), shorter)
    part = slice(max(0, at - _CONTEXT), at + _CONTEXT)
    return f'{logged[part]!r} logged, {recomputed[part]!r} recomputed, at character {at}'


def _in_bytes(logged: bytes, recomputed: bytes) -> str:
    if len(logged) != len(recomputed):
        return f'{len(logged)} bytes logged, {len(recomputed)} recomputed'
    pairs = enumerate(zip(logged, recomputed, strict=True))
    at = next(place for place, (a, b) in pairs if a != b)
    return f'byte {at} = {logged[at]:#04x} logged, {recomputed[at]:#04x} recomputed'
