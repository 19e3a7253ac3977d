# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Messages of a state as bytes: CDR, little endian, with zero padding.

A run publishes and logs the same bytes; replay publishes them again.
"""

import struct
from collections.abc import Collection, Iterable, Sequence
from itertools import chain

from linkage_ros.formulas import Vector
from linkage_ros.mechanism.kinematics import State
from linkage_ros.mechanism.program import Constants, Program
from linkage_ros.mechanism.structure import Link, Point, Structure
from linkage_ros.messages.cdr import ENCAPSULATION, STAMP, align, count, header, string
from linkage_ros.messages.fields import STAMP_FIELDS, Field, Part, Template
from linkage_ros.messages.joints import RobotJoint, joint_rows
from linkage_ros.messages.topics import (
    DRIVING_TORQUE,
    EFFORT_COMMANDS,
    JOINT_STATES,
    MECHANISM_STATE,
    Topic,
    point_topic,
)
from linkage_ros.numeric import Real
from linkage_ros.units import NS_PER_S

ROOT_FRAME = 'base_link'
QUANTITIES = ('position', 'velocity', 'acceleration', 'effort')

# A trajectory point that begins at a multiple of 8 bytes and ends at one: four sequences of one
# number each (length, padding to a multiple of 8, number), and a duration, s and ns.
_POINT = struct.Struct('<' + 4 * 'I4xd' + 'iI')
_LENGTH, _LENGTH_AND_PADDING = 4, 8  # bytes


def joint_numbers(names: Sequence[str]) -> list[str]:
    """Returns the names of the numbers in joint messages, such as 'velocity[coupler]'."""
    return [f'{quantity}[{name}]' for quantity in QUANTITIES for name in names]


def _named(names: Sequence[str], frame_id: str, stamp: int = 0) -> bytes:
    """Encodes a header and joint names, aligned to 4 bytes, without encapsulation."""
    body = count(header(frame_id, stamp), len(names))
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
    yield from (ENCAPSULATION, *STAMP_FIELDS)
    length, before_length = count(b'', len(names)), body[STAMP.size :]
    padding = -(len(body) + len(length)) % 8  # numbers are aligned to 8 bytes
    for quantity in quantities:
        yield before_length + length + bytes(padding)
        yield from (Field(f'{quantity}[{name}]', 'd') for name in names)
        before_length, padding = b'', 4  # the next length follows a number


def joint_state(names: Sequence[str], frame_id: str) -> list[Part]:
    """Returns the template of a JointState message."""
    quantities = (quantity for quantity in QUANTITIES if quantity != 'acceleration')
    return [*_sequences(_named(names, frame_id), names, quantities)]


def trajectory(names: Sequence[str], frame_id: str) -> list[Part]:
    """Returns the template of a JointTrajectory message with one point at time_from_start 0."""
    return [*_sequences(count(_named(names, frame_id), 1), names, QUANTITIES), bytes(8)]


def point_numbers(name: str) -> list[str]:
    """Returns the names of the numbers in the message of a traced point."""
    return [f'point.{axis}[{name}]' for axis in 'xy']


def point(name: str, frame_id: str) -> list[Part]:
    """Returns the template of a PointStamped message with z = 0, of a traced point."""
    rest_of_header = align(header(frame_id), 8)[STAMP.size :]
    fields = (Field(number, 'd') for number in point_numbers(name))
    return [ENCAPSULATION, *STAMP_FIELDS, rest_of_header, *fields, bytes(8)]


def float64(name: str) -> list[Part]:
    """Returns the template of a std_msgs/Float64 message."""
    return [ENCAPSULATION, Field(name, 'd')]


def float64_array(name: str) -> list[Part]:
    """Returns the template of a std_msgs/Float64MultiArray message with one number."""
    return [ENCAPSULATION + struct.pack('<III4x', 0, 0, 1), Field(name, 'd')]


# CDR bytes of an effort of 0 for a controller, which ends a torque.
ZERO_EFFORT = Template(float64_array('torque')).pack(0.0)


class StateTemplates:
    """Templates of the messages of a state, which follow each other without gaps.

    Attributes:
        topics: Topics of the messages, in order.
        parts: Template of each topic's message.
        slices: Place of each topic's message among those of a state.
        names: Names of the numbers in the messages.
        joint_states: Template of the messages on `joint_states` alone.
    """

    def __init__(
        self,
        structure: Structure,
        joints: Sequence[RobotJoint],
        frame_id: str,
        effort_topic: str = '',
    ) -> None:
        """Prepares the templates.

        Args:
            structure: Structure of the mechanism.
            joints: The joint of each link.
            frame_id: Frame of the messages.
            effort_topic: Topic of the feed-forward torque; empty without feed-forward.
        """
        names = [joint.name for joint in joints if joint.name]
        driven = joints[structure.driven]
        self.parts = {
            JOINT_STATES: joint_state(names, frame_id),
            DRIVING_TORQUE: float64(f'effort[{driven.name}]'),
            MECHANISM_STATE: trajectory(names, frame_id),
        }
        # A joint that is not published still has numbers, of which no message has a field.
        every = [joint.name or f'{i}, not published' for i, joint in enumerate(joints)]
        self.names = [field.name for field in STAMP_FIELDS] + joint_numbers(every)
        for name in structure.traced:
            self.parts[point_topic(name)] = point(name, frame_id)
            self.names += point_numbers(name)
        if effort_topic:
            topic = EFFORT_COMMANDS._replace(name=effort_topic)
            self.parts[topic] = float64_array('torque ahead')
            self.names.append('torque ahead')
        self.topics = tuple(self.parts)
        self.joint_states = Template(self.parts[JOINT_STATES])
        self._template = Template([*chain(*self.parts.values())], self.names)
        self.slices = dict[Topic, slice]()
        start = 0
        for topic, parts in self.parts.items():
            end = start + Template(parts).size
            self.slices[topic] = slice(start, end)
            start = end
        self._ratio = driven.ratio
        self._program = _program_of_numbers(structure, joints)

    def numbers(
        self, state: State, unwrapped: Real, ahead: State | None = None, *, stacked: bool = False
    ) -> tuple[Real, ...]:
        """Computes the numbers in the messages of a state, except its stamp.

        Args:
            state: State of the mechanism, with floats or, for many states, arrays.
            unwrapped: Position of the driven link; see `joint_rows`.
            ahead: State whose torque is the feed-forward torque; None without feed-forward.
            stacked: Whether the values are arrays.

        Returns:
            The numbers, without -0.0. Results for arrays and floats are bit-identical.
        """
        position, velocity, acceleration, torque, _, _ = state
        values = *position, *velocity, *acceleration, torque, unwrapped
        program = self._program if stacked else self._program.floats
        found: tuple[Real, ...] = program(*values)
        return found if ahead is None else (*found, ahead.torque / self._ratio + 0.0)

    def pack(self, stamp: int, numbers: Sequence[Real]) -> bytes:
        """Returns the CDR bytes of a state's messages, from its stamp, ns, and its numbers."""
        return self._template.pack(*divmod(stamp, NS_PER_S), *numbers)


def _program_of_numbers(structure: Structure, joints: Sequence[RobotJoint]) -> Program:
    """Returns the program of `_numbers`."""
    points = tuple(structure.points[name] for name in structure.traced)
    constants = Constants((structure.links, tuple(joints), structure.driven, points))
    position, velocity, acceleration = (
        tuple(f'{word}_{link.name}' for link in structure.links)
        for word in ('position', 'velocity', 'acceleration')
    )
    arguments = position, velocity, acceleration, 'torque', 'unwrapped'
    return Program(_numbers, constants, arguments, by_math=True)


def _numbers(
    constants: tuple[Sequence[Link], Sequence[RobotJoint], int, Sequence[Point]],
    position: tuple[Real, ...],
    velocity: tuple[Real, ...],
    acceleration: tuple[Real, ...],
    torque: Real,
    unwrapped: Real,
) -> tuple[Real, ...]:
    """Computes the numbers in a state's messages, without -0.0; compiled as a formula."""
    links, joints, driven, points = constants
    state = State(position, velocity, acceleration, torque)
    rows = joint_rows(links, state, unwrapped, joints, driven)
    directions = [Vector.at(angle) for angle in position]
    rows += [[*point.motion(directions, velocity, acceleration)[0]] for point in points]
    return tuple(number + 0.0 for row in rows for number in row)


def holding_trajectory(name: str, frame_id: str, position: float) -> bytes:
    """Encodes a JointTrajectory message that holds a position with an effort of 0, from now on.

    Args:
        name: Name of the joint.
        frame_id: Frame of the message.
        position: The position, rad or m.

    Returns:
        The CDR bytes of the message, whose stamp is 0: a point of the past would be refused.
    """
    return crank_trajectory(name, frame_id, [(0, (position, 0.0, 0.0, 0.0))])


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
    start, _ = next(iter(points))
    before_points = count(_named([name], frame_id, start), len(points))
    encoded = b''.join(_trajectory_point(time - start, values) for time, values in points)
    if len(before_points) % 8:
        # The first length, 4 bytes after a multiple of 8, needs no padding. All later offsets are
        # as in `_POINT`.
        encoded = encoded[:_LENGTH] + encoded[_LENGTH_AND_PADDING:]
    return ENCAPSULATION + before_points + encoded


def _trajectory_point(time_from_start: int, values: Sequence[float]) -> bytes:
    """Encodes a point of one joint, ns and values as in `crank_trajectory`, without -0.0."""
    position, velocity, acceleration, effort = values
    one = 1  # length of each sequence
    return _POINT.pack(
        one, position + 0.0, one, velocity + 0.0, one, acceleration + 0.0, one, effort + 0.0,
        *divmod(time_from_start, NS_PER_S),
    )  # fmt: skip
