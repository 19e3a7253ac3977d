# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a wind pump settles at under its motor: document 3's figure 3, computed."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from linkage_ros.analysis.averaging import Averaged, Averaging
from linkage_ros.analysis.basins import Basins, Neighbourhoods, explore, make_grid, patience
from linkage_ros.analysis.branch import Branch, find_states, follow_branch
from linkage_ros.analysis.periodic import PeriodicMotion
from linkage_ros.analysis.poincare import PoincareMap
from linkage_ros.analysis.runs import Run, follow_run
from linkage_ros.analysis.sensitivity import Sensitivity, sensitivities
from linkage_ros.core.equations import EquationsOfMotion
from linkage_ros.core.mechanism import WindPump
from linkage_ros.errors import ConfigurationError

_SLOWEST = 1 / 3  # of the slowest start: where the scan of speeds ends
_FASTEST = 10.0  # times the fastest start: where it begins at most
_ABOVE = 1.1  # how far beyond the highest speed of interest it begins
_ASIDE = 0.02  # of the speed of an unstable state: how far from it motions start
_SETTLED = 1e-3  # what remains of the deviations at the start of a run; quick: ten times that
_NEAR = 5e-3  # and of those from the grid


class Analysis(NamedTuple):
    """All that is found of one pump under one motor.

    Attributes:
        section: The Poincare map.
        torque: Of the motor at rest, N m.
        states: Settled motions by growing speed, stable or not.
        averaged_states: What averaging predicts instead.
        branch: Settled motions over the speed.
        averaged: Averaged motions over the speed, in stretches without a gap.
        sensitivities: Of the stable states.
        basins: Where the motions from a grid of starts settle.
        runs: Motions from single starts.
        ends: The number of the state at which each run ends, or ELSEWHERE.
    """

    section: PoincareMap
    torque: float
    states: list[PeriodicMotion]
    averaged_states: list[Averaged]
    branch: Branch
    averaged: list[list[Averaged]]
    sensitivities: list[Sensitivity]
    basins: Basins
    runs: list[Run]
    ends: list[int]

    @property
    def damping(self) -> float:
        """What the motor's torque loses per crank speed, N m s."""
        return self.section.damping

    def record(self) -> dict[str, Any]:
        """For JSON, in SI units; flow is stroke x speed."""
        return {
            'motor': {'torque': self.torque, 'damping': self.damping},
            'states': [
                {**state.record(), 'share_of_starts': self.basins.share(number)}
                for number, state in enumerate(self.states)
            ],
            'averaged_states': [state.record() for state in self.averaged_states],
            'torques_with_two_stable_states': [one._asdict() for one in self.branch.ranges()],
            'stability_lost': [
                {'kind': kind, **motion.record()} for kind, motion in self.branch.boundaries
            ],
            'sensitivities': [one.record() for one in self.sensitivities],
            'load_curve': [
                {
                    'speed': motion.speed,
                    'load': motion.torque - self.damping * motion.speed,
                    'torque': motion.torque,
                    'stroke': motion.stroke,
                    'stable': motion.stable,
                }
                for stretch in self.branch.stretches
                for motion in stretch
            ],
            'averaged_load_curve': [one.record() for stretch in self.averaged for one in stretch],
            'basins': self.basins.record(),
            'runs': [
                {**run.record(), 'settles_at_state': end if end >= 0 else None}
                for run, end in zip(self.runs, self.ends, strict=True)
            ],
        }


def analyse(
    mechanism: WindPump,
    torque: float,
    damping: float,
    *,
    speeds: Sequence[float] = (2.0, 6.0),
    quick: bool = False,
    progress: Callable[[Iterable[Any], str], Any] = lambda items, _: items,
) -> Analysis:
    """Finds what a pump settles at, from where, and for which torques.

    Args:
        mechanism: The pump; its slider starts as it says.
        torque: Of the motor at rest, N m.
        damping: What it loses per crank speed, N m s.
        speeds: Of the crank at angle 0, rad/s, from which the pump is started.
        quick: Whether fewer speeds and starts will do.
        progress: Wraps what is gone through, with a word for it: a progress bar.

    Returns:
        What is found; no states where there are none.

    Raises:
        ConfigurationError: The motor or a speed turns nothing forwards.
        UnreachableError: The pump cannot start from where its slider is.
    """
    require_forwards(mechanism, torque, damping, speeds)
    section, motor = PoincareMap(mechanism, damping), (torque, damping)
    averaging = Averaging(mechanism)
    averaged = _scan(averaging, motor, speeds, 40 if quick else 90)
    branch = follow_branch(section, averaged, progress)
    found = find_states(section, branch, torque)
    states = [state.motion for state in found]

    near, top = Neighbourhoods(section, states), max(*speeds, _top(motor, 2 * max(speeds)))
    grid = make_grid(top, mechanism.crank.length, 28 if quick else 80)
    basins = explore(mechanism, motor, near, grid, patience(states, _NEAR, top), progress)
    duration = patience(states, 10 * _SETTLED if quick else _SETTLED, top)
    runs = [
        follow_run(section.equations, motor, point, duration, name)
        for name, point in progress(_starts(mechanism, speeds, states), 'runs')
    ]
    ends = near.locate(np.array([run.phase for run in runs]).T).tolist()
    return Analysis(
        section, torque, states, averaging.states(averaged, torque, damping), branch, averaged,
        sensitivities(section, branch, torque, found), basins, runs, ends,
    )  # fmt: skip


def require_forwards(
    mechanism: WindPump, torque: float, damping: float, speeds: Sequence[float]
) -> None:
    """Passes if a motor and starts turn the crank forwards.

    Args:
        mechanism: The pump.
        torque: Of the motor at rest, N m.
        damping: What it loses per crank speed, N m s.
        speeds: Of the crank at the starts, rad/s.

    Raises:
        ConfigurationError: They do not.
        UnreachableError: The pump cannot start from where its slider is.
    """
    if not 0 < torque < math.inf:
        raise ConfigurationError(f'motor.torque {torque:g}: must be positive to turn the crank')
    if not 0 <= damping < math.inf:
        raise ConfigurationError(f'motor.damping {damping:g}: must not be negative')
    slider = mechanism.slider
    equations = EquationsOfMotion(mechanism)
    for speed in speeds:
        if not 0 < speed < math.inf:
            raise ConfigurationError(f'start speed {speed:g} rad/s: must be positive')
        equations.accelerations((0.0, slider.position), (speed, slider.velocity), torque)


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


def _top(motor: tuple[float, float], bound: float) -> float:
    """The speed at which the motor's torque is 0, rad/s, within a bound."""
    torque, damping = motor
    return min(torque / damping, bound) if damping else bound


def _scan(
    averaging: Averaging, motor: tuple[float, float], speeds: Sequence[float], count: int
) -> list[list[Averaged]]:
    """Averaged motions over the speed, up to where one takes more torque than any slower one.

    The load is never negative: a motor of torque M0 turns nothing faster than M0 / m.
    """
    torque, damping = motor
    averaged: list[list[Averaged]] = []
    for _ in range(2):
        peak = max((one.torque(damping) for stretch in averaged for one in stretch), default=0.0)
        top = _top((_ABOVE * max(torque, peak), damping), _FASTEST * max(speeds))
        averaged = averaging.follow(np.geomspace(_SLOWEST * min(speeds), top, count).tolist())
    return averaged
