# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Base class of drives.

Methods and attributes of a drive contain what depends on its kind. Programs choose between ways
to run it by `given`.
"""

import math
import time
from abc import abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Generic, TypeVar

from linkage_ros.mechanism.kinematics import Reach
from linkage_ros.mechanism.solver import Solver
from linkage_ros.mechanism.structure import Link, Mechanism
from linkage_ros.messages.joints import RobotJoint
from linkage_ros.messages.topics import Topic
from linkage_ros.motion.law import Law
from linkage_ros.motion.segments import Coordinates, Motion, Segment
from linkage_ros.motion.steps import Integrate, live_steps
from linkage_ros.quantities import Checked
from linkage_ros.units import NS_PER_S

WINDOW = 10  # s, period to which the rates and warnings of diagnostics refer


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
        forces: Force [x, y], N, of each load whose force is set by messages, by name, before the
            first message.
    """

    solver: Solver
    period: int
    crank: str = 'crank'
    joint: RobotJoint = _CRANK
    lead: int | None = None
    integrate: Integrate = live_steps
    forces: Mapping[str, Sequence[float]] = field(default_factory=dict)


T = TypeVar('T')


class Expiring(Generic[T]):
    """The last received value, which acts from the tick that reads it until it expires.

    Attributes:
        default: Value that acts before the first value and after a timeout.
        value: The value that acts.
        timeouts: Number of values that expired.
    """

    def __init__(self, default: T, timeout: float) -> None:
        """Initializes without a received value.

        Args:
            default: Value that acts before the first value and after a timeout.
            timeout: Time for which a received value acts, s.
        """
        self.value, self.timeouts = default, 0
        self.default, self._timeout = default, round(timeout * NS_PER_S)
        self._begin: int | None = None  # of the last received value, ns
        self._is_active = False
        self._without_at = -math.inf  # last time without a value after a timeout, s

    def at(self, now: int, received: Iterable[T]) -> T:
        """Returns the value that acts from now on.

        Args:
            now: Time of a tick, ns. If it goes back, the value expires.
            received: The values received since the last call.
        """
        for self.value in received:
            self._begin, self._is_active = now, True
        if self._begin is not None and not self.acts(now - self._begin):
            self.timeouts += self._is_active
            self.value, self._is_active = self.default, False
            self._without_at = time.monotonic()
        return self.value

    def acts(self, age: int) -> bool:
        """Returns whether a value acts at an age, ns."""
        return 0 <= age < self._timeout

    @property
    def has_expired(self) -> bool:
        """Whether, after a timeout, no value acted at some time in the last 10 s."""
        return time.monotonic() - self._without_at < WINDOW


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
        segment: Class of the segments of the motion.
        subject: A mechanism with this drive, in error messages, where {} is its kind.
        is_measured: Whether each state is that of a measurement, so that nothing is simulated.
        is_integrated: Whether the motion is integrated from state to state under a torque, so that
            segments alone do not determine it.
        effort_command_topic: See `FeedForward`; empty for drives without these parameters, as are
            the next three.
        lead_time: See `FeedForward`.
        trajectory_command_topic: See `TrajectoryFeedForward`.
        trajectory_horizon: See `TrajectoryFeedForward`.
    """

    segment: ClassVar[type[Segment]]
    subject: ClassVar[str] = '{}'
    is_measured: ClassVar[bool] = False
    is_integrated: ClassVar[bool] = False
    effort_command_topic = trajectory_command_topic = ''
    lead_time = trajectory_horizon = 0.0

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

    def law(self, joint: Link) -> Law | None:  # noqa: ARG002, some have one
        """Returns the law of the driven joint; None if its motion is given in another way."""
        return None

    @property
    def plotted_seconds(self) -> float:
        """Duration that the curves of a live picture show, s."""
        return 5.0
