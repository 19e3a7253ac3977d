# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""diagnostic_msgs/DiagnosticArray as CDR bytes."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import NamedTuple

from linkage_ros.wire.cdr import ENCAPSULATION, align, header, string

OK, WARN, ERROR = 0, 1, 2


class Status(NamedTuple):
    """The health of one part, as in a DiagnosticStatus.

    Attributes:
        level: OK, WARN or ERROR.
        name: Name of the part.
        message: Short description.
        values: Figures as text, by name.
    """

    level: int
    name: str
    message: str
    values: dict[str, str]


def encode_diagnostics(stamp: int, hardware: str, statuses: Sequence[Status]) -> bytes:
    """A diagnostic_msgs/DiagnosticArray message as CDR bytes.

    Args:
        stamp: ns.
        hardware: The hardware_id of every status.
        statuses: One for each part.

    Returns:
        The bytes, padded to a multiple of 4 as in `encode_string`.
    """
    body = align(header('', stamp), 4) + struct.pack('<I', len(statuses))
    for level, name, message, values in statuses:
        body += struct.pack('<B', level)
        for text in (name, message, hardware):
            body = string(align(body, 4), text)
        body = align(body, 4) + struct.pack('<I', len(values))
        for text in (text for pair in values.items() for text in pair):
            body = string(align(body, 4), text)
    return align(ENCAPSULATION + body, 4)
