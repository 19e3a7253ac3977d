# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Received torque commands: the last valid one is in force until it expires."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence

from linkage_ros.motion.drives import TorqueDrive
from linkage_ros.run.health import WINDOW
from linkage_ros.units import NS_PER_S
from linkage_ros.wire.cdr import decode_joint_state


class TorqueCommands:
    """The last valid command until it expires, and counts of all commands.

    One thread may receive commands while another reads the torque.

    Attributes:
        accepted: Number of accepted commands.
        limited: Number of accepted commands that were cut to the limit.
        refused: Number of refused commands.
        timeouts: Number of times that a command expired.
    """

    def __init__(
        self, drive: TorqueDrive, crank: str, clock: Callable[[], float] = time.monotonic
    ) -> None:
        """Begins without a command.

        Args:
            drive: Has the limit of commands, and the time after which they expire.
            crank: Name of the crank's joint.
            clock: Returns the time, s.
        """
        self.accepted = self.limited = self.refused = self.timeouts = 0
        self._limit, self._timeout = drive.torque_limit, drive.command_timeout
        self._crank, self._clock = crank, clock
        self._torque, self._end = 0.0, math.inf  # in force, N m, and until when, s
        self._is_active = False
        self._timed_out_at = -math.inf

    def read(self, data: bytes, received: int) -> None:
        """Takes a command.

        Args:
            data: CDR bytes of a JointState.
            received: Time of receipt, ns.

        Raises:
            ValueError: It is refused.
        """
        try:
            command = decode_joint_state(data)
            age = max(0, time.time_ns() - received) / NS_PER_S
            self.receive(command.names, command.efforts, age)
        except ValueError:
            self.refused += 1
            raise

    def receive(self, names: Sequence[str], efforts: Sequence[float], age: float) -> None:
        """Takes a command.

        Args:
            names: Names of joints.
            efforts: One for each of them, N m; the crank's is used.
            age: Time since its receipt, s.

        Raises:
            ValueError: It is no command for this crank.
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
        # First the end: a thread that reads both between them has the old torque a little longer.
        self._end = self._clock() + self._timeout - age
        self._torque = min(max(torque, -self._limit), self._limit)
        self._is_active = True

    def torque(self) -> float:
        """The torque in force, N m: 0 before the first command and after the timeout."""
        now = self._clock()
        if now <= self._end:
            return self._torque
        self.timeouts += self._is_active
        self._is_active, self._timed_out_at = False, now
        return 0.0

    def troubles(self, topic: str) -> list[str]:  # noqa: ARG002, the signature of all
        """A warning if no command was in force at a tick of the last seconds; else empty."""
        if self._clock() - self._timed_out_at >= WINDOW:
            return []
        return [f'no command within command_timeout: the motor drove alone in the last {WINDOW} s']

    def diagnostics(self) -> dict[str, str]:
        """The command in force and counts of all, for diagnostics."""
        return {
            'command, N m': f'{self._torque if self._clock() <= self._end else 0.0:.6g}',
            'commands taken': str(self.accepted),
            'commands cut to torque_limit': str(self.limited),
            'commands refused': str(self.refused),
            'command timeouts': str(self.timeouts),
        }
