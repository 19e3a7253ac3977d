# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Integrators of the charts and their reference; the motion in absolute coordinates."""

import itertools
import math
from dataclasses import replace
from decimal import Decimal
from functools import partial

import numpy as np
import pytest
from mpmath import mp
from oracle import Oracle
from test_dead_centres import MECHANISMS, begun, every, start
from test_methods import slope

from linkage_lab.methods import registry, situations
from linkage_lab.methods.integrators import Multipliers, OfPackage
from linkage_lab.methods.measure import attempt
from linkage_lab.methods.motion_cases import ENERGY, LOOP, MEAN, TRAJECTORY, MotionCase, even
from linkage_lab.reference import motions
from linkage_lab.reference.motions import (
    InitialValueProblem,
    MotionReference,
    coasting,
    driven_pump,
    free_pump,
)
from linkage_lab.reference.multibody import eliminate
from linkage_ros.motion.steps import StiffSteps, live_steps, record_steps
from linkage_ros.numeric import with_turns

# ---------------------------------------------------------------- integrators of the charts

BY_NAME = {method.name: method for method in registry.INTEGRATORS}
DRIVEN, FREE_PUMP, COASTING = driven_pump(6.0), free_pump(9.0), coasting()
each = pytest.mark.parametrize('method', registry.INTEGRATORS, ids=lambda method: method.name)


@pytest.fixture(scope='module')
def cases():
    """Returns the driven pump, the free pump, and a four-bar."""
    return {
        'driven': MotionCase(DRIVEN, even(1.0)),
        'free': MotionCase(FREE_PUMP, even(2.0), (ENERGY,)),
        'four-bar': MotionCase(COASTING, even(0.3)),
    }


def worst(case, method, setting, quantity):
    return max(error for _, error in case.outcomes(method, setting, quantity, MEAN))


# ---------------------------------------------------------------- the reference


@pytest.mark.parametrize('problem', [COASTING, FREE_PUMP])
def test_reference_is_the_same_with_shorter_steps(problem, monkeypatch):
    mine = MotionReference(problem).at(0.3)
    monkeypatch.setattr(motions, '_LONGEST', 0.01)
    for x, y in zip(mine, MotionReference(problem).at(0.3), strict=True):
        assert abs(x - y) < Decimal('1e-17')


def test_reference_agrees_with_an_integral_of_the_energy():
    """The time of a free crank is an integral over its angle, without time steps."""
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
    # From an independent reference, with the pump's other data unchanged.
    [(driven_pump(2.0, 5.0), 0.399465563600), (driven_pump(2.0, -6.0), 0.230043884145),
     (DRIVEN, None)],
)  # fmt: skip
def test_singularity_of_the_coordinates_is_found(problem, end):
    assert MotionReference(problem).end(0.42) == pytest.approx(end, abs=1e-11)


def test_reference_stops_where_its_equations_are_singular():
    parallelogram = situations.four_bar((0.25, 0.75, 0.25, 0.75))
    reference = MotionReference(InitialValueProblem(parallelogram, (-0.5, 2.0)))
    reference._known[Decimal(0)][1:7] = [Decimal(x) for x in (1, 0, 1, 0, 1, 0)]  # in line
    with pytest.raises(ArithmeticError, match='cannot be followed'):
        reference.at(1.0)


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
def test_defaults_are_right_and_equal_those_of_live_runs_and_records(cases, name, steps):
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
def test_free_motion_keeps_its_energy_and_a_closed_loop(cases, method):
    case = cases['free']
    limit = 1e-6 if method.name.startswith(('Radau', 'multipliers')) else 1e-10
    assert worst(case, method, method.steady, ENERGY) < limit
    # Without stabilisation the loop opens; Baumgarte's equation limits the gap, projection
    # closes it.
    limits = {'multipliers, unstabilised': (1e-9, 1e-6), 'multipliers, Baumgarte': (1e-14, 1e-9)}
    least, most = limits.get(method.name, (0.0, 1e-14))
    assert least <= worst(case, method, method.steady, LOOP) < most


# ---------------------------------------------------------------- measuring


def test_a_method_that_fails_has_no_time():
    case = MotionCase(driven_pump(2.0, 6.0), even(0.5))
    panel = BY_NAME['RK4'], {'step': 0.05}, TRAJECTORY, MEAN
    assert attempt(case.timer(*panel)) is None
    assert case.rows(*panel)[-1] is None


def test_errors_of_angle_and_speed_and_lost_turns_are_measured(cases):
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


# ---------------------------------------------------------------- the motion of the package


@every
def test_motion_agrees_with_absolute_coordinates(name):
    mechanism = MECHANISMS[name]
    follower = Multipliers(InitialValueProblem(mechanism, start(mechanism)), 1e-12)
    steps = begun(record_steps, mechanism)
    described = set()
    for tick in range(1, 101):
        due = follower.at(tick * 1e-2)
        steps.advance(tick * 1e-2)
        driven, phase = steps.driven, steps.phase
        if driven.driven == 0:
            crank = driven.position(phase, steps.pairs)
        else:
            crank = driven.solver.state(phase[: len(phase) // 2]).position[0]
            crank += math.tau * round((due[0] - crank) / math.tau)  # the rod counts no turns
        described.add(driven.solver.description)
        assert crank == pytest.approx(due[0], abs=1e-7)
    assert len(described) > 1 or name in {'pump', 'offset_right'}
