# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the states of a torque-driven log should have been, from what the log says of them.

The coordinates with their rates and accelerations are taken from mechanism_state: the motion of
all links and the torque, tau = M q'' + h - Q, must be theirs to the bit, and each state must
follow from the one before it under the torque that was logged there.
"""

from __future__ import annotations

import math

import numpy as np

from linkage_ros.errors import LinkageError, LogError
from linkage_ros.motion.coordinates import Coordinates
from linkage_ros.motion.driven_mechanism import DrivenMechanism
from linkage_ros.motion.drives import TorqueDrive
from linkage_ros.motion.integrators import live_steps
from linkage_ros.motion.torque_driven import CATCH_UP, start
from linkage_ros.numeric import Real, with_turns, within_two_turns
from linkage_ros.run.simulator import Simulator
from linkage_ros.units import NS_PER_S
from linkage_ros.wire.rows import RowLayout

# How far a state may be from where the one before leads: rad and crank lengths, and of rates the
# same per second or the rate itself. Records and live runs integrate in different ways.
_APART = 1e-7
# Longest time, s, over which that is asked: to follow a motion takes time too.
_LONGEST = 10.0


class TorqueCheck:
    """Recomputes the states of one torque-driven log."""

    def __init__(
        self, simulator: Simulator, drive: TorqueDrive, layout: RowLayout, *, recorded: bool
    ) -> None:
        """Prepares it.

        Args:
            simulator: Machine of the logged configuration.
            drive: Its drive.
            layout: Layout of the logged rows.
            recorded: Whether nothing but the motor can have driven the mechanism.

        Raises:
            LogError: The rows have no accelerations.
        """
        self._simulator, self._drive, self._recorded = simulator, drive, recorded
        self._layout = layout
        places = {place.name: place for place in layout.places}
        # The crank and a free slider.
        joints = [simulator.joints[i] for i in (0, -1)[: len(simulator.solver.coordinates)]]
        words = ('positions', 'velocities', 'accelerations')
        try:
            self._places = [[places[f'points[0].{w}[{j}]'] for j in joints] for w in words]
        except KeyError:
            raise LogError(
                'a torque-driven log without mechanism_state cannot be verified: its states have '
                'no accelerations; log that topic'
            ) from None
        self._effort = places[f'points[0].effort[{joints[0]}]']
        self._command = 0.0  # torque beyond the motor's, N m
        self._driven = DrivenMechanism(simulator.solver, self._torque)
        # Tick, coordinates, torque beyond the motor's of the state before; the first one follows
        # from the start.
        self._before = 0, start(simulator.solver.mechanism, drive), 0.0

    def coordinates(self, rows: bytes) -> Coordinates:
        """The coordinates that mechanism_state contains, in arrays.

        Raises:
            LogError: One is not a finite number.
        """
        q, u, a = (
            tuple(self._layout.column(rows, place).copy() for place in places)
            for places in self._places
        )
        if not np.isfinite([*q, *u, *a]).all():
            raise LogError('has a mechanism_state that is not finite')
        angle = np.array([within_two_turns(x)[0] for x in q[0].tolist()])
        return Coordinates((angle, *q[1:]), u, a, q[0])

    def follow(self, tick: int, rows: bytes) -> tuple[int, str]:
        """Goes on behind states whose messages are right.

        Args:
            tick: Number of the first one; the others are of the next ticks.
            rows: Their bytes.

        Returns:
            How many follow from the state before them, and why the next one does not.
        """
        *rows_of, unwrapped = self.coordinates(rows)
        torques = self._layout.column(rows, self._effort).tolist()
        for i, torque in enumerate(torques):
            q, u, a = (tuple(column[i].item() for column in row) for row in rows_of)
            found = Coordinates(q, u, a, unwrapped[i].item())
            if wrong := self._follow(tick + i, found, torque):
                return i, wrong
        return len(torques), ''

    def _follow(self, tick: int, found: Coordinates, torque: float) -> str:
        line = self._drive.motor.at(found.u[0])
        before, self._before = self._before, (tick, found, torque - line)
        if self._recorded and abs(torque - line) > _APART * max(abs(torque), 1e-6):
            return f'has the torque {torque:.9g} N m, the motor line gives {line:.9g}'
        past, origin, self._command = before
        return self._difference(past, origin, tick, found)

    def _torque(self, speed: float) -> Real:
        return self._drive.motor.at(speed) + self._command

    def _difference(self, past: int, origin: Coordinates, tick: int, found: Coordinates) -> str:
        """How far a state is from where the one before it leads, in words."""
        late = self._simulator.elapsed(tick) - self._simulator.elapsed(past)
        stood_still = not self._recorded and late > self._simulator.elapsed(1) + CATCH_UP
        elapsed = 0.0 if stood_still else late / NS_PER_S
        if elapsed > _LONGEST:
            return ''
        try:
            steps = live_steps(self._driven, (*origin.q, *origin.u))
            steps.advance(elapsed)
        except LinkageError as error:
            return f'does not follow from the one before: {error}'
        due = (with_turns(steps.phase[0], steps.pairs), *steps.phase[1:])
        turned = found.unwrapped - (origin.unwrapped - origin.q[0])
        values = (turned, *found.q[1:], *found.u)
        count = len(found.q)
        units = self._driven.units[:count]
        sizes = (*units, *map(max, units, map(abs, due[count:])))
        names = [
            f'{n} {w}' for w in ('position', 'speed') for n in self._simulator.solver.coordinates
        ]
        for name, value, expected, size in zip(names, values, due, sizes, strict=True):
            if not abs(value - expected) <= _APART * size + 4 * math.ulp(found.unwrapped):
                return (
                    f'does not follow from the one before: {name} {value:.9g}, that one leads to '
                    f'{expected:.9g}'
                )
        return ''
