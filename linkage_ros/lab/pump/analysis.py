# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Steady states of a wind pump under its motor: document 3's figure 3, computed."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict
from typing import Any, NamedTuple

import numpy as np

from linkage_ros.lab.pump.attractors import Search
from linkage_ros.lab.pump.branch import (
    END,
    LOST,
    Piece,
    SteadyState,
    bistable_ranges,
    steady_states,
)
from linkage_ros.lab.pump.continuation import Limits, curves, with_curve
from linkage_ros.lab.pump.harmonic_balance import AVERAGED, HarmonicBalance
from linkage_ros.lab.pump.motions import Motions
from linkage_ros.lab.pump.periodic_motion import NUMBERS, PeriodicMotion
from linkage_ros.lab.pump.starts import named_starts, require_forwards
from linkage_ros.model.wind_pump import WindPump
from linkage_ros.motion.drives import Motor
from linkage_ros.numeric import Array

CHANGES = (0.95, 1.05)  # of the motor's torque
_SLOWEST = 1 / 3  # of the slowest start: where the scan of speeds begins
_FASTEST = 10.0  # times the fastest start: where it ends at most
_ABOVE = 1.1  # how far beyond the highest torque of interest it goes
_STEP, _QUICK_STEP = 0.15, 0.3  # along a curve, relative
STARTS = 256  # a state that 2 % of them reach is missed once in 170 times
_SLOW, _SLIDING = 0.03, 2.0  # speeds of starts: of the crank, and of the slider per crank pin's


class Start(NamedTuple):
    """A motion from a start that has a name.

    Attributes:
        name: Name of the start.
        times: s.
        speeds: Speeds of the crank at these times, rad/s.
        state: Number of the steady state at which it settles; None: at none.
        ended: Why it ended; None: it did not.
    """

    name: str
    times: Array
    speeds: Array
    state: int | None
    ended: str | None

    def record(self) -> dict[str, Any]:
        """For JSON."""
        return {
            'start': self.name, 'settles_at_state': self.state, 'ended': self.ended,
            'duration': float(self.times[-1]),
        }  # fmt: skip


class Analysis(NamedTuple):
    """All that is found of one pump under one motor.

    Attributes:
        motor: Motor of the pump.
        states: Its steady states by growing speed, stable or not.
        averaged_states: What averaging predicts instead.
        pieces: The load curve.
        averaged: The averaged load curve.
        sensitivities: Each stable state under the changed torques: number of the state, torque,
            N m, the state then, and its relative changes; none where there is no such state.
        runs: Motions from starts that have names.
        shares: Share of the starts, by the number of the state where they settle.
        ended: Share of the starts from which the motion leaves what the coordinates describe.
        unidentified: Share of the starts that do neither.
    """

    motor: Motor
    states: list[SteadyState]
    averaged_states: list[SteadyState]
    pieces: list[Piece]
    averaged: list[Piece]
    sensitivities: list[dict[str, Any]]
    runs: list[Start]
    shares: list[float]
    ended: float
    unidentified: float

    def record(self) -> dict[str, Any]:
        """For JSON, in SI units."""
        return {
            'motor': asdict(self.motor),
            'states': [
                {**state.motion.record(), 'share_of_starts': share}
                for state, share in zip(self.states, self.shares, strict=True)
            ],
            'averaged_states': [_numbers(state.motion) for state in self.averaged_states],
            'starts': {
                'count': STARTS, 'ended': self.ended, 'unidentified': self.unidentified,
            },
            'torques_with_two_stable_states': bistable_ranges(self.pieces),
            'stability_lost': [
                {'kind': piece.ends_at, **piece.motions[-1].record()}
                for piece in self.pieces
                if piece.ends_at not in (END, LOST)
            ],
            'sensitivities': self.sensitivities,
            'load_curve': [
                {**_numbers(motion), 'stable': piece.stable}
                for piece in self.pieces
                for motion in piece.motions
            ],
            'averaged_load_curve': [
                _numbers(motion) for piece in self.averaged for motion in piece.motions
            ],
            'runs': [run.record() for run in self.runs],
        }  # fmt: skip


def _numbers(motion: PeriodicMotion) -> dict[str, Any]:
    multipliers = [[value.real, value.imag] for value in motion.multipliers]
    return {name: getattr(motion, name) for name in NUMBERS} | {'multipliers': multipliers}


def analyse(
    mechanism: WindPump,
    motor: Motor,
    *,
    speeds: Sequence[float],
    quick: bool,
    progress: Callable[[Iterable[Any], str], Any],
) -> Analysis:
    """Finds the steady states of a pump, from where they are reached, and for which torques.

    Args:
        mechanism: The pump, with the start of its slider.
        motor: Motor of the pump.
        speeds: Speeds of the crank at angle 0, rad/s, from which the pump is started.
        quick: Whether fewer motions of each curve will do.
        progress: Wraps what is gone through, with a word for it: a progress bar.

    Returns:
        The analysis.

    Raises:
        ConfigurationError: The motor or a start speed turns nothing forwards.
        UnreachableError: The pump cannot start from where its slider is.
    """
    require_forwards(mechanism, motor, speeds)
    averaging = HarmonicBalance(mechanism, motor.damping, AVERAGED)
    balance = HarmonicBalance(mechanism, motor.damping)
    limits, averaged = _limits(averaging, motor, speeds)
    limits = limits._replace(step=_QUICK_STEP if quick else _STEP)
    pieces = curves(balance, limits)
    known = [state.motion for state in steady_states(balance, pieces, motor.torque)]
    names, starts = named_starts(mechanism, speeds, known)
    box = _box(mechanism, motor, limits.fastest)
    motions = Motions(balance.solver, motor, np.hstack((starts, box)), len(names))
    search = Search(balance, motor, motions, filter(lambda state: state.stable, known))
    search.run(progress)
    for state in search.states:
        pieces = with_curve(balance, state, pieces, limits)
    states = steady_states(balance, pieces, motor.torque)
    for state in search.states:
        if not any(state.is_same(one.motion) for one in states):
            pieces.append(Piece([state], LOST, LOST))
            states.append(SteadyState(state, pieces[-1]))
    states.sort(key=lambda state: state.motion.speed)
    numbers = [
        next(number for number, one in enumerate(states) if one.motion.is_same(state))
        for state in search.states
    ]
    settled = np.array([*numbers, -1])[search.belongs]
    of_box = slice(len(names), None)
    return Analysis(
        motor,
        states,
        steady_states(averaging, averaged, motor.torque),
        pieces,
        averaged,
        [
            one
            for change in CHANGES
            for one in _changed(balance, pieces, states, change * motor.torque)
        ],
        [
            Start(
                name, np.array(motions.times)[:, number], np.array(motions.speeds)[:, number],
                None if settled[number] < 0 else int(settled[number]), motions.reason(number),
            )
            for number, name in enumerate(names)
        ],
        [float(np.mean(settled[of_box] == number)) for number in range(len(states))],
        float(np.mean(motions.ended[of_box])),
        float(np.mean(search.unidentified[of_box])),
    )  # fmt: skip


def _limits(
    averaging: HarmonicBalance, motor: Motor, speeds: Sequence[float]
) -> tuple[Limits, list[Piece]]:
    """Speeds up to where an averaged motion takes more torque than any slower one; its curve.

    The load is never negative: a motor of torque M0 turns nothing faster than M0 / m.
    """
    slowest, fastest = _SLOWEST * min(speeds), _FASTEST * max(speeds)
    peak = motor.torque
    averaged: list[Piece] = []
    for _ in range(2):
        top = min(fastest, _ABOVE * peak / motor.damping) if motor.damping else fastest
        limits = Limits(slowest, max(top, *speeds), _ABOVE * peak, _QUICK_STEP)
        if averaged:
            break
        averaged = curves(averaging, limits._replace(torque=math.inf))
        peak = max((one.torque for piece in averaged for one in piece.motions), default=peak)
        peak = max(peak, motor.torque)
    return limits, averaged


def _box(mechanism: WindPump, motor: Motor, fastest: float) -> Array:
    """Starts all over slider positions and speeds at crank angle 0, of shape (4, n)."""
    r, b, c = (link.length for link in (mechanism.crank, mechanism.coupler, mechanism.rod))
    if motor.damping:
        fastest = motor.torque / motor.damping
    side = math.copysign(1.0, mechanism.slider.position)
    low = np.array((0.0, side * (abs(b - c) + r), _SLOW * fastest, -_SLIDING * r * fastest))
    high = np.array((0.0, side * (b + c - r), fastest, _SLIDING * r * fastest))
    shares = np.random.default_rng(0).random((STARTS, 4))
    box: Array = (low + shares * (high - low)).T
    return box


def _changed(
    balance: HarmonicBalance,
    found: Sequence[Piece],
    states: Sequence[SteadyState],
    torque: float,
) -> Iterator[dict[str, Any]]:
    """The stable states under another torque."""
    others = {state.piece: state.motion for state in steady_states(balance, found, torque)}
    for number, (state, piece) in enumerate(states):
        if state.stable:
            motion = others.get(piece)
            changes = {
                name: getattr(motion, name) / getattr(state, name) - 1
                for name in ('speed', 'stroke', 'flow')
                if motion
            }
            record = motion and motion.record()
            yield {'state': number, 'torque': torque, 'motion': record, 'changes': changes}
