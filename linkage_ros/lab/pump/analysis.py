# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Steady states of a wind pump under its motor: document 3's figure 3, computed."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict
from typing import Any, NamedTuple

import numpy as np

from linkage_ros.lab.pump.branch import (
    END,
    Piece,
    SteadyState,
    bistable_ranges,
    follow,
    pieces,
    steady_states,
)
from linkage_ros.lab.pump.harmonic_balance import AVERAGED, EXACT, HarmonicBalance
from linkage_ros.lab.pump.periodic_motion import NUMBERS, PeriodicMotion
from linkage_ros.lab.pump.runs import Run, follow_run, require_forwards
from linkage_ros.model.parts import Piston
from linkage_ros.model.wind_pump import WindPump
from linkage_ros.motion.drives import Motor
from linkage_ros.motion.fixed_step_integrator import Values

CHANGES = (0.95, 1.05)  # of the motor's torque
_SLOWEST = 1 / 3  # of the slowest start: where the scan of speeds begins
_FASTEST = 10.0  # times the fastest start: where it ends at most
_ABOVE = 1.1  # how far beyond the highest torque of interest it goes
_ASIDE = 0.02  # of the speed of an unstable state: how far from it motions start
_SETTLED = 1e-3  # what remains of the deviations at the start of a run; quick: ten times that
_TURNS = 150  # of a state at most, in which a run comes near
_UNKNOWN = 60  # turns where there is no state


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
        runs: Motions from single starts.
    """

    motor: Motor
    states: list[SteadyState]
    averaged_states: list[SteadyState]
    pieces: list[Piece]
    averaged: list[Piece]
    sensitivities: list[dict[str, Any]]
    runs: list[Run]

    def record(self) -> dict[str, Any]:
        """For JSON, in SI units."""
        return {
            'motor': asdict(self.motor),
            'states': [state.motion.record() for state in self.states],
            'averaged_states': [_numbers(state.motion) for state in self.averaged_states],
            'torques_with_two_stable_states': bistable_ranges(self.pieces),
            'stability_lost': [
                {'kind': piece.ends_at, **piece.motions[-1].record()}
                for piece in self.pieces
                if piece.ends_at != END
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
        }


def _numbers(motion: PeriodicMotion) -> dict[str, float]:
    return {name: getattr(motion, name) for name in NUMBERS}


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
        quick: Whether fewer speeds and shorter runs will do.
        progress: Wraps what is gone through, with a word for it: a progress bar.

    Returns:
        The analysis.

    Raises:
        ConfigurationError: The motor or a start speed turns nothing forwards.
        UnreachableError: The pump cannot start from where its slider is.
    """
    require_forwards(mechanism, motor, speeds)
    averaging = HarmonicBalance(mechanism, motor.damping, AVERAGED)
    balance = HarmonicBalance(mechanism, motor.damping, EXACT)
    scan = _scan(averaging, motor, speeds, 24 if quick else 90)
    averaged = [Piece(stretch) for stretch in follow(averaging, scan)]
    found = [piece for stretch in follow(balance, scan) for piece in pieces(balance, stretch)]
    states = steady_states(balance, found, motor.torque)
    motions = [state.motion for state in states]
    starts = _starts(mechanism.slider, speeds, motions)
    duration = _settling_time(motions, 10 * _SETTLED if quick else _SETTLED, scan[-1])
    return Analysis(
        motor,
        states,
        steady_states(averaging, averaged, motor.torque),
        found,
        averaged,
        [
            one
            for change in CHANGES
            for one in _changed(balance, found, states, change * motor.torque)
        ],
        [
            follow_run(balance.solver, motor, start, duration, name, motions)
            for name, start in progress(starts, 'runs')
        ],
    )


def _scan(
    averaging: HarmonicBalance, motor: Motor, speeds: Sequence[float], count: int
) -> list[float]:
    """Speeds up to where an averaged motion takes more torque than any slower one, rad/s.

    The load is never negative: a motor of torque M0 turns nothing faster than M0 / m.
    """
    peak, scan = motor.torque, []
    for _ in range(2):
        top = _FASTEST * max(speeds)
        if motor.damping:
            top = min(top, _ABOVE * peak / motor.damping)
        scan = np.geomspace(_SLOWEST * min(speeds), max(top, *speeds), count).tolist()
        motions = itertools.chain(*follow(averaging, scan))
        peak = max((motion.torque for motion in motions), default=peak)
    return scan


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


def _starts(
    slider: Piston, speeds: Sequence[float], states: Sequence[PeriodicMotion]
) -> list[tuple[str, Values]]:
    """Names and phases of the starts of single runs: those asked for, and next to a saddle."""
    starts: list[tuple[str, Values]] = [
        (f'{speed:g} rad/s', (0.0, slider.position, speed, slider.velocity)) for speed in speeds
    ]
    for state in states:
        x, w, v = state.at(np.zeros(1))[:, 0].tolist()
        for sign, word in ((-1, 'below'), (1, 'above')) if not state.stable else ():
            name = f'{_ASIDE:.0%} {word} {state.speed:.4g} rad/s'
            starts.append((name, (0.0, x, w * (1 + sign * _ASIDE), v)))
    return starts


def _settling_time(states: Sequence[PeriodicMotion], shrink: float, fastest: float) -> float:
    """The time, s, in which deviations from all stable states shrink to this part."""
    times = [
        2 * math.pi / state.speed
        * min(_TURNS, 5 + math.log(shrink) / math.log(max(abs(state.multipliers[0]), 1e-9)))
        for state in states
        if state.stable
    ]  # fmt: skip
    return max(times, default=_UNKNOWN * 2 * math.pi / fastest)


def states_table(analysis: Analysis) -> list[str]:
    """The states, and the stable ones under changed torques, as a table.

    Args:
        analysis: Analysis of a pump.

    Returns:
        Lines, for a font of equal widths.
    """
    if not analysis.states:
        return ['no settled motion found']
    lines = [
        f'{"":<11}{"mean speed":>11}{"averaged":>10}{"stroke":>10}{"flow":>10}{"efficiency":>12}'
        f'{"largest":>19}' + ''.join(f'{f"torque {change - 1:+.0%}":>27}' for change in CHANGES),
        f'{"":<11}{"rad/s":>11}{"rad/s":>10}{"m":>10}{"m/s":>10}{"":>12}'
        f'{"multiplier":>19}' + f'{"speed":>11}{"stroke":>8}{"flow":>8}' * len(CHANGES),
    ]
    for number, (state, _) in enumerate(analysis.states):
        averaged = min(
            (one.motion.speed for one in analysis.averaged_states),
            key=lambda speed: abs(speed - state.speed),
            default=math.nan,
        )
        largest = state.multipliers[0]
        share = state.efficiency
        lifted = '-' if share is None else f'{share:.4f}'
        aside = f' \N{PLUS-MINUS SIGN} {largest.imag:.4f}i' if largest.imag else ''
        changes = ''.join(
            '   ' + (''.join(f'{x:>+8.2%}' for x in one['changes'].values()) or f'{"none":>24}')
            for one in analysis.sensitivities
            if one['state'] == number
        )
        lines.append(
            f'{"stable" if state.stable else "unstable":<11}{state.speed:>11.6f}'
            f'{averaged:>10.4f}{state.stroke:>10.6f}{state.flow:>10.6f}{lifted:>12}'
            f'{f"{largest.real:.4f}{aside}":>19}{changes}'
        )
    return lines
