# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A configured mechanism at work: from a stamp to the bytes of its messages.

The node and the recorder step the same machine, which is why equal configurations and elapsed
times give equal bits in both.
"""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple

from linkage_ros.core.solver import Solver
from linkage_ros.core.state import State, loop_residual, point_motion
from linkage_ros.core.travel import travel
from linkage_ros.run.configuration import Configuration
from linkage_ros.run.joints import JointValues, joint_values
from linkage_ros.run.motion import CrankMotion, SpeedDrive
from linkage_ros.wire.messages import (
    COUPLER_POINT,
    DRIVING_TORQUE,
    JOINT_STATES,
    MECHANISM_STATE,
    JointStateCodec,
    PointCodec,
    Topic,
    TrajectoryCodec,
    encode_float64,
    encode_string,
)
from linkage_ros.wire.urdf import make_urdf

_NS = 10**9


class Step(NamedTuple):
    """One stamp's state and messages.

    Attributes:
        state: Of the mechanism.
        values: The joints.
        messages: CDR bytes, one message for each of `Machine.topics`.
    """

    state: State
    values: JointValues
    messages: tuple[bytes, ...]


class Machine:
    """Steps one configuration.

    Attributes:
        configuration: What it was made from.
        solver: Of its mechanism.
        joints: Names, in the order of the messages.
        topics: What each step has a message for.
        description: robot_description message, CDR bytes.
    """

    def __init__(self, configuration: Configuration) -> None:
        self.configuration = configuration
        self.solver = Solver(configuration.mechanism)
        self.joints = self.solver.links
        self.description = encode_string(make_urdf(configuration.mechanism))
        self._tree, points = self.solver.structure.joints, self.solver.structure.points
        self._coupler_point = points.get('C')
        self.topics: tuple[Topic, ...] = (JOINT_STATES, DRIVING_TORQUE, MECHANISM_STATE)
        if self._coupler_point:
            self.topics += (COUPLER_POINT,)
        self._states, self._trajectory = JointStateCodec(self.joints), TrajectoryCodec(self.joints)
        self._point = PointCodec()
        # What was typed in decimals is meant: ticks at 0.1 Hz are 10 s apart to the ns.
        self._rate = Fraction(repr(configuration.session.rate_hz)).as_integer_ratio()

    def summary(self) -> str:
        """What turns, in one line."""
        kind, drive, session = (
            self.configuration.kind, self.configuration.drive, self.configuration.session
        )  # fmt: skip
        return (
            f'{kind.mechanism}, {self.configuration.mechanism.assembly}, '
            f'{self.solver.mobility.grashof}, {", ".join(travel(self.solver).words())}, '
            f'{_speed(drive)} at {session.rate_hz:g} Hz'
        )

    def begin(self, stamp: int) -> CrankMotion:
        """The motion from a stamp, ns, on which t = 0 falls."""
        return CrankMotion.begin(self.configuration.drive, stamp)

    def elapsed(self, tick: int) -> int:
        """Time from the first tick to another, ns: whole, and never off by accumulation."""
        numerator, denominator = self._rate
        return tick * _NS * denominator // numerator

    def tick_at(self, elapsed: int) -> int:
        """The last tick at or before an elapsed time, ns."""
        numerator, denominator = self._rate
        tick = elapsed * numerator // (_NS * denominator)
        # `elapsed` rounds down, so that the next tick may already be due.
        return tick + 1 if self.elapsed(tick + 1) <= elapsed else tick

    def step(self, motion: CrankMotion, stamp: int) -> Step:
        """Solves the state that belongs to a stamp.

        Args:
            motion: The piece of motion that the stamp lies in.
            stamp: ns.

        Returns:
            The state and its messages.
        """
        crank = motion.at(stamp)
        state = self.solver.state(crank.angle, crank.speed, crank.acceleration)
        values = joint_values(self._tree, state, crank)
        position, velocity, _, effort = values
        messages: tuple[bytes, ...] = (
            self._states.encode(stamp, position, velocity, effort),
            encode_float64(effort[0]),
            self._trajectory.encode(stamp, *values),
        )
        if self._coupler_point:
            place = point_motion(self._coupler_point, state).position
            messages += (self._point.encode(stamp, *place),)
        return Step(state, values, messages)

    def residual(self, state: State) -> float:
        """How far the loop is from closed in a state, m."""
        return loop_residual(
            self.solver.structure, self.configuration.mechanism.coupler.length, state
        )


def _speed(drive: SpeedDrive) -> str:
    if drive.start_rpm is None or not drive.crank_acceleration:
        return f'{drive.rpm:g} rpm'
    return (
        f'from {drive.start_rpm:g} to {drive.rpm:g} rpm with {drive.crank_acceleration:g} rad/s^2'
    )
