# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Situations in which integrators fail, generated from a seed: motions under a torque."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeAlias

import numpy as np

from linkage_ros.dynamics.solver import Solver
from linkage_ros.lab.methods.linkages import Random, four_bar, limited
from linkage_ros.lab.methods.motion_bench import ENERGY, LOOP, TRAJECTORY, even
from linkage_ros.lab.reference.motions import MotionReference
from linkage_ros.lab.reference.problems import ChartMechanisms, InitialValueProblem, Phase
from linkage_ros.motion.drives import Motor

_SEED = 20_261_122
_BESIDE = 1e-3  # s before and after the end of a motion


class MotionCase(NamedTuple):
    """One motion in a situation.

    Attributes:
        problem: The motion and its start.
        times: At which it is asked for, in turn, s.
        end: When its coordinates end, s; None: they do not.
        formula: The motion in closed form; None: there is none.
    """

    problem: InitialValueProblem
    times: Sequence[float]
    end: float | None = None
    formula: Callable[[float], Phase] | None = None


Generate: TypeAlias = Callable[[ChartMechanisms, Random, int], Iterator[MotionCase]]


@dataclass(frozen=True)
class MotionSituation:
    """A kind of trouble.

    Attributes:
        name: As charts and docs call it.
        words: What it is.
        generate: Makes the motions; neighbours in the table that share it share them.
        judged: 'trajectory', 'energy' or 'loop' (how far it is open).
        exists: Whether it is judged up to the end of the coordinates; otherwise beyond, where the
            right answer is a refusal, or the motion that goes on in another assembly.
    """

    name: str
    words: str
    generate: Generate
    judged: str = TRAJECTORY
    exists: bool = True

    def cases(self, mechanisms: ChartMechanisms, count: int) -> list[MotionCase]:
        """The motions, the same at every call; the longer they are, the fewer."""
        seed = [_SEED, *self.generate.__name__.encode()]
        return list(self.generate(mechanisms, np.random.default_rng(seed), count))


def _driven(mechanisms: ChartMechanisms, random: Random, count: int) -> Iterator[MotionCase]:
    for i in range(max(2, count // 8)):
        speed = (2.0, 6.0)[i] if i < 2 else float(random.uniform(1.0, 7.0))
        yield MotionCase(mechanisms.driven(speed), even(5.0 if count >= 10 else 2.0))


def _swing(_: ChartMechanisms, random: Random, count: int) -> Iterator[MotionCase]:
    found = 0
    while found < max(1, count // 6):
        mechanism = limited(random)
        solver = Solver(mechanism)
        start, end = solver.reach.arcs[0]
        places = [start + part * (end - start) for part in (1e-9, 0.03, 1 - 1e-9)]
        # At rest where the weights pull it away from one dead centre, and lack the height to
        # take it to the other.
        first, height, last = (solver.energy(place, 0.0)[1] for place in places)
        if height < min(first, last) - 1.0:
            found += 1
            yield MotionCase(InitialValueProblem(mechanism, (places[1], 0.0)), even(3.0))


def _change_point(_: ChartMechanisms, random: Random, count: int) -> Iterator[MotionCase]:
    for _i in range(max(2, count // 5)):
        x, y = (float(k) / 64 for k in random.integers((8, 33), (32, 64)))
        # The coupler does not turn, so that without weights nothing depends on the crank angle.
        mechanism = replace(four_bar((x, y, x, y)), gravity=(0.0, 0.0))
        angle, speed, torque = (float(k) for k in random.uniform((-2, 1, 0.1), (-1, 3, 0.2)))
        problem = InitialValueProblem(mechanism, (angle, speed), Motor(torque))
        ((inertia,),) = problem.driven.solver.matrix(1.0)
        yield MotionCase(problem, even(4.0), formula=_speeding_up(problem.start, torque / inertia))


def _speeding_up(start: Phase, acceleration: float) -> Callable[[float], Phase]:
    angle, speed = start
    return lambda t: (angle + (speed + acceleration / 2 * t) * t, speed + acceleration * t)


def _stretched(mechanisms: ChartMechanisms, random: Random, count: int) -> Iterator[MotionCase]:
    velocities = [5.0, 6.0, -6.0]
    found = 0
    while found < max(4, count // 3):
        if found % 4 == 3:
            mechanism = limited(random)
            start, end = Solver(mechanism).reach.arcs[0]
            problem = InitialValueProblem(
                mechanism, ((start + end) / 2, float(random.uniform(3, 6)) * (end - start))
            )
        else:
            drawn = float(random.uniform(4.6, 8.0)) * (1 if random.random() < 0.5 else -1)
            problem = mechanisms.driven(2.0, velocities[found] if found < 3 else drawn)
        end_time = MotionReference(problem).end(0.5)
        if end_time is not None:
            found += 1
            before = np.linspace(0.0, end_time - _BESIDE, 9)[1:]
            after = end_time + _BESIDE * np.array([1.0, 3.0, 10.0, 30.0])
            yield MotionCase(problem, [*before.tolist(), *after.tolist()], end_time)


def _long(mechanisms: ChartMechanisms, _: Random, count: int) -> Iterator[MotionCase]:
    # The pump's minute, and ten seconds more, are too long for a chart that is to be quick.
    yield MotionCase(mechanisms.coasting(5 * math.pi), even(30.0 if count >= 10 else 20.0))
    if count >= 10:
        yield MotionCase(mechanisms.freed(9.0), even(60.0))


MOTION_SITUATIONS = (
    MotionSituation(
        'driven pump', 'the wind pump with its motor, from 2, 6 and other rad/s', _driven
    ),
    MotionSituation(
        'swing of a limited crank',
        'let go near a dead centre, it swings under the weights of the links',
        _swing,
    ),
    MotionSituation(
        'change point under a torque',
        'a parallelogram whose crank is driven through both, several times',
        _change_point,
    ),
    MotionSituation(
        'before a stretched dyad',
        'coupler and third link come into line at speed: up to 1 ms before',
        _stretched,
    ),
    MotionSituation(
        'stretched dyad',
        'the same from 1 ms after, where the coordinates no longer describe the motion',
        _stretched,
        exists=False,
    ),
    MotionSituation(
        'long free run',
        'the quadrilateral for 30 s, the pump for a minute, without motors: the energy',
        _long,
        ENERGY,
    ),
    MotionSituation(
        'loop after a long run', 'the same: by how much the loop is open', _long, LOOP
    ),
)
