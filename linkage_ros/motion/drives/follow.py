# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A measured crank."""

import math
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple, NoReturn, cast

from linkage_ros.errors import ConfigurationError, LinkageError, UnreachableError
from linkage_ros.mechanism.base import Mechanism
from linkage_ros.mechanism.conditions import OWN_CONDITIONS, Conditions
from linkage_ros.mechanism.solver import Solver
from linkage_ros.mechanism.structure import Link
from linkage_ros.messages.cdr import DoubtfulJointError, JointReader
from linkage_ros.messages.joints import RobotJoint
from linkage_ros.messages.topics import MEASURED_JOINT_STATES, Topic
from linkage_ros.motion.drives.base import Machine
from linkage_ros.motion.drives.feed_forward import FeedForward
from linkage_ros.motion.inputs import Input, Losses, UnnamedError
from linkage_ros.motion.measured import FollowSegment, Tracked, TrackingFilter, extrapolated
from linkage_ros.motion.segments import Coordinates, stacked
from linkage_ros.numeric import Real
from linkage_ros.quantities import Checked, quantity
from linkage_ros.units import NS_PER_S

# s without a measurement after which a warning is issued, if no torque depends on them, or before
# the first one.
_SILENCE = 2.0
_AMPLITUDE = 0.5  # rad, of a law for a crank that turns fully
NO_CRANK, NO_FRAME, NO_JOINT_STATE, OUT_OF_REACH = (
    'without a position of the crank', 'without a position of frame_joint', 'no JointState',
    'out of reach',
)  # fmt: skip


@dataclass(frozen=True)
class FrameJoint(Checked):
    """The joint that turns base_link relative to the world."""

    name: str = quantity(
        'text', 'joint that turns base_link, measured in the same messages; empty: none',
        default='',
    )  # fmt: skip
    zero: float = quantity(
        'number', 'direction of base_link in the world at which the joint is at 0; gravity is '
        'that of direction 0', 'rad', span=(-1e9, 1e9), default=0.0,
    )  # fmt: skip
    ratio: float = quantity(
        'number', 'joint value per rad of base_link', span=(-1e6, 1e6), default=1.0
    )
    pivot: tuple[float, float] = quantity(
        'pair', "point of base_link on the joint's axis", 'm', span=(-1e9, 1e9),
        default=(0.0, 0.0),
    )  # fmt: skip

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.ratio:
            raise ConfigurationError('frame_joint.ratio = 0: must be positive or negative')
        if not self.name and (self.zero, self.ratio, self.pivot) != (0.0, 1.0, (0.0, 0.0)):
            raise ConfigurationError('frame_joint.name is missing: give the joint in measurements')

    def read_by(self) -> RobotJoint:
        """Returns the joint in messages."""
        return RobotJoint(self.name, zero=self.zero, ratio=self.ratio, is_mapped=True)


class _Measured(NamedTuple):
    """A measurement of a joint.

    Attributes:
        stamp: Stamp, ns; 0 if the message has none.
        value: Value of the robot's joint.
        position: Position of the link that it turns, rad.
        velocity: Velocity of that link, rad/s; None if the message has none.
    """

    stamp: int
    value: float
    position: float
    velocity: float | None


class MeasuredCrank(Input):
    """Reads measurements of the crank, and of base_link if it turns, in order of arrival.

    Attributes:
        rejected: Number of rejected messages, by cause.
    """

    def __init__(
        self, machine: Machine, bandwidth: float, frame: FrameJoint, timeout: float = 0.0
    ) -> None:
        """Initializes without a measurement.

        Args:
            machine: The mechanism.
            bandwidth: Bandwidth of the filters, Hz; see `FollowDrive`.
            frame: The joint that turns base_link; one without a name is not read.
            timeout: Time without a measurement after which the node commands a torque of 0, s; 0:
                never.
        """
        self._machine, self._joint = machine, JointReader(machine.crank)
        reach = machine.solver.reach
        self._motion = TrackingFilter(bandwidth, reach.period_turns)
        self._is_limited = not reach.turns_fully
        self._frame_joint, self._frame_reader = frame.read_by(), JointReader(frame.name)
        self._frame = TrackingFilter(bandwidth, 1) if frame.name else None
        self.rejected: Counter[str] = Counter()
        self._timeout = timeout
        self.resume()

    def resume(self) -> None:
        """Waits for the first measurement; see `Input.resume`."""
        self._losses = Losses()
        self._last = time.monotonic()  # time of the last accepted measurement, s, or of the start
        self._is_heard = False

    def read(self, data: bytes, received: int) -> tuple[int, Coordinates]:
        """Returns the stamp, ns, and the coordinates in a JointState; see `Input.read`.

        The time of receipt replaces the stamp if the message has none.

        Raises:
            ValueError: The message must be rejected.
        """
        before = self.tracked()
        stamp, measured = self.measure(data, received)
        try:
            # Near a limit of the crank, rates may overflow.
            for one in filter(None, (measured, self.later(measured))):
                self._require_state(one.q[0], one.u[0], one.a[0], under=one.conditions)
        except ValueError:
            self.take_back(before)
            raise
        now = time.monotonic()
        if self._is_heard and now - self._last > self._silence:
            self._losses.add()
        self._last, self._is_heard = now, True
        return stamp, measured

    def tracked(self) -> tuple[Tracked, Tracked | None]:
        """Returns the state of the filters, for `take_back`."""
        return self._motion.tracked, self._frame.tracked if self._frame else None

    def take_back(self, before: tuple[Tracked, Tracked | None]) -> None:
        """Restores the filters to their state before measurements that are rejected."""
        self._motion.tracked, frame = before
        if self._frame and frame:
            self._frame.tracked = frame

    def stacked(self, found: Sequence[Coordinates]) -> tuple[Coordinates, Coordinates | None]:
        """Stacks coordinates of measurements, and those for the feed-forward torque, if any."""
        if self._machine.lead is None:
            return stacked(found), None
        return stacked(found), stacked([*filter(None, map(self.later, found))])

    def later(self, coordinates: Coordinates) -> Coordinates | None:
        """Extrapolates a measurement by `Machine.lead`; returns None without feed-forward."""
        lead = self._machine.lead
        return None if lead is None else extrapolated(coordinates, lead / NS_PER_S)

    def measure(self, data: bytes, received: int) -> tuple[int, Coordinates]:
        """Reads the coordinates of the crank like `read`, without checking that a state exists."""
        crank = self._decode(data, self._joint, self._machine.joint)
        self.require_motion()
        stamp = crank.stamp or received
        # All checks come first: a filter must not see a measurement that is rejected.
        base = self._decode_frame(data, stamp) if self._frame else None
        if self._is_limited and math.isfinite(crank.position):
            self._require_state(crank.position)
        coordinates = self._motion.at(stamp, crank.position, crank.velocity)
        conditions = self._machine.conditions
        if self._frame and base:
            (angle,), (rate,), (acceleration,), *_ = self._frame.at(
                stamp, base.position, base.velocity
            )
            conditions = replace(conditions, frame=(angle, rate, acceleration))
        if conditions:
            coordinates = coordinates._replace(conditions=conditions)
        if self._machine.joint.is_mapped:
            coordinates = coordinates._replace(unwrapped=crank.value)
        return stamp, coordinates

    def _decode_frame(self, data: bytes, stamp: int) -> _Measured:
        """Reads and checks the joint that turns base_link.

        Raises:
            ValueError: The message must be rejected.
        """
        try:
            base = self._decode(data, self._frame_reader, self._frame_joint)
        except UnnamedError as error:
            raise ValueError(NO_FRAME) from error
        cast('TrackingFilter', self._frame).check(stamp, base.position, base.velocity)
        return base

    def _decode(self, data: bytes, reader: JointReader, joint: RobotJoint) -> _Measured:
        """Reads a joint from a message.

        Raises:
            UnnamedError: The message has no position of the joint, or is not a JointState.
            DoubtfulJointError: The message must be rejected.
        """
        try:
            stamp, value, velocity = reader.read(data)
        except DoubtfulJointError:
            raise
        except ValueError as error:
            raise UnnamedError(NO_JOINT_STATE) from error
        if value is None:
            raise UnnamedError(NO_CRANK)
        if not joint.is_mapped:
            return _Measured(stamp, value, value, velocity)
        rate = None if velocity is None else velocity / joint.ratio
        return _Measured(stamp, value, joint.own(value), rate)

    def _require_state(self, *motion: Real, under: Conditions = OWN_CONDITIONS) -> None:
        try:
            self._machine.solver.state(*motion, under=under)
        except LinkageError as error:
            raise ValueError(f'{OUT_OF_REACH}: {self._in_joint(error)}{error}') from error

    def _in_joint(self, error: LinkageError) -> str:
        """Returns the rejected value and the reach of the robot's joint, if it is mapped."""
        joint = self._machine.joint
        if not (joint.is_mapped and isinstance(error, UnreachableError)):
            return ''
        arcs = (sorted(joint.value(angle) for angle in arc) for arc in error.arcs)
        reach = ' and '.join(f'{start:.6g} to {end:.6g}' for start, end in arcs)
        turn = math.tau * abs(joint.ratio)
        return (
            f'{joint.name} is at {joint.value(error.crank_angle):.6g}, and reaches {reach}, plus '
            f'multiples of {turn:.6g}; own angles: '
        )

    def reject(self, error: ValueError) -> None:
        """Counts a rejected message by its cause; see `Input.reject`."""
        self.rejected[str(error).partition(':')[0]] += 1

    def troubles(self, topic: str) -> list[str]:
        """Returns a warning if measurements stopped, or stop often."""
        is_heard = time.monotonic() - self._last < self._silence
        if self.has_ended or (is_heard and not self._losses.note):
            return []
        crank = self._machine.crank
        if self._frame:
            crank += f' and {self._frame_joint.name}'
        ends = ': a torque of 0 is commanded' if self._is_heard and self._timeout else ''
        when = f'for {self._silence:g} s{self._losses.note}'
        return [f'no measurement of {crank} on {topic} {when}{ends}']

    @property
    def _silence(self) -> float:
        """Time without a measurement after which a warning is issued, s."""
        return self._timeout or _SILENCE if self._is_heard else _SILENCE

    def diagnostics(self) -> dict[str, str]:
        """Returns the counts of rejected messages, for diagnostics."""
        # Copy in one step, because the tick thread may add a count meanwhile.
        counts = list(self.rejected.items())
        return {f'rejected, {cause}': str(count) for cause, count in counts}


@dataclass(frozen=True)
class FollowDrive(FeedForward):
    """A measured crank that the other links follow; `frame_joint` may turn base_link."""

    segment, subject, is_measured = FollowSegment, 'measured {}', True

    follow_bandwidth: float = quantity(
        'number', 'bandwidth of the filter for rates and accelerations; 0 sets them to 0',
        'Hz', span=(0.0, 1e4), default=20.0,
    )  # fmt: skip
    frame_joint: FrameJoint = field(default_factory=FrameJoint)
    measurement_timeout: float = quantity(
        'number', 'time without a measurement after which a torque of 0 is sent on '
        'effort_command_topic; 0: never', 's', span=(0.0, 1e6), default=0.1,
    )  # fmt: skip

    @property
    def crank_angle(self) -> float:
        """The crank angle before the first measurement, rad."""
        return 0.0

    @property
    def pivot(self) -> tuple[float, float]:
        """The point of base_link that is fixed in the world, m."""
        return self.frame_joint.pivot

    @property
    def frame_joint_name(self) -> str:
        """Name in measurements of the joint that turns base_link; empty if it is at rest."""
        return self.frame_joint.name

    def words(self, joint: Link) -> str:
        """Describes the measured joints and the filter."""
        also = f' and {self.frame_joint.name}, which turns base_link' * bool(self.frame_joint.name)
        return f'follows a measured {joint.name}{also}, filter of {self.follow_bandwidth:g} Hz'

    def begin(self, stamp: int, machine: Machine) -> NoReturn:  # noqa: ARG002
        """Refuses to simulate a measured motion.

        Raises:
            ConfigurationError: Always.
        """
        also = ', and leave frame_joint out' * bool(self.frame_joint.name)
        raise ConfigurationError(
            f'drive: follow needs a {machine.solver.reach.driven} that is measured: run '
            'linkage_node, or give linkage_record --measured BAG; without measurements, replace '
            f'it by the lines drive: motion and {self._possible_law(machine.solver)}{also}'
        )

    def _possible_law(self, solver: Solver) -> str:
        """Returns the parameters of a law that the driven joint can follow."""
        center, amplitude = self.drawn_angle(solver.mechanism), _AMPLITUDE
        if not solver.reach.turns_fully:
            low, high = solver.reach.arc_around(center)
            center, amplitude = 0.5 * (low + high), 0.25 * (high - low)
        return f'motion: {{center: {center:.9g}, amplitude: {amplitude:.3g}, frequency: 0.5}}'

    def inputs(self, machine: Machine) -> dict[Topic, Input]:
        """Receives measurements; see `Drive.inputs`."""
        timeout = self.measurement_timeout if self.effort_command_topic else 0.0
        crank = MeasuredCrank(machine, self.follow_bandwidth, self.frame_joint, timeout)
        return {MEASURED_JOINT_STATES: crank}

    def drawn_angle(self, mechanism: Mechanism) -> float:
        """Returns a place that the mechanism can reach; see `Drive.drawn_angle`."""
        if mechanism.drawn:
            return mechanism.drawn.position
        reach = mechanism.reach()
        return 0.5 * sum(reach.arcs[0]) if reach and not reach.turns_fully else self.crank_angle
