# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Integrators of motions under a torque: their reference, orders, floors, work and drift."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from decimal import Decimal
from functools import partial

import numpy as np
import oracle_pump
import pytest
from mpmath import mp
from oracle import Oracle

from linkage_ros import FourBar, Solver
from linkage_ros.formulas import Vector
from linkage_ros.lab.methods import accuracy, linkages, registry
from linkage_ros.lab.methods.bench import LIMIT
from linkage_ros.lab.methods.integrators import Multipliers
from linkage_ros.lab.methods.motion_bench import MotionBench, even
from linkage_ros.lab.reference.motions import MotionReference
from linkage_ros.lab.reference.multibody import Multibody, eliminate
from linkage_ros.lab.reference.problems import ChartMechanisms, InitialValueProblem
from linkage_ros.motion.adaptive_integrator import AdaptiveSteps
from linkage_ros.motion.fixed_step_integrator import FixedSteps
from linkage_ros.numeric import with_turns
from linkage_ros.parameters.configuration import load

PUMP = load('wind_pump')
QUADRILATERAL = load('quadrilateral').mechanism
MECHANISMS = ChartMechanisms(QUADRILATERAL, PUMP.mechanism, PUMP.drive.motor)
BY_NAME = {method.name: method for method in registry.INTEGRATORS}
DRIVEN, COASTING = MECHANISMS.driven(6.0), MECHANISMS.coasting(5 * math.pi)


@pytest.fixture(scope='module')
def benches():
    return {'pump': MotionBench(DRIVEN, even(2.0)), 'four-bar': MotionBench(COASTING, even(0.5))}


def worst(bench, follower):
    return max(bench.error(i, follower.at(time)) for i, time in enumerate(bench.times))


def slope(x, y):
    return np.polyfit(np.log(x), np.log(y), 1)[0]


# ---------------------------------------------------------------- the reference


@pytest.mark.parametrize('problem', [COASTING, MECHANISMS.freed(9.0)])
def test_reference_is_the_same_with_shorter_steps(problem):
    other = MotionReference(problem, longest=0.03)
    mine = MotionReference(problem)
    for time in (0.2, 0.4):
        for x, y in zip(mine.at(time), other.at(time), strict=True):
            assert abs(x - y) < Decimal('1e-17')


def test_the_reference_agrees_with_the_energy_of_another_hand():
    """The time that a free crank needs is an integral over its angle: no steps of time."""
    angle, speed = MotionReference(COASTING).at(0.1)
    oracle = Oracle(QUADRILATERAL)
    with mp.workdps(30):
        start = oracle.energy(0.0, mp.mpf(COASTING.start[1]))

        def rate(x):
            rest = oracle.energy(x, 0)
            return mp.sqrt((start - rest) / (oracle.energy(x, 1) - rest))

        angle = mp.mpf(str(angle))
        assert abs(rate(angle) - mp.mpf(str(speed))) < 1e-17
        taken = mp.quad(lambda x: 1 / rate(x), mp.linspace(0, angle, 4))
        assert abs(taken - mp.mpf(0.1)) < 1e-17


def test_the_reference_agrees_with_absolute_coordinates_of_another_hand():
    times = [0.0, 0.5, 1.0, 1.5]
    with np.errstate(under='ignore'):
        other = oracle_pump.multipliers(oracle_pump.Pump(), oracle_pump.FAST, times)
    reference = MotionReference(DRIVEN)
    for time, row in zip(times[1:], other[1:], strict=True):
        assert np.array(reference.at(time), float) == pytest.approx(row, rel=1e-11, abs=1e-11)


@pytest.mark.parametrize(
    ('velocity', 'end'),
    # From an oracle of another hand, with the pump's other data as they are.
    [(5.0, 0.399465563600), (6.0, 0.273729384923), (-6.0, 0.230043884145)],
)
def test_the_end_of_the_coordinates_is_found(velocity, end):
    assert MotionReference(MECHANISMS.driven(2.0, velocity)).end(1.0) == pytest.approx(
        end, abs=1e-11
    )


def test_a_motion_that_does_not_end_has_no_end():
    assert MotionReference(DRIVEN).end(0.5) is None


def test_reference_stops_where_its_equations_are_singular():
    parallelogram = linkages.four_bar((0.25, 0.75, 0.25, 0.75))
    reference = MotionReference(InitialValueProblem(parallelogram, (-0.5, 2.0)))
    reference._state[1:7] = [Decimal(x) for x in (1, 0, 1, 0, 1, 0)]  # all links in line
    with pytest.raises(ArithmeticError, match='cannot be followed beyond'):
        reference.at(1.0)


@pytest.mark.parametrize('seed', range(2))
def test_multibody_accelerates_as_virtual_power_does(seed):
    random = np.random.default_rng(seed)
    problems = [
        InitialValueProblem(
            MECHANISMS.pump, (*random.uniform((0, 1.3), (7, 1.7)), *random.uniform(-5, 5, 2))
        )
    ]
    while len(problems) < 3:
        mechanism = linkages.turning(random)
        if isinstance(mechanism, FourBar):
            problems.append(InitialValueProblem(mechanism, tuple(random.uniform(-5, 5, 2))))
    for problem in problems:
        start = tuple(map(float, problem.start))
        q, u = start[: problem.count], start[problem.count :]
        solver = Solver(problem.mechanism)
        state = solver.state(q, u, (0.0,) * problem.count)
        places = [Vector.at(x) for x in state.position[:3]]
        places += [Vector(x, 0.0) for x in state.position[3:]]
        bodies = Multibody(problem.mechanism, float, Vector.at)
        found = bodies.accelerations(places, list(state.velocity), 3.0, eliminate)
        chosen = (found[0], *found[3:])
        assert chosen == pytest.approx(solver.accelerations(q, u, 3.0), rel=1e-10)


def test_elimination_takes_the_largest_pivot():
    rows, right = [[0.0, 2.0, 1.0], [1.0, 1.0, 1.0], [4.0, 0.0, -1.0]], [3.0, 2.0, 1.0]
    assert eliminate(rows, right) == pytest.approx(np.linalg.solve(rows, right))
    with pytest.raises(ZeroDivisionError):
        eliminate([[1.0, 2.0], [2.0, 4.0]], [1.0, 1.0])


# ---------------------------------------------------------------- orders


@pytest.mark.parametrize(
    ('name', 'problem', 'steps', 'order'),
    [
        ('RK4', MECHANISMS.driven(2.0), (0.05, 0.025, 0.0125, 0.005), 4),
        ('RK4', COASTING, (2e-3, 1e-3, 5e-4, 2.5e-4), 4),
        (registry.LIVE, MECHANISMS.driven(2.0), (0.05, 0.025, 0.0125, 0.01), 5),
        (registry.LIVE, DRIVEN, (0.025, 0.0125, 0.005, 0.0025), 5),
    ],
)
def test_fixed_steps_are_of_their_order(name, problem, steps, order):
    bench = MotionBench(problem, even(0.4 if problem is COASTING else 1.0))
    found = [worst(bench, BY_NAME[name].make(problem, {'step': step})) for step in steps]
    assert slope(steps, found) == pytest.approx(order, abs=0.3)


# ---------------------------------------------------------------- the registry


@pytest.mark.parametrize('name', [n for n in BY_NAME if n != registry.RECORDS])
def test_errors_fall_with_each_setting_down_to_a_floor(benches, name):
    bench, method = benches['pump'], BY_NAME[name]
    found = [worst(bench, method.make(bench.problem, setting)) for setting in method.settings]
    floor = found.index(min(found))
    down = [max(error, 2e-13) for error in found[: floor + 1]]
    assert all(b < a or b == 2e-13 for a, b in itertools.pairwise(down)), found
    assert down[-1] < (2e-7 if name == 'Radau' else 1e-8), found


def test_the_defaults_are_what_live_runs_and_records_take(benches):
    bench = benches['pump']
    for name, steps in (
        (registry.LIVE, FixedSteps(DRIVEN.driven, DRIVEN.start)),
        (registry.RECORDS, AdaptiveSteps(DRIVEN.driven, DRIVEN.start)),
    ):
        method = BY_NAME[name]
        follower = method.make(DRIVEN, method.steady)
        for time in bench.times:
            steps.advance(time)
            assert follower.at(time) == (with_turns(steps.phase[0], steps.pairs), *steps.phase[1:])


def test_the_defaults_are_right(benches):
    for bench in benches.values():
        for name in (registry.LIVE, registry.RECORDS):
            method = BY_NAME[name]
            assert worst(bench, method.make(bench.problem, method.steady)) < 1e-10


# ---------------------------------------------------------------- energy and the loop


@pytest.mark.parametrize('name', BY_NAME)
def test_the_energy_of_a_free_motion_stays(name):
    problem = MECHANISMS.freed(6.0)
    bench, method = MotionBench(problem, even(5.0)), BY_NAME[name]
    follower = method.make(problem, method.steady)
    limit = 1e-7 if name in ('Radau', 'multipliers, unstabilised') else 1e-10
    assert max(bench.drift(follower.at(time)) for time in bench.times) < limit
    assert bench.drift((math.nan, 1.5, 6.0, 0.0)) == math.inf


@pytest.mark.parametrize('problem', [MECHANISMS.freed(9.0), COASTING], ids=['pump', 'four-bar'])
def test_an_unstabilised_loop_opens_with_the_square_of_time(problem):
    follower, times, gaps = Multipliers(problem, 1e-9), np.arange(1.0, 31.0), []
    for time in times.tolist():
        follower.at(time)
        gaps.append(follower.gap())
    widest = np.maximum.accumulate(gaps)
    assert slope(times[2:], widest[2:]) == pytest.approx(2, abs=0.3)
    assert widest[-1] > 100 * 1e-9 * problem.mechanism.crank.length


def test_a_loop_that_is_closed_from_coordinates_does_not_open():
    for name in (registry.LIVE, registry.RECORDS, 'DOP853', 'RK4', 'Radau'):
        method = BY_NAME[name]
        follower = method.make(DRIVEN, method.steady)
        follower.at(1.0)
        assert follower.gap() < 1e-14


# ---------------------------------------------------------------- measuring


def test_a_method_that_fails_has_no_time_and_an_error_without_bound():
    bench = MotionBench(MECHANISMS.driven(2.0, 6.0), even(0.5))
    point = accuracy.Measurement('RK4', '', '', 'trajectory', '', 0.0, 0.0)
    error = bench.worst_error(BY_NAME['RK4'], {'step': 0.05}, 'trajectory')
    run = partial(accuracy._mean_time, BY_NAME['RK4'], {'step': 0.05}, bench)
    accuracy._take_times([accuracy._Timed(point, run)], 1, lambda items, _: items)
    assert (error, math.isnan(point.us_per_state)) == (math.inf, True)


def test_only_steps_up_to_a_ms_have_a_slowest_ms():
    methods = [replace(BY_NAME['RK4'], settings=({'step': 0.01}, {'step': 1e-3}))]
    points = accuracy.measure_motion_accuracy(
        MECHANISMS, quick=True, progress=lambda items, _: items, methods=methods
    )
    assert len(points) == 2 * (2 + 1 + 2)
    slowest = [p for p in points if p.mode == accuracy.MIN_RATE]
    assert [p.setting for p in slowest] == ['step 0.001'] * 2
    for point in points:
        assert 0 < point.us_per_state < 1e4
        assert point.pareto <= (point.max_error <= LIMIT)


def test_errors_are_seen(benches):
    bench = benches['pump']
    exact = [float(x) for x in MotionReference(DRIVEN).at(bench.times[0])]
    assert bench.error(0, tuple(exact)) < 1e-15
    length = MECHANISMS.pump.crank.length
    assert bench.error(0, (exact[0] + 1e-3, *exact[1:])) == pytest.approx(1e-3)
    assert bench.error(0, (exact[0], exact[1] + 1e-3 * length, *exact[2:])) == pytest.approx(1e-3)
    # A lost turn is an error.
    assert bench.error(0, (exact[0] + 2 * math.pi, *exact[1:])) == pytest.approx(2 * math.pi)
    assert bench.error(0, (math.nan, *exact[1:])) == math.inf
