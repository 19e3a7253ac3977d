# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Who holds the torque that a node commands, and when it must end.

A controller such as forward_command_controller repeats its last command for ever. Therefore a node
that commands efforts sends a zero when it ends, and when the measurements stop on which the torque
depends. A zero means no drive, not standstill.
"""

import math
import time
from collections.abc import Callable

from linkage_ros.log.records import TorqueEnd

MEASUREMENT_TIMEOUT = 'measurement_timeout'  # cause of a zero


class CommandedTorque:
    """Decides when the torque that others hold must end, and ends it.

    The thread of the ticks calls all methods except `end_for_good`.
    """

    def __init__(self, send_zeros: Callable[[TorqueEnd], object], timeout: float = 0.0) -> None:
        """Initializes without a torque.

        Args:
            send_zeros: Sends and logs a zero on each topic of commands.
            timeout: Time after a command without a further one at which the torque ends, s; 0:
                never.
        """
        self._send_zeros, self._timeout = send_zeros, timeout or math.inf
        self._is_held, self._renewed = False, -math.inf
        self._last_cause = ''  # that of the node's end

    def renew(self) -> None:
        """Notes that a torque was commanded now."""
        self._is_held, self._renewed = True, time.monotonic()
        if self._last_cause:  # a tick that hung has commanded a torque after the end
            self._end(self._last_cause)

    @property
    def seconds_left(self) -> float:
        """Time until the torque ends unless it is renewed, s; inf if it does not."""
        return self._renewed + self._timeout - time.monotonic() if self._is_held else math.inf

    def end_if_due(self) -> None:
        """Ends the torque if it was not renewed in time."""
        if self.seconds_left <= 0.0:
            self._end(MEASUREMENT_TIMEOUT)

    def end_for_good(self, cause: str) -> None:
        """Ends the torque with the node, also if it has ended before: the zero may be lost."""
        self._last_cause = cause
        self._end(cause)

    def _end(self, cause: str) -> None:
        self._is_held = False
        self._send_zeros(TorqueEnd(time.time_ns(), cause))
