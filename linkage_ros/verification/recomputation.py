# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the messages of a state should have been, from what the log says of it.

At a given speed the stamp alone tells. Under a torque the coordinates with their rates and
accelerations are taken from mechanism_state: the motion of all links and the torque,
tau = M q'' + h - Q, must be theirs to the bit, and the state must follow from the one before it
under the torque that was logged there.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from linkage_ros.errors import LinkageError, LogError
from linkage_ros.motion.coordinates import Coordinates
from linkage_ros.motion.driven_mechanism import DrivenMechanism
from linkage_ros.motion.drives import Motor, TorqueDrive
from linkage_ros.motion.fixed_step_integrator import FixedSteps
from linkage_ros.motion.segments import Segment, SpeedSegment
from linkage_ros.motion.speed_driven import SpeedMotion
from linkage_ros.motion.torque_driven import CATCH_UP, start
from linkage_ros.numeric import with_turns, within_two_turns
from linkage_ros.run.simulator import Simulator, Snapshot
from linkage_ros.units import NS_PER_S
from linkage_ros.wire.topics import MECHANISM_STATE, Topic

# How far a state may be from where the one before leads: rad and crank lengths, and of rates the
# same per second or the rate itself. Records and live runs integrate in different ways.
_APART = 1e-7
# Longest time, s, over which that is asked: to follow a motion takes time too.
_LONGEST = 10.0


class Recomputation:
    """Recomputes the states of one log."""

    def __init__(self, simulator: Simulator, topics: Sequence[Topic], *, recorded: bool) -> None:
        """Prepares it.

        Args:
            simulator: Simulator of the logged configuration.
            topics: Those of the simulator that the log has, in its order.
            recorded: Whether nothing but the motor can have driven the mechanism.

        Raises:
            LogError: The log does not tell what is needed.
        """
        self._simulator, self._recorded = simulator, recorded
        self._places = [simulator.topics.index(topic) for topic in topics]
        drive = simulator.configuration.drive
        self._drive = drive if isinstance(drive, TorqueDrive) else None
        self._told = topics.index(MECHANISM_STATE) if MECHANISM_STATE in topics else None
        if self._drive and self._told is None:
            raise LogError(
                'a torque-driven log without mechanism_state cannot be verified: its states have '
                'no accelerations; log that topic'
            )
        # Tick, coordinates, torque beyond the motor's of the state before; the first one follows
        # from the start.
        self._before: tuple[int, Coordinates, float] | None = None
        if self._drive:
            self._before = 0, start(simulator.solver.mechanism, self._drive), 0.0
        self._motion: SpeedMotion | None = None

    def messages_at(self, segment: Segment, stamp: int, logged: Sequence[bytes]) -> list[bytes]:
        """The messages that belong to a stamp.

        Args:
            segment: That of the stamp.
            stamp: ns.
            logged: Messages of the state, as many as the log has.

        Returns:
            As many recomputed ones.

        Raises:
            LinkageError: What is logged describes no state.
        """
        snapshot = self._snapshot(segment, stamp, logged)
        return [snapshot.messages[place] for place in self._places[: len(logged)]]

    def _snapshot(self, segment: Segment, stamp: int, logged: Sequence[bytes]) -> Snapshot:
        if isinstance(segment, SpeedSegment):
            if self._motion is None or self._motion.segment is not segment:
                self._motion = SpeedMotion(segment)
            return self._simulator.snapshot_at(self._motion, stamp)
        if self._told is None or self._told >= len(logged):
            raise LogError('has no mechanism_state')
        return self._simulator.snapshot_of(stamp, self._read(logged[self._told])[0])

    def _read(self, data: bytes) -> tuple[Coordinates, float]:
        """The coordinates and the torque, N m, that a mechanism_state tells.

        Raises:
            LogError: It tells none.
        """
        try:
            _, values = self._simulator.mechanism_state.decode(data)
        except ValueError as error:
            raise LogError(f'has a mechanism_state that is {error}') from error
        count = len(self._simulator.joints)
        *rows, effort = (values[i * count :][:count] for i in range(4))
        columns = (0, -1)[: len(self._simulator.solver.coordinates)]  # the crank and a free slider
        q, u, a = (tuple(row[i] for i in columns) for row in rows)
        angle, _ = within_two_turns(q[0])
        return Coordinates((angle, *q[1:]), u, a, q[0]), effort[0]

    def follow(self, tick: int, logged: Sequence[bytes]) -> str:
        """Goes on to a state whose messages are right.

        Args:
            tick: Its number.
            logged: Its messages.

        Returns:
            Why it does not follow from the state before it; empty if it does.
        """
        if not self._drive or self._told is None or self._told >= len(logged):
            return ''
        found, torque = self._read(logged[self._told])
        line = self._drive.motor.at(found.u[0])
        before, self._before = self._before, (tick, found, torque - line)
        if self._recorded and abs(torque - line) > _APART * max(abs(torque), 1e-6):
            return f'has the torque {torque:.9g} N m, the motor line gives {line:.9g}'
        return '' if before is None else self._difference(self._drive.motor, *before, tick, found)

    def _difference(
        self,
        motor: Motor,
        past: int,
        origin: Coordinates,
        command: float,
        tick: int,
        found: Coordinates,
    ) -> str:
        """How far a state is from where the one before it leads, in words."""
        late = self._simulator.elapsed(tick) - self._simulator.elapsed(past)
        stood_still = not self._recorded and late > self._simulator.elapsed(1) + CATCH_UP
        elapsed = 0.0 if stood_still else late / NS_PER_S
        if elapsed > _LONGEST:
            return ''
        solver = self._simulator.solver
        driven = DrivenMechanism(solver, lambda _, speed: motor.at(speed) + command)
        try:
            steps = FixedSteps(driven, (*origin.q, *origin.u))
            steps.advance(elapsed)
        except LinkageError as error:
            return f'does not follow from the one before: {error}'
        due = (with_turns(steps.phase[0], steps.pairs), *steps.phase[1:])
        turned = found.unwrapped - (origin.unwrapped - origin.q[0])
        values = (turned, *found.q[1:], *found.u)
        count = len(found.q)
        units = driven.units[:count]
        sizes = (*units, *map(max, units, map(abs, due[count:])))
        names = [f'{n} {w}' for w in ('position', 'speed') for n in solver.coordinates]
        for name, value, expected, size in zip(names, values, due, sizes, strict=True):
            if not abs(value - expected) <= _APART * size + 4 * math.ulp(found.unwrapped):
                return (
                    f'does not follow from the one before: {name} {value:.9g}, that one leads to '
                    f'{expected:.9g}'
                )
        return ''
