# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Base class of drives.

Methods and attributes of a drive contain what depends on its kind. Programs choose between ways
to run it by `is_measured` and `is_integrated`.
"""

from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

from linkage_ros.mechanism.base import Mechanism
from linkage_ros.mechanism.conditions import OWN_CONDITIONS, Conditions
from linkage_ros.mechanism.solver import Solver
from linkage_ros.mechanism.structure import Link
from linkage_ros.messages.joints import RobotJoint
from linkage_ros.messages.topics import Topic
from linkage_ros.motion.inputs import Input
from linkage_ros.motion.law import Law
from linkage_ros.motion.segments import Coordinates, Motion, Segment
from linkage_ros.motion.steps import Integrate, live_steps
from linkage_ros.quantities import Checked

_CRANK = RobotJoint('crank')


@dataclass(frozen=True)
class Machine:
    """The mechanism that a drive moves, and its driven joint in messages.

    Attributes:
        solver: Solver of the mechanism.
        period: Time between states, ns.
        crank: Name of the driven joint in measurements, commands and trajectories.
        joint: The driven joint.
        lead: Time by which the feed-forward torque is ahead of the stamp, ns; None without
            feed-forward.
        integrate: Creates the integrator of a motion under a torque.
        conditions: Conditions before the first message: they hold the force of each load whose
            force is set by messages.
        others: Names of the driven joints of the other linkages of the run.
    """

    solver: Solver
    period: int
    crank: str = 'crank'
    joint: RobotJoint = _CRANK
    lead: int | None = None
    integrate: Integrate = live_steps
    conditions: Conditions = OWN_CONDITIONS
    others: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Drive(Checked):
    """Base class of drives: frozen dataclasses of quantities.

    `linkage_ros.motion.drives.DRIVES` lists the kinds in parameter files.

    Attributes:
        segment: Class of the segments of the motion.
        subject: A mechanism with this drive, in error messages, where {} is its kind.
        is_measured: Whether each state is that of a measurement, so that nothing is simulated.
        is_integrated: Whether the motion is integrated from state to state under a torque, so that
            segments alone do not determine it.
        effort_command_topic: Topic of the feed-forward torque; empty without it.
        lead_time: Time by which this torque is computed in advance of its stamp, s.
        trajectory_command_topic: Topic of trajectories of the crank; empty without them.
        trajectory_horizon: Duration of each trajectory, s.
        measurement_timeout: Time without a measurement after which a commanded torque ends, s; 0:
            never.
    """

    segment: ClassVar[type[Segment]]
    subject: ClassVar[str] = '{}'
    is_measured: ClassVar[bool] = False
    is_integrated: ClassVar[bool] = False
    effort_command_topic = trajectory_command_topic = ''
    lead_time = trajectory_horizon = measurement_timeout = 0.0

    @property
    @abstractmethod
    def crank_angle(self) -> float:
        """The crank angle at t = 0, rad."""

    @property
    def pivot(self) -> tuple[float, float]:
        """The point of base_link that is fixed in the world, m, if base_link turns."""
        return 0.0, 0.0

    @property
    def frame_joint_name(self) -> str:
        """Name in measurements of the joint that turns base_link; empty if it is at rest."""
        return ''

    @abstractmethod
    def words(self, joint: Link) -> str:
        """Describes the drive, given the link whose joint is driven."""

    def check(self, mechanism: Mechanism) -> None:
        """Checks that the drive can move a mechanism.

        Raises:
            ConfigurationError: The check failed; the message states the reason.
            MechanismError: A dyad does not close at any crank angle.
        """
        _ = Solver(mechanism).mobility

    @abstractmethod
    def begin(self, stamp: int, machine: Machine) -> Motion:
        """Returns the motion in its first segment, given the stamp of t = 0, ns.

        Raises:
            ConfigurationError: The crank is measured, not simulated.
        """

    def inputs(self, machine: Machine) -> dict[Topic, Input]:  # noqa: ARG002, most receive nothing
        """Returns the topics that a run receives, with new readers of their messages."""
        return {}

    def rehearse(self, machine: Machine) -> Iterator[Coordinates]:  # noqa: ARG002, most need not
        """Prepares a live run, and yields coordinates whose programs are to be compiled.

        Raises:
            ConfigurationError: A live run cannot follow the motion.
        """
        return iter(())

    def drawn_angle(self, mechanism: Mechanism) -> float:  # noqa: ARG002, some need it
        """Returns where the mechanism is drawn before its first state.

        Returns:
            The crank angle, rad, or the position of a driven link that slides, m.
        """
        return self.crank_angle

    def law(self, joint: Link) -> Law | None:  # noqa: ARG002, some have one
        """Returns the law of the driven joint; None if its motion is given in another way."""
        return None

    @property
    def plotted_seconds(self) -> float:
        """Duration that the curves of a live picture show, s."""
        return 5.0
