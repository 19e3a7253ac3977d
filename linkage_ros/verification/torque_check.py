# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Recomputes the states of a torque-driven log from its accelerations and commands.

The coordinates with their rates and accelerations are taken from mechanism_state: the motion of
all links and the torque, tau = M q'' + h - Q, must be theirs to the bit, and each state must
follow from the one before it under the torque that was logged there.
"""

from __future__ import annotations

import functools
from dataclasses import replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from linkage_ros.errors import LinkageError, LogError
from linkage_ros.model.parts import CROSSED, OPEN
from linkage_ros.motion.coordinates import Coordinates
from linkage_ros.motion.driven_mechanism import DrivenMechanism, turns_between
from linkage_ros.motion.drives import TorqueDrive
from linkage_ros.motion.fixed_step_integrator import FixedSteps, leap
from linkage_ros.motion.integrators import live_method
from linkage_ros.motion.published import own_coordinates
from linkage_ros.motion.segments import TorqueSegment
from linkage_ros.motion.torque_driven import CATCH_UP, start
from linkage_ros.numeric import Array, Real, with_turns, within_two_turns, wrap
from linkage_ros.run.simulator import Simulator
from linkage_ros.units import NS_PER_S
from linkage_ros.wire.rows import RowLayout

# How far a state may be from where the one before leads: rad and crank lengths, and of rates the
# same per second or the rate itself. Records and live runs integrate in different ways.
_APART = 1e-7
# Longest time, s, over which that is asked: to follow a motion takes time too.
_LONGEST = 10.0
# Of the steps with which a state that is off is followed again.
_TOLERANCE, _TRIALS = 1e-11, 10_000
# In rad and crank lengths, and per second: no fault is what a start so far away makes.
_NUDGE = 1e-9
_LEAPS = (1, 4)  # steps between two states that are tried for all states at a time


class TorqueCheck:
    """Recomputes the states of one torque-driven log."""

    def __init__(
        self, simulator: Simulator, drive: TorqueDrive, layout: RowLayout, *, recorded: bool
    ) -> None:
        """Prepares the check.

        Args:
            simulator: Simulator of the logged configuration.
            drive: Drive of the configuration.
            layout: Layout of the logged rows.
            recorded: Whether it is a record, in which only the motor drove the mechanism.

        Raises:
            LogError: The rows have no accelerations.
        """
        self._simulator, self._motor, self._recorded = simulator, drive.motor, recorded
        self._layout, solver = layout, simulator.solver
        places = {place.name: place for place in layout.places}
        words = ('positions', 'velocities', 'accelerations')
        try:
            self._places = {
                link: [places[f'points[0].{word}[{joint}]'] for word in words]
                for link, joint in zip(solver.links, simulator.joints, strict=True)
            }
        except KeyError:
            raise LogError(
                'a torque-driven log without mechanism_state cannot be verified: its states have '
                'no accelerations; log that topic'
            ) from None
        self._effort = places[f'points[0].effort[{simulator.joints[0]}]']
        self._own = self._last = DrivenMechanism(solver, self._torque)
        # The state before: coordinates, rates, the crank as it is logged, the torque beyond the
        # motor's. The first one follows from the start.
        begin, self._tick = start(solver.mechanism, drive), 0
        self._before = np.array([*begin.q, *begin.u, begin.unwrapped, 0.0])[:, None]
        self._command: Real = 0.0  # torque beyond the motor's, N m; or an array

    def coordinates(self, segment: TorqueSegment, rows: bytes) -> Coordinates:
        """Reads coordinates, rates and accelerations from mechanism_state, as arrays.

        Raises:
            LogError: One is not a finite number, or the mechanism has no such coordinates.
        """
        driven = self._driven(segment)
        solver, names = driven.solver, self._own.solver.coordinates
        (*values, unwrapped), count = self._read(driven, rows), len(names)
        q, u = tuple(values[:count]), tuple(values[count:])
        if solver.coordinates != names:
            torques = self._layout.column(rows, self._effort)
            state = solver.driven_state(q, u, torques, by_math=True)
            if not driven.has_crank:
                pairs = zip(state.position[0].tolist(), unwrapped.tolist(), strict=True)
                unwrapped = np.array([with_turns(x, turns_between(x, y)) for x, y in pairs])
            return own_coordinates(solver, state, unwrapped)
        a = tuple(self._column(rows, name, 2) for name in names)
        given = solver.state(q, u, a, by_math=True) if solver is not self._own.solver else None
        return Coordinates(q, u, a, unwrapped, given)

    def _driven(self, segment: TorqueSegment) -> DrivenMechanism:
        """What moves, as a segment describes it.

        Raises:
            LogError: The mechanism has no such coordinates or assembly.
        """
        mechanism = self._own.solver.mechanism
        description = segment.description or mechanism.description
        known = mechanism.coordinates, mechanism.other_coordinates
        if description.coordinates not in known or description.assembly not in {OPEN, CROSSED}:
            raise LogError(
                f'is described by {" and ".join(description.coordinates)}, '
                f'{description.assembly}: the mechanism is not'
            )
        return self._own.described(description)

    def _column(self, rows: bytes, link: str, quantity: int) -> Array:
        """What is logged of a joint: position, velocity or acceleration.

        Raises:
            LogError: A value is not a finite number.
        """
        found: Array = self._layout.column(rows, self._places[link][quantity]).copy()
        if not np.isfinite(found).all():
            raise LogError('has a mechanism_state that is not finite')
        return found

    def _read(self, driven: DrivenMechanism, rows: bytes) -> list[Array]:
        """Coordinates and rates as a description has them, then the whole crank angle."""
        crank = driven.solver.links[0]
        unwrapped, speed = (self._column(rows, crank, i) for i in range(2))
        angle = np.array([within_two_turns(x)[0] for x in unwrapped.tolist()])
        values = []
        for quantity, of_crank in enumerate((angle, speed)):
            for link in driven.links:
                value = of_crank
                if link.name != crank:
                    value = self._column(rows, link.name, quantity)
                    # A joint that hangs on the crank counts from it.
                    value = value if link.parent is None else of_crank + value
                values.append(value)
        return [*values, unwrapped]

    def follow(self, segment: TorqueSegment, ticks: list[int], rows: bytes) -> tuple[int, str]:
        """Checks states whose messages are right, and advances.

        Args:
            segment: In which they lie.
            ticks: Their numbers.
            rows: Their bytes.

        Returns:
            The number of states that follow from their predecessors, and the error of the next.
        """
        driven = self._driven(segment)
        values = self._read(driven, rows)
        torques = self._layout.column(rows, self._effort)
        lines = self._motor.at(self._column(rows, driven.solver.links[0], 1))
        found = np.array([*values, torques - lines])
        origin = np.concatenate([self._before, found[:, :-1]], axis=1)
        times = [self._simulator.elapsed(tick) for tick in (self._tick, *ticks)]
        late = np.array([after - before for before, after in pairwise(times)], float)
        if not self._recorded:  # for that time the plant stood still
            late[late > self._simulator.elapsed(1) + CATCH_UP] = 0
        spans = late / NS_PER_S
        foreign = abs(torques - lines) > _APART * np.maximum(abs(torques), 1e-3)
        foreign &= self._recorded
        follows = np.zeros(len(spans), bool)
        if driven.solver.coordinates == self._own.solver.coordinates:
            follows = self._lead_to(driven, origin, found, spans)
            follows[0] &= self._last.solver is driven.solver
        for i in map(int, np.flatnonzero(foreign | ~follows)):
            if foreign[i]:
                given = f'the motor line gives {lines[i]:.9g}'
                return i, f'has the torque {torques[i]:.9g} N m, {given}'
            before = driven if i else self._last
            if wrong := self._difference(
                before, origin[:, i], driven, found[:, i], float(spans[i])
            ):
                return i, f'does not follow from the one before: {wrong}'
        self._tick, self._before, self._last = ticks[-1], found[:, -1:], driven
        return len(ticks), ''

    @functools.cached_property
    def _method(self) -> type[FixedSteps]:
        return live_method(self._own)

    def _lead_to(
        self, driven: DrivenMechanism, origin: Array, found: Array, spans: Array
    ) -> npt.NDArray[np.bool_]:
        """Finds states that certainly follow from their predecessors, with few steps for all."""
        follows, size = np.zeros(len(spans), bool), len(origin) - 2

        def slope(y: tuple[Array, ...]) -> tuple[Array, ...]:
            q, u = y[: size // 2], y[size // 2 :]
            return *u, *driven.solver.accelerations(q, u, self._torque(u[0]))

        for steps in _LEAPS:
            left = np.flatnonzero(~follows)
            phase, self._command = tuple(origin[:size, left]), origin[-1, left]
            good = spans[left] <= _LONGEST
            try:
                with np.errstate(all='ignore'):  # where the steps are too long
                    for _ in range(steps):
                        phase, errors = leap(slope, driven.units, phase, spans[left] / steps)
                        good &= np.max(errors, axis=0) <= _APART / 10
            except LinkageError:  # of one of them; they are looked at one by one
                return follows
            due, values = np.array(phase), found[:size, left].copy()
            values[0] = found[-2, left] - (origin[-2, left] - origin[0, left])
            follows[left] = good & ~_off(driven, due, values, found[-2, left]).any(axis=0)
        return follows

    def _torque(self, speed: Real) -> Real:
        return self._motor.at(speed) + self._command

    def _difference(
        self,
        before: DrivenMechanism,
        origin: Array,
        driven: DrivenMechanism,
        found: Array,
        span: float,
    ) -> str:
        """Describes the difference of a state from the one that its predecessor leads to.

        Args:
            before: What moves, as the state before is described.
            origin: The state before; see `_before`.
            driven: What moves, as the state is described.
            found: The state.
            span: Time between them, s.

        Returns:
            Words; empty if it is not far.
        """
        if span > _LONGEST:
            return ''
        self._command = float(origin[-1])
        due = self._led(before, origin, driven, found, span)
        nudged = origin.copy()
        nudged[: len(origin) - 2] += _NUDGE * np.array(before.units)
        if isinstance(due, str):  # a start next to it may lead there
            other = self._led(before, nudged, driven, found, span)
            return due if isinstance(other, str) else ''
        values = found[: len(due)]
        off = _off(driven, due[:, None], values[:, None], found[-2:-1])[:, 0]
        if off.any():
            other = self._led(before, nudged, driven, found, span)
            spread = np.inf if isinstance(other, str) else abs(other - due)
            off &= abs(values - due) > spread
        names = [f'{n} {w}' for w in ('position', 'speed') for n in driven.solver.coordinates]
        rows = zip(names, values, due, off, strict=True)
        wrong = (f'{n} {v:.9g}, that one leads to {d:.9g}' for n, v, d, is_off in rows if is_off)
        return next(wrong, '')

    def _led(
        self,
        before: DrivenMechanism,
        origin: Array,
        driven: DrivenMechanism,
        found: Array,
        span: float,
    ) -> Array | str:
        """Where a state leads, with as many turns as the state found; or why it does not.

        Arguments as those of `_difference`.
        """
        size, crank = len(origin) - 2, float(found[-2])
        turns = origin[-2] - origin[0] if before.has_crank else 0.0
        try:
            begin = replace(before, middle=before.arc_middle(float(origin[-2] - turns)))
            steps = self._method(
                begin, tuple(origin[:size].tolist()), tolerance=_TOLERANCE, trials=_TRIALS
            )
            steps.advance(span)
            there, phase = steps.driven, steps.phase
            if there.solver is not driven.solver:
                there, phase = there.redescribed(phase, driven.solver.coordinates)
            due_crank = there.crank(phase, steps.pairs) + turns
        except LinkageError as error:
            return str(error)
        if there.solver is not driven.solver:
            return f'that one leads to the assembly {there.solver.description.assembly}'
        due = np.array(phase)
        if driven.has_crank:
            due[0] = found[0] + (due_crank - crank)
        elif abs(due_crank - crank) > 1:
            return f'crank position {crank:.9g}, that one leads to {due_crank:.9g}'
        for i, link in enumerate(driven.links):
            if not link.slides and link.name != driven.solver.links[0]:
                apart = found[i] - due[i]
                due[i] += apart - wrap(apart)
        return due


def _off(
    driven: DrivenMechanism, due: Array, values: Array, crank: Array
) -> npt.NDArray[np.bool_]:
    """Which coordinates and rates are off.

    Args:
        driven: What moves.
        due: Coordinates and rates to which the states before lead.
        values: Those that are logged, the crank with as many turns as there.
        crank: The logged whole angle.

    Returns:
        Of the shape of both.
    """
    units, count = np.array(driven.units)[:, None], len(due) // 2
    sizes = np.maximum(units, abs(due))
    sizes[:count] = units[:count]
    found: npt.NDArray[np.bool_] = ~(
        abs(values - due) <= _APART * sizes + 4 * np.spacing(abs(crank))
    )
    return found
