# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Steady states of a wind pump under its motor: document 3's figure 3, computed."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, replace
from typing import Any, NamedTuple

import numpy as np

from linkage_ros.dynamics.solver import Solver
from linkage_ros.lab.pump.averaging import Averaged, Averaging
from linkage_ros.lab.pump.branch import Branch, find_states, follow_branch
from linkage_ros.lab.pump.periodic import PeriodicMotion
from linkage_ros.lab.pump.poincare import PoincareMap
from linkage_ros.lab.pump.runs import START_SPEED, Run, follow_run
from linkage_ros.lab.pump.sensitivity import CHANGES, Sensitivity, sensitivities
from linkage_ros.model.wind_pump import WindPump
from linkage_ros.motion.drives import Motor
from linkage_ros.quantities import Quantity

_SLOWEST = 1 / 3  # of the slowest start: where the scan of speeds ends
_FASTEST = 10.0  # times the fastest start: where it begins at most
_ABOVE = 1.1  # how far beyond the highest speed of interest it begins
_ASIDE = 0.02  # of the speed of an unstable state: how far from it motions start
_SETTLED = 1e-3  # what remains of the deviations at the start of a run; quick: ten times that
_TURNS = 150  # of a state at most, in which a run comes near
_UNKNOWN = 60  # turns where there is no state
_NEAR = 0.05  # of the speed of a state: a run that ends so near has settled there
_FORWARDS = Quantity('number', 'motor torque at rest that turns the crank', 'N m', 1e-9, 1e12)


class Analysis(NamedTuple):
    """All that is found of one pump under one motor.

    Attributes:
        poincare: The Poincare map.
        motor: Motor of the pump.
        states: Settled motions by growing speed, stable or not.
        averaged_states: What averaging predicts instead.
        branch: Settled motions over the speed.
        averaged: Averaged motions over the speed, in stretches without a gap.
        sensitivities: Sensitivities of the stable states.
        runs: Motions from single starts.
        ends: The number of the state at which each run settles; None: at none of them.
    """

    poincare: PoincareMap
    motor: Motor
    states: list[PeriodicMotion]
    averaged_states: list[Averaged]
    branch: Branch
    averaged: list[list[Averaged]]
    sensitivities: list[Sensitivity]
    runs: list[Run]
    ends: list[int | None]

    def record(self) -> dict[str, Any]:
        """For JSON, in SI units; flow is stroke x speed."""
        return {
            'motor': asdict(self.motor),
            'states': [state.record() for state in self.states],
            'averaged_states': [state.record() for state in self.averaged_states],
            'torques_with_two_stable_states': [
                one._asdict() for one in self.branch.bistable_ranges()
            ],
            'stability_lost': [
                {'kind': kind, **motion.record()} for kind, motion in self.branch.boundaries
            ],
            'sensitivities': [one.record() for one in self.sensitivities],
            'load_curve': [
                {
                    'speed': motion.speed,
                    'load': motion.torque - self.motor.damping * motion.speed,
                    'torque': motion.torque,
                    'stroke': motion.stroke,
                    'stable': motion.stable,
                }
                for stretch in self.branch.stretches
                for motion in stretch
            ],
            'averaged_load_curve': [one.record() for stretch in self.averaged for one in stretch],
            'runs': [
                {**run.record(), 'settles_at_state': end}
                for run, end in zip(self.runs, self.ends, strict=True)
            ],
        }


def analyse(
    mechanism: WindPump,
    motor: Motor,
    *,
    speeds: Sequence[float],
    quick: bool,
    progress: Callable[[Iterable[Any], str], Any],
) -> Analysis:
    """Finds what a pump settles at, from where, and for which torques.

    Args:
        mechanism: The pump, with the start of its slider.
        motor: Motor of the pump.
        speeds: Speeds of the crank at angle 0, rad/s, from which the pump is started.
        quick: Whether fewer speeds and starts will do.
        progress: Wraps what is gone through, with a word for it: a progress bar.

    Returns:
        What is found; no states where there are none.

    Raises:
        ConfigurationError: The motor or a speed turns nothing forwards.
        UnreachableError: The pump cannot start from where its slider is.
    """
    require_forwards(mechanism, motor, speeds)
    poincare, averaging = PoincareMap(mechanism, motor.damping), Averaging(mechanism)
    averaged = _scan(averaging, motor, speeds, 24 if quick else 90)
    branch = follow_branch(poincare, averaged, progress)
    torques = [motor.torque, *(motor.torque * change for change in CHANGES)]
    found, *others = find_states(poincare, branch, torques)
    states = [state.motion for state in found]

    top = max(*speeds, _top(motor, 2 * max(speeds)))
    duration = _settling_time(states, 10 * _SETTLED if quick else _SETTLED, top)
    runs = [
        follow_run(poincare.solver, motor, point, duration, name)
        for name, point in progress(_starts(mechanism, speeds, states), 'runs')
    ]
    ends = [_end(run, states) for run in runs]
    changed = sensitivities(motor.torque, found, others)
    return Analysis(
        poincare, motor, states, averaging.states(averaged, motor), branch, averaged,
        changed, runs, ends,
    )  # fmt: skip


def require_forwards(mechanism: WindPump, motor: Motor, speeds: Sequence[float]) -> None:
    """Passes if a motor and starts turn the crank forwards.

    Args:
        mechanism: The pump.
        motor: Motor of the pump.
        speeds: Speeds of the crank at the starts, rad/s.

    Raises:
        ConfigurationError: They do not.
        UnreachableError: The pump cannot start from where its slider is.
    """
    _FORWARDS.clean('motor.torque', motor.torque)
    slider = mechanism.slider
    solver = Solver(mechanism)
    for speed in speeds:
        START_SPEED.clean('start speed', speed)
        solver.accelerations((0.0, slider.position), (speed, slider.velocity), motor.torque)


def _starts(
    mechanism: WindPump, speeds: Sequence[float], states: Sequence[PeriodicMotion]
) -> list[tuple[str, tuple[float, float, float]]]:
    """Names and places of the starts of single runs: those asked for, and next to a saddle."""
    slider = mechanism.slider
    starts = [(f'{speed:g} rad/s', (slider.position, slider.velocity, speed)) for speed in speeds]
    for state in states:
        x, v, w = state.point
        for sign, word in ((-1, 'below'), (1, 'above')) if not state.stable else ():
            name = f'{_ASIDE:.0%} {word} {state.speed:.4g} rad/s'
            starts.append((name, (x, v, w * (1 + sign * _ASIDE))))
    return starts


def _settling_time(states: Sequence[PeriodicMotion], shrink: float, fastest: float) -> float:
    """The time, s, in which deviations from all stable states shrink to this part."""
    times = [
        state.period * min(_TURNS, 5 + math.log(shrink) / math.log(max(state.radius, 1e-9)))
        for state in states
        if state.stable
    ]
    return max(times, default=_UNKNOWN * 2 * math.pi / fastest)


def _end(run: Run, states: Sequence[PeriodicMotion]) -> int | None:
    """The number of the stable state at whose speed a run ends."""
    speed = float(np.mean(run.speeds[-len(run.speeds) // 10 :]))
    near = [
        number
        for number, state in enumerate(states)
        if state.stable and abs(speed / state.speed - 1) < _NEAR
    ]
    return near[0] if near and not run.ended else None


def _top(motor: Motor, bound: float) -> float:
    """The no-load speed of a motor, at which its torque is 0, rad/s, within a bound."""
    return min(motor.torque / motor.damping, bound) if motor.damping else bound


def _scan(
    averaging: Averaging, motor: Motor, speeds: Sequence[float], count: int
) -> list[list[Averaged]]:
    """Averaged motions over the speed, up to where one takes more torque than any slower one.

    The load is never negative: a motor of torque M0 turns nothing faster than M0 / m.
    """
    averaged: list[list[Averaged]] = []
    for _ in range(2):
        peak = max(
            (one.torque(motor.damping) for stretch in averaged for one in stretch), default=0.0
        )
        stronger = replace(motor, torque=_ABOVE * max(motor.torque, peak))
        top = _top(stronger, _FASTEST * max(speeds))
        averaged = averaging.follow(np.geomspace(_SLOWEST * min(speeds), top, count).tolist())
    return averaged
