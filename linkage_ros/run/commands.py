# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Messages of a run other than its states: commands, measurements, crank trajectories."""

import itertools
import math
import time
from bisect import bisect_right
from collections import Counter, deque
from collections.abc import Iterable, Sequence
from contextlib import suppress
from typing import Any, cast

from linkage_ros.errors import LinkageError, MotionError
from linkage_ros.messages.cdr import JointReader, decode_joint_state, decode_trajectory
from linkage_ros.messages.templates import crank_trajectory
from linkage_ros.messages.topics import (
    CRANK_TRAJECTORY,
    JOINT_COMMANDS,
    MEASURED_JOINT_STATES,
    TRAJECTORY_COMMANDS,
    Topic,
)
from linkage_ros.motion.along_law import LawMotion, require_possible
from linkage_ros.motion.at_speed import SpeedMotion
from linkage_ros.motion.drives import FollowDrive, LawDrive, TorqueDrive
from linkage_ros.motion.measured import FollowMotion
from linkage_ros.motion.segments import Coordinates, stacked
from linkage_ros.numeric import Real
from linkage_ros.run.states import Simulator
from linkage_ros.settings.session import TrajectoryFeedForward
from linkage_ros.units import NS_PER_MS, NS_PER_S

WINDOW = 10  # s, period to which the rates and warnings of diagnostics refer
_SILENCE = 2.0  # s without a measurement after which a warning is issued
NO_CRANK, NO_JOINT_STATE, OUT_OF_REACH = (
    'without a position of the crank', 'no JointState', 'out of reach'
)  # fmt: skip
TAKEN, CUT, REJECTED, TIMEOUTS = (
    'commands taken', 'commands cut to torque_limit', 'commands rejected', 'command timeouts'
)  # fmt: skip
TRAJECTORIES_TAKEN, TRAJECTORIES_REJECTED = 'trajectories taken', 'trajectories rejected'

# Time between points, ns; short, because the controller interpolates the effort linearly.
_STEP = NS_PER_MS


class TorqueCommands:
    """Stores the last valid command until it expires, and counts commands.

    Attributes:
        counts: Numbers of commands, by their names in diagnostics.
    """

    def __init__(self, drive: TorqueDrive, crank: str, ratio: float = 1.0) -> None:
        """Initializes without an active command.

        Args:
            drive: Drive with the limit and the timeout of commands.
            crank: Name of the crank's joint.
            ratio: Ratio of the joint; the crank's torque is its effort times the ratio.
        """
        self.counts = dict.fromkeys((TAKEN, CUT, REJECTED, TIMEOUTS), 0)
        self._limit, self._crank, self._ratio = drive.torque_limit, crank, ratio
        self._timeout = round(drive.command_timeout * NS_PER_S)
        self._torque, self._end = 0.0, math.inf  # active torque, N m, and when it expires, ns
        self._is_active = False
        self._timed_out_at = -math.inf

    def read(self, data: bytes, _: int) -> float:
        """Decodes a message.

        Args:
            data: CDR bytes of a JointState.

        Returns:
            See `commanded`.

        Raises:
            ValueError: The message is not a command for this crank.
        """
        try:
            command = decode_joint_state(data)
            return self.commanded(command.names, command.efforts)
        except ValueError:
            self.counts[REJECTED] += 1
            raise

    def commanded(self, names: Sequence[str], efforts: Sequence[float]) -> float:
        """Checks a command.

        Args:
            names: Names of the joints.
            efforts: Effort of each joint, N m; only the effort of the crank is used.

        Returns:
            The commanded torque within `torque_limit`, N m.

        Raises:
            ValueError: The message is not a command for this crank.
        """
        if len(efforts) != len(names):
            raise ValueError(
                f'{len(names)} names and {len(efforts)} efforts: must be one for each'
            )
        if list(names).count(self._crank) != 1:
            shown = ascii(', '.join(names))[1:-1] or 'nothing'
            raise ValueError(f'it names {shown:.80}: must name {self._crank} once')
        torque = float(efforts[list(names).index(self._crank)]) * self._ratio
        if not math.isfinite(torque):
            raise ValueError(f'effort {torque}: must be a finite number, N m')
        self.counts[TAKEN] += 1
        self.counts[CUT] += abs(torque) > self._limit
        return min(max(torque, -self._limit), self._limit)

    def torque(self, now: int, received: Iterable[float]) -> float:
        """Returns the torque from a tick until the next one.

        A command acts from the tick that reads it until it expires.

        Args:
            now: Time from tick 0 to this tick, ns, which a step of the clock does not change.
            received: Results of `read` since the last call.

        Returns:
            The torque, N m; 0 before the first command and after a timeout.
        """
        for torque in received:
            self._torque, self._end, self._is_active = torque, now + self._timeout, True
        if now >= self._end:
            self.counts[TIMEOUTS] += self._is_active
            self._torque, self._is_active, self._timed_out_at = 0.0, False, time.monotonic()
        return self._torque

    def troubles(self, topic: str) -> list[str]:  # noqa: ARG002, the signature of all
        """Returns a warning if no command was active at some tick in the last 10 s."""
        if time.monotonic() - self._timed_out_at >= WINDOW:
            return []
        alone = f'the motor alone drove the crank in the last {WINDOW} s'
        return [f'no command within command_timeout: {alone}']

    def diagnostics(self) -> dict[str, str]:
        """Returns the active torque and the counts of commands, for diagnostics."""
        counts = {name: str(count) for name, count in self.counts.items()}
        return {'command, N m': f'{self._torque:.6g}', **counts}


class MeasuredCrank:
    """Reads measurements of the crank, in order of arrival.

    Attributes:
        rejected: Number of rejected messages, by cause.
    """

    def __init__(self, simulator: Simulator) -> None:
        """Initializes without a measurement.

        Args:
            simulator: Simulator of a configuration with `drive: follow`.
        """
        self._simulator, self._joint = simulator, JointReader(simulator.crank_joint)
        self._robot_joint = simulator.robot_joints[0]
        drive, reach = cast('FollowDrive', simulator.configuration.drive), simulator.solver.reach
        self._motion, self._is_limited = (
            FollowMotion(drive, reach.period_turns),
            not reach.turns_fully,
        )
        self.rejected: Counter[str] = Counter()
        self._last = -math.inf  # time of the last accepted measurement, s

    def read(self, data: bytes, received: int) -> tuple[int, Coordinates]:
        """Reads a measurement from a message.

        Args:
            data: CDR bytes of a JointState.
            received: Time of receipt, ns; replaces the stamp if the message has none.

        Returns:
            The stamp, ns, and the coordinates of the crank.

        Raises:
            ValueError: The message is rejected and counted. The error text is the cause, which may
                be followed by a colon and details.
        """
        found = self._measure(data, received)
        self._require_states(found[1])
        self._last = time.monotonic()
        return found

    def answers(
        self, messages: Iterable[tuple[int, bytes]]
    ) -> tuple[list[int], list[int], Sequence[Real]]:
        """Answers many messages, with the same results as `read`.

        Args:
            messages: Time of receipt, ns, and CDR bytes of each JointState.

        Returns:
            The time of receipt of each accepted message, ns, the stamp of its state, ns, and the
            numbers in the messages of the states. Rejected messages are counted.
        """
        heard = list[tuple[int, int, Coordinates]]()
        for received, data in messages:
            try:
                stamp, found = self._measure(data, received)
            except ValueError:  # counted; `suppress` takes a twentieth of the time of a record
                continue
            heard.append((received, stamp, found))
        try:
            return self._answers(heard)
        except LinkageError:  # of at least one state
            return self._answers([one for one in heard if self._has_states(one[-1])])

    def _answers(
        self, heard: Sequence[tuple[int, int, Coordinates]]
    ) -> tuple[list[int], list[int], Sequence[Real]]:
        if not heard:
            return [], [], ()
        times, stamps, found = zip(*heard, strict=True)
        return [*times], [*stamps], self._simulator.numbers(*self.stacked(found))

    def _has_states(self, found: Coordinates) -> bool:
        """Returns whether a measurement has states; if not, it is counted as rejected."""
        with suppress(ValueError):
            self._require_states(found)
            return True
        return False

    def stacked(self, found: Sequence[Coordinates]) -> tuple[Coordinates, Coordinates | None]:
        """Stacks the coordinates of accepted measurements.

        Args:
            found: The coordinates of each measurement.

        Returns:
            The coordinates as arrays, and those for the feed-forward torque or None.
        """
        later = [x for one in found if (x := self._simulator.later(one))]
        return stacked(found), stacked(later) if later else None

    def _measure(self, data: bytes, received: int) -> tuple[int, Coordinates]:
        """Reads the coordinates of the crank; see `read`.

        Raises:
            ValueError: The message is rejected and counted.
        """
        try:
            stamp, value, velocity = self._decode(data)
            position, joint = value, self._robot_joint
            if joint.is_mapped:
                position = joint.own(value)
                velocity = velocity if velocity is None else velocity / joint.ratio
            if self._is_limited and math.isfinite(position):
                self._require_state(position)  # the filter must not see other angles
            stamp = stamp or received
            found = self._motion.at(stamp, position, velocity)
            return stamp, found._replace(unwrapped=value) if joint.is_mapped else found
        except ValueError as error:
            self._reject(error)
            raise

    def _decode(self, data: bytes) -> tuple[int, float, float | None]:
        """Returns the stamp, ns, and position and, if it was measured, velocity of the joint.

        Raises:
            ValueError: The message has no measurement. The error text is the cause.
        """
        try:
            stamp, position, velocity = self._joint.read(data)
        except ValueError as error:
            raise ValueError(NO_JOINT_STATE) from error
        if position is None:
            raise ValueError(NO_CRANK)
        return stamp, position, velocity

    def _require_states(self, found: Coordinates) -> None:
        """Checks the states of a measurement; near a limit of the crank, rates may overflow.

        Raises:
            ValueError: The message is rejected and counted.
        """
        try:
            for one in filter(None, (found, self._simulator.later(found))):
                self._require_state(one.q[0], one.u[0], one.a[0])
        except ValueError as error:
            self._reject(error)
            raise

    def _require_state(self, *motion: Real) -> None:
        try:
            self._simulator.solver.state(*motion)
        except LinkageError as error:
            raise ValueError(f'{OUT_OF_REACH}: {error}') from error

    def _reject(self, error: ValueError) -> None:
        self.rejected[str(error).partition(':')[0]] += 1

    def troubles(self, topic: str) -> list[str]:
        """Returns a warning if no measurement has been accepted for 2 s."""
        if time.monotonic() < self._last + _SILENCE:
            return []
        crank = self._simulator.crank_joint
        return [f'no measurement of {crank} on {topic} in the last {_SILENCE:g} s']

    def diagnostics(self) -> dict[str, str]:
        """Returns the counts of rejected messages, for diagnostics."""
        # Copy in one step, because the tick thread may add a count meanwhile.
        counts = list(self.rejected.items())
        return {f'rejected, {cause}': str(count) for cause, count in counts}


class CrankTrajectories:
    """Reads trajectories of the crank, and joins each of them to the motion.

    Attributes:
        counts: Numbers of trajectories, by their names in diagnostics.
    """

    def __init__(self, simulator: Simulator) -> None:
        """Initializes without a motion.

        Args:
            simulator: Simulator of a configuration with `drive: motion`.
        """
        self.counts = dict.fromkeys((TRAJECTORIES_TAKEN, TRAJECTORIES_REJECTED), 0)
        self._simulator = simulator
        self._stamp = 0
        self._motion = cast('LawMotion', simulator.begin(0))

    def read(self, data: bytes, _: int) -> LawMotion:
        """Reads a trajectory that leaves the motion at the stamp of the last `continued`.

        Args:
            data: CDR bytes of a JointTrajectory.

        Returns:
            The motion along the trajectory.

        Raises:
            ValueError: The message is rejected and counted. The error text is the cause.
        """
        try:
            motion = self._motion.join(self._stamp, *self._decode(data))
            require_possible(motion.segment.law, self._simulator.solver)
        except ValueError:
            self.counts[TRAJECTORIES_REJECTED] += 1
            raise
        self.counts[TRAJECTORIES_TAKEN] += 1
        return motion

    def _decode(
        self, data: bytes
    ) -> tuple[list[int], list[float], list[tuple[float, ...]] | None]:
        """Returns the future points: stamps, ns, angles, and rates or rates and accelerations.

        Raises:
            ValueError: The message is not a trajectory for this crank.
        """
        stamp, names, points = decode_trajectory(data)
        crank, start = self._simulator.crank_joint, stamp or self._stamp
        if names != [crank]:
            words = ascii(', '.join(names))[1:-1] or 'nothing'
            raise ValueError(f'it names {words:.80}: must name {crank} alone')
        if not points:
            raise ValueError('it has no points')
        sizes = {(len(x.positions), len(x.velocities), len(x.accelerations)) for x in points}
        if sizes not in ({(1, 0, 0)}, {(1, 1, 0)}, {(1, 1, 1)}):
            raise ValueError(
                'its points do not match: each must have one position and, if every other point '
                'has them, one velocity, or one velocity and one acceleration'
            )
        joint = self._simulator.robot_joints[0]
        rows = []
        for point in points:
            rates = *point.velocities, *point.accelerations
            rows.append((joint.own(point.positions[0]), *(rate / joint.ratio for rate in rates)))
        if not all(map(math.isfinite, itertools.chain(*rows))):
            raise ValueError('a number of it is not finite')
        times = [start + point.time for point in points]
        if any(before >= after for before, after in itertools.pairwise(times)):
            raise ValueError('its times do not increase')
        if len(rows[-1]) > 1 and rows[-1][1]:
            raise ValueError(f'its last velocity is {rows[-1][1]:g}: must be 0, where it ends')
        past = bisect_right(times, self._stamp)
        if past == len(times):
            late = (self._stamp - times[-1]) / NS_PER_S
            raise ValueError(f'all its points are in the past: the last one by {late:.3f} s')
        angles = [row[0] for row in rows[past:]]
        slopes = [row[1:] for row in rows[past:]]
        return times[past:], angles, slopes if slopes[0] else None

    def continued(self, motion: LawMotion, stamp: int, received: Iterable[LawMotion]) -> LawMotion:
        """Returns the motion from a tick on.

        Args:
            motion: The motion so far.
            stamp: Stamp of the tick, ns.
            received: Iterator that calls `read` for each new message.

        Returns:
            The motion along the last accepted trajectory, or the motion so far.
        """
        self._motion, self._stamp = motion, stamp
        for self._motion in received:
            pass
        return self._motion

    def troubles(self, topic: str) -> list[str]:  # noqa: ARG002, the signature of all
        """Returns no warnings, because the law goes on without trajectories."""
        return []

    def diagnostics(self) -> dict[str, str]:
        """Returns the counts of trajectories, for diagnostics."""
        return {name: str(count) for name, count in self.counts.items()}


def inputs_of(simulator: Simulator) -> dict[Topic, Any]:
    """Returns the topic received by a run, if any, with the reader of its messages."""
    drive = simulator.configuration.drive
    if isinstance(drive, TorqueDrive):
        ratio = simulator.robot_joints[0].ratio
        return {JOINT_COMMANDS: TorqueCommands(drive, simulator.crank_joint, ratio)}
    if isinstance(drive, FollowDrive):
        return {MEASURED_JOINT_STATES: MeasuredCrank(simulator)}
    if isinstance(drive, LawDrive):
        return {CRANK_TRAJECTORY: CrankTrajectories(simulator)}
    return {}


class CrankTrajectory:
    """Computes trajectories of a fixed duration; the next one is due after half of it.

    A trajectory starts at or just before its stamp, so that a controller can follow it as soon as
    it arrives. Each tick computes only the new points within the horizon. The first tick, and the
    first one after a change of the motion, compute all points.

    Attributes:
        topic: Topic of the trajectories.
    """

    def __init__(self, simulator: Simulator, drive: TrajectoryFeedForward) -> None:
        """Prepares the trajectories.

        Args:
            simulator: Simulator of the run.
            drive: Drive with the topic and the duration of the trajectories.
        """
        self.topic = TRAJECTORY_COMMANDS._replace(name=drive.trajectory_command_topic)
        self._names = simulator.crank_joint, simulator.configuration.session.frame_id
        self._joint = simulator.robot_joints[0]
        self._simulator, self._solver = simulator, simulator.solver
        self._horizon = round(drive.trajectory_horizon * NS_PER_S)
        self._motion: SpeedMotion | LawMotion | None = None
        self._points: deque[tuple[int, tuple[float, ...]]] = deque()
        self._next = self._due = 0

    def message_at(self, motion: SpeedMotion | LawMotion, stamp: int) -> bytes | None:
        """Returns the trajectory to send at a stamp, if one is due.

        Args:
            motion: Motion in the segment that contains the stamp. If it differs from the motion in
                the last call, the previous trajectory is invalid, and a new one is due.
            stamp: Stamp of the current tick, ns.

        Returns:
            The CDR bytes of the message; None if no message is due.
        """
        if motion is not self._motion or stamp >= self._next:
            self._points.clear()
            self._motion, self._next, self._due = motion, stamp, stamp
            self._solver = self._simulator.under(motion.segment.gravity).solver
        with suppress(MotionError):  # a law may end within the horizon
            while self._next < stamp + self._horizon + _STEP:
                (q,), (u,), (a,), unwrapped, _ = motion.at(self._next)
                torque = float(self._solver.state(q, u, a).torque)
                joint = self._joint
                position, effort = joint.value(unwrapped), torque / joint.ratio
                values = position, joint.ratio * u, joint.ratio * a, effort
                self._points.append((self._next, values))
                self._next += _STEP
        while len(self._points) > 1 and self._points[1][0] <= stamp:
            self._points.popleft()
        if stamp < self._due:
            return None
        self._due = stamp + self._horizon // 2
        return crank_trajectory(*self._names, self._points)
