# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Commands to a run: torques and laws of the crank; and the topic that a run receives."""

import itertools
import math
import time
from bisect import bisect_right
from collections.abc import Iterable, Sequence
from typing import Any, cast

from linkage_ros.messages.cdr import decode_joint_state, decode_trajectory
from linkage_ros.messages.topics import (
    CRANK_TRAJECTORY,
    JOINT_COMMANDS,
    MEASURED_JOINT_STATES,
    Topic,
)
from linkage_ros.motion.along_law import LawMotion, require_possible
from linkage_ros.motion.drives import FollowDrive, LawDrive, TorqueDrive
from linkage_ros.run.measured_crank import MeasuredCrank
from linkage_ros.run.states import Simulator
from linkage_ros.units import NS_PER_S

WINDOW = 10  # s, period to which the rates and warnings of diagnostics refer
TAKEN, CUT, REJECTED, TIMEOUTS = (
    'commands taken', 'commands cut to torque_limit', 'commands rejected', 'command timeouts'
)  # fmt: skip
TRAJECTORIES_TAKEN, TRAJECTORIES_REJECTED = 'trajectories taken', 'trajectories rejected'


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


class LawCommands:
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
        return {CRANK_TRAJECTORY: LawCommands(simulator)}
    return {}
