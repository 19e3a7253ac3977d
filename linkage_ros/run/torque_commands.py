# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Torque commands as they come from elsewhere: the last good one counts, for a while."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence


class TorqueCommands:
    """What was commanded, and what became of it.

    One thread may hear commands while another asks for the torque.

    Attributes:
        taken: Commands that were followed.
        cut: Of these, those that were cut to the limit.
        refused: Commands that were not.
        ended: How often commands stopped coming for longer than the timeout.
    """

    def __init__(
        self, limit: float, timeout: float, clock: Callable[[], float] = time.monotonic,
        crank: str = 'crank',
    ) -> None:  # fmt: skip
        """Begins without a command.

        Args:
            limit: Largest torque, N m.
            timeout: After which a command counts no more, s.
            clock: Tells the time, s.
            crank: Name of the crank's joint.
        """
        self.taken = self.cut = self.refused = self.ended = 0
        self._limit, self._timeout, self._clock = limit, timeout, clock
        self._crank = crank
        self._last: tuple[float, float] | None = None  # torque, and until when it counts
        self._counts = False
        self._silent_at = -math.inf

    def hear(self, names: Sequence[str], efforts: Sequence[float], age: float) -> str:
        """Takes a command, or refuses it.

        Args:
            names: Of joints.
            efforts: One for each of them, N m; the crank's counts.
            age: How long ago it came, s.

        Returns:
            Why it is refused; empty: it is taken.
        """
        wrong = ''
        if len(efforts) != len(names):
            wrong = f'{len(names)} names and {len(efforts)} efforts: must be one for each'
        elif list(names).count(self._crank) != 1:
            shown = ascii(', '.join(names))[1:-1] or 'nothing'
            wrong = f'it names {shown:.80}: must name {self._crank} once'
        else:
            torque = float(efforts[list(names).index(self._crank)])
            if not math.isfinite(torque):
                wrong = f'effort {torque}: must be a finite number, N m'
        if wrong:
            return self.refuse(wrong)
        if abs(torque) > self._limit:
            self.cut += 1
            torque = math.copysign(self._limit, torque)
        self.taken += 1
        self._last = torque, self._clock() + self._timeout - age
        self._counts = True
        return ''

    def refuse(self, wrong: str) -> str:
        """Counts a command that is not followed; returns why, as it was given."""
        self.refused += 1
        return wrong

    @property
    def timed_out(self) -> bool:
        """Whether commands came, and come no more."""
        return self._last is not None and self._clock() > self._last[1]

    def silent_within(self, seconds: float) -> bool:
        """Whether a tick of the last seconds had no command any more."""
        return self._clock() - self._silent_at < seconds

    def torque(self) -> float:
        """The torque that counts now, N m: 0 before the first command and after the timeout."""
        last, now = self._last, self._clock()
        if last and now <= last[1]:
            return last[0]
        if last:
            self._silent_at = now
        self.ended += self._counts
        self._counts = False
        return 0.0

    def figures(self) -> dict[str, str]:
        """What became of the commands, for diagnostics."""
        return {
            'command, N m': f'{0.0 if self.timed_out or not self._last else self._last[0]:.6g}',
            'commands taken': str(self.taken),
            'commands cut to torque_limit': str(self.cut),
            'commands refused': str(self.refused),
            'command timeouts': str(self.ended),
        }
