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
from linkage_ros.run.states import Simulator

# Forces of states, x and y, N, by name of the load: numbers, or an array each.
Forces: TypeAlias = Mapping[str, tuple[Real, Real]]


class LoggedForces:
    """The forces of live loads.

    A message acts from the state that follows it in the log until it expires.

    Attributes:
        is_live: Whether the run received forces.
    """

    def __init__(self, simulator: Simulator, log: LogReader) -> None:
        """Initializes without a message.

        Args:
            simulator: Simulator of the logged configuration.
            log: The log.
        """
        channels = [(log.channel(topic), x) for topic, x in simulator.live_forces().items()]
        self._loads = {
            channel.number: _Heard(source) for channel, source in channels if channel is not None
        }
        self.is_live = bool(self._loads)
        self._default: dict[str, tuple[Real, Real]] = dict(simulator.conditions.forces)

    def handle(self, message: LoggedMessage, state: int) -> None:
        """Handles a message that is not part of a state; called in the order of writing.

        Args:
            message: The message.
            state: Number of the states before it.
        """
        if load := self._loads.get(message.channel):
            with suppress(ValueError):  # a rejected message
                load.add(state, load.source.read(message.data, message.time))

    def at(self, first: int, elapsed: Sequence[int]) -> Forces:
        """Returns the forces of all live loads in adjacent states.

        Args:
            first: Number of the states before them, not less than in earlier calls.
            elapsed: Time of each state, ns.
        """
        heard = {load.source.name: load.at(first, elapsed) for load in self._loads.values()}
        return {**self._default, **heard}


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
        if past := bisect_right(self._states, first - 1) - 1:
            for row in (self._states, self._times, self._forces):
                del row[: max(past, 0)]
        held, found = self.source.held, []
        for i, now in enumerate(elapsed):
            last = bisect_right(self._states, first + i) - 1
            if last >= 0 and self._states[last] == first + i:
                self._times[last] = now
            begin = self._times[last] if last >= 0 else None
            is_active = begin is not None and held.acts(now - begin)
            found.append(self._forces[last] if is_active else held.default)
        x, y = np.array(found).T
        return x, y
