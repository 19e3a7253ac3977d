# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Forces of a run's loads that were set by messages, read from its log."""

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import TypeAlias

import numpy as np

from linkage_ros.log.reader import LoggedMessage, LogReader
from linkage_ros.motion.live_force import LiveForce, Vector
from linkage_ros.numeric import Array, Real
from linkage_ros.run.robot import Robot

# Forces of states, x and y, N, by name of the load: numbers, or an array each.
Forces: TypeAlias = Mapping[str, tuple[Real, Real]]


class LoggedForces:
    """The forces of live loads.

    A message acts from the state that follows it in the log until it expires.

    Attributes:
        is_live: Whether the run received forces.
    """

    def __init__(self, robot: Robot, log: LogReader) -> None:
        """Initializes without a message."""
        # The received forces of each load, by its channel, and by its linkage.
        self._loads, self._of = dict[int, _Heard](), dict[str, list[_Heard]]()
        for name, forces in robot.live_forces().items():
            self._of[name] = []
            for topic, source in forces.items():
                if channel := log.channel(topic):
                    self._loads[channel.number] = heard = _Heard(source)
                    self._of[name].append(heard)
        self.is_live = bool(self._loads)
        self._default: dict[str, Forces] = {
            name: dict(simulator.conditions.forces) for name, simulator in robot.simulators.items()
        }

    def handle(self, message: LoggedMessage, state: int) -> None:
        """Handles a message that is not part of a state; called in the order of writing.

        Args:
            message: The message.
            state: Number of the states before it.
        """
        if load := self._loads.get(message.channel):
            with suppress(ValueError):  # a rejected message
                load.add(state, load.source.read(message.data, message.time))

    def at(self, first: int, elapsed: Sequence[int]) -> dict[str, Forces]:
        """Returns the forces of all live loads in adjacent states, by linkage.

        Args:
            first: Number of the states before them, not less than in earlier calls.
            elapsed: Time of each state, ns.
        """
        forces = dict[str, Forces]()
        for linkage, default in self._default.items():
            received = {load.source.name: load.at(first, elapsed) for load in self._of[linkage]}
            forces[linkage] = {**default, **received}
        return forces


class _Heard:
    """The received forces of one load.

    Attributes:
        source: Reader of the messages.
    """

    def __init__(self, source: LiveForce) -> None:
        self.source = source
        # The state from which each force acts, that state's time, ns, if it is known, and the
        # force.
        self._states: list[int] = []
        self._times: list[int | None] = []
        self._forces: list[Vector] = []

    def add(self, state: int, force: Vector) -> None:
        """Adds a force that acts from a state on."""
        self._states.append(state)
        self._times.append(None)
        self._forces.append(force)

    def at(self, first: int, elapsed: Sequence[int]) -> tuple[Array, Array]:
        """Returns the forces in states; see `LoggedForces.at`."""
        self._forget_before(first)
        timing, forces = self.source.held, []
        for state, now in enumerate(elapsed, first):
            last = bisect_right(self._states, state) - 1  # the last force received so far
            if last < 0:
                forces.append(timing.default)
                continue
            if self._states[last] == state:
                self._times[last] = now
            begin = self._times[last]
            is_active = begin is not None and timing.acts(now - begin)
            forces.append(self._forces[last] if is_active else timing.default)
        x, y = np.array(forces).T
        return x, y

    def _forget_before(self, first: int) -> None:
        """Removes the forces that no state from `first` on can have."""
        past = bisect_right(self._states, first - 1) - 1
        if past > 0:
            for row in (self._states, self._times, self._forces):
                del row[:past]
