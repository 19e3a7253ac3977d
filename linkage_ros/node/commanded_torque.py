# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The torques that controllers hold for a node, and when they must end.

A controller such as forward_command_controller repeats its last command for ever. Therefore a node
that commands efforts sends a zero when it ends, and when the measurements stop on which the torque
depends. A zero means no drive, not standstill.
"""

import math
import time
from collections.abc import Callable, Iterable, Mapping

from linkage_ros.log.records import TorqueEnd
from linkage_ros.run.robot import HeldEfforts
from linkage_ros.run.states import RowPart

# Causes of zeros.
MEASUREMENT_TIMEOUT, INVALID_MEASUREMENT = 'measurement_timeout', 'invalid measurement'
END_OF_MOTION = 'end of the motion'


class CommandedTorque(HeldEfforts):
    """Decides when the torques that others hold must end, and ends them.

    The thread of the ticks calls all methods; `end_for_good` is for other threads as well.
    """

    def __init__(
        self,
        names: Iterable[str],
        send_zeros: Callable[[TorqueEnd], object],
        timeout: float = 0.0,
    ) -> None:
        """Initializes without a torque.

        Args:
            names: Names of the linkages.
            send_zeros: Sends and logs the efforts, and with them a zero for the linkage of the end
                or, without a name, for all.
            timeout: Time after a command without a further one at which the torque ends, s; 0:
                never.
        """
        super().__init__(names)
        self._send_zeros, self._timeout = send_zeros, timeout or math.inf
        self._renewed = dict[str, float]()  # time of the last command, s, of each held torque
        self._last_cause = ''  # that of the motion's end

    def renew(self, parts: Mapping[str, RowPart]) -> None:
        """Holds the torques of a state, which were commanded now, by linkage."""
        self.hold(parts)
        self._renewed |= dict.fromkeys(parts, time.monotonic())
        if self._last_cause:  # a tick that hung has commanded a torque after the end
            self._end(self._last_cause)

    @property
    def seconds_left(self) -> float:
        """Time until a torque ends unless it is renewed, s; inf if none does."""
        return min(self._renewed.values(), default=math.inf) + self._timeout - time.monotonic()

    def end_if_due(self) -> None:
        """Ends the torques that were not renewed in time."""
        due = time.monotonic() - self._timeout
        late = [linkage for linkage, renewed in self._renewed.items() if renewed <= due]
        self.end(late, MEASUREMENT_TIMEOUT)

    def end(self, linkages: Iterable[str], cause: str) -> None:
        """Ends the torques of linkages that have one, until it is renewed."""
        for linkage in linkages:
            if self._renewed.pop(linkage, None) is not None:
                self.clear([linkage])
                self._send_zeros(TorqueEnd(time.time_ns(), cause, linkage))

    def end_for_good(self, cause: str) -> None:
        """Ends all torques with the motion, also if they have ended before: a zero may be lost."""
        if not self._last_cause:
            self._last_cause = cause
            self._end(cause)

    def _end(self, cause: str) -> None:
        self._renewed.clear()
        self.clear(self.efforts)
        self._send_zeros(TorqueEnd(time.time_ns(), cause))
