# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Computes the steady states of a wind pump under its motor, as in Deliu and Vlase's figure 3."""

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np

from linkage_lab.output import progress
from linkage_lab.pump.averaged import AveragedMotion, averaged
from linkage_lab.pump.continuation import LOST, Piece, bistable_ranges, follow, stability_lost
from linkage_lab.pump.shooting import ROUGH, TURN, PeriodicMotion, Shooting
from linkage_ros import ConfigurationError, MotionError, WindPump
from linkage_ros.formulas import Array
from linkage_ros.internals import Motor

# Starts at crank angle 0: parts of the slider's range and of the no-load speed, and slider speeds
# relative to that of the crank pin at the no-load speed.
_GRID = (0.1, 0.5, 0.9), (0.15, 0.4, 0.65, 0.9), (-0.5, 0.5)
_PERIODS = 1, 2, 4  # turns after which a motion may repeat
# No-load turns before each check of a motion; the numbers of its checks, and after how many of
# them Newton's method is used.
_TURNS_PER_CHECK, _CHECKS, _NEWTON_EVERY = 8, range(1, 31), 4
# A motion has settled if its last _PASSAGES of crank angle 0 are within _NEAR of a stable state,
# and within _INSIDE of the state's distance from the nearest unstable one. It repeats if its
# distance from an earlier passage is below _REPEATS.
_PASSAGES, _NEAR, _INSIDE, _REPEATS = 6, 0.05, 0.3, 0.01
_ASIDE, _SAMPLES = 0.01, 1500  # distance of starts from an unstable state; samples of a run
# Reasons why starts settle in no listed state.
STRETCHED, STOPPED, UNSETTLED = REASONS = (
    'stretches or folds the dyad of coupler and rod, or its load jumps too often',
    'comes to rest, or rocks back and forth',
    'settles too slowly or in no motion that repeats after 1, 2 or 4 turns',
)


class SteadyState(NamedTuple):
    """A periodic motion that the motor sustains.

    Attributes:
        motion: The motion.
        piece: The piece of a curve that contains it.
        averaged: The averaged motion near it; None if none was found.
        share: Fraction of the starts that settle in this state.
    """

    motion: PeriodicMotion
    piece: Piece
    averaged: AveragedMotion | None = None
    share: float = 0.0


class Run(NamedTuple):
    """A motion from a named start.

    Attributes:
        name: Name of the start.
        times: Times, s.
        speeds: Crank speeds at these times, rad/s.
        state: Number of the steady state that the motion reaches; None if it reaches none.
    """

    name: str
    times: Array
    speeds: Array
    state: int | None


class Analysis(NamedTuple):
    """The results for one pump under one motor.

    Attributes:
        motor: The motor.
        states: Steady states in order of speed, stable or not.
        pieces: The curves of periodic motions over the torque.
        runs: Motions from named starts.
        starts: Number of starts.
        lost: Fractions of the starts that settle in none of the states, by reason.
    """

    motor: Motor
    states: list[SteadyState]
    pieces: list[Piece]
    runs: list[Run]
    starts: int
    lost: dict[str, float]

    def record(self) -> dict[str, Any]:
        """Returns the analysis as a JSON record, in SI units."""
        stretched, stopped, unsettled = (
            self.lost.get(reason, 0.0) for reason in (STRETCHED, STOPPED, UNSETTLED)
        )
        return {
            'motor': {'torque': self.motor.torque, 'damping': self.motor.damping},
            'states': [
                {**state.motion.record(), 'share_of_starts': state.share}
                for state in self.states
            ],
            'averaged_states': [self._averaged_record(state) for state in self.states],
            'starts': {
                'count': self.starts, 'stopped': stopped, 'stretched': stretched,
                'unidentified': unsettled,
            },
            'torques_with_two_stable_states': bistable_ranges(self.pieces),
            'stability_lost': [
                {'kind': kind, **motion.record()}
                for kind, motion in stability_lost(self.pieces)
            ],
            'load_curve': [
                {**motion.numbers, 'stable': piece.stable}
                for piece in self.pieces
                for motion in piece.motions
            ],
            'runs': [
                {
                    'start': run.name, 'settles_at_state': run.state,
                    'duration': float(run.times[-1]),
                }
                for run in self.runs
            ],
        }  # fmt: skip

    def _averaged_record(self, state: SteadyState) -> dict[str, Any] | None:
        """Returns the averaged motion near a state as a JSON record; None if none was found."""
        if state.averaged is None:
            return None
        load = self.motor.at(state.averaged.speed)
        return {'torque': self.motor.torque, 'load': load, **state.averaged.numbers}


class _Outcome(NamedTuple):
    """The end of a motion from a start.

    Attributes:
        end: The stable state in which it settles, or one of REASONS why it settles in none.
        duration: Time until then, s.
    """

    end: PeriodicMotion | str
    duration: float


def analyse(mechanism: WindPump, motor: Motor, speeds: Sequence[float]) -> Analysis:
    """Finds the steady states of a pump, their shares of the starts, and their torques.

    Args:
        mechanism: The pump, with the start of its slider.
        motor: The motor of its crank.
        speeds: Crank speeds at angle 0 from which the pump is started, positive, rad/s.

    Returns:
        The analysis.

    Raises:
        ConfigurationError: The motor does not turn the crank forwards.
        UnreachableError: The pump cannot be assembled with its slider at the start position.
    """
    shooting = _shooting(mechanism, motor, speeds)
    search, starts = _Search(shooting), list(_starts(mechanism, shooting))
    for start in progress(starts, "Newton's method"):
        search.try_newton(np.array(start))
    ends = [search.settled(start).end for start in progress(starts, 'starts')]
    # The runs may find further states, hence the states are numbered after them.
    runs = list(_runs(search, mechanism, speeds))
    states = [
        state._replace(
            averaged=averaged(state.motion), share=ends.count(state.motion) / len(starts)
        )
        for state in sorted(search.states, key=lambda state: state.motion.speed)
    ]
    numbers: dict[object, int] = {state.motion: number for number, state in enumerate(states)}
    return Analysis(
        motor,
        states,
        search.pieces,
        [run._replace(state=numbers.get(end)) for run, end in runs],
        len(starts),
        {reason: ends.count(reason) / len(starts) for reason in REASONS if reason in ends},
    )


def settle(mechanism: WindPump, motor: Motor, speed: float) -> PeriodicMotion:
    """Integrates a pump until it is near a stable periodic motion.

    Args:
        mechanism: The pump, with the start of its slider.
        motor: The motor of its crank.
        speed: Speed of the crank at angle 0, above 0, rad/s.

    Returns:
        The motion.

    Raises:
        ConfigurationError: The motor does not turn the crank forwards, or the pump does not
            settle.
        UnreachableError: The pump cannot be assembled with its slider at the start position.
    """
    search = _Search(_shooting(mechanism, motor, [speed]), follows=False)
    start = mechanism.slider.position, speed, mechanism.slider.velocity
    outcome = search.settled(start, progress(_CHECKS, 'motion'))
    if isinstance(outcome.end, str):
        raise ConfigurationError(
            f'from {speed:g} rad/s the pump does not settle within {outcome.duration:.3g} s, '
            f'because it {outcome.end}: try another speed, or linkage_record'
        )
    return outcome.end


def _shooting(mechanism: WindPump, motor: Motor, speeds: Sequence[float]) -> Shooting:
    """Prepares the map of a pump.

    Raises:
        ConfigurationError: The motor does not turn the crank forwards.
        UnreachableError: The pump cannot be assembled with its slider at the start position.
    """
    if not motor.torque > 0:
        raise ConfigurationError(
            f'motor.torque = {motor.torque:g}: must be above 0 N m, so that the motor turns the '
            'crank'
        )
    pace = motor.torque / motor.damping if motor.damping else max(speeds)
    shooting = Shooting(mechanism, motor, pace)
    x, v = mechanism.slider.position, mechanism.slider.velocity
    # It may be out of reach.
    shooting.solver.accelerations((0.0, x), (max(speeds), v), motor.torque)
    return shooting


def _starts(mechanism: WindPump, shooting: Shooting) -> Iterator[tuple[float, ...]]:
    """Chooses starting points: a grid of slider positions, crank speeds and slider velocities."""
    r, b, c = (link.length for link in (mechanism.crank, mechanism.coupler, mechanism.rod))
    near, far = abs(b - c) + r, b + c - r
    side = math.copysign(1.0, mechanism.slider.position)
    _, speed_unit, velocity_unit, _ = shooting.units.tolist()
    for part, speed, velocity in itertools.product(*_GRID):
        yield side * (near + part * (far - near)), speed * speed_unit, velocity * velocity_unit


def _runs(
    search: '_Search', mechanism: WindPump, speeds: Sequence[float]
) -> Iterator[tuple[Run, PeriodicMotion | str]]:
    """Computes the motions for the chart, from given speeds and from beside unstable states.

    Yields:
        A run without the number of its state, and `_Outcome.end`.
    """
    starts = _run_starts(search, mechanism, speeds)
    outcomes = [search.settled(start) for _, start in starts]
    longest = max(outcome.duration for outcome in outcomes)
    times = np.linspace(0.0, longest, _SAMPLES)
    for (name, start), outcome in zip(starts, outcomes, strict=True):
        solution = search.shooting.run(np.array((0.0, *start)), longest, times)
        _, _, crank_speeds, _ = np.reshape(solution.y, (4, -1))
        yield Run(name, solution.t, crank_speeds, state=None), outcome.end


def _run_starts(
    search: '_Search', mechanism: WindPump, speeds: Sequence[float]
) -> list[tuple[str, list[float]]]:
    """Returns the name of each start, and slider position, crank speed and slider velocity."""
    x, v = mechanism.slider.position, mechanism.slider.velocity
    starts = [(f'{speed:g} rad/s', [x, speed, v]) for speed in speeds]
    for state in search.unstable:
        # Deviations along this eigenvector grow most.
        values, vectors = np.linalg.eig(state.derivative[:, :3])
        direction = vectors[:, np.abs(values).argmax()].real
        faster = direction * (np.copysign(_ASIDE, direction[1]) * search.shooting.units[:3])
        name = f'beside {state.speed:.4g} rad/s'
        starts.append((f'{name}, slower', (state.phase[:3] - faster).tolist()))
        starts.append((f'{name}, faster', (state.phase[:3] + faster).tolist()))
    return starts


class _Search:
    """The steady states of a pump that are known so far.

    Attributes:
        shooting: The map of the pump.
        states: The states, stable or not.
        pieces: The curves through them.
    """

    def __init__(self, shooting: Shooting, *, follows: bool = True) -> None:
        """Starts without states; with `follows`, the curves of the states are followed."""
        self.shooting, self._follows = shooting, follows
        self.states: list[SteadyState] = []
        self.pieces: list[Piece] = []

    @property
    def unstable(self) -> list[PeriodicMotion]:
        """The unstable states."""
        return [state.motion for state in self.states if not state.motion.stable]

    def _add(self, motion: PeriodicMotion) -> None:
        """Adds a state, its curve, and the other states on this curve."""
        pieces = follow(motion) if self._follows else [Piece([motion], LOST)]
        self.pieces += pieces
        for piece in pieces:
            states = [*piece.states(motion.torque)]
            if motion in piece.motions:
                states.insert(0, motion)
            for state in states:
                if not self._known(state):
                    self.states.append(SteadyState(state, piece))

    def settled(self, start: Sequence[float], checks: Iterable[int] = _CHECKS) -> _Outcome:
        """Finds the state in which a motion settles.

        Args:
            start: Slider position, crank speed and slider velocity at crank angle 0.
            checks: Numbers of the checks, in order; may be wrapped in a progress bar.
        """
        values, time = np.array((0.0, *start)), 0.0
        between_checks = _TURNS_PER_CHECK * TURN / self.shooting.units[1]
        passages = np.empty((3, 0))
        for check in checks:
            solution = self.shooting.run(values, between_checks)
            time += solution.t[-1]
            if not solution.success:
                return _Outcome(STRETCHED, time)
            # Each column is a state at which the sine of the crank angle rises.
            crossings = solution.y_events[0].T
            if not crossings.size:
                return _Outcome(STOPPED, time)
            # The sine also rises at pi, if the crank passes it backwards.
            is_at_0 = np.cos(crossings[0]) > 0
            passages = np.hstack((passages, crossings[1:, is_at_0]))
            values = solution.y[:, -1]
            values[0] %= TURN
            if check % _NEWTON_EVERY == 0:
                self._identify(passages)
            state = self._reached(passages)
            if state:
                return _Outcome(state, time)
        return _Outcome(UNSETTLED, time)

    def _reached(self, passages: Array) -> PeriodicMotion | None:
        """Returns the stable state that a motion has reached after its passages, if any."""
        if passages.shape[1] <= _PASSAGES:
            return None
        last = passages[:, -_PASSAGES:]
        for state in self.states:
            motion = state.motion
            if motion.stable and motion.distance(last).max() < self._settled_distance(motion):
                return motion
        return None

    def _settled_distance(self, motion: PeriodicMotion) -> float:
        """Returns the distance from a stable state below which a motion has settled in it."""
        to_unstable = [motion.distance(other.sections[:3]).min() for other in self.unstable]
        return min([_NEAR, *(_INSIDE * distance for distance in to_unstable)])

    def try_newton(self, passage: Array, turns: int = 1) -> PeriodicMotion | None:
        """Adds the state that Newton's method finds from a passage, and returns it, if any."""
        with suppress(MotionError):
            guess = np.append(passage, self.shooting.motor.torque)
            rough = self.shooting.find(guess, turns, tolerance=ROUGH)
            if known := self._known(rough):
                return known
            motion = self.shooting.find(rough.phase, rough.turns)
            if not self._known(motion):
                self._add(motion)
            return self._known(motion)
        return None

    def _identify(self, passages: Array) -> None:
        """Adds the stable state that a motion approaches, if Newton's method finds one."""
        last, units = passages[:, -1], self.shooting.units[:3]
        for turns in _PERIODS:
            if passages.shape[1] <= turns:
                continue
            moved = (last - passages[:, -1 - turns]) / units
            if np.abs(moved).max() < _REPEATS:
                motion = self.try_newton(last, turns)
                if motion and motion.stable:
                    return

    def _known(self, motion: PeriodicMotion) -> PeriodicMotion | None:
        """Returns the known state that is the same as a motion, if any."""
        same = (state.motion for state in self.states if motion.is_same(state.motion))
        return next(same, None)
