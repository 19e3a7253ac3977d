# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Computes the steady states of a wind pump under its motor, as in document 3's figure 3."""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, replace
from typing import Any, NamedTuple, cast

import numpy as np

from linkage_ros.lab.pump.equations import BOTH
from linkage_ros.lab.pump.harmonic_balance import AVERAGED, HarmonicBalance
from linkage_ros.lab.pump.load_curve import (
    ALONE,
    Piece,
    SteadyState,
    bistable_ranges,
    stability_lost,
    steady_states,
    with_curves,
)
from linkage_ros.lab.pump.motions import alternating_motions
from linkage_ros.lab.pump.periodic_motion import PeriodicMotion
from linkage_ros.lab.pump.settling import Search, prepared, require_slow
from linkage_ros.model.load_curve import LoadCurve
from linkage_ros.model.wind_pump import WindPump
from linkage_ros.motion.drives import Motor
from linkage_ros.numeric import Array

_CHANGES = (0.95, 1.05)  # of the motor's torque
CHANGED = 'speed', 'stroke', 'flow'  # quantities of which changes are given
_SLOWEST, _FASTEST = 1 / 3, 10.0  # ends of the load curve, relative to the extreme start speeds
_ALIKE = 0.1  # largest relative difference in speed and stroke between a motion and its average
# Smallest crank speed, and largest slider speed relative to the crank pin, of the starts.
_SLOW, _SLIDING = 0.03, 2.0
# Number of starts: a state that attracts 2 % of them is missed in one of 170 runs. Largest number
# of checks of the motions.
COUNT, _CHECKS = 256, 64


class Start(NamedTuple):
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
        motor: Motor of the pump.
        assembly: Assembly of the pump.
        states: Steady states in order of speed, stable or not.
        pieces: The load curve.
        sensitivities: One record for each stable state and each changed torque: number, speed
            (rad/s) and period of the state; the changed torque (N m); the state at that torque and
            its relative changes, or the reason why that state is unknown.
        runs: Motions from named starts.
        stopped: Fraction of the starts from which the crank comes to rest or rocks back and forth.
        unidentified: Fraction of the starts with another or an unknown outcome.
        alternating: Records of motions that alternate between the assemblies and repeat, but were
            not found as Fourier series.
        has_corners: Whether a load is given by a curve, which has corners.
        spread: Slider speed below which loads that jump are smoothed, m/s; 0 if no load jumps.
    """

    motor: Motor
    assembly: str
    states: list[SteadyState]
    pieces: list[Piece]
    sensitivities: list[dict[str, Any]]
    runs: list[Start]
    stopped: float
    unidentified: float
    alternating: list[dict[str, Any]]
    has_corners: bool
    spread: float

    def record(self) -> dict[str, Any]:
        """Returns the analysis as a JSON record, in SI units."""
        return {
            'motor': asdict(self.motor),
            'states': [
                {**state.motion.record(), 'share_of_starts': state.share}
                for state in self.states
            ],
            'averaged_states': [
                state.averaged and state.averaged.numbers for state in self.states
            ],
            'starts': {
                'count': COUNT, 'stopped': self.stopped, 'unidentified': self.unidentified,
            },
            'alternating_motions': self.alternating,
            'jump_spread_over_slider_speed': self.spread,
            'torques_with_two_stable_states': bistable_ranges(self.pieces),
            'stability_lost': [
                {'kind': kind, **motion.record()}
                for kind, motion in stability_lost(self.pieces)
            ],
            'sensitivities': self.sensitivities,
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


def analyse(
    mechanism: WindPump,
    motor: Motor,
    *,
    speeds: Sequence[float],
    progress: Callable[[Iterable[Any], str], Any],
) -> Analysis:
    """Finds the steady states of a pump, their shares of the starts, and their torques.

    Args:
        mechanism: The pump, with the start of its slider.
        motor: Motor of the pump.
        speeds: Crank speeds at angle 0 from which the pump is started, positive, rad/s.
        progress: Wraps an iterable in a progress bar with a label.

    Returns:
        The analysis.

    Raises:
        ConfigurationError: The motor does not turn the crank forwards, or the damping is too
            strong.
        UnreachableError: The pump cannot be assembled with its slider at the start position.
    """
    balance, given, pace = prepared(mechanism, motor, speeds)
    require_slow(mechanism, motor, pace)
    limits = _SLOWEST * min(speeds), _FASTEST * max(speeds)
    pump = cast('WindPump', balance.solver.mechanism)
    inside = 2 * limits[0], limits[1] / 2
    resting = (next(balance.resting_sliders(*way), None) for way in (inside, inside[::-1]))
    pieces = with_curves(balance, [], resting, limits)
    known = [state.motion for state in steady_states(balance, pieces, motor.torque)]
    box = balance.solver.converted(_box(mechanism, pace))
    search = Search(balance, motor, np.hstack((given, box)), known, len(speeds))
    search.run(progress, _CHECKS)
    pieces = with_curves(balance, pieces, search.states, limits)
    states = steady_states(balance, pieces, motor.torque)
    for found in search.states:
        if not any(found.is_same(state.motion) for state in states):
            pieces.append(Piece([found], ALONE, ALONE))
            states.append(SteadyState(found, pieces[-1]))
    states.sort(key=lambda state: state.motion.speed)
    numbers = [
        next(number for number, state in enumerate(states) if state.motion.is_same(found))
        for found in search.states
    ]
    settled, motions = np.array([*numbers, -1])[search.belongs], search.motions
    of_box = range(len(speeds), len(speeds) + COUNT)
    states = [
        state._replace(
            averaged=_averaged(pump, state.motion),
            share=float(np.mean(settled[of_box] == number)),
        )
        for number, state in enumerate(states)
    ]
    lost = [number for number in of_box if search.unidentified[number]]
    alternating = alternating_motions(
        (motions.speeds(number) for number in lost if motions.assembly(number) == BOTH),
        [state.motion.speed for state in states], COUNT,
    )  # fmt: skip
    named = sum(one['share_of_starts'] for one in alternating)
    return Analysis(
        motor,
        mechanism.assembly,
        states,
        pieces,
        [
            one
            for change in _CHANGES
            for one in _changed(balance, pieces, states, change * motor.torque)
        ],
        list(_runs(search, speeds, settled.tolist())),
        float(np.mean(search.stopped[of_box])),
        max(0.0, len(lost) / COUNT - named),
        alternating,
        any(isinstance(load, LoadCurve) for load in pump.loads),
        max((getattr(load, 'width', 0.0) for load in pump.loads), default=0.0),
    )


def _runs(search: Search, speeds: Sequence[float], settled: Sequence[int]) -> Iterator[Start]:
    """Names the motions for the chart: the first ones, and those beside unstable states."""
    times, phases = np.array(search.motions.times), np.array(search.motions.phases)
    beside = [
        f'beside {state.speed:.4g} rad/s, {word}'
        for state in search.unstable
        for word in ('slower', 'faster')
    ]
    names = [*(f'{speed:g} rad/s' for speed in speeds), *[''] * COUNT, *beside]
    for number, (name, state) in enumerate(zip(names, settled, strict=True)):
        if name:
            crank_speeds = phases[:, -2, number]
            yield Start(name, times[:, number], crank_speeds, None if state < 0 else state)


def _averaged(pump: WindPump, motion: PeriodicMotion) -> PeriodicMotion | None:
    """Finds the averaged motion near a motion of one turn in one assembly; None if none exists."""
    if motion.turns > 1 or motion.assembly == BOTH:
        return None
    averaging = HarmonicBalance(replace(pump, assembly=motion.assembly), motion.damping, AVERAGED)
    found = averaging.find(averaging.sized(motion.slider, motion.crank, np.array([motion.torque])))
    changes = [getattr(found, x) / getattr(motion, x) - 1 for x in ('speed', 'stroke') if found]
    return found if found and np.abs(changes).max() < _ALIKE else None


def _box(mechanism: WindPump, pace: float) -> Array:
    """Distributes starts over slider positions and speeds at crank angle 0; shape (4, n)."""
    r, b, c = (link.length for link in (mechanism.crank, mechanism.coupler, mechanism.rod))
    side = math.copysign(1.0, mechanism.slider.position)
    low = np.array((0.0, side * (abs(b - c) + r), _SLOW * pace, -_SLIDING * r * pace))
    high = np.array((0.0, side * (b + c - r), pace, _SLIDING * r * pace))
    shares = np.random.default_rng(0).random((COUNT, 4))
    return (low + shares * (high - low)).T


def _changed(
    balance: HarmonicBalance,
    found: Sequence[Piece],
    states: Sequence[SteadyState],
    torque: float,
) -> Iterator[dict[str, Any]]:
    """Makes records of the stable states at another motor torque, N m."""
    pieces = [piece for piece in found if piece.stable]
    others = {state.piece: state.motion for state in steady_states(balance, pieces, torque)}
    for number, (state, piece, *_) in enumerate(states):
        if state.stable:
            motion = others.get(piece)
            end, kind = piece.ends[1 if torque > state.torque else 0]
            ended = f'its curve ends at {end.torque:.4g} N m: {kind}'
            reason = 'its curve was not followed' if kind == ALONE else ended
            yield {
                'state': number, 'speed': state.speed, 'period': state.turns, 'torque': torque,
                'motion': motion and motion.record(),
                'changes': {
                    name: getattr(motion, name) / getattr(state, name) - 1
                    for name in CHANGED
                    if motion
                },
                'reason': None if motion else reason,
            }  # fmt: skip
