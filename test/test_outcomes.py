# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The rule by which outcomes are told, on planted failures, and the situations they come of."""

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from linkage_ros import ConfigurationError, MotionError, Solver, UnreachableError
from linkage_ros.formulas import Opaque
from linkage_ros.lab.methods.chain import BATCH, MOTION, ONE, POSITION, RATES, Method
from linkage_ros.lab.methods.integrators import Follower
from linkage_ros.lab.methods.linkages import other_assembly
from linkage_ros.lab.methods.motion_bench import MotionBench
from linkage_ros.lab.methods.motion_situations import MOTION_SITUATIONS
from linkage_ros.lab.methods.outcomes import (
    DIVERGED,
    NAN,
    REFUSED,
    RIGHT,
    WRONG_BRANCH,
    measure_outcomes,
)
from linkage_ros.lab.methods.registry import INTEGRATORS
from linkage_ros.lab.methods.situations import SITUATIONS
from linkage_ros.lab.reference.problems import free_pump

BY_NAME = {situation.name: situation for situation in (*SITUATIONS, *MOTION_SITUATIONS)}
measured = partial(measure_outcomes, cases=2, progress=lambda items, _: items)


def outcome(locate, situation='ordinary', stage=POSITION, modes=(ONE,)):
    """The cell of a method whose position, or rate, is that of a function of task and crank."""

    def tool(task, _):
        def at(crank, index):
            each = [locate(task, x)[index] for x in np.atleast_1d(crank).tolist()]
            return np.array(each) if np.ndim(crank) else each[0]

        return tuple(Opaque(partial(at, index=i)) for i in (0, 1))

    def solve(links, crank, *_):
        pair = tuple(part(crank) for part in links.tool)
        return pair if stage == POSITION else (pair,) * 3

    method = Method('planted', stage, '', '', solve, modes=modes, tool=tool)
    (cell,) = measured([BY_NAME[situation]], [method])
    return cell.outcome, cell.worst_error


def right(task, crank):
    return Solver(task.mechanism).state(crank).position[1:]


def other_side(task, crank):
    return Solver(other_assembly(task.mechanism)).state(crank).position[1:]


def failing_once(value):
    """Right but at one of the angles."""

    def locate(task, crank):
        coupler, output = right(task, crank)
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


def test_the_other_assembly_is_a_wrong_branch():
    found, error = outcome(other_side)
    assert found == WRONG_BRANCH
    assert error > 0.01


def test_the_other_assembly_missed_or_as_a_rate_is_no_branch():
    assert outcome(lambda *given: np.add(other_side(*given), (1e-4, 0)))[0] == DIVERGED
    assert outcome(other_side, stage=RATES)[0] == DIVERGED


def refuses_first(locate):
    """Refuses the first angle of each case, and locates the others."""
    refused = []

    def first_refused(task, crank):
        if task not in refused:
            refused.append(task)
            raise ConfigurationError('no such state')
        return locate(task, crank)

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


def test_a_programming_error_is_no_outcome():
    with pytest.raises(KeyError):
        outcome(failing_once(raised(KeyError('typo'))))


# ---------------------------------------------------------------- situations


@pytest.mark.parametrize('situation', SITUATIONS, ids=lambda situation: situation.name)
def test_situations_are_the_same_every_time_and_as_many_as_asked(situation):
    first, again = ([(b.task, *b.cranks) for b in situation.cases(3)] for _ in range(2))
    assert len(first) == 3
    assert first == again
    assert len({task.mechanism for task, *_ in first}) > 1


def test_beyond_its_reach_a_crank_has_no_state():
    for bench in BY_NAME['no assembly'].cases(2):
        for crank in bench.cranks.tolist():
            with pytest.raises(UnreachableError, match='does not close'):
                bench.reference.state(crank)


def test_motions_are_the_same_every_time():
    make = BY_NAME['change point under a torque'].cases
    first, again = (make.__wrapped__(1)[-1] for _ in range(2))
    assert first.problem == again.problem
    assert first.times == again.times == tuple(sorted(first.times))


# ---------------------------------------------------------------- motions: the rule


class Planted(Follower):
    """The default but for what is planted from a time on."""

    def __init__(self, problem, since, fault):
        super().__init__(problem)
        self.right = INTEGRATORS[1].solve(problem, {})
        self.since, self.fault = since, fault

    def _advance(self, time):
        if time < self.since:
            return self.right.at(time)
        return self.fault(self.right, time)


def motion_outcome(fault, situation='change point under a torque', since=1.0):
    chosen = BY_NAME[situation]
    if 'run' in situation:
        chosen = replace(chosen, cases=lambda _: [MotionBench(free_pump(6.0), (0.5, 1.0, 1.5))])
    method = Method('planted', MOTION, '', '', lambda problem, _: Planted(problem, since, fault))
    (cell,) = measured([chosen], [method])
    return cell.outcome, cell.worst_error


def moved(by):
    def fault(right, time):
        angle, *rest = right.at(time)
        return angle + by, *rest

    return fault


def told(time):
    return raised(MotionError('the motion ends', time=time, coordinates=(0.0,)))


@pytest.mark.parametrize(
    ('fault', 'expected', 'error'),
    [
        (moved(1e-9), RIGHT, 1e-9),
        (moved(2 * math.pi), DIVERGED, 2 * math.pi),
        (moved(math.nan), NAN, 0),
        (raised(ZeroDivisionError()), NAN, 0),
        # Nothing ends there, so that no time can be told well.
        (told(1.0), REFUSED, 0),
    ],
)
def test_one_planted_fault_decides_what_comes_of_a_motion(fault, expected, error):
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

    found, error = motion_outcome(faster, 'long free run')
    assert (found, error) == (DIVERGED, pytest.approx(2e-5, rel=0.5))
    assert motion_outcome(faster, 'loop after a long run')[0] == RIGHT


def test_a_programming_error_in_an_integrator_is_no_outcome():
    with pytest.raises(KeyError):
        motion_outcome(raised(KeyError('typo')))
