# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Integrators of motions under a torque: their reference, orders, floors, work and drift."""

import itertools
import math
from dataclasses import replace
from decimal import Decimal
from functools import partial

import numpy as np
import pytest
from mpmath import mp
from oracle import Oracle

from linkage_ros import FourBar, Solver
from linkage_ros.formulas import Vector
from linkage_ros.lab.methods import registry, situations
from linkage_ros.lab.methods.integrators import OfPackage
from linkage_ros.lab.methods.measure import attempt
from linkage_ros.lab.methods.motion_cases import (
    ENERGY,
    LOOP,
    MEAN,
    TRAJECTORY,
    MotionCase,
    even,
)
from linkage_ros.lab.reference.motions import MotionReference
from linkage_ros.lab.reference.multibody import Multibody, eliminate
from linkage_ros.lab.reference.problems import (
    InitialValueProblem,
    coasting,
    driven_pump,
    free_pump,
)
from linkage_ros.motion.integrators import live_steps, record_steps
from linkage_ros.motion.stiff_integrator import StiffSteps
from linkage_ros.numeric import with_turns

BY_NAME = {method.name: method for method in registry.INTEGRATORS}
DRIVEN, FREE, COASTING = driven_pump(6.0), free_pump(9.0), coasting()
each = pytest.mark.parametrize('method', registry.INTEGRATORS, ids=lambda method: method.name)


@pytest.fixture(scope='module')
def cases():
    """The driven pump, the free pump, and a four-bar."""
    return {
        'driven': MotionCase(DRIVEN, even(1.0)),
        'free': MotionCase(FREE, even(2.0), (ENERGY,)),
        'four-bar': MotionCase(COASTING, even(0.3)),
    }


def worst(case, method, setting, quantity):
    return max(error for _, error in case.outcomes(method, setting, quantity, MEAN))


def slope(x, y):
    return np.polyfit(np.log(x), np.log(y), 1)[0]


# ---------------------------------------------------------------- the reference


@pytest.mark.parametrize('problem', [COASTING, FREE])
def test_reference_is_the_same_with_shorter_steps(problem):
    mine, other = (MotionReference(problem, longest=s).at(0.3) for s in (0.1, 0.03))
    for x, y in zip(mine, other, strict=True):
        assert abs(x - y) < Decimal('1e-17')


def test_reference_agrees_with_the_energy_of_another_hand():
    """The time that a free crank needs is an integral over its angle: no steps of time."""
    angle, speed = MotionReference(COASTING).at(0.1)
    oracle = Oracle(COASTING.mechanism)
    with mp.workdps(30):
        start = oracle.energy(0.0, mp.mpf(COASTING.start[1]))

        def rate(x):
            rest = oracle.energy(x, 0)
            return mp.sqrt((start - rest) / (oracle.energy(x, 1) - rest))

        angle = mp.mpf(str(angle))
        assert abs(rate(angle) - mp.mpf(str(speed))) < 1e-17
        taken = mp.quad(lambda x: 1 / rate(x), mp.linspace(0, angle, 4))
        assert abs(taken - mp.mpf(0.1)) < 1e-17


@pytest.mark.parametrize(
    ('problem', 'end'),
    # From an oracle of another hand, with the pump's other data as they are.
    [(driven_pump(2.0, 5.0), 0.399465563600), (driven_pump(2.0, -6.0), 0.230043884145),
     (DRIVEN, None)],
)  # fmt: skip
def test_the_end_of_the_coordinates_is_found(problem, end):
    assert MotionReference(problem).end(0.42) == pytest.approx(end, abs=1e-11)


def test_reference_stops_where_its_equations_are_singular():
    parallelogram = situations.four_bar((0.25, 0.75, 0.25, 0.75))
    reference = MotionReference(InitialValueProblem(parallelogram, (-0.5, 2.0)))
    reference._known[Decimal(0)][1:7] = [Decimal(x) for x in (1, 0, 1, 0, 1, 0)]  # in line
    with pytest.raises(ArithmeticError, match='cannot be followed beyond'):
        reference.at(1.0)


def test_multibody_accelerates_as_virtual_power_does():
    random = np.random.default_rng(0)
    mechanisms = [situations.turning(random) for _ in range(4)]
    motions = [(m, random.uniform(-5, 5, 2)) for m in mechanisms if isinstance(m, FourBar)]
    pump = random.uniform((0, 1.3, -5, -5), (7, 1.7, 5, 5))
    for mechanism, motion in (*motions, (DRIVEN.mechanism, pump)):
        q, u = map(tuple, np.split(motion, 2))
        solver = Solver(mechanism)
        state = solver.state(q, u, (0.0,) * len(q))
        places = [Vector.at(x) for x in state.position[:3]]
        places += [Vector(x, 0.0) for x in state.position[3:]]
        bodies = Multibody(mechanism, float, Vector.at)
        rows, forces = bodies.system(places, list(state.velocity))
        forces[0] += 3.0
        *found, _, _ = eliminate(rows, forces)
        right = solver.accelerations(q, u, 3.0)
        assert (found[0], *found[3:]) == pytest.approx(right, rel=1e-10)


def test_elimination_takes_the_largest_pivot():
    rows, right = [[0.0, 2.0, 1.0], [1.0, 1.0, 1.0], [4.0, 0.0, -1.0]], [3.0, 2.0, 1.0]
    assert eliminate(rows, right) == pytest.approx(np.linalg.solve(rows, right))
    with pytest.raises(ZeroDivisionError):
        eliminate([[1.0, 2.0], [2.0, 4.0]], [1.0, 1.0])


# ---------------------------------------------------------------- orders and floors


def implicit(problem, setting):
    begin = partial(StiffSteps, longest=setting['step'], tolerance=math.inf)
    return OfPackage(problem, begin)


@pytest.mark.parametrize(
    ('method', 'steps', 'order'),
    [
        (BY_NAME['RK4'], (0.05, 0.025, 0.0125, 0.005), 4),
        (BY_NAME[registry.LIVE], (0.025, 0.0125, 0.005, 0.0025), 5),
        (replace(BY_NAME[registry.LIVE], solve=implicit), (0.025, 0.0125, 0.00625), 5),
    ],
)
def test_fixed_steps_are_of_their_order(cases, method, steps, order):
    found = [worst(cases['driven'], method, {'step': s}, TRAJECTORY) for s in steps]
    assert slope(steps, found) == pytest.approx(order, abs=0.3)


@each
def test_errors_fall_with_each_setting_down_to_a_floor(cases, method):
    case = cases['driven']
    found = [worst(case, method, setting, TRAJECTORY) for setting in method.settings]
    down = [max(error, 2e-13) for error in found[: found.index(min(found)) + 1]]
    assert all(b < a or b == 2e-13 for a, b in itertools.pairwise(down)), found
    assert down[-1] < (2e-7 if method.name == 'Radau' else 1e-8), found


@pytest.mark.parametrize(
    ('name', 'steps'), [(registry.LIVE, live_steps), (registry.RECORDS, record_steps)]
)
def test_the_defaults_are_right_and_what_live_runs_and_records_take(cases, name, steps):
    method, case = BY_NAME[name], cases['driven']
    for judged in (case, cases['four-bar']):
        assert worst(judged, method, method.steady, TRAJECTORY) < 1e-10
    taken = steps(DRIVEN.driven, DRIVEN.start)
    rows = case.rows(method, method.steady, TRAJECTORY, MEAN)
    for time, (*phase, _) in zip(case.times, rows, strict=True):
        taken.advance(time)
        assert tuple(phase) == (with_turns(taken.phase[0], taken.pairs), *taken.phase[1:])


# ---------------------------------------------------------------- energy and the loop


@each
def test_energy_of_a_free_motion_stays_and_a_loop_closed_from_coordinates(cases, method):
    case = cases['free']
    limit = 1e-6 if method.name.startswith(('Radau', 'multipliers')) else 1e-10
    assert worst(case, method, method.steady, ENERGY) < limit
    # As it is the loop opens; Baumgarte's equation holds it, a projection closes it.
    limits = {'multipliers, unstabilised': (1e-9, 1e-6), 'multipliers, Baumgarte': (1e-14, 1e-9)}
    least, most = limits.get(method.name, (0.0, 1e-14))
    assert least <= worst(case, method, method.steady, LOOP) < most


# ---------------------------------------------------------------- measuring


def test_a_method_that_fails_has_no_time():
    case = MotionCase(driven_pump(2.0, 6.0), even(0.5))
    panel = BY_NAME['RK4'], {'step': 0.05}, TRAJECTORY, MEAN
    assert attempt(case.timer(*panel)) is None
    assert case.rows(*panel)[-1] is None


def test_errors_are_seen(cases):
    case = cases['driven']
    exact = [float(x) for x in MotionReference(DRIVEN).at(case.times[0])]
    length = DRIVEN.mechanism.crank.length

    def error(*added):
        phase = tuple(np.add(exact, [*added, *[0.0] * (4 - len(added))]).tolist())
        return case.error(TRAJECTORY, 0, [*phase, 0.0])

    assert error(0.0) < 1e-15
    assert error(1e-3) == pytest.approx(1e-3)
    assert error(0.0, 1e-3 * length) == pytest.approx(1e-3)
    assert error(2 * math.pi) == pytest.approx(2 * math.pi)  # a lost turn is an error
