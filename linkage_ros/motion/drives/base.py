# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Base class of drives.

Everything that depends on the kind of drive is a method or an attribute of it.
"""

from abc import abstractmethod
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import Enum
from typing import Any, ClassVar

from linkage_ros.mechanism.kinematics import Reach
from linkage_ros.mechanism.solver import Solver
from linkage_ros.mechanism.structure import Mechanism
from linkage_ros.messages.joints import RobotJoint
from linkage_ros.messages.topics import Topic
from linkage_ros.motion.segments import Coordinates, Motion, Segment
from linkage_ros.motion.steps import Integrate, live_steps
from linkage_ros.quantities import Checked

WINDOW = 10  # s, period to which the rates and warnings of diagnostics refer


class Given(Enum):
    """The quantity that a drive prescribes, and from which the others are computed."""

    MOTION = 'the motion of the crank over time'
    MEASUREMENT = 'the measured crank'
    TORQUE = 'the torque on the crank'


_CRANK = RobotJoint('crank')


@dataclass(frozen=True)
class Machine:
    """The mechanism that a drive moves, and its crank in messages.

    Attributes:
        solver: Solver of the mechanism.
        period: Time between states, ns.
        crank: Name of the crank in measurements, commands and trajectories.
        joint: The crank's joint.
        lead: Time by which the feed-forward torque is ahead of the stamp, ns; None without
            feed-forward.
        integrate: Creates the integrator of a motion under a torque.
    """

    solver: Solver
    period: int
    crank: str = 'crank'
    joint: RobotJoint = _CRANK
    lead: int | None = None
    integrate: Integrate = live_steps


class Input:
    """Reader of the messages on a topic that a drive receives."""

    def read(self, data: bytes, received: int) -> Any:
        """Reads a message.

        Args:
            data: CDR bytes of the message.
            received: Time of receipt, ns.

        Returns:
            A value for `applied`.

        Raises:
            ValueError: The message must be rejected; the error text is the cause.
        """
        raise NotImplementedError

    def applied(self, motion: Any, stamp: int, elapsed: int, received: Iterable[Any]) -> Motion:
        """Applies the messages received since the last tick to a motion.

        Args:
            motion: The motion so far.
            stamp: Stamp of the tick, ns.
            elapsed: Time from tick 0, ns, which a step of the clock does not change.
            received: Iterator that calls `read` for each new message.

        Returns:
            The motion from the tick on.
        """
        raise NotImplementedError

    def troubles(self, topic: str) -> list[str]:  # noqa: ARG002, for other inputs
        """Returns warnings, given the name of the topic."""
        return []

    def diagnostics(self) -> dict[str, str]:
        """Returns figures for diagnostics, by name."""
        return {}


@dataclass(frozen=True)
class Drive(Checked):
    """Base class of drives: frozen dataclasses of quantities.

    `linkage_ros.motion.drives.DRIVES` lists the kinds in parameter files.

    Attributes:
        given: The given quantity. It decides how the states of a log are recomputed.
        segment: Class of the segments of the motion.
        subject: A mechanism with this drive, in error messages, where {} is its kind.
    """

    given: ClassVar[Given]
    segment: ClassVar[type[Segment]]
    subject: ClassVar[str] = '{}'

    @property
    @abstractmethod
    def crank_angle(self) -> float:
        """The crank angle at t = 0, rad."""

    @property
    def pivot(self) -> tuple[float, float]:
        """The point of base_link that is fixed in the world, m, if base_link turns."""
        return 0.0, 0.0

    @abstractmethod
    def words(self) -> str:
        """Describes the drive."""

    def check(self, mechanism: Mechanism) -> None:
        """Checks that the drive can move a mechanism.

        Raises:
            ConfigurationError: The check failed; the message states the reason.
            MechanismError: A dyad does not close at any crank angle.
        """
        _ = Solver(mechanism).mobility

    @abstractmethod
    def begin(self, stamp: int, machine: Machine) -> Motion:
        """Starts the motion.

        Args:
            stamp: Stamp of t = 0, ns.
            machine: The mechanism to move.

        Returns:
            The motion in its first segment.

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

    def drawn_angle(self, reach: Reach | None) -> float:  # noqa: ARG002, a measured crank needs it
        """Returns the crank angle at which the mechanism is drawn before its first state, rad."""
        return self.crank_angle

    @property
    def plotted_seconds(self) -> float:
        """Duration that the curves of a live picture show, s."""
        return 5.0
