# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""States of a configured linkage.

The node, the recorder and the verification share this code, so equal configurations and elapsed
times give bit-identical states.
"""

from collections.abc import Callable, Collection, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from linkage_ros.errors import LinkageError
from linkage_ros.mechanism.conditions import OWN_CONDITIONS, Conditions
from linkage_ros.mechanism.kinematics import State
from linkage_ros.mechanism.loads.force import Force
from linkage_ros.mechanism.solver import Solver
from linkage_ros.messages.cdr import encode_string
from linkage_ros.messages.templates import LinkageNumbers
from linkage_ros.messages.topics import Topic
from linkage_ros.messages.urdf import make_urdf
from linkage_ros.motion.drives.base import Machine
from linkage_ros.motion.inputs import Input
from linkage_ros.motion.live_force import LiveForce
from linkage_ros.motion.segments import Coordinates, Motion
from linkage_ros.motion.steps import Integrate, live_steps
from linkage_ros.run.ticks import TickRate
from linkage_ros.settings.configuration import Linkage
from linkage_ros.units import NS_PER_S


class RowPart(NamedTuple):
    """The numbers of one linkage in the messages of a state, or of many as arrays.

    Attributes:
        numbers: Numbers of the linkage; see `LinkageNumbers`.
        effort: Effort of the driven joint for a controller; None without feed-forward.
    """

    numbers: Sequence[Any]
    effort: Any = None

    def at(self, rows: Any) -> 'RowPart':
        """Returns one of many states, given its index, or some, given a slice."""
        numbers = [column[rows] if np.ndim(column) else column for column in self.numbers]
        effort = self.effort[rows] if np.ndim(self.effort) else self.effort
        return RowPart(numbers, effort)


class Simulator:
    """Computes the states of a linkage.

    Attributes:
        linkage: Configuration of the linkage.
        name: Name of the linkage; empty for the only one.
        solver: Solver of the mechanism.
        robot_joints: The joint of each link in messages.
        joints: Names of the published joints, in the order of the messages.
        driven: Index of the driven link.
        crank_joint: Name of the driven joint in measurements, commands and trajectories.
        numbers: Converts a state to the numbers in its messages.
        ticks: Times of the ticks.
        conditions: Conditions before the first message: they hold the force of each load whose
            force is set by messages.
        machine: The mechanism with its crank's joint, for the drive.
        lead: Time by which the feed-forward torque is ahead of the stamp, ns; None without
            feed-forward.
        description: CDR bytes of the robot_description message; None if it is not published.
    """

    def __init__(self, linkage: Linkage, others: Collection[str] = ()) -> None:
        """Prepares the computation; `others` names the driven joints of other linkages."""
        self.linkage, self.name = linkage, linkage.name
        mechanism, session, drive = linkage.mechanism, linkage.session, linkage.drive
        self.solver = Solver(mechanism, by_math=True, pivot=drive.pivot)
        prefix, frame_id = session.joint_prefix, session.frame_id
        self.robot_joints = joints = linkage.robot_joints
        self.joints = tuple(joint.name for joint in joints if joint.name)
        self.driven = self.solver.structure.driven
        self.crank_joint = linkage.crank_joint
        self.description: bytes | None = None
        if session.publish_description or (
            session.publish_description is None and not linkage.joints
        ):
            self.description = encode_string(make_urdf(mechanism, prefix, frame_id))
        has_efforts = bool(drive.effort_command_topic)
        self.lead = round(drive.lead_time * NS_PER_S) if has_efforts else None
        self.numbers = LinkageNumbers(self.solver.structure, joints, frame_id, self.name)
        self.ticks = TickRate(session.rate_hz)
        forces = {force.name: force.held.value for force in self.live_forces().values()}
        self.conditions = Conditions(forces=forces) if forces else OWN_CONDITIONS
        self.machine = Machine(
            self.solver, self.ticks.elapsed(1), self.crank_joint, joints[self.driven], self.lead,
            conditions=self.conditions, others=frozenset(others),
        )  # fmt: skip

    def begin(self, stamp: int, integrate: Integrate = live_steps) -> Motion:
        """Returns the motion in its first segment; see `Drive.begin` and `Machine.integrate`."""
        drive, machine = self.linkage.drive, replace(self.machine, integrate=integrate)
        return drive.begin(stamp, machine).under(stamp, self.conditions, drive)

    def inputs(self) -> dict[Topic, Input]:
        """Returns the topics that a run receives, with new readers of their messages."""
        return self.linkage.drive.inputs(self.machine)

    def live_forces(self) -> dict[Topic, LiveForce]:
        """Returns the topics of live loads, with new readers of their messages."""
        session, loads = self.linkage.session, self.linkage.mechanism.loads
        forces = [
            LiveForce(load, session.joint_prefix, session.frame_id, self.name)
            for load in loads
            if isinstance(load, Force) and load.wrench_topic
        ]
        return {force.topic: force for force in forces}

    def prepare_live(self) -> None:
        """Compiles the programs, and rejects a motion that is too fast for a live run.

        Raises:
            ConfigurationError: A live run cannot follow the motion.
        """
        for coordinates in self.linkage.drive.rehearse(self.machine):
            with suppress(LinkageError):  # the run will report this error
                self.numbers.of(self.state(coordinates), coordinates.unwrapped)

    def state(self, coordinates: Coordinates) -> State:
        """Computes the state at coordinates; many, as arrays, are bit-identical to single ones."""
        q, u, a, _, state, conditions = coordinates
        if state is None:
            row = (q[0], u[0], a[0]) if len(q) == 1 else (q, u, a)
            return self.solver.state(*row, under=conditions)
        return state

    def part(
        self,
        coordinates: Coordinates,
        ahead: Coordinates | None = None,
        see: Callable[[State], object] = lambda _: None,
    ) -> RowPart:
        """Computes the numbers in the messages of many states, bit-identical to single ones.

        Args:
            coordinates: Coordinates of the states, as arrays.
            ahead: Coordinates for the feed-forward torque; None without feed-forward.
            see: Called with the states.
        """
        state = self.state(coordinates)
        see(state)
        later = None if ahead is None else self.numbers.effort(self.state(ahead))
        return RowPart(self.numbers.of(state, coordinates.unwrapped, stacked=True), later)

    def ahead(self, motion: Motion, stamps: Sequence[int]) -> Coordinates | None:
        """Returns the coordinates `lead` after the stamps; None without feed-forward."""
        lead = self.lead
        return None if lead is None else motion.at_all([stamp + lead for stamp in stamps])

    def ahead_of(self, motion: Motion, stamp: int) -> Coordinates | None:
        """Returns the coordinates `lead` after a stamp; None without feed-forward."""
        return None if self.lead is None else motion.at(stamp + self.lead)

    def joint_words(self, numbers: Sequence[float]) -> str:
        """Describes the positions of the published joints, given the numbers of a state."""
        words = [
            f'{joint.name} {value:.6g} {link.units.position}'
            for joint, link, value in zip(
                self.robot_joints, self.solver.structure.links, numbers, strict=False
            )
            if joint.name
        ]
        return ', '.join(words)
