# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Messages of a state as bytes: CDR, little endian, with zero padding.

A run publishes and logs the same bytes; replay publishes them again.
"""

import functools
import struct
from collections.abc import Collection, Iterable, Mapping, Sequence
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
    prefix_of,
    topic_of_linkage,
)
from linkage_ros.numeric import Real
from linkage_ros.units import NS_PER_S

ROOT_FRAME = 'base_link'
QUANTITIES = ('position', 'velocity', 'acceleration', 'effort')

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


def float64_array(names: Sequence[str]) -> list[Part]:
    """Returns the template of a std_msgs/Float64MultiArray message with one number per name."""
    head = ENCAPSULATION + struct.pack('<III4x', 0, 0, len(names))
    return [head, *(Field(name, 'd') for name in names)]


def encode_efforts(efforts: Sequence[float]) -> bytes:
    """Encodes efforts for a controller; an effort of 0 ends a torque."""
    return Template(float64_array([str(i) for i in range(len(efforts))])).pack(*efforts)


class LinkageNumbers:
    """The numbers of a linkage in the messages of a state.

    Attributes:
        linkage: Name of the linkage; empty for the only one.
        names: Names of the numbers.
        joints: Names of the published joints.
        driven: The driven joint.
        points: Names of the traced points.
        frame_id: Frame of the points.
    """

    def __init__(
        self, structure: Structure, joints: Sequence[RobotJoint], frame_id: str, linkage: str = ''
    ) -> None:
        """Prepares the program of the numbers, given the joint of each link."""
        self.linkage, self.frame_id = linkage, frame_id
        self.joints = [joint.name for joint in joints if joint.name]
        self.driven, self.points = joints[structure.driven], [*structure.traced]
        # A joint that is not published still has numbers, of which no message has a field.
        prefix = prefix_of(linkage)
        every = [x.name or f'{prefix}{i}, not published' for i, x in enumerate(joints)]
        points = (number for name in self.points for number in point_numbers(f'{prefix}{name}'))
        self.names = [*joint_numbers(every), *points]
        self._program = _program_of_numbers(structure, joints)

    def topics(self) -> dict[Topic, list[Part]]:
        """Returns the templates of the linkage's own messages, by topic; torque first."""
        found = {DRIVING_TORQUE: float64(f'effort[{self.driven.name}]')}
        for name in self.points:
            found[point_topic(name)] = point(f'{prefix_of(self.linkage)}{name}', self.frame_id)
        return {topic_of_linkage(topic, self.linkage): parts for topic, parts in found.items()}

    def of(self, state: State, unwrapped: Real, *, stacked: bool = False) -> tuple[Real, ...]:
        """Computes the numbers in the messages of a state.

        Args:
            state: State of the mechanism, with floats or, for many states, arrays.
            unwrapped: Position of the driven link; see `joint_rows`.
            stacked: Whether the values are arrays.

        Returns:
            The numbers, without -0.0. Results for arrays and floats are bit-identical.
        """
        position, velocity, acceleration, torque, _, _ = state
        values = *position, *velocity, *acceleration, torque, unwrapped
        program = self._program if stacked else self._program.floats
        numbers: tuple[Real, ...] = program(*values)
        return numbers

    def effort(self, state: State) -> Real:
        """Returns the effort of the driven joint in a state, without -0.0."""
        return state.torque / self.driven.ratio + 0.0


class StateTemplates:
    """Templates of the messages of a state, which follow each other without gaps.

    Attributes:
        topics: Topics of the messages, in order.
        parts: Template of each topic's message.
        slices: Place of each topic's message among those of a state.
        names: Names of the numbers in the messages: the stamp, the numbers of each linkage that
            the state holds, and, with feed-forward, an effort of each linkage of the run.
        joint_states: Template of the messages on `joint_states` alone.
    """

    def __init__(
        self,
        linkages: Sequence[LinkageNumbers],
        frame_id: str,
        effort_topic: str = '',
        every: Sequence[str] = ('',),
    ) -> None:
        """Prepares the templates of states that hold some linkages of a run.

        On the topic of feed-forward torques, if any, `every` linkage has an effort, in order.
        """
        joints = [joint for linkage in linkages for joint in linkage.joints]
        self.parts = {JOINT_STATES: joint_state(joints, frame_id)}
        points = dict[Topic, list[Part]]()
        for linkage in linkages:
            (torque, torque_parts), *others = linkage.topics().items()
            self.parts[torque] = torque_parts
            points.update(others)
        self.parts[MECHANISM_STATE] = trajectory(joints, frame_id)
        self.parts |= points
        self.names = [field.name for field in STAMP_FIELDS]
        self.names += [name for linkage in linkages for name in linkage.names]
        if effort_topic:
            ahead = [f'torque ahead{f" of {x}" * bool(x)}' for x in every]
            self.parts[EFFORT_COMMANDS._replace(name=effort_topic)] = float64_array(ahead)
            self.names += ahead
        self.topics = tuple(self.parts)
        self.joint_states = Template(self.parts[JOINT_STATES])
        self._template = Template([*chain(*self.parts.values())], self.names)
        self.slices = dict[Topic, slice]()
        start = 0
        for topic, parts in self.parts.items():
            end = start + Template(parts).size
            self.slices[topic] = slice(start, end)
            start = end

    def pack(self, stamp: int, numbers: Sequence[Real]) -> bytes:
        """Returns the CDR bytes of a state's messages, from its stamp, ns, and its numbers."""
        return self._template.pack(*divmod(stamp, NS_PER_S), *numbers)


class RunTemplates:
    """Templates of the states of a run, which hold all of its linkages or some of them.

    Attributes:
        names: Names of all linkages.
        topics: Topics of the states.
        owned: The topics that each linkage alone has, by its name.
    """

    def __init__(
        self, linkages: Sequence[LinkageNumbers], frame_id: str, effort_topic: str = ''
    ) -> None:
        """Initializes the templates; see `StateTemplates`."""
        self._linkages = {linkage.linkage: linkage for linkage in linkages}
        self.names, self._others = tuple(self._linkages), (frame_id, effort_topic)
        self._made = dict[tuple[str, ...], StateTemplates]()
        self.topics = self.of(self.names).topics
        self.owned = {name: tuple(x.topics()) for name, x in self._linkages.items()}

    def of(self, names: tuple[str, ...]) -> StateTemplates:
        """Returns the templates of states that hold some linkages, in the order of `names`."""
        if names not in self._made:
            linkages = [self._linkages[name] for name in names]
            self._made[names] = StateTemplates(linkages, *self._others, self.names)
        return self._made[names]


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


def holding_trajectory(positions: Mapping[str, float], frame_id: str) -> bytes:
    """Encodes a JointTrajectory message that holds positions with efforts of 0, from now on.

    The positions are given by joint, rad or m. The stamp is 0: a point of the past would be
    refused.
    """
    zeros = [0.0] * len(positions)
    return crank_trajectory([*positions], frame_id, [(0, ([*positions.values()], *[zeros] * 3))])


def crank_trajectory(
    names: Sequence[str],
    frame_id: str,
    points: Collection[tuple[int, Sequence[Sequence[float]]]],
) -> bytes:
    """Encodes a JointTrajectory message of the driven joints and many points.

    Args:
        names: Names of the joints.
        frame_id: Frame of the message.
        points: Stamp of each point, ns, in increasing order, and its four rows, which have a
            number for each joint: positions, rad, velocities, rad/s, accelerations, rad/s^2, and
            efforts, N m.

    Returns:
        The CDR bytes of the message, whose stamp is that of the first point.
    """
    start, _ = next(iter(points))
    before_points = count(_named(names, frame_id, start), len(points))
    encoded = b''.join(_trajectory_point(time - start, *rows) for time, rows in points)
    if len(before_points) % 8:
        # The first length, 4 bytes after a multiple of 8, needs no padding. All later offsets are
        # as in `_point_of`.
        encoded = encoded[:_LENGTH] + encoded[_LENGTH_AND_PADDING:]
    return ENCAPSULATION + before_points + encoded


@functools.cache
def _point_of(joints: int) -> struct.Struct:
    """Returns the layout of a trajectory point that begins at a multiple of 8 bytes.

    It has four sequences (length, padding to a multiple of 8, numbers), and a duration, s and ns,
    and ends at a multiple of 8.
    """
    return struct.Struct('<' + 4 * f'I4x{joints}d' + 'iI')


def _trajectory_point(
    time_from_start: int, positions: Sequence[float], *others: Sequence[float]
) -> bytes:
    """Encodes a point, ns and rows as in `crank_trajectory`, without -0.0."""
    numbers, length = list[float](), len(positions)
    for row in (positions, *others):
        numbers.append(length)
        numbers += [number + 0.0 for number in row]
    return _point_of(length).pack(*numbers, *divmod(time_from_start, NS_PER_S))
