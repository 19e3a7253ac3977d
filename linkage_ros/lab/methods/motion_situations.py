# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Motions under a torque in which integrators fail, generated from a seed."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, partial

import numpy as np

from linkage_ros.dynamics.solver import Solver
from linkage_ros.lab.methods.linkages import Random, four_bar, limited
from linkage_ros.lab.methods.motion_bench import ENERGY, LOOP, TRAJECTORY, MotionBench, even
from linkage_ros.lab.methods.outcomes import Situation
from linkage_ros.lab.reference.motions import MotionReference
from linkage_ros.lab.reference.problems import (
    InitialValueProblem,
    Phase,
    coasting,
    driven_pump,
    free_pump,
    preset,
)
from linkage_ros.model.parts import Body, Coupler
from linkage_ros.motion.drives import Motor

_SEED = 20_261_122


def _cases(
    make: Callable[[Random, int], Iterator[MotionBench]],
) -> Callable[[int], list[MotionBench]]:
    """Motions of a situation, shared by situations that judge the same motions."""

    @cache
    def cases(count: int) -> list[MotionBench]:
        return list(make(np.random.default_rng([_SEED, *make.__name__.encode()]), count))

    return cases


@_cases
def _driven(random: Random, count: int) -> Iterator[MotionBench]:
    for i in range(max(2, count // 8)):
        speed = (2.0, 6.0)[i] if i < 2 else float(random.uniform(1.0, 7.0))
        yield MotionBench(driven_pump(speed), even(5.0 if count >= 10 else 2.0))


@_cases
def _change_point(random: Random, count: int) -> Iterator[MotionBench]:
    for _ in range(max(2, count // 5)):
        x, y = (float(k) / 64 for k in random.integers((8, 33), (32, 64)))
        # The coupler does not turn, so that without weights nothing depends on the crank angle.
        mechanism = replace(four_bar((x, y, x, y)), gravity=(0.0, 0.0))
        angle, speed, torque = (float(k) for k in random.uniform((-2, 1, 0.1), (-1, 3, 0.2)))
        problem = InitialValueProblem(mechanism, (angle, speed), Motor(torque))
        ((inertia,),) = problem.driven.solver.matrix(1.0)
        law = partial(_speeding_up, angle, speed, torque / inertia)
        yield MotionBench(problem, even(4.0), at=law)


@_cases
def _steep_line(random: Random, count: int) -> Iterator[MotionBench]:
    for i in range(max(2, count // 5)):
        damping = (1e3, 1e7)[i] if i < 2 else 10.0 ** float(random.uniform(3, 9))
        x, y = (float(k) / 64 for k in random.integers((8, 33), (32, 64)))
        mechanism = replace(four_bar((x, y, x, y)), gravity=(0.0, 0.0))
        speed = float(random.uniform(5, 20))
        problem = InitialValueProblem(mechanism, (0.0, 0.0), Motor(damping * speed, damping))
        ((inertia,),) = problem.driven.solver.matrix(1.0)
        law = partial(_settling, 0.0, speed, damping / inertia)
        yield MotionBench(problem, even(1.0), at=law)


@_cases
def _stiff_guide(random: Random, count: int) -> Iterator[MotionBench]:
    pump = preset('wind_pump').mechanism
    # Without masses coupler and rod, between crank and slider, leave them to themselves.
    pump = replace(
        pump, gravity=(0.0, 0.0), crank=Body(0.12, inertia=20.0),
        coupler=Coupler(0.8), rod=Body(1.6),
    )  # fmt: skip
    for i in range(max(2, count // 5)):
        damping = (1e5, 1e9)[i] if i < 2 else 10.0 ** float(random.uniform(5, 11))
        force, speed = (float(k) for k in random.uniform((-0.1, 1), (0.1, 3)))
        slider = replace(pump.slider, damping=damping, force=damping * force)
        start = 0.0, slider.position, speed, 1.0
        problem = InitialValueProblem(replace(pump, slider=slider), start)
        law = partial(_sliding, start, force, damping / slider.mass)
        yield MotionBench(problem, even(1.0), at=law)


def _settling(begin: float, end: float, rate: float, time: float) -> tuple[float, float]:
    """Path and speed of a body that approaches a speed under linear damping."""
    settled = -math.expm1(-rate * time)
    way = end * time + (begin - end) * settled / rate
    return way, begin + (end - begin) * settled


def _sliding(start: Phase, end: float, rate: float, time: float) -> Phase:
    """The same for a slider, beside a crank of constant speed."""
    angle, place, speed, velocity = start
    moved, velocity = _settling(velocity, end, rate, time)
    return angle + speed * time, place + moved, speed, velocity


def _speeding_up(angle: float, speed: float, acceleration: float, time: float) -> Phase:
    return angle + (speed + acceleration / 2 * time) * time, speed + acceleration * time


@_cases
def _stretched(random: Random, count: int) -> Iterator[MotionBench]:
    velocities = [5.0, 6.0, -7.0]
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
            problem = driven_pump(2.0, velocities[found] if found < 3 else drawn)
        reference = MotionReference(problem)
        stretched = reference.end(0.5)
        if stretched is not None:
            found += 1
            times = stretched * np.linspace(0.0, 1.5, 14)[1:]
            yield MotionBench(problem, times.tolist(), at=reference.at)


@_cases
def _long(_: Random, count: int) -> Iterator[MotionBench]:
    # The pump's minute, and ten seconds more, are too long for a chart that is to be quick.
    yield MotionBench(coasting(), even(30.0 if count >= 10 else 20.0))
    if count >= 10:
        yield MotionBench(free_pump(9.0), even(60.0))


MOTION_SITUATIONS = (
    Situation(
        'driven pump', 'the wind pump with its motor, from 2, 6 and other rad/s', _driven,
        judged=TRAJECTORY,
    ),
    Situation(
        'change point under a torque',
        'a parallelogram whose crank is driven through both, several times', _change_point,
        judged=TRAJECTORY,
    ),
    Situation(
        'steep motor line',
        'a parallelogram at rest under motor lines of 1e3 to 1e9 N m s', _steep_line,
        judged=TRAJECTORY,
    ),
    Situation(
        'stiff guide',
        "a slider, moving and pressed, in a pump's guide of 1e5 to 1e11 N s/m", _stiff_guide,
        judged=TRAJECTORY,
    ),
    Situation(
        'stretched dyad',
        'coupler and third link come into line at speed, and the motion goes on', _stretched,
        judged=TRAJECTORY,
    ),
    Situation(
        'long free run',
        'quadrilateral for 30 s, pump for a minute, without motors: the energy', _long,
        judged=ENERGY,
    ),
    Situation(
        'loop after a long run', 'the same: by how much the loop is open', _long, judged=LOOP
    ),
)  # fmt: skip
