# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Messages received by a run: torque commands and measurements of the crank."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from typing import Any, cast

from linkage_ros.errors import LinkageError
from linkage_ros.motion.coordinates import Coordinates
from linkage_ros.motion.drives import FollowDrive, TorqueDrive
from linkage_ros.motion.follow import FollowMotion, Measurement
from linkage_ros.numeric import Real
from linkage_ros.run.health import WINDOW
from linkage_ros.run.simulator import Simulator
from linkage_ros.units import NS_PER_S
from linkage_ros.wire.cdr import decode_joint_state
from linkage_ros.wire.topics import JOINT_COMMANDS, MEASURED_JOINT_STATES, Topic

_SILENCE = 2.0  # s without a measurement after which a warning is issued
NO_CRANK, NO_JOINT_STATE, OUT_OF_REACH = 'without the crank', 'no JointState', 'out of reach'


class TorqueCommands:
    """Stores the last valid command until it expires, and counts commands.

    One thread may receive commands while another reads the torque.

    Attributes:
        accepted: Number of accepted commands.
        limited: Number of accepted commands that were clipped to the limit.
        refused: Number of rejected commands.
        timeouts: Number of commands that expired before the next one.
    """

    def __init__(
        self, drive: TorqueDrive, crank: str, clock: Callable[[], float] = time.monotonic
    ) -> None:
        """Initializes without an active command.

        Args:
            drive: Drive with the limit and the timeout of commands.
            crank: Name of the crank's joint.
            clock: Function that returns the time, s.
        """
        self.accepted = self.limited = self.refused = self.timeouts = 0
        self._limit, self._timeout = drive.torque_limit, drive.command_timeout
        self._crank, self._clock = crank, clock
        self._torque, self._end = 0.0, math.inf  # active torque, N m, and when it expires, s
        self._is_active = False
        self._timed_out_at = -math.inf

    def read(self, data: bytes, received: int) -> None:
        """Decodes a message and activates its command.

        Args:
            data: CDR bytes of a JointState.
            received: Wall-clock time of receipt, ns.

        Raises:
            ValueError: The message is not a command for this crank.
        """
        try:
            command = decode_joint_state(data)
            age = max(0, time.time_ns() - received) / NS_PER_S
            self.receive(command.names, command.efforts, age)
        except ValueError:
            self.refused += 1
            raise

    def receive(self, names: Sequence[str], efforts: Sequence[float], age: float) -> None:
        """Activates a command.

        Args:
            names: Names of the joints.
            efforts: Effort of each joint, N m; all but that of the crank are ignored.
            age: Time since the command was received, s.

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
        torque = float(efforts[list(names).index(self._crank)])
        if not math.isfinite(torque):
            raise ValueError(f'effort {torque}: must be a finite number, N m')
        self.accepted += 1
        self.limited += abs(torque) > self._limit
        # Set the end first, so that a concurrent reader at worst uses the old torque once more.
        self._end = self._clock() + self._timeout - age
        self._torque = min(max(torque, -self._limit), self._limit)
        self._is_active = True

    def torque(self) -> float:
        """Returns the active torque, N m; 0 before the first command and after a timeout."""
        now = self._clock()
        if now <= self._end:
            return self._torque
        self.timeouts += self._is_active
        self._is_active, self._timed_out_at = False, now
        return 0.0

    def troubles(self, topic: str) -> list[str]:  # noqa: ARG002, the signature of all
        """Returns a warning if no command was active at some tick in the last 10 s."""
        if self._clock() - self._timed_out_at >= WINDOW:
            return []
        return [f'no command within command_timeout: the motor drove alone in the last {WINDOW} s']

    def diagnostics(self) -> dict[str, str]:
        """Returns the active torque and the counts of commands, for diagnostics."""
        return {
            'command, N m': f'{self._torque if self._clock() <= self._end else 0.0:.6g}',
            'commands taken': str(self.accepted),
            'commands cut to torque_limit': str(self.limited),
            'commands refused': str(self.refused),
            'command timeouts': str(self.timeouts),
        }


class MeasuredCrank:
    """Reads measurements of the crank, in order of arrival.

    Attributes:
        left_out: Number of rejected messages for each cause.
    """

    def __init__(self, simulator: Simulator) -> None:
        """Initializes without a measurement.

        Args:
            simulator: Simulator of a configuration with `drive: follow`.
        """
        self._simulator = simulator
        self._motion = FollowMotion(cast('FollowDrive', simulator.configuration.drive))
        self.left_out = self._motion.left_out
        self._last = -math.inf  # time of the last accepted measurement, s

    def read(self, data: bytes, received: int) -> tuple[int, Coordinates]:
        """Reads a measurement from a message.

        Args:
            data: CDR bytes of a JointState.
            received: Time of receipt, ns; replaces the stamp if the message has none.

        Returns:
            The stamp, ns, and the coordinates of the crank.

        Raises:
            ValueError: The message is rejected and counted. The error text is the cause.
        """
        try:
            heard = decode_joint_state(data)
        except ValueError as error:
            raise self._rejected(NO_JOINT_STATE) from error
        names = heard.names[: len(heard.positions)]
        if self._simulator.crank_joint not in names:
            raise self._rejected(NO_CRANK)
        index, stamp = names.index(self._simulator.crank_joint), heard.stamp or received
        position = heard.positions[index]
        velocity = heard.velocities[index] if index < len(heard.velocities) else None
        if math.isfinite(position) and not self._has_state(position):
            raise self._rejected(OUT_OF_REACH)
        before = self.left_out.copy()
        found = self._motion.at(Measurement(stamp, position, velocity))
        if found is None:
            (cause,) = self.left_out - before
            raise ValueError(cause)
        # Near a limit of the crank, the rates of the links may overflow.
        for one in filter(None, (found, self._simulator.later(found))):
            if not self._has_state(one.q[0], one.u[0], one.a[0]):
                raise self._rejected(OUT_OF_REACH)
        self._last = time.monotonic()
        return stamp, found

    def _rejected(self, cause: str) -> ValueError:
        self.left_out[cause] += 1
        return ValueError(cause)

    def troubles(self, topic: str) -> list[str]:
        """Returns a warning if no measurement has been accepted for 2 s."""
        if time.monotonic() < self._last + _SILENCE:
            return []
        crank = self._simulator.crank_joint
        return [f'no measurement of {crank} on {topic} in the last {_SILENCE:g} s']

    def diagnostics(self) -> dict[str, str]:
        """Returns the counts of rejected messages, for diagnostics."""
        # Copy in one step, because the tick thread may add a count meanwhile.
        counts = list(self.left_out.items())
        return {f'left out, {cause}': str(count) for cause, count in counts}

    def _has_state(self, *motion: Real) -> bool:
        try:
            self._simulator.solver.state(*motion)
        except LinkageError:
            return False
        return True


def inputs_of(simulator: Simulator) -> dict[Topic, Any]:
    """Returns the topic received by a run, if any, with the reader of its messages."""
    drive = simulator.configuration.drive
    if isinstance(drive, TorqueDrive):
        return {JOINT_COMMANDS: TorqueCommands(drive, simulator.crank_joint)}
    if isinstance(drive, FollowDrive):
        return {MEASURED_JOINT_STATES: MeasuredCrank(simulator)}
    return {}
