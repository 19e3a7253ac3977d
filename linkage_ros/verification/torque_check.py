# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the states of a torque-driven log should have been, from what the log says of them.

The coordinates with their rates and accelerations are taken from mechanism_state: the motion of
all links and the torque, tau = M q'' + h - Q, must be theirs to the bit, and each state must
follow from the one before it under the torque that was logged there.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import numpy.typing as npt

from linkage_ros.errors import LinkageError, LogError
from linkage_ros.motion.coordinates import Coordinates
from linkage_ros.motion.driven_mechanism import DrivenMechanism
from linkage_ros.motion.drives import TorqueDrive
from linkage_ros.motion.fixed_step_integrator import leap
from linkage_ros.motion.integrators import live_steps
from linkage_ros.motion.torque_driven import CATCH_UP, start
from linkage_ros.numeric import Array, Real, with_turns, within_two_turns
from linkage_ros.run.simulator import Simulator
from linkage_ros.units import NS_PER_S
from linkage_ros.wire.rows import RowLayout

# How far a state may be from where the one before leads: rad and crank lengths, and of rates the
# same per second or the rate itself. Records and live runs integrate in different ways.
_APART = 1e-7
# Longest time, s, over which that is asked: to follow a motion takes time too.
_LONGEST = 10.0
_LEAPS = (1, 4)  # steps between two states that are tried for all states at a time


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
        self._simulator, self._motor, self._recorded = simulator, drive.motor, recorded
        self._solver, self._layout = simulator.solver, layout
        places = {place.name: place for place in layout.places}
        # The crank and a free slider.
        joints = [simulator.joints[i] for i in (0, -1)[: len(self._solver.coordinates)]]
        words = ('positions', 'velocities', 'accelerations')
        try:
            self._places = [[places[f'points[0].{w}[{j}]'] for j in joints] for w in words]
        except KeyError:
            raise LogError(
                'a torque-driven log without mechanism_state cannot be verified: its states have '
                'no accelerations; log that topic'
            ) from None
        self._effort = places[f'points[0].effort[{joints[0]}]']
        # The state before: coordinates, rates, the crank as it is logged, the torque beyond the
        # motor's. The first one follows from the start.
        begin, self._tick = start(self._solver.mechanism, drive), 0
        self._before = np.array([*begin.q, *begin.u, begin.unwrapped, 0.0])[:, None]
        self._command: Real = 0.0  # torque beyond the motor's, N m; or an array
        self._driven = DrivenMechanism(self._solver, self._torque)

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

    def follow(self, ticks: list[int], rows: bytes) -> tuple[int, str]:
        """Goes on behind states whose messages are right.

        Args:
            ticks: Their numbers.
            rows: Their bytes.

        Returns:
            How many follow from the state before them, and why the next one does not.
        """
        q, u, _, unwrapped = self.coordinates(rows)
        torques = self._layout.column(rows, self._effort)
        lines = self._motor.at(u[0])
        found = np.array([*q, *u, unwrapped, torques - lines])
        origin = np.concatenate([self._before, found[:, :-1]], axis=1)
        times = [self._simulator.elapsed(tick) for tick in (self._tick, *ticks)]
        late = np.array([after - before for before, after in pairwise(times)], float)
        if not self._recorded:  # for that time the plant stood still
            late[late > self._simulator.elapsed(1) + CATCH_UP] = 0
        spans = late / NS_PER_S
        foreign = abs(torques - lines) > _APART * np.maximum(abs(torques), 1e-6)
        foreign &= self._recorded
        doubtful = foreign | ~self._lead_to(origin, found, spans)
        for i in map(int, np.flatnonzero(doubtful)):
            if foreign[i]:
                given = f'the motor line gives {lines[i]:.9g}'
                return i, f'has the torque {torques[i]:.9g} N m, {given}'
            one = slice(i, i + 1)
            if wrong := self._difference(origin[:, one], found[:, one], float(spans[i])):
                return i, f'does not follow from the one before: {wrong}'
        self._tick, self._before = ticks[-1], found[:, -1:]
        return len(ticks), ''

    def _lead_to(self, origin: Array, found: Array, spans: Array) -> npt.NDArray[np.bool_]:
        """Which states certainly follow from those before them: by few steps of all at a time."""
        follows, size = np.zeros(len(spans), bool), 2 * len(self._solver.coordinates)
        for steps in _LEAPS:
            left = np.flatnonzero(~follows)
            phase, self._command = tuple(origin[:size, left]), origin[-1, left]
            good = spans[left] <= _LONGEST
            try:
                with np.errstate(all='ignore'):  # where the steps are too long
                    for _ in range(steps):
                        phase, errors = leap(
                            self._slope, self._driven.units, phase, spans[left] / steps
                        )
                        good &= np.max(errors, axis=0) <= _APART / 10
            except LinkageError:  # of one of them; they are looked at one by one
                return follows
            off, _ = self._off(origin[:, left], found[:, left], np.array(phase))
            follows[left] = good & ~off.any(axis=0)
        return follows

    def _slope(self, y: tuple[Array, ...]) -> tuple[Array, ...]:
        q, u = y[: len(y) // 2], y[len(y) // 2 :]
        return *u, *self._solver.accelerations(q, u, self._torque(u[0]))

    def _torque(self, speed: Real) -> Real:
        return self._motor.at(speed) + self._command

    def _off(self, origin: Array, found: Array, due: Array) -> tuple[npt.NDArray[np.bool_], Array]:
        """Which coordinates and rates are off, and what they are where pairs of turns count.

        Args:
            origin: States before; see `_before`.
            found: States.
            due: The coordinates and rates to which the states before them lead.
        """
        count, units = len(due) // 2, np.array(self._driven.units)[:, None]
        values = found[: 2 * count].copy()
        values[0] = found[-2] - (origin[-2] - origin[0])
        sizes = np.maximum(units, abs(due))
        sizes[:count] = units[:count]
        most = _APART * sizes + 4 * np.spacing(abs(found[-2]))
        return ~(abs(values - due) <= most), values

    def _difference(self, origin: Array, found: Array, span: float) -> str:
        """How far a state is from where the one before it leads, in words."""
        if span > _LONGEST:
            return ''
        size, self._command = 2 * len(self._solver.coordinates), float(origin[-1, 0])
        try:
            steps = live_steps(self._driven, tuple(origin[:size, 0].tolist()))
            steps.advance(span)
        except LinkageError as error:
            return str(error)
        due = np.array([with_turns(steps.phase[0], steps.pairs), *steps.phase[1:]])[:, None]
        off, values = self._off(origin, found, due)
        names = [f'{n} {w}' for w in ('position', 'speed') for n in self._solver.coordinates]
        rows = zip(names, values[:, 0], due[:, 0], off[:, 0], strict=True)
        wrong = (f'{n} {v:.9g}, that one leads to {d:.9g}' for n, v, d, is_off in rows if is_off)
        return next(wrong, '')
