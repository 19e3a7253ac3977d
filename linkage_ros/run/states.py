# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Simulates a configured mechanism: computes states and encoded messages at given stamps.

The node and the recorder share this code, so equal configurations and elapsed times give
bit-identical messages.
"""

import itertools
from collections.abc import Iterable, Sequence
from contextlib import suppress
from fractions import Fraction
from typing import NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

from linkage_ros.errors import ConfigurationError, LinkageError
from linkage_ros.formulas import Vector
from linkage_ros.mechanism.kinematics import State
from linkage_ros.mechanism.program import Constants, Program
from linkage_ros.mechanism.ranges import Ranges
from linkage_ros.mechanism.solver import Solver
from linkage_ros.mechanism.structure import Link, Point
from linkage_ros.messages.cdr import encode_string
from linkage_ros.messages.joints import RobotJoint, joint_rows, link_rows, own_joints
from linkage_ros.messages.rows import STAMP_FIELDS, TIME_FIELDS, RowLayout, Template
from linkage_ros.messages.templates import (
    POINT_FIELDS,
    float64,
    float64_array,
    joint_numbers,
    joint_state,
    point,
    trajectory,
)
from linkage_ros.messages.topics import (
    COUPLER_POINT,
    DRIVING_TORQUE,
    EFFORT_COMMANDS,
    JOINT_STATES,
    MECHANISM_STATE,
    Topic,
)
from linkage_ros.messages.urdf import make_urdf
from linkage_ros.motion.along_law import LawMotion
from linkage_ros.motion.at_speed import SpeedMotion
from linkage_ros.motion.drives import LawDrive, SpeedDrive, TorqueDrive
from linkage_ros.motion.measured import ahead as later
from linkage_ros.motion.segments import Coordinates
from linkage_ros.motion.steps import Integrate, live_steps
from linkage_ros.motion.under_torque import Motion, TorqueMotion
from linkage_ros.numeric import Array, Real
from linkage_ros.settings.configuration import Configuration
from linkage_ros.settings.session import FeedForward
from linkage_ros.units import NS_PER_S

# Integers of any size; arrays of them have dtype object.
Whole = TypeVar('Whole', int, npt.NDArray[np.object_])


class Snapshot(NamedTuple):
    """A state of a run and its messages.

    Attributes:
        state: State of the mechanism.
        stamp: Stamp of the state, ns.
        numbers: Numbers in the messages, except stamps.
        layout: Layout of the messages.
    """

    state: State
    stamp: int
    numbers: Sequence[float]
    layout: RowLayout

    def row(self, time: int) -> bytes:
        """Returns the MCAP records of the messages, with a log and publish time, ns."""
        return self.layout.pack(time, time, *divmod(self.stamp, NS_PER_S), *self.numbers)

    @property
    def messages(self) -> tuple[bytes, ...]:
        """The CDR bytes of the messages, one for each of `Simulator.topics`."""
        row = self.row(0)
        return tuple(row[body] for body in self.layout.bodies)


class Simulator:
    """Computes the states and messages of a configuration.

    Attributes:
        configuration: Configuration of the run.
        solver: Solver of the mechanism.
        robot_joints: The joint of each link in messages.
        joints: Names of the published joints, in the order of the messages.
        ranges: Load curves that the states so far have left.
        crank_joint: Name of the crank in measurements, commands and trajectories.
        joint_states: Template of the messages on `joint_states`.
        topics: Topics on which a message is published for each state.
        layout: Layout of a state's messages, with channels numbered from 1.
        description: CDR bytes of the robot_description message; None if it is not published.
    """

    def __init__(self, configuration: Configuration) -> None:
        self.configuration = configuration
        mechanism, session = configuration.mechanism, configuration.session
        self.solver = Solver(mechanism)
        self.ranges = Ranges(self.solver)
        prefix, frame_id = session.joint_prefix, session.frame_id
        self._links = self.solver.structure.links
        self.robot_joints = joints = configuration.robot_joints
        self.joints = tuple(joint.name for joint in joints if joint.name)
        self.crank_joint = session.crank_joint or self.joints[0]
        self.description: bytes | None = None
        if session.publish_description or (
            session.publish_description is None and not configuration.joints
        ):
            self.description = encode_string(make_urdf(mechanism, prefix, frame_id))
        fields = [field.name for field in (*TIME_FIELDS, *STAMP_FIELDS)]
        # A joint that is not published still has numbers, of which no message has a field.
        every = [joint.name or f'{i}, not published' for i, joint in enumerate(joints)]
        self._names = [*fields, *joint_numbers(every)]
        self._parts = {
            JOINT_STATES: joint_state(self.joints, frame_id),
            DRIVING_TORQUE: float64(f'effort[{self.joints[0]}]'),
            MECHANISM_STATE: trajectory(self.joints, frame_id),
        }
        self.joint_states = Template(self._parts[JOINT_STATES])
        shown = [point for name, point in self.solver.structure.points.items() if name == 'C']
        if shown:
            self._parts[COUPLER_POINT] = point(frame_id)
            self._names += [field.name for field in POINT_FIELDS]
        self._lead: int | None = None  # ns
        drive = configuration.drive
        if isinstance(drive, FeedForward) and drive.effort_command_topic:
            topic = EFFORT_COMMANDS._replace(name=drive.effort_command_topic)
            self._parts[topic] = float64_array('torque ahead')
            self._names.append('torque ahead')
            self._lead = round(drive.lead_time * NS_PER_S)
        letters = 'position', 'velocity', 'acceleration'
        rows = (tuple(f'{word}_{name}' for name in self.solver.links) for word in letters)
        constants = Constants((self._links, joints, tuple(shown)))
        self._numbers = Program(_numbers, constants, (*rows, 'torque', 'unwrapped'))
        self.topics = tuple(self._parts)
        self.layout = self.layout_of(zip(itertools.count(1), self.topics))
        # Use the decimal value, so that ticks at 0.1 Hz are exactly 10 s apart.
        self._rate = Fraction(repr(session.rate_hz)).as_integer_ratio()

    @property
    def guesses_zero(self) -> bool:
        """Whether the crank has the name of a robot's joint, but its zero is not given."""
        prefix, given = self.configuration.session.joint_prefix, self.configuration.joints
        is_own = self.crank_joint == own_joints(self._links, prefix)[0].name
        return not is_own and ('crank' not in given or given['crank'].zero is None)

    def begin(self, stamp: int, integrate: Integrate = live_steps) -> Motion:
        """Starts a motion.

        Args:
            stamp: Stamp of t = 0, ns.
            integrate: Function that creates the integrator of a motion under a torque.

        Returns:
            The motion in its first segment.

        Raises:
            ConfigurationError: The crank is measured, not simulated.
        """
        drive = self.configuration.drive
        if isinstance(drive, TorqueDrive):
            return TorqueMotion(self.solver, drive, stamp, self.elapsed(1), integrate)
        if isinstance(drive, SpeedDrive):
            return SpeedMotion.begin(drive, stamp)
        if isinstance(drive, LawDrive):
            return LawMotion.begin(drive, stamp)
        raise ConfigurationError(
            'drive: follow needs a crank that is measured: run linkage_node, or give '
            'linkage_record --measured BAG'
        )

    def prepare_live(self) -> None:
        """Compiles the programs, and rejects a motion that is too fast for a live run.

        Raises:
            ConfigurationError: As for `TorqueMotion.require_live`, or commands would expire within
                a tick.
        """
        drive = self.configuration.drive
        if isinstance(drive, TorqueDrive):
            tick = self.elapsed(1)
            if round(drive.command_timeout * NS_PER_S) < tick:
                raise ConfigurationError(
                    f'command_timeout = {drive.command_timeout} s: must be at least a tick, '
                    f'{tick / NS_PER_S} s, because a command acts for whole ticks; raise '
                    'command_timeout or rate_hz'
                )
            motion = TorqueMotion(self.solver, drive, 0, tick)
            motion.require_live()
            with suppress(LinkageError):  # the run will report this error
                self.snapshot_at(motion, NS_PER_S)
                motion.rehearse()

    def elapsed(self, tick: Whole) -> Whole:
        """Returns the time from tick 0 to a tick, ns, without accumulated error."""
        numerator, denominator = self._rate
        elapsed: Whole = tick * NS_PER_S * denominator // numerator
        return elapsed

    def tick_at(self, elapsed: Whole) -> Whole:
        """Returns the last tick at or before an elapsed time, ns."""
        numerator, denominator = self._rate
        tick: Whole = elapsed * numerator // (NS_PER_S * denominator)
        # Because `elapsed` rounds down, the next tick may already be due.
        tick += self.elapsed(tick + 1) <= elapsed
        return tick

    def layout_of(self, channels: Iterable[tuple[int, Topic]]) -> RowLayout:
        """Returns the layout of a state's messages in a log.

        Args:
            channels: Channel numbers with their topics, in the order of the log.

        Returns:
            The layout of a row, which consists of one message per channel.
        """
        messages = [(number, self._parts[topic]) for number, topic in channels]
        return RowLayout(messages, self._names)

    def snapshot_at(self, motion: Motion, stamp: int) -> Snapshot:
        """Computes the state at a stamp.

        Args:
            motion: Motion in the segment that contains the stamp.
            stamp: Stamp of the state, ns.

        Returns:
            The state and its messages.
        """
        ahead = None if self._lead is None else motion.at(stamp + self._lead)
        return self.snapshot(stamp, motion.at(stamp), ahead)

    def later(self, coordinates: Coordinates) -> Coordinates | None:
        """Extrapolates a measured motion by `lead_time`; returns None without feed-forward."""
        return None if self._lead is None else later(coordinates, self._lead / NS_PER_S)

    def snapshot(
        self, stamp: int, coordinates: Coordinates, ahead: Coordinates | None
    ) -> Snapshot:
        """Computes the state at given coordinates.

        Args:
            stamp: Stamp of the state, ns.
            coordinates: Coordinates at the stamp.
            ahead: Coordinates for the feed-forward torque; None without feed-forward.

        Returns:
            The state and its messages.
        """
        state, numbers = self._solved(coordinates, ahead)
        return Snapshot(state, stamp, numbers, self.layout)

    def rows(
        self,
        stamps: Sequence[int],
        coordinates: Coordinates,
        ahead: Coordinates | None = None,
        *,
        times: npt.NDArray[np.uint64] | None = None,
        layout: RowLayout | None = None,
    ) -> bytearray:
        """Computes the messages of many states.

        Args:
            stamps: Stamps of the states, ns.
            coordinates: Coordinates at the stamps, as arrays.
            ahead: Coordinates for the feed-forward torque; None without feed-forward.
            times: Log times, ns; by default, the stamps.
            layout: Layout of the rows; by default, that of the simulator.

        Returns:
            MCAP records of the messages, bit-identical to those of snapshots.
        """
        _, numbers = self._solved(coordinates, ahead, by_math=True)
        nanoseconds = np.array(stamps)
        stamped = np.divmod(nanoseconds, NS_PER_S)
        logged = nanoseconds if times is None else times
        return (layout or self.layout).fill(len(stamps), (logged, logged, *stamped, *numbers))

    def links_of(self, numbers: Array) -> tuple[Array, Array, Array]:
        """Converts the numbers in messages on joint_states to the motion of the links.

        Args:
            numbers: Positions, velocities and efforts of the published joints, shape (n, numbers).

        Returns:
            Positions, rad and m, and rates of the links, shape (n, links), and the driving torque,
            N m, shape (n, 1).
        """
        joints, count = self.robot_joints, len(self.joints)
        torque = numbers[:, 2 * count :][:, :1] * joints[0].ratio
        table = np.reshape(numbers[:, : 2 * count].T, (2, count, -1))
        if count < len(joints):  # the others follow from the crank
            crank, rate = joints[0].own(table[0, 0]), table[1, 0] / joints[0].ratio
            state = self.solver.state(crank, rate, 0.0 * rate)
            table = np.array([(crank, *state.position[1:]), state.velocity])
        else:
            table = link_rows(joints, table)
        return table[0].T, table[1].T, torque

    def ahead(self, motion: Motion, stamps: Sequence[int]) -> Coordinates | None:
        """Returns the coordinates `lead_time` after the stamps; None without feed-forward."""
        lead = self._lead
        return None if lead is None else motion.at_all([stamp + lead for stamp in stamps])

    def _solved(
        self, coordinates: Coordinates, ahead: Coordinates | None, *, by_math: bool = False
    ) -> tuple[State, Sequence[Real]]:
        """Returns the state at the given coordinates and the numbers in its messages."""
        state = self._state(coordinates, by_math=by_math)
        (*rows, torque), program = state, self._numbers
        values = *itertools.chain(*rows), torque, coordinates.unwrapped
        numbers = program(*values, by_math=True) if by_math else program.floats(*values)
        if ahead is not None:
            torque = self._state(ahead, by_math=by_math).torque / self.robot_joints[0].ratio
            numbers = *numbers, torque + 0.0
        return state, numbers

    def _state(self, coordinates: Coordinates, *, by_math: bool) -> State:
        q, u, a, _, state = coordinates
        if state is not None:
            self.ranges.see(state)
            return state
        row = (q[0], u[0], a[0]) if len(q) == 1 else (q, u, a)
        state = self.solver.state(*row, by_math=by_math)
        self.ranges.see(state)
        return state


def _numbers(
    constants: tuple[Sequence[Link], Sequence[RobotJoint], Sequence[Point]],
    position: tuple[Real, ...],
    velocity: tuple[Real, ...],
    acceleration: tuple[Real, ...],
    torque: Real,
    unwrapped: Real,
) -> tuple[Real, ...]:
    """Computes the numbers in a state's messages, without -0.0; compiled as a formula."""
    links, joints, points = constants
    state = State(position, velocity, acceleration, torque)
    rows = joint_rows(links, state, unwrapped, joints)
    directions = [Vector.at(angle) for angle in position]
    rows += [[*point.follow(directions, velocity, acceleration)[0]] for point in points]
    return tuple(number + 0.0 for row in rows for number in row)
