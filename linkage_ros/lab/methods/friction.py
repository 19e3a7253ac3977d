# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Methods of solving dry friction, and situations in which they fail.

Only the guide of a slider-crank has friction: its normal force is N = |b + k N|, where b is the
force without friction. The right answer is b / (1 - k) or -b / (1 + k), whichever develops from
|b| as the coefficient grows. If there is none, the mechanism is self-locking.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from linkage_ros.dynamics.solver import Solver
from linkage_ros.lab.methods.chain import Method, Task
from linkage_ros.lab.methods.linkages import Random, slider_crank
from linkage_ros.lab.methods.outcomes import Outcome, Situation, judged
from linkage_ros.model.friction import Friction

if TYPE_CHECKING:
    from linkage_ros.model.slider_crank import SliderCrank

_SEED = 20_261_123
_ROUNDS = 100
_PROBE = 10.0  # N, along the guide


class FrictionBench:
    """The guide of one slider-crank at one crank angle.

    Attributes:
        push: The normal force b without friction, to the guide's left, N.
        gain: The factor k: normal force that the friction of 1 N of normal force adds.
    """

    def __init__(self, mechanism: SliderCrank, crank: float, share: float) -> None:
        """Prepares the bench.

        Args:
            mechanism: The linkage, without friction.
            crank: Crank angle, rad.
            share: Share of the coefficient at which |k| is 1.
        """
        task = Task.at(mechanism, crank)
        self._asked = crank, task.speed, task.acceleration
        self.push, velocity = self._force(mechanism)
        pushed = replace(mechanism, slider=replace(mechanism.slider, force=_PROBE))
        slope = -math.copysign(1.0, velocity) * (self._force(pushed)[0] - self.push) / _PROBE
        self._friction = Friction(guide=share / abs(slope))
        self._mechanism, self.gain = mechanism, self._friction.guide * slope

    @property
    def locks(self) -> float:
        """The sign is that of what friction adds to the force: k or -k."""
        return self.gain * math.copysign(1.0, self.push)

    def _force(self, mechanism: SliderCrank) -> tuple[float, float]:
        solver = Solver(mechanism)
        state = solver.state(*self._asked)
        return float(solver.reactions(state).guide_force or 0.0), float(state.velocity[-1])

    def own(self) -> float:
        """Normal force computed by the package."""
        return abs(self._force(replace(self._mechanism, loads=(self._friction,)))[0])

    def judge(self, method: Method, situation: Situation) -> Iterator[Outcome]:
        """The outcome of a method."""
        exact = abs(self.push) / (1 - self.locks)
        yield judged(lambda: method.solve(self), exact, abs(exact), exists=situation.exists)


def _own(bench: FrictionBench) -> float:
    return bench.own()


def _one_round(bench: FrictionBench) -> float:
    return abs(bench.push + bench.gain * abs(bench.push))


def _fixed_point(bench: FrictionBench) -> float:
    force = 0.0
    for _ in range(_ROUNDS):
        force = abs(bench.push + bench.gain * force)
    return force


def _newton(bench: FrictionBench) -> float:
    force = 10.0 * abs(bench.push)  # as from a state before, in which more was pressed
    for _ in range(_ROUNDS):
        sign = math.copysign(1.0, bench.push + bench.gain * force)
        force = sign * bench.push / (1 - sign * bench.gain)
    return force


GROWN = 'Newton, growing'
FRICTION_METHODS = [
    Method(
        GROWN, 'friction', 'nothing', 'this package: dynamics/force_search.py', _own,
    ),
    Method(
        'Newton, at once', 'friction', 'a first guess', 'Newton on N = abs(b + k N)', _newton,
    ),
    Method(
        'fixed point', 'friction', 'a gain below 1', 'friction and forces in turn', _fixed_point,
    ),
    Method(
        'one round', 'friction', 'little friction', 'friction of the force without it', _one_round,
    ),
]  # fmt: skip


def _situation(
    name: str, words: str, share: float, wanted: Callable[[float], bool], *, exists: bool = True
) -> Situation:
    """Makes a situation of random slider-cranks at a share of the coefficient where |k| = 1."""

    def cases(count: int) -> list[FrictionBench]:
        random = np.random.default_rng([_SEED, *name.encode()])
        found: list[FrictionBench] = []
        while len(found) < count:
            bench = FrictionBench(*_rubbing(random), share)
            if wanted(bench.locks):
                found.append(bench)
        return found

    return Situation(name, words, cases, exists)


def _rubbing(random: Random) -> tuple[SliderCrank, float]:
    r, b, offset = (float(x) for x in random.uniform((0.1, 0.5, -0.02), (0.3, 1.0, 0.02)))
    crank = float(random.uniform(0.5, 2.6)) * (1 if random.random() < 0.5 else -1)
    return slider_crank(r, b, offset), crank


FRICTION_SITUATIONS = (
    _situation('friction', 'the normal force grows by a tenth', 0.1, lambda k: k > 0),
    _situation(
        'nearly self-locking', 'the coefficient is 0.999 of the one that locks', 0.999,
        lambda k: k > 0,
    ),
    _situation(
        'friction that relieves', 'friction takes off three times what presses on the guide', 3.0,
        lambda k: k < 0,
    ),
    _situation(
        'self-locking', 'the coefficient is 1.001 of the one that locks', 1.001, lambda k: k > 0,
        exists=False,
    ),
)  # fmt: skip
