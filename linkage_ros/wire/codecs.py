# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The messages of a state as templates: CDR, little endian, padding bytes zero.

The same bytes are published, logged and replayed.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Collection, Iterable, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from linkage_ros.dynamics.state import State
from linkage_ros.formulas import where
from linkage_ros.model.structure import Link
from linkage_ros.numeric import Array, Real, wrap
from linkage_ros.units import NS_PER_S
from linkage_ros.wire.cdr import ENCAPSULATION, STAMP, align, header, string
from linkage_ros.wire.template import Field, Part, Template

ROOT_FRAME = 'base_link'
STAMP_SOURCES = ('sec', 'nanosec')
QUANTITIES = ('position', 'velocity', 'acceleration', 'effort')

_SECONDS, _REST = (
    Field(f'header.stamp.{unit}', code, unit) for unit, code in (('sec', 'i'), ('nanosec', 'I'))
)


def joint_rows(
    links: Sequence[Link],
    state: State,
    unwrapped: Real,
    to_whole: Callable[[Real], Real] = round,
) -> list[list[Real]]:
    """Converts a state to the joints of the URDF's open tree, as in messages.

    Args:
        links: The tree; its first joint is the crank's.
        state: The state, of floats or of arrays.
        unwrapped: The whole angle of the crank, rad.
        to_whole: Rounds to the nearest whole number, such as `np.rint`.

    Returns:
        Positions, rad or m: the crank's unwrapped, other angles in (-pi, pi] from the link before;
        their rates and accelerations; efforts, the driving torque, N m, at the crank, 0 elsewhere.
    """
    position, *_ = rows = [list(row) for row in state[:3]]
    for i, link in reversed(list(enumerate(links))):  # those that hang on a link before it
        if link.parent is not None:
            for row in rows:
                row[i] = row[i] - row[link.parent]  # an array stays as it is
            position[i] = wrap(position[i], to_whole)
        if not link.slides:
            position[i] = where(position[i] <= -math.pi, math.pi, position[i])
    position[0] = unwrapped
    return [*rows, [state.torque, *(0.0 for _ in links[1:])]]


def joint_sources(names: Sequence[str], quantities: Iterable[str] = QUANTITIES) -> list[str]:
    """Names of the numbers in joint messages, such as 'velocity coupler'."""
    return [f'{quantity} {name}' for quantity in quantities for name in names]


def _joint_arrays(
    body: bytes, names: Sequence[str], arrays: Iterable[tuple[str, str]]
) -> Iterable[Part]:
    """The part of a message after its stamp: constant bytes, then a sequence per quantity.

    Args:
        body: Its bytes so far, without encapsulation, on a multiple of 4.
        names: The joints.
        arrays: Names of the sequences, and the quantities in them.

    Yields:
        Parts of a template.
    """
    start: list[Part] = [ENCAPSULATION, _SECONDS, _REST, body[STAMP.size :]]
    yield from start
    gap = -(len(body) + 4) % 8
    for array, quantity in arrays:
        yield struct.pack('<I', len(names)) + bytes(gap)
        yield from (Field(f'{array}[{name}]', 'd', f'{quantity} {name}') for name in names)
        gap = 4  # behind doubles and a length


def _names(field: bytes, names: Sequence[str]) -> bytes:
    body = align(field, 4) + struct.pack('<I', len(names))
    for name in names:
        body = align(string(body, name), 4)
    return body


def joint_state(names: Sequence[str], frame_id: str) -> list[Part]:
    """A JointState message of joints."""
    arrays = [(quantity, quantity) for quantity in QUANTITIES if quantity != 'acceleration']
    return list(_joint_arrays(_names(header(frame_id), names), names, arrays))


def trajectory(names: Sequence[str], frame_id: str) -> list[Part]:
    """A JointTrajectory message of joints and one point, whose time_from_start is 0."""
    words = ('positions', 'velocities', 'accelerations', 'effort')
    arrays = [(f'points[0].{word}', q) for word, q in zip(words, QUANTITIES, strict=True)]
    body = _names(header(frame_id), names) + struct.pack('<I', 1)
    return [*_joint_arrays(body, names, arrays), bytes(8)]


def point(frame_id: str) -> list[Part]:
    """A PointStamped message; its z is 0."""
    body = align(header(frame_id), 8)[STAMP.size :]
    fields = Field('point.x', 'd', 'x'), Field('point.y', 'd', 'y')
    return [ENCAPSULATION, _SECONDS, _REST, body, *fields, bytes(8)]


def float64(source: str) -> list[Part]:
    """A std_msgs/Float64 message."""
    return [ENCAPSULATION, Field('data', 'd', source)]


def float64_array(source: str) -> list[Part]:
    """A std_msgs/Float64MultiArray message of one number, without layout."""
    return [ENCAPSULATION + struct.pack('<III4x', 0, 0, 1), Field('data[0]', 'd', source)]


class JointStateCodec:
    """JointState messages of a fixed set of joints.

    Attributes:
        names: The joints.
    """

    quantities: Sequence[str] = ('position', 'velocity', 'effort')
    parts = staticmethod(joint_state)

    def __init__(self, names: Sequence[str], frame_id: str = ROOT_FRAME) -> None:
        self.names = tuple(names)
        sources = (*STAMP_SOURCES, *joint_sources(names, self.quantities))
        self._template = Template(self.parts(names, frame_id), sources)

    def encode(self, stamp: int, *rows: Sequence[float]) -> bytes:
        """Encodes one message.

        Args:
            stamp: ns.
            *rows: Positions, rad or m, velocities, efforts, N m or N; one number for each joint.
                Those of a trajectory have accelerations before the efforts.

        Returns:
            Its CDR bytes.
        """
        numbers = (number + 0.0 for row in rows for number in row)  # a zero there has no sign
        return self._template.pack(*divmod(stamp, NS_PER_S), *numbers)

    def decode(self, data: bytes) -> tuple[int, tuple[float, ...]]:
        """Stamp, ns, and numbers of one message: see `decode_all`."""
        (stamp,), (numbers,) = self.decode_all(data)
        return int(stamp), tuple(numbers.tolist())

    def decode_all(self, data: bytes) -> tuple[npt.NDArray[np.int64], Array]:
        """Reads messages of the same joints.

        Args:
            data: Their CDR bytes, one message after the other; at least one.

        Returns:
            Stamps, ns, and of each message all rows one after the other, shape (n, numbers).

        Raises:
            ValueError: The bytes are no such messages.
        """
        template = self._template
        if not data or len(data) % template.size or template.differs(data).any():
            raise ValueError(f'no message of the joints {", ".join(self.names)}')
        whole, rest, *numbers = (template.column(data, place) for place in template.places)
        return whole.astype(np.int64) * NS_PER_S + rest, np.stack(numbers, axis=1)


class TrajectoryCodec(JointStateCodec):
    """JointTrajectory messages of one point."""

    quantities = QUANTITIES
    parts = staticmethod(trajectory)


def encode_float64(value: float) -> bytes:
    """A std_msgs/Float64 message as CDR bytes."""
    return ENCAPSULATION + struct.pack('<d', value + 0.0)


def encode_string(text: str) -> bytes:
    """A std_msgs/String message as CDR bytes.

    It is padded to a multiple of 4 bytes, as DDS does, so that subscribers get the logged bytes.
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
        """Encodes one message, with the stamp of its first point.

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
