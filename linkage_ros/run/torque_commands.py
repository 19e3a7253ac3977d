# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Received torque commands: the last valid one is in force until it expires."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence


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
        self, limit: float, timeout: float, clock: Callable[[], float] = time.monotonic,
        crank: str = 'crank',
    ) -> None:  # fmt: skip
        """Begins without a command.

        Args:
            limit: Largest torque, N m.
            timeout: Time after which a command expires, s.
            clock: Returns the time, s.
            crank: Name of the crank's joint.
        """
        self.accepted = self.limited = self.refused = self.timeouts = 0
        self._limit, self._timeout, self._clock = limit, timeout, clock
        self._crank = crank
        self._last = 0.0, math.inf  # torque, and until when it counts
        self._is_active = False
        self._timed_out_at = -math.inf

    def receive(self, names: Sequence[str], efforts: Sequence[float], age: float) -> str:
        """Takes a command, or refuses it.

        Args:
            names: Names of joints.
            efforts: One for each of them, N m; the crank's is used.
            age: Time since its receipt, s.

        Returns:
            The reason for refusing it; empty: accepted.
        """
        if len(efforts) != len(names):
            wrong = f'{len(names)} names and {len(efforts)} efforts: must be one for each'
            return self.refuse(wrong)
        if list(names).count(self._crank) != 1:
            shown = ascii(', '.join(names))[1:-1] or 'nothing'
            return self.refuse(f'it names {shown:.80}: must name {self._crank} once')
        torque = float(efforts[list(names).index(self._crank)])
        if not math.isfinite(torque):
            return self.refuse(f'effort {torque}: must be a finite number, N m')
        self.accepted += 1
        self.limited += abs(torque) > self._limit
        torque = min(max(torque, -self._limit), self._limit)
        self._last = torque, self._clock() + self._timeout - age
        self._is_active = True
        return ''

    def refuse(self, wrong: str) -> str:
        """Counts a refused command; returns the reason."""
        self.refused += 1
        return wrong

    @property
    def timed_out(self) -> bool:
        """Returns whether the last command has expired."""
        return self._clock() > self._last[1]

    def timed_out_within(self, seconds: float) -> bool:
        """Returns whether a command had expired at a tick of the last seconds."""
        return self._clock() - self._timed_out_at < seconds

    def torque(self) -> float:
        """The torque in force, N m: 0 before the first command and after the timeout."""
        (torque, end), now = self._last, self._clock()
        if now <= end:
            return torque
        self.timeouts += self._is_active
        self._is_active, self._timed_out_at = False, now
        return 0.0

    def diagnostics(self) -> dict[str, str]:
        """Counts of the commands, for diagnostics."""
        return {
            'command, N m': f'{0.0 if self.timed_out else self._last[0]:.6g}',
            'commands taken': str(self.accepted),
            'commands cut to torque_limit': str(self.limited),
            'commands refused': str(self.refused),
            'command timeouts': str(self.timeouts),
        }
