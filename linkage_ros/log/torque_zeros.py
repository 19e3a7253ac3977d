# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Checks the zeros with which a run ended torques that it had commanded."""

from collections.abc import Collection

from linkage_ros.log.reader import LoggedMessage, LogReader
from linkage_ros.log.records import TorqueEnd
from linkage_ros.log.rows import RowLayout
from linkage_ros.messages.cdr import decode_trajectory
from linkage_ros.messages.templates import encode_efforts, holding_trajectory
from linkage_ros.messages.topics import EFFORT_COMMANDS, TRAJECTORY_COMMANDS
from linkage_ros.run.robot import HeldEfforts, Robot


class TorqueZeros:
    """Checks that each record of the end of a torque has its zeros.

    On the topic of efforts, a message that is not part of a state is such a zero. It repeats the
    last efforts of the linkages whose torques continue.
    """

    def __init__(self, robot: Robot, log: LogReader) -> None:
        """Initializes before the first message."""
        self._robot, self._names = robot, robot.names
        self._efforts = log.channel(EFFORT_COMMANDS)
        channels = self._efforts, log.channel(TRAJECTORY_COMMANDS)
        # The ends whose zeros have not been read yet, by channel and log time, ns.
        self._due = dict[tuple[int, int], list[TorqueEnd]]()
        for channel in filter(None, channels):
            for end in log.torque_ends:
                self._due.setdefault((channel.number, end.stamp), []).append(end)
        self._last = HeldEfforts(self._names)  # in the log

    def take(self, layout: RowLayout, rows: bytes) -> None:
        """Takes the logged efforts of states, of which there is at least one."""
        if not self._efforts or self._efforts.number not in layout.channels:
            return
        start = layout.starts[layout.channels.index(self._efforts.number)]
        places = [x for x in layout.places if x.offset > start and x.code == 'd']
        values = [float(layout.column(rows, place)[-1]) for place in places]
        self._last.efforts = dict(zip(self._names, values, strict=False))

    def end_at(self, message: LoggedMessage) -> Collection[str]:
        """Returns the linkages whose torques a message ends; empty if it ends none."""
        ends = self._due and self._due.get((message.channel, message.time))
        if not ends:
            return ()
        return (ends[0].linkage,) if ends[0].linkage else self._names

    def check(self, message: LoggedMessage) -> str:
        """Checks a message that ends torques; returns a description of its error, or ''."""
        place = message.channel, message.time
        self._last.clear(self.end_at(message))
        self._due[place].pop(0)
        if not self._due[place]:
            del self._due[place]
        if message.data == self._zero_like(message):
            return ''
        return (
            f'{message.topic}: the message logged at {message.time} ns is not a torque of 0, '
            'though a record says so'
        )

    def _zero_like(self, message: LoggedMessage) -> bytes:
        """Returns the zero that a message must be; it may hold any positions."""
        if self._efforts and message.channel == self._efforts.number:
            return encode_efforts([*self._last.efforts.values()])
        simulators = self._robot.simulators.values()
        try:
            _, _, points = decode_trajectory(message.data)
            positions = points[0].positions
            joints = [simulator.crank_joint for simulator in simulators]
            frame_id = self._robot.configuration.session.frame_id
            return holding_trajectory(dict(zip(joints, positions, strict=True)), frame_id)
        except (ValueError, IndexError):
            return b''

    def missing(self) -> str:
        """Describes the first missing zero; returns '' if none is missing."""
        times = sorted(time for _, time in self._due)
        return f'the torque of 0 recorded at {times[0]} ns is not in the log' if times else ''
