# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The rule for outcomes, on planted failures, and the situations in which methods are judged."""

import math
from dataclasses import replace

import numpy as np
import pytest

from linkage_ros import ConfigurationError, MotionError, Solver, UnreachableError
from linkage_ros.lab.methods import stages
from linkage_ros.lab.methods.measure import (
    BATCH,
    DIVERGED,
    NAN,
    ONE,
    REFUSED,
    RIGHT,
    WRONG_BRANCH,
    Method,
    measure_outcomes,
)
from linkage_ros.lab.methods.motion_cases import MOTION_SITUATIONS, MotionCase
from linkage_ros.lab.methods.registry import INTEGRATORS
from linkage_ros.lab.methods.situations import SITUATIONS
from linkage_ros.lab.methods.stages import POSITION, RATES
from linkage_ros.lab.reference.problems import free_pump
from linkage_ros.lab.reference.states import other_assembly

BY_NAME = {situation.name: situation for situation in (*SITUATIONS, *MOTION_SITUATIONS)}


def measured(method, situation):
    (cell,) = measure_outcomes([situation], [method], cases=2, progress=lambda items, _: items)
    return cell['outcome'], cell['worst_error']


def outcome(locate, situation='ordinary', stage=POSITION, modes=(ONE,)):
    """The outcome of a method whose position, or rate, is that of a function of case and crank."""

    def tool(case, _):
        def at(crank):
            found = [locate(case, x) for x in np.atleast_1d(crank).tolist()]
            return tuple(np.array(found).T) if np.ndim(crank) else found[0]

        return at

    def solve(links, crank, *_):
        pair = stages.looked_up(links, crank)
        return pair if stage == POSITION else (pair,) * 3

    return measured(
        Method('planted', stage, '', '', solve, modes=modes, tool=tool), BY_NAME[situation]
    )


def right(case, crank):
    return Solver(case.mechanism).state(crank).position[1:]


def other_side(case, crank):
    return Solver(other_assembly(case.mechanism)).state(crank).position[1:]


def failing_once(value):
    """Right but at one of the angles."""

    def locate(case, crank):
        coupler, output = right(case, crank)
        return (value(coupler) if 3.0 < crank < 3.2 else coupler), output

    return locate


def raised(error):
    def value(*_):
        raise error

    return value


@pytest.mark.parametrize(
    ('value', 'expected', 'error'),
    [
        (lambda x: x + 1e-9, RIGHT, 1e-9),
        (lambda x: x + 1e-5, DIVERGED, 1e-5),
        (lambda x: 1e300 + x, DIVERGED, None),
        (lambda _: math.nan, NAN, None),
        (lambda _: -math.inf, NAN, None),
        (raised(ZeroDivisionError()), NAN, None),
        (raised(ValueError('math domain error')), NAN, None),
        (raised(np.linalg.LinAlgError()), NAN, None),
        (raised(ConfigurationError('no such state')), REFUSED, None),
    ],
)
def test_one_planted_failure_decides(value, expected, error):
    found, worst = outcome(failing_once(value))
    assert found == expected
    assert error is None or worst == pytest.approx(error, rel=1e-3)


def test_only_the_position_of_the_other_assembly_is_a_wrong_branch():
    found, error = outcome(other_side)
    assert found == WRONG_BRANCH
    assert error > 0.01
    assert outcome(lambda *given: np.add(other_side(*given), (1e-4, 0)))[0] == DIVERGED
    assert outcome(other_side, stage=RATES)[0] == DIVERGED


def refuses_first(locate):
    """Refuses the first angle of each case, and locates the others."""
    refused = []

    def first_refused(case, crank):
        if case not in refused:
            refused.append(case)
            raise ConfigurationError('no such state')
        return locate(case, crank)

    return first_refused


def test_where_no_state_exists_only_a_refusal_of_every_angle_is_right():
    assert outcome(right, 'no assembly') == (REFUSED, None)
    assert outcome(lambda *_: (0.1, 0.2), 'no assembly') == (DIVERGED, None)
    assert outcome(lambda *_: (math.nan, 0.2), 'no assembly')[0] == NAN
    assert outcome(refuses_first(lambda *_: (0.1, 0.2)), 'no assembly')[0] == DIVERGED


# An array is refused as a whole; then each of its angles is asked by itself.
@pytest.mark.parametrize('mode', [ONE, BATCH])
def test_a_refusal_at_one_angle_hides_nothing_at_the_others(mode):
    wrong = refuses_first(lambda *given: np.add(right(*given), (1.0, 0)))
    assert outcome(wrong, modes=(mode,))[0] == DIVERGED


# ---------------------------------------------------------------- situations


@pytest.mark.parametrize('situation', SITUATIONS, ids=lambda situation: situation.name)
def test_situations_are_the_same_every_time_and_as_many_as_asked(situation):
    first, again = (
        [(c.mechanism, c.guess, *c.cranks) for c in situation.cases(3)] for _ in range(2)
    )
    assert len(first) == 3
    assert first == again
    assert len({mechanism for mechanism, *_ in first}) > 1


@pytest.mark.parametrize('situation', MOTION_SITUATIONS, ids=lambda situation: situation.name)
def test_motions_are_the_same_every_time_and_fewer(situation):
    first, again = ([(c.problem, c.times) for c in situation.cases(10)] for _ in range(2))
    assert 1 <= len(first) <= 4
    assert first == again
    assert all(times == tuple(sorted(times)) for _, times in first)


def test_beyond_its_reach_a_crank_has_no_state():
    for case in BY_NAME['no assembly'].cases(2):
        for crank in case.cranks.tolist():
            with pytest.raises(UnreachableError, match='does not close'):
                case.reference.state(crank)


# ---------------------------------------------------------------- motions: the rule


class Planted:
    """The default but for what is planted from a time on."""

    def __init__(self, problem, since, fault):
        self.right = INTEGRATORS[1].solve(problem, {})
        self.since, self.fault, self.gap = since, fault, self.right.gap

    def at(self, time):
        return self.right.at(time) if time < self.since else self.fault(self.right, time)


def motion_outcome(fault, *quantity, since=1.0):
    situation = BY_NAME['change point under a torque']
    if quantity:
        case = MotionCase(free_pump(6.0), (0.5, 1.0, 1.5), quantity)
        situation = replace(situation, make=lambda *_: case)
    solve = lambda problem, _: Planted(problem, since, fault)  # noqa: E731
    return measured(Method('planted', 'motion', '', '', solve), situation)


def moved(by):
    def fault(right, time):
        angle, *rest = right.at(time)
        return angle + by, *rest

    return fault


@pytest.mark.parametrize(
    ('fault', 'expected', 'error'),
    [
        (moved(1e-9), RIGHT, 1e-9),
        (moved(2 * math.pi), DIVERGED, 2 * math.pi),
        (moved(math.nan), NAN, 0),
        (raised(ZeroDivisionError()), NAN, 0),
        (raised(MotionError('the motion ends', time=1.0, coordinates=(0.0,))), REFUSED, 0),
    ],
)
def test_one_planted_fault_decides_the_outcome_of_a_motion(fault, expected, error):
    found, worst = motion_outcome(fault)
    assert found == expected
    assert worst == pytest.approx(error, rel=1e-2, abs=1e-11)


@pytest.mark.parametrize('error', [ConfigurationError('no'), ZeroDivisionError()])
def test_a_wrong_value_counts_more_than_a_failure_after_it(error):
    def fault(right, time):
        if time > 2.0:
            raise error
        return moved(1e-3)(right, time)

    assert motion_outcome(fault) == (DIVERGED, pytest.approx(1e-3, rel=1e-2))


def test_energy_and_loop_are_judged_by_themselves():
    def faster(right, time):
        angle, place, speed, velocity = right.at(time)
        return angle, place, speed * (1 + 1e-5), velocity

    found, error = motion_outcome(faster, 'energy')
    assert (found, error) == (DIVERGED, pytest.approx(2e-5, rel=0.5))
    assert motion_outcome(faster, 'loop')[0] == RIGHT


@pytest.mark.parametrize('judged', [outcome, motion_outcome])
def test_programming_errors_are_raised(judged):
    with pytest.raises(KeyError):
        judged(raised(KeyError('typo')))
