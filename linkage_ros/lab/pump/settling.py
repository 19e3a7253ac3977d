# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The states at which motions settle: each end is explained by a state, or counted."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np

from linkage_ros.dynamics.solver import Solver
from linkage_ros.errors import ConfigurationError
from linkage_ros.lab.pump.harmonic_balance import EXACT, HarmonicBalance
from linkage_ros.lab.pump.motions import Motions
from linkage_ros.lab.pump.periodic_motion import PeriodicMotion
from linkage_ros.lab.pump.smooth_load import smoothed
from linkage_ros.model.wind_pump import WindPump
from linkage_ros.motion.drives import Motor
from linkage_ros.numeric import Array
from linkage_ros.quantities import Quantity

_START = Quantity('number', 'crank speed to start from', 'rad/s', 1e-6, 1e6)
_FORWARDS = Quantity('number', 'motor torque at rest that turns the crank', 'N m', 1e-9, 1e12)

_STEPS = 100  # between two looks where the motions are; a turn takes some 10
_BACK = 60  # steps ago from which a motion must have come nearer
_NEAR = 0.05  # of crank length and speed: a motion so near to a state has settled there
_COMING, _NEARER = 0.5, 0.9  # or as near as this, and that much nearer than before
_LED = 2.0  # or as near as this to a state that Newton's method finds from its last turns
_ASKED = 6  # motions whose state is asked for at one look; at the last, failures to find one
_PERIODS = range(1, 9)  # turns after which a motion may repeat
_REPEATS = 0.02  # of a motion's spread: what a series over a period may miss
_GUESSES = 1, 2, 4  # turns, of a motion that has not yet settled
_BLOCKS = 40  # looks at a single motion


class Search:
    """Motions from many starts, and the stable states at which they settle.

    Attributes:
        motions: The motions.
        states: The states that are known, stable or not.
        belongs: The number of the state at which each motion settles, or -1.
        stopped: Whether the crank of each motion stands, or rocks to and fro.
    """

    def __init__(
        self, balance: HarmonicBalance, motor: Motor, starts: Array,
        states: Iterable[PeriodicMotion] = (),
    ) -> None:  # fmt: skip
        """Begins with the states that are known."""
        self._balance, self._motor, self.states = balance, motor, list(states)
        self.motions = Motions(balance.solver, motor, starts)
        self.belongs: Any = np.full(starts.shape[1], -1)
        self.stopped: Any = self.belongs > 0

    @property
    def unidentified(self) -> Any:
        """Whether each motion has neither ended nor stopped nor settled at a known state."""
        return (self.belongs < 0) & ~self.motions.ended & ~self.stopped

    def run(self, progress: Callable[[Iterable[Any], str], Any], blocks: int) -> None:
        """Follows the motions until all have settled or ended, for a bounded time."""
        for block in progress(range(blocks), 'motions'):
            self.motions.advance(_STEPS)
            self._assign()
            rest = np.flatnonzero(self.unidentified)
            apart = 1 if block == blocks - 1 else max(len(rest) // _ASKED, 1)
            failures = 0
            for number in rest[::apart].tolist():
                if self.unidentified[number] and failures < _ASKED:
                    failures += not self._identify(number)
            if not self.unidentified.any():
                return

    def _assign(self) -> None:
        """Finds which motions are at a state, or come near to it."""
        phases = self.motions.phases
        now, before = (
            np.array(phases[last - 10 : last]).swapaxes(0, 1)
            for last in (len(phases), len(phases) - _BACK)
        )
        turned = np.abs(phases[-1][0] - phases[-_STEPS][0]) > np.pi
        self.stopped = (self.belongs < 0) & ~self.motions.ended & ~turned
        for number, state in enumerate(self.states):
            away, was = state.distance(now), state.distance(before)
            near = (away < _NEAR) | ((away < _COMING) & (away < _NEARER * was))
            self.belongs[near & self.unidentified & state.stable] = number

    def _identify(self, number: int) -> bool:
        """Finds the state to which a motion leads, by Newton's method, and adds it if it is new.

        Returns:
            Whether one is found.
        """
        for turns in self._periods(number):
            equations = self._balance.over(turns)
            last = self.motions.last_turns(number, turns)
            if last is None:
                break
            state = equations.find(equations.guess(last, self._motor.torque)[0])
            if state and state.stable and not state.repeats_sooner:
                same = [i for i, known in enumerate(self.states) if state.is_same(known)]
                if not same:
                    self.states.append(state)
                    self._assign()
                if state.distance(last[:, -10:, None]) < _LED:
                    self.belongs[number] = same[0] if same else len(self.states) - 1
                return True
        return False

    def _periods(self, number: int) -> Iterable[int]:
        """The turns after which a motion may repeat: the least that fit, then guesses."""
        for turns in _PERIODS:
            last = self.motions.last_turns(number, 2 * turns)
            if last is None:
                break
            if self._balance.over(turns).guess(last, 0.0)[1] < _REPEATS:
                return dict.fromkeys((turns, *_GUESSES))
        return _GUESSES


def require_forwards(mechanism: WindPump, motor: Motor, speeds: Sequence[float]) -> Array:
    """The starts of a pump, if they and its motor turn the crank forwards.

    Args:
        mechanism: The pump, with the start of its slider.
        motor: Motor of the pump.
        speeds: Speeds of the crank at angle 0, rad/s.

    Returns:
        Crank angles, rad, slider positions, m, and their rates, of shape (4, n).

    Raises:
        ConfigurationError: They do not.
        UnreachableError: The pump cannot start from where its slider is.
    """
    _FORWARDS.clean('motor.torque', motor.torque)
    slider, solver = mechanism.slider, Solver(mechanism)
    for speed in speeds:
        _START.clean('start speed', speed)
        solver.accelerations((0.0, slider.position), (speed, slider.velocity), motor.torque)
    starts: Array = np.array([(0.0, slider.position, w, slider.velocity) for w in speeds]).T
    return starts


def pace_of(motor: Motor, speeds: Sequence[float]) -> float:
    """The speed at which the motor has no torque left; without damping, the fastest start."""
    return motor.torque / motor.damping if motor.damping else max(speeds)


def equations_of(mechanism: WindPump, motor: Motor, speeds: Sequence[float]) -> HarmonicBalance:
    """The equations of a pump; if a load of it jumps, of one with a smooth load.

    Args:
        mechanism: The pump.
        motor: Motor of the pump.
        speeds: Speeds of the crank at the starts, rad/s.
    """
    pump = smoothed(mechanism, pace_of(motor, speeds))
    return HarmonicBalance(pump, motor.damping, EXACT if pump is mechanism else 2 * EXACT)


def settle(
    mechanism: WindPump,
    motor: Motor,
    speed: float,
    progress: Callable[[Iterable[Any], str], Any],
) -> PeriodicMotion:
    """Follows a pump until it is near to a stable motion.

    Args:
        mechanism: The pump, with the start of its slider.
        motor: Motor of the pump.
        speed: Speed of the crank at angle 0, rad/s.
        progress: Wraps what is gone through, with a word for it: a progress bar.

    Returns:
        The stable motion.

    Raises:
        ConfigurationError: Motor or speed turn nothing forwards, or it does not settle.
        LinkageError: The motion leaves what the coordinates describe.
    """
    start = require_forwards(mechanism, motor, [speed])
    search = Search(equations_of(mechanism, motor, [speed]), motor, start)
    search.run(progress, _BLOCKS)
    search.motions.require_going(0)
    if search.belongs[0] < 0:
        turns = search.motions.phases[-1][0, 0] / (2 * np.pi)
        raise ConfigurationError(
            f'from {speed:g} rad/s the pump does not settle within {turns:.0f} turns: '
            'linkage_chart pump draws what it does'
        )
    return search.states[int(search.belongs[0])]
