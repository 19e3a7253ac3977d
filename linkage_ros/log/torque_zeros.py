# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Checks the zeros with which a run ended the torque that it had commanded."""

from linkage_ros.log.reader import LoggedMessage, LogReader
from linkage_ros.messages.cdr import decode_trajectory
from linkage_ros.messages.templates import ZERO_EFFORT, holding_trajectory
from linkage_ros.messages.topics import EFFORT_COMMANDS, TRAJECTORY_COMMANDS
from linkage_ros.run.states import Simulator


class TorqueZeros:
    """Checks that each record of the end of a torque has its zeros.

    On the topic of efforts, a message that is not part of a state is such a zero.
    """

    def __init__(self, simulator: Simulator, log: LogReader) -> None:
        """Initializes before the first message.

        Args:
            simulator: Simulator of the logged configuration.
            log: The log.
        """
        self._names = simulator.crank_joint, simulator.configuration.session.frame_id
        self._efforts = log.channel(EFFORT_COMMANDS)
        channels = self._efforts, log.channel(TRAJECTORY_COMMANDS)
        # Channel and log time, ns, of the zeros that are still to come.
        self._due = {
            (channel.number, end.stamp)
            for channel in channels if channel
            for end in log.torque_ends
        }  # fmt: skip

    def check(self, message: LoggedMessage) -> str:
        """Checks a message that is not part of a state; describes its error, or returns ''."""
        place = message.channel, message.time
        if place not in self._due:
            return ''
        self._due.remove(place)
        if message.data == self._zero_like(message):
            return ''
        return (
            f'{message.topic}: the message logged at {message.time} ns is not a torque of 0, '
            'though a record says so'
        )

    def _zero_like(self, message: LoggedMessage) -> bytes:
        """Returns the zero that a message must be; it may hold any position."""
        if self._efforts and message.channel == self._efforts.number:
            return ZERO_EFFORT
        try:
            _, _, points = decode_trajectory(message.data)
            return holding_trajectory(*self._names, points[0].positions[0])
        except (ValueError, IndexError):
            return b''

    def missing(self) -> str:
        """Describes the first zero that did not come; returns '' if all came."""
        times = sorted(time for _, time in self._due)
        return f'the torque of 0 recorded at {times[0]} ns is not in the log' if times else ''
