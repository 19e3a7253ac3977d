# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Recomputes the states of a torque-driven log from its accelerations and commands.

Coordinates, rates and accelerations are read from mechanism_state. In a record, which has no
commands, the accelerations are instead computed from the motor's torque. From these values, the
motion of all links and the torque, tau = M q'' + h - Q, are recomputed for comparison. Each state
must also follow from the previous state under the torque logged there.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from linkage_ros.errors import LinkageError, LogError
from linkage_ros.log.expected_states import Rows, SegmentStates, TickStates
from linkage_ros.log.logged_forces import Forces
from linkage_ros.mechanism.conditions import Conditions
from linkage_ros.mechanism.elementwise import is_noisy, noisy
from linkage_ros.mechanism.solver import Solver
from linkage_ros.messages.joints import link_rows
from linkage_ros.messages.templates import joint_numbers
from linkage_ros.messages.topics import MECHANISM_STATE
from linkage_ros.motion.driven_mechanism import DrivenMechanism, turns_between
from linkage_ros.motion.runge_kutta import Plant, leap, slope_at
from linkage_ros.motion.segments import Coordinates
from linkage_ros.motion.steps import live_method
from linkage_ros.motion.under_torque import CATCH_UP, TorqueSegment, own_coordinates
from linkage_ros.numeric import Array, Real, with_turns, within_two_turns, wrap
from linkage_ros.run.states import Simulator
from linkage_ros.units import NS_PER_S

# Tolerance between a state and its prediction from the previous state: rad and crank lengths; for
# rates, the same per second or relative. It covers the errors of different integrators.
_APART = 1e-7
# Longest time between two states, s. States farther apart are not predicted.
_LONGEST = 10.0
# Tolerance and trials of the integrator that checks a deviating state again.
_TOLERANCE, _TRIALS = 1e-11, 10_000
# Perturbation of a state, in rad and crank lengths, and per second. If it changes the prediction
# by more than the difference from the logged state, the difference is accepted.
_NUDGE = 1e-9
_NOWHERE = 1e300  # predicted value if the motion cannot be integrated
_ROUNDINGS = 8  # bound on the rounding errors of a mapped value
# If all states are integrated at once: median motion per step, in rad or crank lengths, and the
# smallest and largest number of steps between two states.
_STEP, _STEPS = 0.02, (2, 20)


class DrivenStates(SegmentStates):
    """Recomputes the states of a torque-driven linkage.

    A state is stored as a column: positions of all links, including all turns of a driven crank;
    their rates; and the torque added to the motor's torque, N m or N.
    """

    def __init__(self, run: TickStates, simulator: Simulator, motions: Sequence[Any]) -> None:
        """Prepares the check; see `SegmentStates`. The rows must contain mechanism_state."""
        super().__init__(run, simulator, motions)
        drive: Any = simulator.linkage.drive
        solver, self._motor = simulator.solver, drive.motor
        self._links, self._driven_link = solver.structure.links, solver.structure.driven
        self._names = joint_numbers(simulator.joints)
        self._own = self._last_driven = DrivenMechanism(
            solver, drive.motor.at, conditions=simulator.conditions
        )
        # NumPy's functions: many states are predicted, to a tolerance, not to the bit.
        self._fast = DrivenMechanism(Solver(solver.mechanism), drive.motor.at)
        length = solver.mechanism.crank.length
        self._units = np.array([length if link.slides else 1.0 for link in self._links] * 2)
        # The previous state, initially that at t = 0, and the components of its live forces.
        start = drive.start(solver.mechanism)
        state = solver.state(start.q, start.u)
        positions = self._with_driven(state.position, start.unwrapped)
        self._last_state = np.array([[*positions, *state.velocity, 0.0]]).T
        self._last_forces = np.array([[x] for x in simulator.conditions.values])

    def _with_driven(self, positions: Sequence[Any], driven: Any) -> list[Any]:
        """Returns positions of the links, with the position of the driven link replaced."""
        found = [*positions]
        found[self._driven_link] = driven
        return found

    def has_ended(self, stamp: int) -> bool:  # noqa: ARG002
        """Returns True: how a motion under commands goes on is not known."""
        return True

    def coordinates(
        self, number: int, _: list[int], rows: Rows | None, forces: Forces
    ) -> tuple[Coordinates, Coordinates | None]:
        """Reads coordinates, rates and accelerations from mechanism_state, as arrays.

        Raises:
            LogError: A value is not finite, or the mechanism has no such coordinates.
        """
        self._driven = driven = self._described(self._motions[number])
        solver, link, under = driven.solver, self._driven_link, Conditions(forces=forces)
        table, unwrapped = self._read(rows)
        positions, rates, accelerations, efforts = table
        if not is_noisy():
            # Kept for `take`: the states as columns, and the components of their live forces.
            columns = [*self._with_driven(positions, unwrapped), *rates, efforts[link]]
            self._states = np.array(columns)
            self._forces = np.array([np.broadcast_to(x, len(unwrapped)) for x in under.values])
        moving = solver.structure.indices_of(solver.coordinates)
        q, u, a = (tuple(values[moving]) for values in (positions, rates, accelerations))
        # Use the logged torque of live runs, because it includes commands.
        torque = self._motor.at(rates[link]) if self._run.is_record else efforts[link]
        if driven.is_own:
            if self._run.is_record:
                a = solver.accelerations(q, u, torque, under=under)
            return Coordinates(q, u, a, unwrapped, solver.state(q, u, a, under=under)), None
        state = solver.driven_state(q, u, torque, under=under)
        if driven.turns and not driven.has_driven:
            # The coordinates determine the crank angle; only its turns are those logged.
            angles = zip(state.position[link].tolist(), unwrapped.tolist(), strict=True)
            unwrapped = np.array([with_turns(x, turns_between(x, y)) for x, y in angles])
        return own_coordinates(solver, state, unwrapped), None

    def _described(self, segment: TorqueSegment) -> DrivenMechanism:
        """Returns the driven mechanism in the description of a segment.

        Raises:
            LogError: The mechanism has no such coordinates.
            ConfigurationError: The mechanism has no such assembly.
        """
        mechanism = self._own.solver.mechanism
        description = segment.description or mechanism.description
        if description.coordinates not in {mechanism.coordinates, mechanism.other_coordinates}:
            raise LogError(
                f'the mechanism has no description by {", ".join(description.coordinates)}'
            )
        return self._own.described(description)

    def _rows(self, driven: DrivenMechanism) -> list[int]:
        """Returns the indices of the coordinates and their rates in a state."""
        moving = driven.solver.structure.indices_of(driven.solver.coordinates)
        return [*moving, *(len(self._links) + i for i in moving)]

    def _read(self, rows: Rows | None) -> tuple[Array, Array]:
        """Reads mechanism_state.

        Returns:
            Positions, rates, accelerations and efforts of all links, shape (4, links, states),
            with a driven crank's angle within two turns; and the position of the driven link,
            including all turns of a crank.

        Raises:
            LogError: A value is not a finite number.
        """
        layout, data = cast('Rows', rows)
        # If fields have the same name, `fields` holds the last, which is that of mechanism_state.
        columns = [layout.column(data, layout.fields[name]) for name in self._names]
        table = np.reshape(columns, (4, len(self._links), -1))
        if not np.isfinite(table).all():
            raise LogError('mechanism_state is not finite')
        joints, link = self._simulator.robot_joints, self._driven_link
        driven_joint = joints[link]
        is_inexact = is_noisy() and any(joint.is_mapped for joint in joints)
        if is_inexact:
            table[:3] = _rounded_often(table[:3])
        unwrapped = driven_joint.own(table[0, link].copy())
        if self._own.turns:
            reduced = [within_two_turns(x)[0] for x in unwrapped.tolist()]
            table[0, link] = [driven_joint.value(x) for x in reduced]
        table[3, link] *= driven_joint.ratio
        table[:3] = link_rows(joints, table[:3])
        if is_inexact:
            table[:3] = _rounded_often(table[:3])
        return table, unwrapped

    def take(self, number: int, ticks: list[int]) -> tuple[int, str]:
        """Checks that states follow from their predecessors; see `SegmentStates`."""
        driven, count = self._driven, len(ticks)
        states = self._states[:, :count]
        rates = states[len(self._links) :]
        states[-1] -= self._motor.at(rates[self._driven_link])  # leaves the added torque
        previous = np.concatenate([self._last_state, states[:, :-1]], axis=1)
        # The forces that act after each previous state.
        forces: Any = ()
        if len(self._last_forces):
            forces = np.concatenate([self._last_forces, self._forces], axis=1)
        spans = self._spans(ticks)
        under = self._conditions([row[:count] for row in forces])
        follows = self._many_follow(driven, previous, states, spans, under) | (spans > _LONGEST)
        follows[0] |= self._run.is_after_gap
        for i in map(int, np.flatnonzero(~follows)):
            conditions = self._conditions([float(row[i]) for row in forces])
            before = replace(driven if i else self._last_driven, conditions=conditions)
            wrong = self._difference(before, previous[:, i], states[:, i], float(spans[i]))
            if wrong:
                return i, f'it does not follow from the previous state: {wrong}'
        self._last_state, self._last_driven = states[:, -1:], driven
        if len(self._last_forces):
            self._last_forces = self._forces[:, count - 1 : count]
        return super().take(number, ticks)

    def _spans(self, ticks: list[int]) -> Array:
        """Returns the time of motion before each tick, s; the plant is paused in longer gaps."""
        numbers = np.array([max(self._run.tick, 0), *ticks], object)  # of any size
        elapsed = np.diff(self._simulator.ticks.elapsed(numbers)).astype(float)
        if not self._run.is_record:
            elapsed[elapsed > self._simulator.ticks.elapsed(1) + CATCH_UP] = 0
        return np.asarray(elapsed / NS_PER_S)

    def _conditions(self, components: Sequence[Real]) -> Conditions:
        """Returns conditions from the components of their forces."""
        pairs = zip(components[::2], components[1::2], strict=True)
        names = (name for name, _ in self._simulator.conditions.forces)
        return Conditions(forces=dict(zip(names, pairs, strict=True)))

    def _many_follow(
        self,
        driven: DrivenMechanism,
        previous: Array,
        states: Array,
        spans: Array,
        under: Conditions,
    ) -> npt.NDArray[np.bool_]:
        """Returns which states follow from their predecessors, integrating all at once.

        Args:
            driven: The driven mechanism in the description of the states.
            previous: The state before each state.
            states: The states.
            spans: Times between them, s.
            under: Conditions of the motions, as arrays.
        """
        no_state, count = np.zeros(len(spans), bool), len(driven.links)
        if not driven.is_own:
            return no_state
        solver = self._fast.described(driven.solver.description).solver
        # The first half of these rows are coordinates, the second half their rates.
        rows, units = self._rows(driven), np.array(driven.units)[:, None]
        fastest = np.max(abs(previous[rows[count:]]) / units[count:], axis=0)
        steps = int(np.clip(np.ceil(np.median(fastest * spans) / _STEP), *_STEPS))

        def accelerations(*phase: Array) -> Any:
            torque = self._motor.at(phase[count]) + previous[-1]
            return solver.accelerations(phase[:count], phase[count:], torque, under=under)

        plant = Plant(driven.units, accelerations)
        try:
            with np.errstate(all='ignore'):  # long steps may overflow
                predicted, errors = _leapt(plant, previous[rows], spans, steps)
        except LinkageError:  # check the states one by one instead
            return no_state
        follows = _agrees(units, previous[rows], predicted, states[rows], spans).all(axis=0)
        follows &= errors <= _APART / 10
        follows[0] &= self._last_driven.solver is driven.solver
        return follows

    def _difference(
        self, before: DrivenMechanism, previous: Array, state: Array, span: float
    ) -> str:
        """Describes the difference between a state and its prediction from the previous state.

        Args:
            before: The driven mechanism in the description of the previous state.
            previous: The previous state.
            state: The logged state to check.
            span: Time between the two states, s.

        Returns:
            The description; empty if the difference is within the tolerance, or if rounding errors
            of the previous state explain it.
        """
        values = state[:-1]
        due = self._predicted(before, previous, values, span)
        wrong = ~_agrees(self._units, previous[:-1], due, values, span)
        if wrong.any():
            nudged = previous + _NUDGE * np.array([*self._units, 0.0])
            spread = abs(self._predicted(before, nudged, values, span) - due)
            is_explained = abs(values - due) <= spread
            wrong &= ~is_explained
        if not wrong.any():
            return ''
        names = [f'{link.name} {word}' for word in ('position', 'speed') for link in self._links]
        i = int(wrong.argmax())
        return f'{names[i]} {values[i]:.9g}, expected {due[i]:.9g}'

    def _predicted(
        self, before: DrivenMechanism, previous: Array, values: Array, span: float
    ) -> Array:
        """Predicts positions and rates from the previous state.

        The predicted angles, except that of the crank, are shifted by whole turns to be closest to
        the logged angles.

        Args:
            before: The driven mechanism in the description of the previous state.
            previous: The previous state.
            values: Logged positions and rates.
            span: Time between the two states, s.
        """
        added_torque = float(previous[-1])
        driven = replace(
            before,
            torque=lambda speed: self._motor.at(speed) + added_torque,
            middle=before.arc_middle(float(previous[self._driven_link])),
        )
        phase = tuple(previous[self._rows(driven)].tolist())
        try:
            steps = live_method(self._own)(driven, phase, tolerance=_TOLERANCE, trials=_TRIALS)
            steps.advance(span)
            driven, half = steps.driven, len(phase) // 2
            state = driven.solver.state(steps.phase[:half], steps.phase[half:])
            position = driven.position(steps.phase, steps.pairs)
        except LinkageError:
            return np.full(len(values), _NOWHERE)
        due = np.array([*self._with_driven(state.position, position), *state.velocity])
        turning = [
            i for i, link in enumerate(self._links) if i != self._driven_link and not link.slides
        ]
        apart = values[turning] - due[turning]
        whole_turns = apart - wrap(apart, np.rint)
        due[turning] += whole_turns
        return due


class TorqueStates(TickStates):
    """The states of torque-driven linkages."""

    needed = (MECHANISM_STATE,)
    kind = DrivenStates


def _leapt(plant: Plant, start: Array, spans: Array, steps: int) -> tuple[Array, Array]:
    """Integrates many motions at once, over `spans`, s, each in the same number of steps.

    Returns:
        The coordinates and rates at the end, and the largest error of each motion; see `leap`.
    """
    phase, largest_errors = tuple(start), np.zeros(len(spans))
    slope = slope_at(plant.accelerations, phase)
    for _ in range(steps):
        phase, slope, errors = leap(plant, phase, spans / steps, slope)
        largest_errors = np.maximum(largest_errors, np.max(errors, axis=0))
    return np.array(phase), largest_errors


def _agrees(
    units: Array, before: Array, due: Array, values: Array, span: Array | float
) -> npt.NDArray[np.bool_]:
    """Returns whether logged positions and rates agree with predicted values.

    The integrators' error of a rate is relative to that rate. The tolerance of a position
    therefore grows with the distance travelled, and that of a rate also with the largest rate.

    Args:
        units: Unit of each value.
        before: Positions, starting with the crank, and rates of the previous state.
        due: Predicted positions and rates.
        values: Logged positions and rates.
        span: Time between the states, s.

    Returns:
        A boolean for each value.
    """
    half = len(due) // 2
    # Use the smaller rate, so that a forged rate cannot widen its own tolerance.
    rates_at_end = np.minimum(abs(due[half:]), abs(values[half:]))
    rates = np.maximum(abs(before[half:]), rates_at_end) / units[half:]
    largest_rate = rates.max(axis=0)
    sizes = units * np.maximum(1.0, largest_rate * span)
    sizes[half:] *= np.maximum(1.0, largest_rate)
    allowed = _APART * sizes + 4 * np.spacing(abs(values[0]))  # a crank angle of many turns
    return np.asarray(abs(values - due) <= allowed, bool)


def _rounded_often(table: Array) -> Array:
    """Adds noise for the rounding errors of mapping links to joints and back."""
    rows = [[row + _ROUNDINGS * (noisy(row) - row) for row in rows] for rows in table]
    return np.array(rows)
