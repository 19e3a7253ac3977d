# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Finds the states at which motions settle, and counts the motions that do not settle."""

import functools
import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np

from linkage_ros.dynamics.solver import Solver
from linkage_ros.errors import ConfigurationError
from linkage_ros.lab.pump.equations import smoothed
from linkage_ros.lab.pump.harmonic_balance import EXACT, STATE, HarmonicBalance
from linkage_ros.lab.pump.motions import Motions
from linkage_ros.lab.pump.periodic_motion import PeriodicMotion
from linkage_ros.model.wind_pump import WindPump
from linkage_ros.motion.driven_mechanism import DrivenMechanism
from linkage_ros.motion.drives import Motor
from linkage_ros.numeric import Array
from linkage_ros.quantities import Quantity

_FORWARDS = Quantity('number', 'motor torque at rest that turns the crank', 'N m', 1e-9, 1e12)

_FASTEST_SETTLING = 25.0  # relative to the pace; if faster, a turn takes too many explicit steps
_STEPS = 50  # steps between two checks of the motions; a turn takes 8 to 20
_LONG = 200  # steps, in which a crank that has not stopped makes half a turn
_ROWS = 10  # steps, about a turn
_BACK = 50  # steps between two compared distances of a motion from a state
# A motion has settled if its distance from a state, relative to crank length and speed, is below
# _APPROACHING and below _INSIDE times the distance of the nearest unstable state, and if one of
# these conditions also holds: the distance is below _NEAR; it was below _BEFORE times this limit
# and decreases, over many turns at half the rate of the state's largest multiplier, or to _HALF;
# or Newton's method finds the state from the motion's last turns.
_NEAR, _APPROACHING = 0.05, 0.5
_HALF, _BEFORE = 0.5, 4.0
_INSIDE = 0.3
_COMPARED, _POINTS = 8, 256  # turns and points for the distance between two states
_WAIT = 4  # checks before states are identified from motions
# After _LATE checks, the search ends if the fraction of unidentified motions is below _RARE at
# _AGAIN successive checks.
_LATE, _RARE, _AGAIN = 10, 0.005, 3
_TRIES = 4  # largest number of periods to try for a motion
_MOST_FAILURES = 12  # failed attempts to identify a state at one check
_PERIODS = range(1, 9)  # turns after which a motion may repeat
# Largest relative difference of the mean speeds of turns that may repeat; the same at the last
# attempt.
_ALIKE, _ROUGHLY = 0.01, 0.05
_REPEATS = 0.02  # allowed residual of a series over a period, relative to the motion's spread
_FINER = 64  # largest number of harmonics per turn at the last attempt
_ASIDE = 0.1  # distance of starts from an unstable state, in the units of `_NEAR`
_CHECKS = 80  # largest number of checks for a single motion


class Search:
    """Motions from many starts, and the stable states at which they settle.

    Two additional motions start near each unstable state, one below and one above its speed.

    Attributes:
        motions: All motions; the last of them start near unstable states.
        states: The known states, stable or not.
        unstable: The unstable states known at the start.
        belongs: Number of the state at which each motion settles; -1 if none is known.
        stopped: Whether the crank of each motion has stopped or rocks back and forth.
    """

    def __init__(
        self, balance: HarmonicBalance, motor: Motor, starts: Array,
        states: Iterable[PeriodicMotion] = (), drawn: int = 1,
    ) -> None:  # fmt: skip
        """Starts the search with the known states; the first `drawn` motions are for the chart."""
        self._balance, self._motor, self.states = balance, motor, list(states)
        self.unstable = [state for state in self.states if not state.stable]
        starts = np.hstack((starts, *map(_starts_near, self.unstable)))
        # Motions for the chart are integrated further after they have settled.
        self._drawn: Any = np.full(starts.shape[1], fill_value=True)
        self._drawn[drawn : starts.shape[1] - 2 * len(self.unstable)] = False
        self.motions = Motions(balance.solver, motor, starts)
        self.belongs: Any = np.full(starts.shape[1], -1)
        self.stopped: Any = self.belongs > 0

    @property
    def unidentified(self) -> Any:
        """Whether each motion has neither stopped nor settled at a known state."""
        return (self.belongs < 0) & ~self.stopped

    def run(self, progress: Callable[[Iterable[Any], str], Any], checks: int) -> None:
        """Advances the motions until all have settled, or `checks` checks are done."""
        rare = 0
        for check in progress(range(1, checks + 1), 'motions'):
            self.motions.advance(_STEPS)
            self._assign()
            self.motions.active = np.flatnonzero((self.belongs < 0) | self._drawn)
            rare = rare + 1 if self.unidentified.mean() < _RARE else 0
            is_late, is_last = check >= _LATE and rare >= _AGAIN, check == checks
            is_due = check % _WAIT == 0 or is_late or is_last
            failures, due = 0, self.unidentified & is_due
            for number in np.flatnonzero(due).tolist():
                if self.unidentified[number] and failures < _MOST_FAILURES:
                    failures += self._identify(number, is_last=is_last)
            if is_late or self.belongs.min() >= 0:
                return

    def _assign(self) -> None:
        """Assigns motions to the states that they have reached or are approaching."""
        phases, times = self.motions.phases, self.motions.times
        turned = np.abs(phases[-1][0] - phases[-_LONG:][0][0]) > np.pi
        # A motion with extremely short steps has not stopped.
        is_long = (times[-1] - times[-_LONG:][0]) * self.motions.pace > np.pi
        self.stopped = (self.belongs < 0) & ~turned & is_long
        left = np.flatnonzero(self.unidentified)

        def rows(back: int, turns: int = 1) -> Array:
            count = _ROWS * turns
            return np.array(phases[-count - back :][:count:3])[..., left].swapaxes(0, 1)

        for number, state in enumerate(self.states):
            if state.stable:
                courses = [rows(back, state.turns) for back in (0, _BACK, 2 * _BACK)]
                away, was, began = (state.distance(course) for course in courses)
                inside = self._inside(state, number)
                nearer = (away < was) & (away < _falls(state, courses[2], courses[0]) * began)
                near = (away < _NEAR) | (nearer & (was < _BEFORE * inside))
                self.belongs[left[near & (away < inside)]] = number
        # If the motions from both sides of an unstable state settle at one state, the motions near
        # the unstable state are assigned to it, too.
        for (below, above), state in zip(self._sides, self.unstable, strict=True):
            if below == above >= 0:
                near = (state.distance(rows(0)) < self._inside(state, below)) & (
                    self.belongs[left] < 0
                )
                self.belongs[left[near]] = below

    @property
    def _sides(self) -> list[list[int]]:
        """States at which the motions on both sides of each unstable state settle."""
        first = len(self.belongs) - 2 * len(self.unstable)
        return self.belongs[first:].reshape(-1, 2).tolist()

    def _inside(self, state: PeriodicMotion, number: int) -> float:
        """Returns the distance from a state within which motions are expected to settle in it.

        An unstable state does not limit it if the motions on both of its sides settle there.
        """
        among = [
            one
            for one, sides in zip(self.unstable, self._sides, strict=True)
            if sides == [number, number]
        ]
        others = [one for one in self.states if not (one.stable or one in among)]
        apart = min((_apart(state, one) for one in others), default=math.inf)
        return min(_APPROACHING / state.turns, _INSIDE * apart)

    def _identify(self, number: int, *, is_last: bool) -> int:
        """Finds the limit state of a motion by Newton's method, and adds it if it is new.

        Args:
            number: Number of the motion.
            is_last: Whether to integrate further turns accurately, because errors may hide the
                period.

        Returns:
            The number of failed attempts; 0 if a state was found.
        """
        periods = self._periods(number, _ROUGHLY if is_last else _ALIKE)
        for turns in periods:
            equations, course = self._balance.over(turns), self.motions.last_turns
            if is_last:
                same = self._with_speeds(self.motions.speeds(number)[-turns:])
                if same >= 0:
                    self.belongs[number] = same
                    return 0
                equations = self._balance.over(turns, min(_FINER, STATE.most // turns))
                course = self.motions.next_turns
            last = course(number, 2 * turns)
            if last is None:
                break
            guess, missed = equations.guess(last, self._motor.torque)
            state = equations.find(guess) if missed < _REPEATS else None
            state = state and state.shortest
            if state and state.stable:
                place = self._number(state)
                if state.distance(last[:, -_ROWS:, None]) < self._inside(state, place):
                    self.belongs[number] = place
                return 0
        return len(periods)

    def _periods(self, number: int, limit: float) -> list[int]:
        """Returns periods, in turns, after which the speeds of the last turns nearly repeat."""
        speeds = self.motions.speeds(number)
        found = [
            turns
            for turns in _PERIODS
            if len(speeds) >= 2 * turns
            and np.abs(speeds[-turns:] / speeds[-2 * turns : -turns] - 1).max() < limit
        ]
        return found[:_TRIES]

    def _number(self, state: PeriodicMotion) -> int:
        """Returns the number of a state, which is added if it is new."""
        for number, known in enumerate(self.states):
            if state.is_same(known):
                return number
        self.states.append(state)
        self._assign()
        return len(self.states) - 1

    def _with_speeds(self, speeds: Array) -> int:
        """Returns the number of the stable state with these speeds of its turns, or -1."""
        alike = (
            number
            for number, state in enumerate(self.states)
            if state.stable and state.turns == len(speeds)
            and np.abs(np.sort(speeds) / np.sort(state.speeds) - 1).max() < _ALIKE
        )  # fmt: skip
        return next(alike, -1)


def _falls(state: PeriodicMotion, before: Array, now: Array) -> Array:
    """Returns the factors by which the distance of motions from a state must have decreased."""
    periods = (now[0, -1] - before[0, -1]) / (2 * np.pi * state.turns)
    return np.clip(abs(state.multipliers[0]) ** (periods / 2), _HALF, 1.0)


@functools.cache  # requested at every check
def _apart(state: PeriodicMotion, other: PeriodicMotion) -> float:
    """Computes the distance of two states, over enough turns to compare different periods."""
    angles = np.linspace(0, 2 * np.pi * _COMPARED, _POINTS, endpoint=False)
    course = np.concatenate((angles[None], other.phase(angles)))[..., None]
    return float(state.distance(course).item())


def _starts_near(state: PeriodicMotion) -> Array:
    """Returns two starts near an unstable state in its most unstable direction, slower first."""
    values, vectors = np.linalg.eig(state.monodromy)
    unit, units = state.solver.units[-1], state.units[-2:]
    way = vectors[:, np.abs(values).argmax()].real / (unit, *units)
    way *= _ASIDE / np.linalg.norm(way) * np.copysign((unit, *units), way[1])
    there = state.phase(np.zeros(1)) + np.outer(state.ways @ way, (-1, 1))
    return np.concatenate((np.zeros((1, 2)), there))


def prepared(
    mechanism: WindPump, motor: Motor, speeds: Sequence[float]
) -> tuple[HarmonicBalance, Array, float]:
    """Prepares the equations and the starts of a pump; smooths loads that jump.

    Args:
        mechanism: The pump, with the start of its slider.
        motor: Motor of the pump.
        speeds: Speeds of the crank at angle 0, above 0, rad/s.

    Returns:
        The equations; the starts as phases of their solver, of shape (k, n); and the
        motor's no-load speed or, without damping, the speed of the fastest start, rad/s.

    Raises:
        ConfigurationError: The motor does not turn the crank forwards.
        UnreachableError: The pump cannot be assembled with its slider at the start position.
    """
    _FORWARDS.clean('motor.torque', motor.torque)
    x, v, fastest = mechanism.slider.position, mechanism.slider.velocity, max(speeds)
    Solver(mechanism).accelerations((0.0, x), (fastest, v), motor.torque)
    starts = np.array([(0.0, x, w, v) for w in speeds]).T
    pace = motor.torque / motor.damping if motor.damping else fastest
    pump = smoothed(mechanism, pace)
    harmonics = EXACT if pump is mechanism else 2 * EXACT
    equations = HarmonicBalance(pump, motor.damping, harmonics)
    return equations, equations.solver.converted(starts), pace


def require_slow(mechanism: WindPump, motor: Motor, pace: float) -> None:
    """Raises an error if strong damping would require too many steps per turn.

    Args:
        mechanism: Description of the pump.
        motor: Motor of the pump.
        pace: From `prepared`.

    Raises:
        ConfigurationError: The damping is too strong.
    """
    settling, _ = DrivenMechanism(Solver(mechanism), motor.at).rates
    if settling > _FASTEST_SETTLING * pace:
        raise ConfigurationError(
            f'the pump settles on its motor line or its resistance at {settling:.3g}/s: must be '
            f'at most {_FASTEST_SETTLING:g} times {pace:.3g} rad/s, its no-load speed, to be '
            'charted; lower motor.damping or slider.damping, or use linkage_record'
        )


def settle(
    mechanism: WindPump,
    motor: Motor,
    speed: float,
    progress: Callable[[Iterable[Any], str], Any],
) -> PeriodicMotion:
    """Integrates a pump until it is near a stable motion.

    Args:
        mechanism: The pump, with the start of its slider.
        motor: Motor of the pump.
        speed: Speed of the crank at angle 0, rad/s.
        progress: Wraps an iterable in a progress bar with a label.

    Returns:
        The stable motion.

    Raises:
        ConfigurationError: The motor does not turn the crank forwards, or the pump does not
            settle.
    """
    balance, start, _ = prepared(mechanism, motor, [speed])
    search = Search(balance, motor, start)
    search.run(progress, _CHECKS)
    if search.belongs[0] < 0:
        turns = search.motions.phases[-1][0, 0] / (2 * np.pi)
        raise ConfigurationError(
            f'from {speed:g} rad/s the pump does not settle within {turns:.1f} turns: '
            'linkage_chart pump draws its motion'
        )
    return search.states[int(search.belongs[0])]
