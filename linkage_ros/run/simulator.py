# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Simulates a configuration: from a stamp to the bytes of its messages.

The node and the recorder use the same simulator, which is why equal configurations and elapsed
times give equal bits in both.
"""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple

from linkage_ros.dynamics.solver import Solver
from linkage_ros.dynamics.state import State
from linkage_ros.errors import ConfigurationError
from linkage_ros.motion.coordinates import Coordinates
from linkage_ros.motion.drives import SpeedDrive, TorqueDrive
from linkage_ros.motion.fixed_step_integrator import FixedSteps, Integrate
from linkage_ros.motion.follow import ahead
from linkage_ros.motion.speed_driven import SpeedMotion
from linkage_ros.motion.torque_driven import Motion, TorqueMotion
from linkage_ros.parameters.configuration import Configuration
from linkage_ros.parameters.drives import FeedForward
from linkage_ros.units import NS_PER_S
from linkage_ros.wire.codecs import (
    JointStateCodec,
    PointCodec,
    TrajectoryCodec,
    TrajectoryPoint,
    encode_float64,
    encode_float64_array,
    encode_string,
    joint_rows,
)
from linkage_ros.wire.topics import (
    COUPLER_POINT,
    DRIVING_TORQUE,
    JOINT_STATES,
    MECHANISM_STATE,
    Topic,
    effort_commands,
)
from linkage_ros.wire.urdf import joint_names, make_urdf


class Snapshot(NamedTuple):
    """A run at one stamp.

    Attributes:
        coordinates: Coordinates of the mechanism.
        state: Its state there.
        messages: CDR bytes, one message for each of `Simulator.topics`.
    """

    coordinates: Coordinates
    state: State
    messages: tuple[bytes, ...]


class Simulator:
    """Makes the states and messages of one configuration.

    Attributes:
        configuration: What it was made from.
        solver: Solver of its mechanism.
        joints: Names, in the order of the messages.
        joint_states: Codec of the messages on that topic.
        mechanism_state: Likewise.
        topics: What each state has a message on.
        description: robot_description message, CDR bytes.
    """

    def __init__(self, configuration: Configuration) -> None:
        self.configuration = configuration
        mechanism = configuration.mechanism
        self.solver = Solver(mechanism)
        session = configuration.session
        prefix, frame_id = session.joint_prefix, session.frame_id
        self._links = self.solver.structure.links
        self.joints = joint_names(self._links, prefix)
        self.joint_states = JointStateCodec(self.joints, frame_id)
        self.mechanism_state = TrajectoryCodec(self.joints, frame_id)
        self.description = encode_string(make_urdf(mechanism, prefix, frame_id))
        self._has_coupler_point = 'C' in self.solver.structure.points
        self.topics: tuple[Topic, ...] = (JOINT_STATES, DRIVING_TORQUE, MECHANISM_STATE)
        if self._has_coupler_point:
            self.topics += (COUPLER_POINT,)
        self._point = PointCodec(frame_id)
        self._lead: int | None = None  # ns
        drive = configuration.drive
        if isinstance(drive, FeedForward) and drive.effort_command_topic:
            self.topics += (effort_commands(drive.effort_command_topic),)
            self._lead = round(drive.lead_time * NS_PER_S)
        # What was typed in decimals is meant: ticks at 0.1 Hz are 10 s apart to the ns.
        self._rate = Fraction(repr(session.rate_hz)).as_integer_ratio()

    def begin(self, stamp: int, integrate: Integrate = FixedSteps) -> Motion:
        """The motion from a stamp on which t = 0 falls.

        Args:
            stamp: ns.
            integrate: Makes the integrator of a motion under a torque.

        Returns:
            The motion.

        Raises:
            ConfigurationError: The crank is measured: nothing here moves it.
        """
        drive = self.configuration.drive
        if isinstance(drive, TorqueDrive):
            return TorqueMotion(self.solver, drive, stamp, self.elapsed(1), integrate)
        if isinstance(drive, SpeedDrive):
            return SpeedMotion.begin(drive, stamp)
        raise ConfigurationError(
            'drive: follow needs a crank that is measured: run linkage_node, or give drive: speed'
        )

    def elapsed(self, tick: int) -> int:
        """Time from the first tick to another, ns: whole, and never off by accumulation."""
        numerator, denominator = self._rate
        return tick * NS_PER_S * denominator // numerator

    def tick_at(self, elapsed: int) -> int:
        """The last tick at or before an elapsed time, ns."""
        numerator, denominator = self._rate
        tick = elapsed * numerator // (NS_PER_S * denominator)
        # `elapsed` rounds down, so that the next tick may already be due.
        return tick + 1 if self.elapsed(tick + 1) <= elapsed else tick

    def snapshot_at(self, motion: Motion, stamp: int) -> Snapshot:
        """Solves the state at a stamp.

        Args:
            motion: Motion in the segment that contains the stamp.
            stamp: ns.

        Returns:
            The state and its messages.
        """
        snapshot = self.snapshot_of(stamp, motion.at(stamp))
        if self._lead is None:
            return snapshot
        return self._with_command(snapshot, motion.at(stamp + self._lead))

    def snapshot_measured(self, stamp: int, coordinates: Coordinates) -> Snapshot:
        """Solves the state of a measured crank.

        Args:
            stamp: ns.
            coordinates: As measured and filtered.

        Returns:
            The state and its messages.
        """
        snapshot = self.snapshot_of(stamp, coordinates)
        if self._lead is None:
            return snapshot
        return self._with_command(snapshot, ahead(coordinates, self._lead / NS_PER_S))

    def _with_command(self, snapshot: Snapshot, later: Coordinates) -> Snapshot:
        command = encode_float64_array(self._solve(later).torque)
        return snapshot._replace(messages=(*snapshot.messages, command))

    def snapshot_of(self, stamp: int, coordinates: Coordinates) -> Snapshot:
        """Solves the state at coordinates.

        Args:
            stamp: ns.
            coordinates: Coordinates at that stamp.

        Returns:
            The state and its messages.
        """
        state = self._solve(coordinates)
        rows = joint_rows(self._links, state, coordinates.unwrapped)
        position, velocity, _, effort = rows
        messages: tuple[bytes, ...] = (
            self.joint_states.encode(stamp, position, velocity, effort),
            encode_float64(state.torque),
            self.mechanism_state.encode(stamp, *rows),
        )
        if self._has_coupler_point:
            place = self.solver.point(state, 'C').position
            messages += (self._point.encode(stamp, *place),)
        return Snapshot(coordinates, state, messages)

    def crank_at(self, motion: Motion, stamp: int) -> TrajectoryPoint:
        """The crank at a stamp, as a point of a trajectory.

        Args:
            motion: Motion in the segment that contains the stamp.
            stamp: ns.

        Returns:
            Its motion and torque.
        """
        coordinates = motion.at(stamp)
        torque = self._solve(coordinates).torque
        return TrajectoryPoint(
            coordinates.unwrapped, coordinates.u[0], coordinates.a[0], float(torque)
        )

    def _solve(self, coordinates: Coordinates) -> State:
        q, u, a, _ = coordinates
        return self.solver.state(q, u, a) if len(q) > 1 else self.solver.state(q[0], u[0], a[0])
