# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where motions from a grid of starts settle: the basins of the stable states."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from linkage_ros.lab.pump.ensemble import Ensemble
from linkage_ros.lab.pump.periodic import PeriodicMotion
from linkage_ros.lab.pump.poincare import PoincareMap
from linkage_ros.model.wind_pump import WindPump
from linkage_ros.motion.drives import Motor
from linkage_ros.numeric import Array

LEAVES = -1  # what the coordinates describe: coupler and rod come into one line
ELSEWHERE = -2  # in none of the states, or not yet
_NEAR = 0.05  # of a state, in crank lengths and of its speed, is settled
_PARTS = 256  # of a turn, between which the course of a state is taken to be straight
_OFTEN = 5  # steps after which is looked where a motion is
_SHORTEST = 1e-7  # s: a step of a motion that cannot be followed on
_FIRST = _SHORTEST**0.5  # s: a step that is short of most, and far from the shortest
_MOST = 20_000  # steps
_BEYOND = 1.25  # of the speed that a grid is made for, its largest
_PULL = 8.0  # of the crank pin's speed then, the largest slider velocity
_TURNS = 150  # at most, of a state, in which a motion comes near
_UNKNOWN = 60  # turns where there is no state


class Neighbourhoods:
    """Tells which of the settled motions others are near to."""

    def __init__(self, poincare: PoincareMap, states: Sequence[PeriodicMotion]) -> None:
        """Takes up their courses.

        Args:
            poincare: The Poincare map.
            states: All of them; motions come to the stable ones.
        """
        self._length = poincare.solver.mechanism.crank.length
        self._angles = np.linspace(0, 2 * math.pi, _PARTS + 1)
        self._courses = []
        for number, state in enumerate(states):
            if state.stable:
                course = poincare.orbit(np.array([state.point]).T, state.torque, _PARTS)[:3, :, 0]
                # A state next to the edge of its basin counts only when it is really reached.
                gaps = [
                    abs(other.speed / state.speed - 1) / 4
                    for other in states
                    if other is not state
                ]
                self._courses.append((number, course, state.speed, min(gaps, default=_NEAR)))

    def locate(self, phases: Array) -> npt.NDArray[np.int_]:
        """Where motions are.

        Args:
            phases: As `Ensemble.advance` takes them.

        Returns:
            For each, the number of the state that it is near to, or ELSEWHERE.
        """
        found = np.full(phases.shape[1], ELSEWHERE)
        phi = phases[0] % (2 * math.pi)
        for number, course, speed, gap in self._courses:
            x, v, w = (np.interp(phi, self._angles, values) for values in course)
            apart = (
                abs(phases[1] - x) / self._length,
                abs(phases[3] - v) / (self._length * speed),
                abs(phases[2] - w) / speed,
            )
            found[np.max(apart, axis=0) < min(_NEAR, gap)] = number
        return found


class Basins(NamedTuple):
    """A grid of starts at crank angle 0, and where the motions from there settle.

    Attributes:
        position: Of the slider, m.
        speeds: Of the crank, rad/s.
        velocities: Of the slider, m/s.
        outcomes: A row for each velocity: the number of the state, LEAVES or ELSEWHERE.
        duration: For how long motions are followed, s.
    """

    position: float
    speeds: Array
    velocities: Array
    outcomes: npt.NDArray[np.int_]
    duration: float

    def share(self, outcome: int) -> float:
        """The part of the starts that have an outcome."""
        return float(np.mean(self.outcomes == outcome))

    def record(self) -> dict[str, Any]:
        """For JSON: a row of starts is a word, a letter for each."""
        letters = {LEAVES: 'x', ELSEWHERE: '?'}
        return {
            'slider_position': self.position,
            'crank_speeds': self.speeds.tolist(),
            'slider_velocities': self.velocities.tolist(),
            'duration': self.duration,
            'letters': "number of the state; x: leaves the coordinates' range; ?: none of these",
            'outcomes': [
                ''.join(letters.get(outcome, str(outcome)) for outcome in row)
                for row in self.outcomes.tolist()
            ],
        }


def settling_time(states: Sequence[PeriodicMotion], shrink: float, fastest: float) -> float:
    """How long it takes until deviations from all stable states have shrunk.

    Args:
        states: The states.
        shrink: To this part.
        fastest: Speed of the crank, rad/s, that tells the time where there is no state.

    Returns:
        s, of bounded length.
    """
    times = [
        state.period * min(_TURNS, 5 + math.log(shrink) / math.log(max(state.radius, 1e-9)))
        for state in states
        if state.stable
    ]
    return max(times, default=_UNKNOWN * 2 * math.pi / fastest)


def make_grid(fastest: float, length: float, count: int) -> tuple[Array, Array]:
    """Starts around those that a motor can lead to.

    Args:
        fastest: Crank speed, rad/s, that the grid is to go a little beyond.
        length: Of the crank, m.
        count: Of the crank speeds; the slider velocities are fewer.

    Returns:
        Crank speeds, rad/s, and slider velocities, m/s.
    """
    half = count // 3
    return (
        _BEYOND * fastest * np.arange(1, count + 1) / count,
        _PULL * fastest * length * np.arange(-half, half + 1) / half,
    )


def find_basins(
    mechanism: WindPump,
    motor: Motor,
    neighbourhoods: Neighbourhoods,
    grid: tuple[Array, Array],
    duration: float,
    progress: Callable[[Iterable[Any], str], Any],
) -> Basins:
    """Follows motions from a grid of starts until they settle.

    Args:
        mechanism: The pump; its slider starts from its position.
        motor: Of the pump.
        neighbourhoods: Of the states.
        grid: Crank speeds, rad/s, and slider velocities, m/s.
        duration: Longest time, s.
        progress: Wraps what is gone through, with a word for it.

    Returns:
        Where they settle.
    """
    ensemble, position = Ensemble(mechanism, motor), mechanism.slider.position
    speeds, velocities = (values.ravel() for values in np.meshgrid(*grid))
    phases = np.array((0 * speeds, 0 * speeds + position, speeds, velocities))
    outcomes, going = np.full(len(speeds), ELSEWHERE), np.arange(len(speeds))
    times, spans = 0 * speeds, np.full(len(speeds), _FIRST)
    for number in progress(iter(range(_MOST)), 'starts'):  # without its length: all settle before
        phases, made, spans = ensemble.advance(phases, spans)
        times += made
        found = np.where(spans < _SHORTEST, LEAVES, ELSEWHERE)
        if number % _OFTEN == 0:
            found = np.maximum(found, neighbourhoods.locate(phases))
        outcomes[going] = found
        rest = (found == ELSEWHERE) & (times < duration)
        if not rest.any():
            break
        phases, going, times, spans = phases[:, rest], going[rest], times[rest], spans[rest]
    return Basins(position, *grid, outcomes.reshape(len(grid[1]), len(grid[0])), duration)
